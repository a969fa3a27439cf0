/* SPDX-License-Identifier: MIT */
#include "nodes/report/logbook.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "msgs/unpack.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_plan.h"
#include "nodes/rt/names.h"

#define STEP_NS  150000000LL   /* of trails, which have TRAILS_MAX_POINTS */
#define AGAIN_NS 10000000000LL /* an id that comes back later is another track's */

void logbook_init(struct logbook *d)
{
    memset(d, 0, sizeof *d);
    trails_init(&d->trails, LOGBOOK_SHOWN_NS, STEP_NS);
}

void logbook_ego(struct logbook *d, const Anlos__EgoMotion *m, int64_t capture_ns)
{
    trails_ego(&d->trails, m, capture_ns);
}

void logbook_survey(struct logbook *d, const Anlos__Survey *m)
{
    setting_survey(&d->setting, m);
}

int logbook_walls(struct logbook *d, const Anlos__WallList *m)
{
    Anlos__WallList *fresh = (Anlos__WallList *)message_copy(&m->base);

    if (!fresh)
        return -ENOMEM;
    if (!setting_walls(&d->setting, fresh)) {
        anlos__wall_list__free_unpacked(fresh, NULL);
        return 0;
    }
    anlos__wall_list__free_unpacked(d->wall_list, NULL);
    d->wall_list = fresh;
    return 0;
}

/* NULL: there is no room.  *err: no memory. */
static struct logbook_track *find_track(struct logbook *d, uint32_t id, int64_t now_ns,
                                        int *err)
{
    for (size_t i = d->n_tracks; i-- > 0;)
        if (d->tracks[i].id == id && now_ns - d->tracks[i].last_ns < AGAIN_NS)
            return &d->tracks[i];
    if (d->n_tracks == LOGBOOK_MAX_TRACKS) {
        d->n_left_out++;
        return NULL;
    }
    *err = list_grow(&d->tracks, d->n_tracks, &d->room, sizeof *d->tracks);
    if (*err)
        return NULL;
    d->tracks[d->n_tracks] =
        (struct logbook_track){.id = id, .first_ns = now_ns, .velocity_m_s = {NAN, NAN}};
    return &d->tracks[d->n_tracks++];
}

static int take_track(struct logbook *d, const Anlos__Detection *m, int64_t now_ns)
{
    int err = 0;

    if (!m->position_m || m->measurement == ANLOS__MEASUREMENT__DELETED)
        return 0;
    const double at[3] = {m->position_m->x, m->position_m->y, m->position_m->z};
    struct logbook_track *k = find_track(d, m->id, now_ns, &err);
    if (!k)
        return err;
    if (!k->n++)
        memcpy(k->from_m, at, sizeof at);
    memcpy(k->to_m, at, sizeof at);
    k->last_ns = now_ns;
    k->shape = m->shape;
    k->existence = fmax(k->existence, m->existence);
    k->n_measured += m->measurement != ANLOS__MEASUREMENT__PREDICTED;
    if (m->n_velocity_m_s != 2)
        return 0;
    memcpy(k->velocity_m_s, m->velocity_m_s, sizeof k->velocity_m_s);
    k->speed_sum_m_s += hypot(m->velocity_m_s[0], m->velocity_m_s[1]);
    k->n_speeds++;
    return 0;
}

int logbook_list(struct logbook *d, const Anlos__DetectionList *list, int64_t capture_ns)
{
    int err = 0;

    if (!list->tracked || !trails_stamp_holds(capture_ns))
        return 0;
    trails_take(&d->trails, list, capture_ns);
    d->tracked = true;
    d->in_vehicle_frame = list->in_vehicle_frame;
    d->first_ns = d->n_lists++ ? d->first_ns : capture_ns;
    d->last_ns = capture_ns;
    for (size_t i = 0; !err && i < list->n_detections; i++)
        err = take_track(d, list->detections[i], capture_ns);
    return err;
}

static json_t *seconds(const struct logbook *d, int64_t at_ns)
{
    return export_real(1e-9 * (double)(at_ns - d->first_ns));
}

static json_t *track_json(const struct logbook *d, const struct logbook_track *k)
{
    json_t *o = json_object();

    json_object_set_new(o, "id", json_integer(k->id));
    json_object_set_new(o, "class", json_string(name_of_shape(k->shape)));
    json_object_set_new(o, "first_s", seconds(d, k->first_ns));
    json_object_set_new(o, "last_s", seconds(d, k->last_ns));
    json_object_set_new(o, "from_m", export_reals(k->from_m, 3));
    json_object_set_new(o, "to_m", export_reals(k->to_m, 3));
    json_object_set_new(
        o, "mean_speed_m_s",
        export_real(k->n_speeds ? k->speed_sum_m_s / (double)k->n_speeds : NAN));
    json_object_set_new(o, "last_velocity_m_s", export_reals(k->velocity_m_s, 2));
    json_object_set_new(o, "greatest_existence", export_real(k->existence));
    json_object_set_new(o, "lists", json_integer((json_int_t)k->n));
    json_object_set_new(o, "lists_measured", json_integer((json_int_t)k->n_measured));
    return o;
}

static json_t *wall_json(const Anlos__Wall *w)
{
    json_t *o = json_object();

    json_object_set_new(o, "id", json_integer(w->id));
    json_object_set_new(o, "from", json_string(name_of_wall_origin(w->origin)));
    json_object_set_new(
        o, "normal",
        export_reals((const double[]){w->normal->x, w->normal->y, w->normal->z}, 3));
    json_object_set_new(o, "distance_m", export_real(w->distance_m));
    json_object_set_new(o, "existence", export_real(w->existence));
    json_object_set_new(o, "unseen_s", export_real(w->unseen_s));
    return o;
}

json_t *logbook_json(const struct logbook *d)
{
    json_t *o, *tracks, *walls;

    if (!d->tracked)
        return NULL;
    o = json_object();
    tracks = json_array();
    walls = json_array();
    json_object_set_new(o, "frame",
                        json_string(d->in_vehicle_frame ? "vehicle" : "array"));
    json_object_set_new(o, "seconds", seconds(d, d->last_ns));
    json_object_set_new(o, "lists", json_integer((json_int_t)d->n_lists));
    for (size_t i = 0; i < d->n_tracks; i++)
        json_array_append_new(tracks, track_json(d, &d->tracks[i]));
    json_object_set_new(o, "tracks", tracks);
    json_object_set_new(o, "left_out", json_integer((json_int_t)d->n_left_out));
    for (size_t i = 0; d->wall_list && i < d->wall_list->n_walls; i++)
        json_array_append_new(walls, wall_json(d->wall_list->walls[i]));
    json_object_set_new(o, "walls_in_the_array_frame", walls);
    return o;
}

int logbook_picture(const struct logbook *d, const char *folder, const struct grid *grid,
                    struct error *why)
{
    struct plan_track tracks[TRAILS_MAX];
    char title[96];
    struct plan_picture picture = {.title = title,
                                   .survey = &d->setting.survey,
                                   .walls = &d->setting.walls,
                                   .trails = &d->trails,
                                   .tracks = tracks,
                                   .grid = grid};

    if (!d->tracked || !d->setting.has_survey)
        return 0;
    double s = fmin(1e-9 * (double)(d->last_ns - d->first_ns), 1e-9 * LOGBOOK_SHOWN_NS);
    snprintf(title, sizeof title, "Tracks of the last %.0f s, over ground", s);
    for (size_t i = d->n_tracks; i-- > 0 && picture.n_tracks < TRAILS_MAX;) {
        const struct logbook_track *k = &d->tracks[i];
        tracks[picture.n_tracks++] =
            (struct plan_track){.id = k->id,
                                .velocity_m_s = {k->velocity_m_s[0], k->velocity_m_s[1]},
                                .class = name_of_shape(k->shape)};
    }
    return export_plan(folder, "plan.png", &picture, why);
}

void logbook_clear(struct logbook *d)
{
    setting_clear(&d->setting);
    anlos__wall_list__free_unpacked(d->wall_list, NULL);
    free(d->tracks);
    logbook_init(d);
}
