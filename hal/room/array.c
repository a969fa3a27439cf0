/* SPDX-License-Identifier: MIT */
/* hal/room/array.c -- the simulated room as an array.  A shot of a standing room is
 * rendered whole when it is fired; its pings come as fast as they are asked for, or at
 * the true pace.  Endless shots, drives and continuous scans are rendered ping by ping
 * for the time of each, at the true pace always. */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "hal/array.h"
#include "hal/device.h"
#include "hal/room/room.h"

/* A ping that comes this much after its end is late; and this much, and of an endless
 * shot it is left out. */
#define LATE_NS     INT64_C(20000000)
#define TOO_LATE_NS INT64_C(500000000)

struct array_sim {
    const struct clock_source *clock;
    struct room *room;
    struct room_stream *stream; /* else NULL: the shot is in samples */
    bool real_pace, endless, continuous;
    size_t n_ping;            /* samples: slot and tail */
    uint32_t *takes;          /* [2 passes][n_positions]: shots so far, for their noise */
    float *samples;           /* [n_microphones][room_frames(n_speakers)] */
    float *ping;              /* [n_microphones][n_ping] */
    uint32_t *clipped, *none; /* [n_microphones] */
    struct calibration *calibration;
    const uint32_t *speakers; /* of the shot; hal/array.c keeps them */
    uint64_t next;            /* ping of the shot */
    size_t n_speakers, n_frames;
    int64_t fired_ns;
    uint64_t n_late, n_skipped; /* pings */
    double temperature_c;
};

static void sim_close(void *state)
{
    struct array_sim *a = state;
    room_stream_destroy(a->stream);
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
                    struct error *why)
{
    static const char *const known[] = {"pace", "calibrated", FIRING_KEYS, NULL};
    static const char *const paces[] = {"fast", "real", NULL};
    struct firing firing;
    struct device d;
    int err = device_parse(&d, arg, known, why);
    if (err)
        return err;
    struct array_sim *a = calloc(1, sizeof *a);
    if (!a) {
        err = error_say(why, -ENOMEM, "out of memory");
        goto device;
    }
    a->clock = clock;
    int pace = device_choice(&d, "pace", paces, why);
    a->real_pace = pace == 1;
    err = pace < 0 ? pace : 0;
    if (!err && !*d.path)
        err = error_say(why, -EINVAL, "expected a scene file, sim:SCENE.yaml");
    if (!err)
        err = firing_from_device(&firing, &d, why);
    if (!err)
        err = room_load_drawn(&a->room, d.path, &firing, 0, why);
    if (!err && room_survey(a->room)->n_positions > 1)
        err = firing_refuse_uneven(&firing, "not of a scan with a stage", why);
    if (!err && room_is_drive(a->room) && pace == 0 && device_option(&d, "pace"))
        err = error_say(why, -EINVAL,
                        "option \"pace\": a drive runs at the true pace, "
                        "expected real");
    if (!err)
        err = room_calibrate(a->room, device_option(&d, "calibrated"), &a->calibration,
                             why);
    if (!err && allocate(a) < 0)
        err = error_say(why, -ENOMEM, "out of memory");
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

static int fire_whole(struct array_sim *a, const struct array_shot *shot)
{
    size_t n_positions = room_survey(a->room)->n_positions;
    bool background = shot->pass == PASS_BACKGROUND;
    uint32_t *take = a->takes + background * n_positions + shot->position;
    int err = room_record(a->room, shot->pass, shot->position, shot->speakers,
                          shot->n_speakers, *take, a->samples);
    if (!err)
        ++*take;
    return err;
}

static int fire_stream(struct array_sim *a, const struct array_shot *shot)
{
    const struct survey *s = room_survey(a->room);
    size_t n_rounds = shot->endless ? 0 : shot->n_rounds ? shot->n_rounds : 1;
    struct room_stream_config cfg = {.pass = shot->pass,
                                     .speakers = shot->speakers,
                                     .n_speakers = shot->n_speakers,
                                     .start_s = room_time_s(a->room, a->fired_ns),
                                     .position = shot->position,
                                     .stage_m = s->stage_positions_m[shot->position],
                                     .n_emissions = n_rounds * shot->n_speakers};
    if (s->continuous)
        cfg.take =
            a->takes[(shot->pass == PASS_BACKGROUND) * s->n_positions + shot->position]++;
    if (shot->n_rounds) {
        cfg.stage_m_s = shot->stage_m_s;
        cfg.stage_m = shot->stage_m +
                      shot->stage_m_s * 1e-9 * (double)(a->fired_ns - shot->start_ns);
    }
    return room_stream_create(&a->stream, a->room, &cfg);
}

static int sim_fire(void *state, const struct array_shot *shot)
{
    struct array_sim *a = state;
    room_stream_destroy(a->stream);
    a->stream = NULL;
    a->fired_ns = clock_now_ns(a->clock);
    if (shot->n_rounds && shot->start_ns > a->fired_ns)
        a->fired_ns = shot->start_ns;
    bool streams = shot->endless || room_is_drive(a->room) ||
                   room_survey(a->room)->continuous;
    int err = streams ? fire_stream(a, shot) : fire_whole(a, shot);
    if (err)
        return err;
    a->endless = shot->endless;
    a->continuous = shot->n_rounds > 0;
    a->speakers = shot->speakers;
    a->n_speakers = shot->n_speakers;
    a->next = 0;
    a->n_frames = room_frames(a->room, shot->n_speakers);
    a->temperature_c = room_temperature_c(a->room, shot->pass, shot->position);
    if (!a->stream)
        a->fired_ns = clock_now_ns(a->clock);
    return 0;
}

static int64_t samples_ns(const struct survey *s, uint64_t n)
{
    return (int64_t)((double)n / s->sample_rate_hz * 1e9);
}

/* Samples from the start of the shot to that of a ping. */
static uint64_t start_of(const struct array_sim *a, uint64_t n)
{
    const struct survey *s = room_survey(a->room);
    return a->stream ? room_stream_start(a->stream, n)
                     : survey_slot_of(s, n) * s->slot_samples;
}

static int64_t end_ns(const struct array_sim *a, uint64_t n)
{
    return a->fired_ns + samples_ns(room_survey(a->room), start_of(a, n) + a->n_ping);
}

/* Passes over what nobody took in time, as a sound card's ring does. */
static void catch_up(struct array_sim *a)
{
    int64_t now_ns = clock_now_ns(a->clock);
    if (!a->endless || now_ns - end_ns(a, a->next) <= TOO_LATE_NS)
        return;
    for (; end_ns(a, a->next) < now_ns; a->next++)
        a->n_skipped++;
}

/* The samples of the next ping into a->ping. */
static int take_ping(struct array_sim *a)
{
    size_t n_microphones = room_survey(a->room)->n_microphones, stride = a->n_ping;
    const float *samples = a->samples + start_of(a, a->next);
    if (a->stream) {
        int err = room_stream_ping(a->stream, a->next, &samples);
        if (err)
            return err;
    } else {
        stride = a->n_frames;
    }
    for (size_t m = 0; m < n_microphones; m++)
        memcpy(a->ping + m * a->n_ping, samples + m * stride, a->n_ping * sizeof(float));
    return 0;
}

/* At the true pace a ping is there when its tail has been recorded. */
static int wait_for_end(struct array_sim *a)
{
    bool late = a->stream && clock_now_ns(a->clock) - end_ns(a, a->next) > LATE_NS;
    int err = a->clock->sleep_until_ns(a->clock->state, end_ns(a, a->next));
    a->n_late += !err && late;
    return err;
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

/* Not at the true pace a ping takes no time, and was taken now. */
static int sim_next(void *state, struct array_ping *out, struct error *why)
{
    struct array_sim *a = state;
    const struct survey *s = room_survey(a->room);
    bool real = a->real_pace || a->stream;
    catch_up(a);
    int err = take_ping(a);
    if (err)
        return error_say(why, err, "a ping cannot be rendered: %s", strerror(-err));
    if (real)
        err = wait_for_end(a);
    if (err)
        return error_say(why, err, "the wait for a ping was interrupted");
    size_t index = (size_t)(a->next % a->n_speakers);
    count_clipped(a);
    calibration_correct(a->calibration, a->speakers[index], a->n_ping, a->ping);
    *out = (struct array_ping){
        .shot_index = index,
        .frame = a->endless || a->continuous ? (uint32_t)(a->next / a->n_speakers + 1)
                                             : 0,
        .samples = a->ping,
        .n_samples = a->n_ping,
        .clipped = a->clipped,
        .not_finite = a->none,
        .valid = true,
        .temperature_c = a->temperature_c,
        .t0_ns = real ? a->fired_ns + samples_ns(s, start_of(a, a->next))
                      : clock_now_ns(a->clock)};
    a->next++;
    return 0;
}

static void sim_halt(void *state)
{
    struct array_sim *a = state;
    room_stream_destroy(a->stream);
    a->stream = NULL;
}

static size_t sim_counts(void *state, struct device_count out[DEVICE_MAX_COUNTS])
{
    const struct array_sim *a = state;
    out[0] = (struct device_count){.name = "pings_late", .value = a->n_late};
    out[1] = (struct device_count){.name = "pings_skipped", .value = a->n_skipped};
    return 2;
}

const struct array_ops array_sim_ops = {.scheme = "sim",
                                        .open = sim_open,
                                        .survey = sim_survey,
                                        .fire = sim_fire,
                                        .next = sim_next,
                                        .halt = sim_halt,
                                        .counts = sim_counts,
                                        .close = sim_close};
