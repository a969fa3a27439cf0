/* SPDX-License-Identifier: MIT */
/* hal/alsa/array.c -- a sound card as an array.  The card runs all the time
 * (hal/alsa/engine.h); a ping is cut out of what it has recorded of the shot. */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hal/alsa/engine.h"
#include "hal/array.h"
#include "hal/device.h"
#include "hal/recording/recording.h"
#include "hal/recording/riff.h"
#include "hal/survey/file.h"
#include "hal/survey/firing.h"
#include "hal/turn.h"

#define SAME_PLACE_M 1e-4

struct array_alsa {
    const struct clock_source *clock;
    struct rig rig;
    struct alsa_engine *engine;
    struct recording *background; /* made before; NULL: recorded like the scene */
    struct array_shot shot;
    struct turn turn;
    size_t n_ping;        /* samples: slot and tail */
    float *ping;          /* [n_microphones][n_ping] */
    uint32_t *clipped;    /* [n_speakers][n_microphones], [0] when live */
    uint32_t *not_finite; /* [n_speakers][n_microphones] */
    float *played;        /* [n_microphones][recording_frames] of the background */
    bool loaded;          /* a position is in played: */
    size_t position;
};

static void alsa_close(void *state)
{
    struct array_alsa *a = state;
    if (a->engine)
        alsa_engine_destroy(a->engine);
    recording_close(a->background);
    rig_clear(&a->rig);
    free(a->ping);
    free(a->clipped);
    free(a->not_finite);
    free(a->played);
    free(a);
}

static int allocate(struct array_alsa *a)
{
    const struct survey *s = &a->rig.survey;
    const struct alsa_shot *shot = alsa_engine_shot(a->engine);
    size_t n_counts = s->n_speakers * s->n_microphones;
    a->n_ping = s->slot_samples + shot->plan.tail_samples;
    a->ping = calloc(s->n_microphones * a->n_ping, sizeof *a->ping);
    a->clipped = calloc(n_counts, sizeof *a->clipped);
    a->not_finite = calloc(n_counts, sizeof *a->not_finite);
    if (a->background)
        a->played =
            calloc(s->n_microphones * recording_frames(a->background), sizeof *a->played);
    return a->ping && a->clipped && a->not_finite && (a->played || !a->background)
               ? 0
               : -ENOMEM;
}

static bool is_same_sound(const struct survey *a, const struct survey *b)
{
    bool same = a->slot_samples == b->slot_samples &&
                a->chirp_start_hz == b->chirp_start_hz &&
                a->chirp_stop_hz == b->chirp_stop_hz &&
                a->chirp_duration_s == b->chirp_duration_s &&
                a->chirp_sine == b->chirp_sine &&
                a->chirp_alternates == b->chirp_alternates &&
                survey_slots(a, 2) == survey_slots(b, 2) &&
                a->n_positions == b->n_positions && a->continuous == b->continuous;
    for (size_t i = 0; same && i < a->n_positions; i++)
        same = fabs(a->stage_positions_m[i] - b->stage_positions_m[i]) < SAME_PLACE_M;
    return same;
}

/* Subtracted from every ping: one of another chirp or other places would spoil all. */
static int open_background(struct array_alsa *a, const char *folder, struct error *why)
{
    char path[PATH_MAX];
    struct survey s;
    struct error missing;
    snprintf(path, sizeof path, "%s/survey.yaml", folder);
    if (!access(path, F_OK)) {
        int err = survey_load(&s, path, &missing);
        if (err)
            return error_say(why, err, "%s", missing.text);
        bool same = is_same_sound(&s, &a->rig.survey);
        survey_clear(&s);
        if (!same)
            return error_say(why, -EINVAL,
                             "the background %s was recorded with another chirp, slot or "
                             "stage positions than the rig's: record it anew",
                             folder);
    }
    return recording_open(&a->background, folder, &a->rig.survey, why);
}

static int open_parts(struct array_alsa *a, const struct device *d, struct error *why)
{
    const char *rig = device_option(d, "rig");
    const char *background = device_option(d, "background");
    struct firing firing;
    if (!*d->path || !rig)
        return error_say(why, -EINVAL,
                         "expected a sound card and its rig, alsa:DEVICE?rig=FILE.yaml; "
                         "'anlos array list' has the names of the cards");
    int err = rig_load_calibrated(&a->rig, rig, device_option(d, "calibrated"), why);
    if (!err)
        err = firing_from_device(&firing, d, why);
    if (!err && a->rig.survey.n_positions > 1)
        err = firing_refuse_uneven(&firing, "not of a scan with a stage", why);
    if (!err)
        err = firing_apply(&a->rig.survey, &firing, why);
    if (!background)
        background = a->rig.background;
    if (!err && background && *background)
        err = open_background(a, background, why);
    /* No two arrays start in the same nanosecond: each has draws of its own. */
    const struct firing_slots slots =
        firing_slots(&a->rig.survey, &firing, true, (uint64_t)clock_now_ns(a->clock));
    if (!err)
        err = alsa_engine_create(&a->engine, d->path, &a->rig, &slots, a->clock, why);
    if (!err && allocate(a))
        err = error_say(why, -ENOMEM, "out of memory");
    return err;
}

static int alsa_array_open(void **state, const char *arg,
                           const struct clock_source *clock, struct error *why)
{
    static const char *const known[] = {"rig", "background", "calibrated", FIRING_KEYS,
                                        NULL};
    struct device d;
    int err = device_parse(&d, arg, known, why);
    if (err)
        return err;
    struct array_alsa *a = calloc(1, sizeof *a);
    if (a) {
        a->clock = clock;
        err = open_parts(a, &d, why);
        if (err)
            alsa_close(a);
        else
            *state = a;
    } else {
        err = error_say(why, -ENOMEM, "out of memory");
    }
    device_clear(&d);
    return err;
}

static const struct survey *alsa_survey(void *state)
{
    return &((const struct array_alsa *)state)->rig.survey;
}

static bool is_played(const struct array_alsa *a)
{
    return a->background && a->shot.pass == PASS_BACKGROUND;
}

static int alsa_fire(void *state, const struct array_shot *shot)
{
    struct array_alsa *a = state;
    a->shot = *shot;
    turn_start(&a->turn, shot, clock_now_ns(a->clock));
    a->loaded = false;
    if (!is_played(a))
        alsa_shot_fire(alsa_engine_shot(a->engine), shot);
    return 0;
}

static void alsa_halt(void *state)
{
    struct array_alsa *a = state;
    if (!is_played(a))
        alsa_shot_halt(alsa_engine_shot(a->engine));
}

/* Who was away too long goes on with what is new. */
static void catch_up(struct array_alsa *a)
{
    const struct survey *s = &a->rig.survey;
    size_t slot = turn_slot(&a->turn, s), newest;
    newest = alsa_shot_newest(alsa_engine_shot(a->engine), slot);
    if (newest == slot)
        return;
    turn_go(&a->turn, s, newest);
    alsa_report_count(alsa_engine_report(a->engine), ALSA_SLOTS_SKIPPED, newest - slot);
}

/* Full scale is the card's: gains come after the count. */
static void finish(struct array_alsa *a, size_t speaker)
{
    size_t n_microphones = a->rig.survey.n_microphones;
    const struct wav_samples w = {.n_channels = n_microphones,
                                  .n_frames = a->n_ping,
                                  .n_slots = 1,
                                  .slot_samples = a->n_ping};
    wav_samples_count(&w, a->ping, a->n_ping, a->clipped, a->not_finite);
    for (size_t m = 0; m < n_microphones; m++)
        for (size_t i = 0; i < a->n_ping; i++)
            a->ping[m * a->n_ping + i] *= a->rig.input_gain[m];
    calibration_correct(a->rig.calibration, speaker, a->n_ping, a->ping);
}

static int record(struct array_alsa *a, struct array_ping *out, struct error *why)
{
    struct alsa_shot *shot = alsa_engine_shot(a->engine);
    catch_up(a);
    size_t slot = turn_slot(&a->turn, &a->rig.survey);
    int err = alsa_engine_wait(a->engine, slot, why);
    if (err)
        return err;
    out->valid = alsa_shot_read(shot, slot, &out->t0_ns);
    alsa_shot_copy(shot, slot, a->ping);
    finish(a, a->shot.speakers[a->turn.next]);
    out->clipped = a->clipped;
    out->not_finite = a->not_finite;
    return 0;
}

static int play(struct array_alsa *a, struct array_ping *out, struct error *why)
{
    const struct survey *s = &a->rig.survey;
    size_t speaker = a->shot.speakers[a->turn.next], slot = survey_slot_of(s, speaker);
    int err = turn_wait(&a->turn, s, a->n_ping, a->clock, &out->t0_ns, why);
    if (err)
        return err;
    size_t position = a->shot.position + a->turn.round;
    if (!a->loaded || a->position != position) {
        err = recording_read_slots(a->background, position, a->played, a->clipped,
                                   a->not_finite, why);
        if (err)
            return err;
        a->loaded = true;
        a->position = position;
    }
    size_t n_frames = recording_frames(a->background);
    for (size_t m = 0; m < s->n_microphones; m++)
        memcpy(a->ping + m * a->n_ping, a->played + m * n_frames + slot * s->slot_samples,
               a->n_ping * sizeof *a->ping);
    calibration_correct(a->rig.calibration, speaker, a->n_ping, a->ping);
    out->clipped = a->clipped + slot * s->n_microphones;
    out->not_finite = a->not_finite + slot * s->n_microphones;
    out->valid = true;
    return 0;
}

static int alsa_next(void *state, struct array_ping *out, struct error *why)
{
    struct array_alsa *a = state;
    *out = (struct array_ping){.samples = a->ping,
                               .n_samples = a->n_ping,
                               .temperature_c = a->rig.survey.temperature_c};
    int err = is_played(a) ? play(a, out, why) : record(a, out, why);
    if (err)
        return err;
    out->shot_index = a->turn.next;
    out->frame = turn_frame(&a->turn);
    turn_advance(&a->turn);
    if (!is_played(a))
        alsa_shot_release(alsa_engine_shot(a->engine),
                          turn_slot(&a->turn, &a->rig.survey));
    return 0;
}

/* A recording was made of all speakers in turn. */
static bool alsa_is_down(void *state, size_t k)
{
    const struct array_alsa *a = state;
    return survey_is_down(&a->rig.survey, is_played(a) ? a->shot.speakers[k] : k);
}

static size_t alsa_counts(void *state, struct device_count out[DEVICE_MAX_COUNTS])
{
    struct array_alsa *a = state;
    return alsa_report_counts(alsa_engine_report(a->engine), out);
}

static int alsa_condition(void *state, struct error *why)
{
    struct array_alsa *a = state;
    return alsa_report_condition(alsa_engine_report(a->engine), why);
}

static bool alsa_notice(void *state, struct error *out)
{
    struct array_alsa *a = state;
    return alsa_report_take(alsa_engine_report(a->engine), out);
}

const struct array_ops array_alsa_ops = {.scheme = "alsa",
                                         .open = alsa_array_open,
                                         .survey = alsa_survey,
                                         .fire = alsa_fire,
                                         .next = alsa_next,
                                         .is_down = alsa_is_down,
                                         .halt = alsa_halt,
                                         .counts = alsa_counts,
                                         .condition = alsa_condition,
                                         .notice = alsa_notice,
                                         .close = alsa_close};
