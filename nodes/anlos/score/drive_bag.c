/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/score/drive_bag.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "hal/room/figure.h"
#include "hal/room/scene.h"
#include "msgs/convert.h"
#include "msgs/topics.h"
#include "nodes/anlos/bag/stream.h"
#include "recon/mount.h"

enum { MOST_AT_ONCE = 64 };

int drive_bag_world_survey(struct drive_bag_world *w, const Anlos__Survey *m,
                           struct error *why)
{
    struct survey fresh;

    if (w->has_survey) /* one after the other: gate and volume are those of the first */
        return 0;
    int err = survey_from_message(&fresh, m, why);
    if (err)
        return err;
    w->survey = fresh;
    w->has_survey = true;
    return 0;
}

int drive_bag_world_ego(struct drive_bag_world *w, const Anlos__EgoMotion *m, int64_t ns,
                        struct error *why)
{
    if (!m->valid || (w->n_ego && ns <= w->ego[w->n_ego - 1].ns))
        return 0;
    if (list_grow(&w->ego, w->n_ego, &w->ego_room, sizeof *w->ego))
        return error_say(why, -ENOMEM, "out of memory");
    w->ego[w->n_ego] = (struct bag_ego){.ns = ns};
    ego_from_message(&w->ego[w->n_ego++].motion, m);
    return 0;
}

static int drive_bag_world_walls(struct drive_bag_world *w, const Anlos__WallList *m,
                                 int64_t ns, struct error *why)
{
    struct walls walls;
    int err = walls_from_message(&walls, m, why);

    if (err || (w->n_walls && ns <= w->walls[w->n_walls - 1].ns))
        return err;
    if (list_grow(&w->walls, w->n_walls, &w->walls_room, sizeof *w->walls))
        return error_say(why, -ENOMEM, "out of memory");
    w->walls[w->n_walls++] = (struct bag_wall){ns, walls.n > 0, walls.list[0].plane};
    return 0;
}

/* Time since begin_ns. */
static double drive_bag_world_s(const struct drive_bag_world *w, int64_t ns)
{
    return 1e-9 * (double)(ns - w->begin_ns);
}

/* Times are asked for in their order, mostly. */
struct ego_motion drive_bag_world_motion(const struct drive_bag_world *w, int64_t ns)
{
    static const struct ego_motion standing = {0.0, 0.0};
    size_t i = w->n_ego;

    while (i && w->ego[i - 1].ns > ns)
        i--;
    return i ? w->ego[i - 1].motion : w->n_ego ? w->ego[0].motion : standing;
}

/* The wall as it was last said, or as the survey has it; false: none. */
static bool wall_at(const struct drive_bag_world *w, int64_t ns, struct wall *out)
{
    struct walls own;
    size_t i = w->n_walls;

    while (i && w->walls[i - 1].ns > ns)
        i--;
    if (w->n_walls) {
        const struct bag_wall *b = &w->walls[i ? i - 1 : 0];
        *out = b->plane;
        return b->is;
    }
    walls_from_survey(&own, &w->survey);
    *out = own.list[0].plane;
    return own.n > 0;
}

/* Over ground: the vehicle's own velocity there is added. */
static void set_velocity(const struct ego_motion *ego, const struct truth_place *p,
                         struct room_truth *out)
{
    out->velocity_m_s[0] = p->velocity_m_s[0] + ego->speed_m_s -
                           ego->yaw_rate_rad_s * p->position_m[1];
    out->velocity_m_s[1] = p->velocity_m_s[1] + ego->yaw_rate_rad_s * p->position_m[0];
}

/* A body's size along the axes; it looks where it goes. */
static void set_extent(struct room_truth *t)
{
    struct figure_pose pose = {.up = {0.0, 0.0, 1.0}};
    double speed_m_s = hypot(t->velocity_m_s[0], t->velocity_m_s[1]);
    int kind = 0;

    while (kind < SCENE_KINDS && strcmp(scene_kind_name(kind), t->kind))
        kind++;
    if (kind == SCENE_KINDS || !figure_size(kind, false))
        return;
    pose.heading[0] = speed_m_s > 0.0 ? t->velocity_m_s[0] / speed_m_s : 1.0;
    pose.heading[1] = speed_m_s > 0.0 ? t->velocity_m_s[1] / speed_m_s : 0.0;
    figure_extent(kind, &pose, t->extent_m);
}

/* Where it is imaged: mirrored at the wall, in the array frame, at the array's height. */
static void set_virtual(const struct drive_bag_world *w, int64_t ns, struct room_truth *t)
{
    double r[3][3], at[3], p[3];
    struct wall wall;

    mount_survey_axes(&w->survey, r, at);
    for (int a = 0; a < 3; a++)
        p[a] = r[0][a] * (t->position_m[0] - at[0]) +
               r[1][a] * (t->position_m[1] - at[1]) +
               r[2][a] * (t->position_m[2] - at[2]);
    if (wall_at(w, ns, &wall))
        wall_mirror(&wall, p, t->virtual_m);
    else
        memcpy(t->virtual_m, p, sizeof p);
}

static size_t file_at(const struct drive_bag_world *w, double t_s, struct room_truth *out,
                      size_t max)
{
    struct truth_place places[MOST_AT_ONCE];
    int64_t ns = w->begin_ns + llround(1e9 * t_s);
    const struct ego_motion ego = drive_bag_world_motion(w, ns);
    size_t n = truth_file_at(w->truth, ns, places, MOST_AT_ONCE);

    for (size_t i = 0; i < n && i < max && i < MOST_AT_ONCE; i++) {
        struct room_truth *t = &out[i];
        *t = (struct room_truth){.until_sight_s = NAN};
        snprintf(t->name, sizeof t->name, "%s", places[i].name);
        snprintf(t->kind, sizeof t->kind, "%s", places[i].kind);
        t->position_m[0] = places[i].position_m[0];
        t->position_m[1] = places[i].position_m[1];
        t->position_m[2] = w->survey.mount_origin_m[2];
        set_velocity(&ego, &places[i], t);
        set_extent(t);
        set_virtual(w, ns, t);
    }
    return n;
}

static size_t who_at(const void *context, double t_s, struct room_truth *out, size_t max)
{
    const struct drive_bag_world *w = context;

    if (w->truth)
        return file_at(w, t_s, out, max);
    return room_truth(w->scene, room_time_s(w->scene, w->begin_ns) + t_s, out, max);
}

struct drive_truth drive_bag_world_truth(const struct drive_bag_world *w)
{
    return (struct drive_truth){.at = who_at, .context = w};
}

void drive_bag_world_clear(struct drive_bag_world *w)
{
    if (w->has_survey)
        survey_clear(&w->survey);
    free(w->ego);
    free(w->walls);
    *w = (struct drive_bag_world){.scene = NULL};
}

struct reading {
    const char *bag;
    struct drive_bag_world world;
    struct drive_truth truth;
    struct drive_score score;
    struct drive_told told;
    struct drive_outcome *out;
    bool begun;
    size_t n_untracked;
};

static int add_list(struct reading *r, const Anlos__DetectionList *list,
                    const struct envelope *e)
{
    struct drive_moment moment;

    if (!list->tracked) {
        r->n_untracked++;
        return 0;
    }
    if (!list->in_vehicle_frame)
        return error_say(&r->out->why, -EINVAL,
                         "%s: lists in the array frame: the survey has no mount", r->bag);
    if (!r->begun) {
        r->world.begin_ns = e->capture_ns;
        drive_score_init(&r->score, &r->truth, &r->world.survey, 0.0);
    }
    r->begun = true;
    drive_score_list(&r->score, drive_bag_world_s(&r->world, e->capture_ns),
                     drive_bag_world_s(&r->world, e->publish_ns), list, NULL, &moment);
    drive_score_told(&r->score, &r->told, drive_bag_world_s(&r->world, e->capture_ns),
                     list, e->capture_ns, e->publish_ns);
    return drive_moments_add(&r->out->moments, &moment)
               ? error_say(&r->out->why, -ENOMEM, "out of memory")
               : 0;
}

static int take(struct reading *r, const struct stream_message *m,
                const ProtobufCMessage *content)
{
    const struct envelope *e = &m->envelope;

    if (m->topic == topic_survey())
        drive_told_survey(&r->told, (const Anlos__Survey *)content);
    if (m->topic == topic_survey())
        return drive_bag_world_survey(&r->world, (const Anlos__Survey *)content,
                                      &r->out->why);
    if (m->topic == topic_ego())
        return drive_bag_world_ego(&r->world, (const Anlos__EgoMotion *)content,
                                   e->capture_ns, &r->out->why);
    if (m->topic == topic_wall())
        return drive_bag_world_walls(&r->world, (const Anlos__WallList *)content,
                                     e->capture_ns, &r->out->why);
    return add_list(r, (const Anlos__DetectionList *)content, e);
}

static int take_next(struct reading *r, struct stream *s)
{
    struct stream_message m;
    int err = stream_next(s, &m, &r->out->why);

    if (err)
        return err;
    ProtobufCMessage *content;
    err = stream_unpack(&content, s, &m, &r->out->why);
    if (err)
        return err;
    err = take(r, &m, content);
    protobuf_c_message_free_unpacked(content, NULL);
    return err;
}

/* The survey first: a bag that was cut may have it later. */
static int read_bag(struct reading *r, struct stream *s)
{
    stream_select(s, topic_survey()->name);
    int err = take_next(r, s);

    if (err == -ENODATA)
        return error_say(&r->out->why, -EINVAL, "%s: no survey", r->bag);
    stream_select(s, "survey,ego,wall,detections");
    stream_rewind(s);
    while (!err)
        err = take_next(r, s);
    if (err == -ENODATA && !r->begun)
        return error_say(&r->out->why, -EINVAL, "%s: no lists of tracks%s", r->bag,
                         r->n_untracked ? ", only of single images" : "");
    return err == -ENODATA ? 0 : err;
}

void drive_bag(const char *bag, const struct room *scene, const struct truth_file *truth,
               struct drive_outcome *out)
{
    struct reading *r = calloc(1, sizeof *r);
    struct stream *s = NULL;

    *out = (struct drive_outcome){.err = -ENOMEM};
    if (!r) {
        error_say(&out->why, -ENOMEM, "out of memory");
        return;
    }
    *r = (struct reading){.bag = bag, .out = out};
    drive_told_init(&r->told, NULL);
    r->world.scene = scene;
    r->world.truth = truth;
    r->truth = drive_bag_world_truth(&r->world);
    out->err = stream_open(&s, bag, &out->why);
    if (!out->err)
        out->err = read_bag(r, s);
    if (r->begun) {
        drive_score_end(&r->score);
        out->result = r->score.result;
    }
    stream_close(s);
    drive_bag_world_clear(&r->world);
    free(r);
}
