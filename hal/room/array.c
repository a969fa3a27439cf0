/* hal/room/array.c -- the simulated room as an array.  A shot is rendered whole when it
 * is fired; its pings come as fast as they are asked for, or at the true pace. */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "hal/array_backends.h"
#include "hal/device.h"
#include "hal/room/room.h"

struct array_sim {
    const struct clock_source *clock;
    struct room *room;
    bool real_pace;
    size_t n_ping;            /* samples: slot and tail */
    uint32_t *takes;          /* [2 passes][n_positions]: shots so far, for their noise */
    float *samples;           /* [n_microphones][room_frames(n_speakers)] */
    float *ping;              /* [n_microphones][n_ping] */
    uint32_t *clipped, *none; /* [n_microphones] */
    struct calibration *calibration;
    const uint32_t *speakers; /* of the shot; hal/array.c keeps them */
    size_t next, n_frames;
    int64_t fired_ns;
    double temperature_c;
};

static void sim_close(void *state)
{
    struct array_sim *a = state;
    room_destroy(a->room);
    calibration_destroy(a->calibration);
    free(a->takes);
    free(a->samples);
    free(a->ping);
    free(a->clipped);
    free(a->none);
    free(a);
}

static int allocate(struct array_sim *a)
{
    const struct survey *s = room_survey(a->room);
    a->n_ping = room_frames(a->room, 1);
    a->takes = calloc(2 * s->n_positions, sizeof *a->takes);
    a->samples = calloc(s->n_microphones * room_frames(a->room, s->n_speakers),
                        sizeof *a->samples);
    a->ping = calloc(s->n_microphones * a->n_ping, sizeof *a->ping);
    a->clipped = calloc(s->n_microphones, sizeof *a->clipped);
    a->none = calloc(s->n_microphones, sizeof *a->none);
    return a->takes && a->samples && a->ping && a->clipped && a->none ? 0 : -ENOMEM;
}

static int sim_open(void **state, const char *arg, const struct clock_source *clock,
                    struct complaint *why)
{
    static const char *const known[] = {"pace", "calibrated", NULL};
    static const char *const paces[] = {"fast", "real", NULL};
    struct device d;
    int err = device_parse(&d, arg, known, why);
    if (err)
        return err;
    struct array_sim *a = calloc(1, sizeof *a);
    if (!a) {
        err = complain(why, -ENOMEM, "out of memory");
        goto device;
    }
    a->clock = clock;
    int pace = device_choice(&d, "pace", paces, why);
    a->real_pace = pace == 1;
    err = pace < 0 ? pace : 0;
    if (!err && !*d.path)
        err = complain(why, -EINVAL, "expected a scene file, sim:SCENE.yaml");
    if (!err)
        err = room_load(&a->room, d.path, why);
    if (!err)
        err = room_calibrate(a->room, device_option(&d, "calibrated"), &a->calibration,
                             why);
    if (!err && allocate(a) < 0)
        err = complain(why, -ENOMEM, "out of memory");
    if (err)
        sim_close(a);
    else
        *state = a;
device:
    device_clear(&d);
    return err;
}

static const struct survey *sim_survey(void *state)
{
    return room_survey(((const struct array_sim *)state)->room);
}

static int sim_fire(void *state, const struct array_shot *shot)
{
    struct array_sim *a = state;
    size_t n_positions = room_survey(a->room)->n_positions;
    bool background = shot->pass == ANLOS__PASS__BACKGROUND;
    uint32_t *take = a->takes + background * n_positions + shot->position;
    int err = room_record(a->room, shot->pass, shot->position, shot->speakers,
                          shot->n_speakers, *take, a->samples);
    if (err)
        return err;
    ++*take;
    a->speakers = shot->speakers;
    a->next = 0;
    a->n_frames = room_frames(a->room, shot->n_speakers);
    a->temperature_c = room_temperature_c(a->room, shot->pass, shot->position);
    a->fired_ns = clock_now_ns(a->clock);
    return 0;
}

static int64_t samples_ns(const struct survey *s, size_t n)
{
    return (int64_t)((double)n / s->sample_rate_hz * 1e9);
}

static void count_clipped(struct array_sim *a)
{
    for (size_t m = 0; m < room_survey(a->room)->n_microphones; m++) {
        const float *x = a->ping + m * a->n_ping;
        float limit = room_limit(a->room, m);
        a->clipped[m] = 0;
        for (size_t i = 0; isfinite(limit) && i < a->n_ping; i++)
            a->clipped[m] += fabsf(x[i]) >= limit;
    }
}

/* At the true pace a ping is there when its tail has been recorded.  Else it takes no
 * time, and was taken now. */
static int sim_next(void *state, struct array_ping *out, struct complaint *why)
{
    struct array_sim *a = state;
    const struct survey *s = room_survey(a->room);
    size_t start = a->next * s->slot_samples;
    int64_t t0_ns = a->fired_ns + samples_ns(s, start);
    if (a->real_pace) {
        int err =
            a->clock->sleep_until_ns(a->clock->state, t0_ns + samples_ns(s, a->n_ping));
        if (err)
            return complain(why, err, "the wait for a ping was interrupted");
    } else {
        t0_ns = clock_now_ns(a->clock);
    }
    for (size_t m = 0; m < s->n_microphones; m++)
        memcpy(a->ping + m * a->n_ping, a->samples + m * a->n_frames + start,
               a->n_ping * sizeof *a->ping);
    count_clipped(a);
    calibration_correct(a->calibration, a->speakers[a->next], a->n_ping, a->ping);
    *out = (struct array_ping){.shot_index = a->next++,
                               .samples = a->ping,
                               .n_samples = a->n_ping,
                               .clipped = a->clipped,
                               .not_finite = a->none,
                               .valid = true,
                               .temperature_c = a->temperature_c,
                               .t0_ns = t0_ns};
    return 0;
}

const struct array_ops array_sim_ops = {.scheme = "sim",
                                        .open = sim_open,
                                        .survey = sim_survey,
                                        .fire = sim_fire,
                                        .next = sim_next,
                                        .close = sim_close};
