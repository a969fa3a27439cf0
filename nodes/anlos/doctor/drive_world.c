/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/doctor/drive_world.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "recon/survey.h"

#define BEGIN_NS     INT64_C(1000000000) /* stamps are above 0 */
#define WALL_SIGMA_M 0.02
#define WALL_TURN    (0.3 * M_PI / 180.0)

static int pack_survey(struct drive_world *w)
{
    uint8_t *bytes = NULL;
    size_t size;
    int err = survey_pack(room_survey(w->room), &bytes, &size);

    if (err)
        return err;
    w->survey = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    return w->survey ? 0 : -ENOMEM;
}

int drive_world_create(struct drive_world *w, const struct drive_world_config *cfg,
                       struct error *why)
{
    *w = (struct drive_world){.begin_ns = BEGIN_NS};
    int err = room_load_drawn(&w->room, cfg->scene, cfg->firing, cfg->draw, why);
    if (err)
        return err;
    if (!room_is_drive(w->room))
        return error_say(why, -ENOTSUP, "%s: not a drive: the key \"drive\" is missing",
                         cfg->scene);
    const struct survey *s = room_survey(w->room);
    w->n_samples = room_frames(w->room, 1);
    w->n_speakers = cfg->n_speakers ? cfg->n_speakers : s->n_speakers;
    w->clipped = calloc(s->n_microphones, sizeof *w->clipped);
    w->speakers = calloc(w->n_speakers, sizeof *w->speakers);
    err = w->clipped && w->speakers ? pack_survey(w) : -ENOMEM;
    for (size_t i = 0; !err && i < w->n_speakers; i++)
        w->speakers[i] = cfg->n_speakers ? cfg->speakers[i] : (uint32_t)i;
    return err ? error_say(why, err, "%s: not enough memory", cfg->scene) : 0;
}

double drive_world_s(int64_t stamp_ns)
{
    return 1e-9 * (double)(stamp_ns - BEGIN_NS);
}

static int64_t start_ns(const struct drive_world *w, uint64_t n)
{
    double s = (double)room_stream_start(w->stream, n) /
               room_survey(w->room)->sample_rate_hz;
    return w->begin_ns + llround(1e9 * s);
}

int drive_world_shoot(struct drive_world *w, enum pass pass, struct error *why)
{
    if (w->stream)
        w->begin_ns = start_ns(w, w->n);
    const struct room_stream_config cfg = {.pass = pass,
                                           .speakers = w->speakers,
                                           .n_speakers = w->n_speakers,
                                           .start_s = drive_world_s(w->begin_ns)};
    room_stream_destroy(w->stream);
    w->stream = NULL;
    w->n = 0;
    int err = room_stream_create(&w->stream, w->room, &cfg);
    return err ? error_say(why, err, "sound of the drive: %s", strerror(-err)) : 0;
}

int drive_world_ping(struct drive_world *w, enum pass pass, Anlos__Ping *out,
                     int64_t *capture_ns)
{
    const struct survey *s = room_survey(w->room);
    const float *samples;
    uint64_t n = w->n++;
    int err = room_stream_ping(w->stream, n, &samples);

    if (err)
        return err;
    *capture_ns = start_ns(w, n);
    anlos__ping__init(out);
    out->survey_id = w->survey->id;
    out->scan = 1;
    out->pass = (Anlos__Pass)pass;
    out->speaker = w->speakers[n % w->n_speakers];
    out->frame = (uint32_t)(n / w->n_speakers) + 1;
    out->down = survey_is_down(s, n % w->n_speakers);
    out->samples =
        tensor_borrow_f32(&w->view, samples, 2, s->n_microphones, w->n_samples);
    out->n_clipped = out->n_not_finite = s->n_microphones;
    out->clipped = out->not_finite = w->clipped;
    out->valid = true;
    out->temperature_c = s->temperature_c;
    return 0;
}

void drive_world_ego(const struct drive_world *w, int64_t stamp_ns, Anlos__EgoMotion *out)
{
    struct room_ego ego;

    room_ego(w->room, drive_world_s(stamp_ns), &ego);
    anlos__ego_motion__init(out);
    out->speed_m_s = ego.speed_m_s;
    out->yaw_rate_rad_s = ego.yaw_rate_rad_s;
    out->standstill = ego.standstill;
    out->valid = true;
}

/* normal . p = distance of the array frame, in the vehicle's. */
void drive_world_wall(const struct drive_world *w, int64_t stamp_ns,
                      struct drive_walls *out)
{
    double n[3], distance_m;

    room_vehicle_wall(w->room, drive_world_s(stamp_ns), n, &distance_m);
    anlos__wall_list__init(&out->list);
    anlos__wall__init(&out->wall);
    anlos__vec3__init(&out->normal);
    out->normal.x = n[0];
    out->normal.y = n[1];
    out->normal.z = n[2];
    memset(out->covariance, 0, sizeof out->covariance);
    out->covariance[0] = out->covariance[3] = WALL_TURN * WALL_TURN;
    out->covariance[5] = WALL_SIGMA_M * WALL_SIGMA_M;
    out->wall.id = 1;
    out->wall.origin = ANLOS__WALL__ORIGIN__GIVEN;
    out->wall.normal = &out->normal;
    out->wall.distance_m = distance_m;
    out->wall.covariance = out->covariance;
    out->wall.n_covariance = 6;
    out->wall.existence = 1.0;
    out->walls[0] = &out->wall;
    out->list.walls = out->walls;
    out->list.n_walls = 1;
}

void drive_world_clear(struct drive_world *w)
{
    room_stream_destroy(w->stream);
    room_destroy(w->room);
    if (w->survey)
        anlos__survey__free_unpacked(w->survey, NULL);
    free(w->clipped);
    free(w->speakers);
}
