/* SPDX-License-Identifier: MIT */
/* hal/recording/array.c -- a recording, played as if it were taken now. */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hal/array.h"
#include "hal/device.h"
#include "hal/recording/recording.h"
#include "hal/survey/calibration.h"
#include "hal/survey/file.h"
#include "hal/turn.h"
#include "recon/tail.h"

struct array_wav {
    const struct clock_source *clock;
    struct survey survey;
    struct calibration *calibration;      /* may be NULL */
    struct recording *scene, *background; /* background may be NULL */
    size_t n_ping;                        /* samples: slot and tail */
    struct array_shot shot;
    struct turn turn;
    bool loop; /* an endless shot of the scene begins again where the recording ends */
    struct {   /* of an endless shot */
        size_t next;     /* emission of the recording */
        uint64_t passed; /* samples of the recording that were played through, */
        uint32_t frames; /* and its frames */
        bool down;       /* of the newest emission */
        bool any;        /* there was one */
    } play;
    bool loaded; /* a position is in samples: */
    size_t position;
    float *samples;       /* [n_microphones][recording_frames] */
    float *ping;          /* [n_microphones][n_ping] */
    uint32_t *clipped;    /* [n_speakers][n_microphones] */
    uint32_t *not_finite; /* [n_speakers][n_microphones] */
};

/* What the option says, else FOLDER/survey.yaml, else the one beside the folder. */
static int find_survey(const struct device *d, char **path, struct error *why)
{
    const char *given = device_option(d, "survey");
    *path = given ? strdup(given) : NULL;
    if (given)
        return *path ? 0 : error_say(why, -ENOMEM, "out of memory");
    if (access(d->path, F_OK) < 0)
        return error_say(why, -errno, "%s: %s", d->path, strerror(errno));
    if (asprintf(path, "%s/survey.yaml", d->path) < 0)
        return error_say(why, -ENOMEM, "out of memory");
    if (!access(*path, F_OK))
        return 0;
    free(*path);
    if (asprintf(path, "%s/../survey.yaml", d->path) < 0)
        return error_say(why, -ENOMEM, "out of memory");
    if (!access(*path, F_OK))
        return 0;
    free(*path);
    return error_say(why, -ENOENT,
                     "%s: no survey.yaml in it or beside it; name it with ?survey=FILE",
                     d->path);
}

static void wav_close(void *state)
{
    struct array_wav *a = state;
    recording_close(a->scene);
    recording_close(a->background);
    calibration_destroy(a->calibration);
    survey_clear(&a->survey);
    free(a->samples);
    free(a->ping);
    free(a->clipped);
    free(a->not_finite);
    free(a);
}

static int allocate(struct array_wav *a)
{
    const struct survey *s = &a->survey;
    size_t n_counts = s->n_speakers * s->n_microphones;
    a->n_ping = s->slot_samples + tail_samples(s);
    a->samples = calloc(s->n_microphones * recording_frames(a->scene), sizeof(float));
    a->ping = calloc(s->n_microphones * a->n_ping, sizeof(float));
    a->clipped = calloc(n_counts, sizeof *a->clipped);
    a->not_finite = calloc(n_counts, sizeof *a->not_finite);
    return a->samples && a->ping && a->clipped && a->not_finite ? 0 : -ENOMEM;
}

static int take_loop(struct array_wav *a, const char *text, struct error *why)
{
    a->loop = text && !strcmp(text, "yes");
    return !text || a->loop || !strcmp(text, "no")
               ? 0
               : error_say(why, -EINVAL, "loop=%s: expected yes or no", text);
}

static int open_parts(struct array_wav *a, const struct device *d, struct error *why)
{
    char *path;
    const char *background = device_option(d, "background");
    if (!*d->path)
        return error_say(why, -EINVAL, "expected a folder, wav:FOLDER");
    int err = find_survey(d, &path, why);
    if (err)
        return err;
    err = survey_load(&a->survey, path, why);
    free(path);
    if (err)
        return err;
    a->survey.source = SURVEY_REPLAY;
    err = calibration_take(&a->calibration, device_option(d, "calibrated"), &a->survey,
                           why);
    if (err)
        return err;
    err = take_loop(a, device_option(d, "loop"), why);
    if (!err)
        err = recording_open(&a->scene, d->path, &a->survey, why);
    if (!err && background)
        err = recording_open(&a->background, background, &a->survey, why);
    if (!err && background)
        err =
            recording_check_background(a->scene, d->path, a->background, background, why);
    if (!err && allocate(a) < 0)
        err = error_say(why, -ENOMEM, "out of memory");
    return err;
}

static int wav_open(void **state, const char *arg, const struct clock_source *clock,
                    struct error *why)
{
    static const char *const known[] = {"background", "survey", "calibrated", "loop",
                                        NULL};
    struct device d;
    int err = device_parse(&d, arg, known, why);
    if (err)
        return err;
    struct array_wav *a = calloc(1, sizeof *a);
    if (!a) {
        err = error_say(why, -ENOMEM, "out of memory");
        goto device;
    }
    a->clock = clock;
    err = open_parts(a, &d, why);
    if (err)
        wav_close(a);
    else
        *state = a;
device:
    device_clear(&d);
    return err;
}

static const struct survey *wav_survey(void *state)
{
    return &((const struct array_wav *)state)->survey;
}

static int wav_fire(void *state, const struct array_shot *shot)
{
    struct array_wav *a = state;
    if (shot->pass == PASS_BACKGROUND && !a->background)
        return -EINVAL;
    /* What is in memory serves a retake. */
    if (shot->pass != a->shot.pass || shot->endless)
        a->loaded = false;
    a->shot = *shot;
    memset(&a->play, 0, sizeof a->play);
    turn_start(&a->turn, shot, clock_now_ns(a->clock));
    return 0;
}

static const struct recording *recording_of(const struct array_wav *a)
{
    return a->shot.pass == PASS_BACKGROUND ? a->background : a->scene;
}

static void fill_ping(struct array_wav *a, size_t shot_index, size_t count,
                      struct array_ping *out)
{
    const struct survey *s = &a->survey;
    calibration_correct(a->calibration, a->shot.speakers[shot_index], a->n_ping, a->ping);
    *out = (struct array_ping){.shot_index = shot_index,
                               .samples = a->ping,
                               .n_samples = a->n_ping,
                               .clipped = a->clipped + count * s->n_microphones,
                               .not_finite = a->not_finite + count * s->n_microphones,
                               .valid = true,
                               .temperature_c = s->temperature_c};
}

/* -- a scan: slot after slot of the shot's position -------------------------------------
 */

static int load(struct array_wav *a, struct error *why)
{
    size_t position = a->shot.position + a->turn.round;
    if (a->loaded && a->position == position)
        return 0;
    int err = recording_read_slots(recording_of(a), position, a->samples, a->clipped,
                                   a->not_finite, why);
    a->loaded = !err;
    a->position = position;
    return err;
}

static int next_slot(struct array_wav *a, struct array_ping *out, struct error *why)
{
    const struct survey *s = &a->survey;
    size_t n_frames = recording_frames(a->scene),
           speaker = a->shot.speakers[a->turn.next];
    size_t slot = survey_slot_of(s, speaker);
    int64_t t0_ns;
    int err = load(a, why);
    if (!err)
        err = turn_wait(&a->turn, s, a->n_ping, a->clock, &t0_ns, why);
    if (err)
        return err;
    for (size_t m = 0; m < s->n_microphones; m++)
        memcpy(a->ping + m * a->n_ping,
               a->samples + m * n_frames + slot * s->slot_samples,
               a->n_ping * sizeof *a->ping);
    fill_ping(a, a->turn.next, slot, out);
    out->t0_ns = t0_ns;
    out->frame = turn_frame(&a->turn);
    turn_advance(&a->turn);
    return 0;
}

/* -- an array that stands: what was recorded, to its end --------------------------------
 */

static bool find_speaker(const struct array_shot *shot, uint32_t speaker, size_t *index)
{
    for (*index = 0; *index < shot->n_speakers; ++*index)
        if (shot->speakers[*index] == speaker)
            return true;
    return false;
}

/* The background stands still: as long as it is asked for, it begins again.  false: the
 * recording has ended. */
static bool begin_again(struct array_wav *a, const struct emission *list, size_t n)
{
    if (!a->loop && a->shot.pass != PASS_BACKGROUND)
        return false;
    a->play.next = 0;
    a->play.passed += list[n - 1].sample - list[0].sample + a->survey.slot_samples;
    a->play.frames += list[n - 1].frame - list[0].frame + 1;
    return true;
}

/* The next emission of one of the shot's speakers, if there is any at all. */
static const struct emission *next_emission(struct array_wav *a, size_t *shot_index)
{
    size_t n;
    const struct emission *list = recording_emissions(recording_of(a), &n);
    for (size_t tries = 0; n && tries <= n; tries++) {
        if (a->play.next == n && !begin_again(a, list, n))
            return NULL;
        if (find_speaker(&a->shot, list[a->play.next].speaker, shot_index))
            return &list[a->play.next];
        a->play.next++;
    }
    return NULL;
}

static int wait_for(const struct array_wav *a, uint64_t sample, int64_t *t0_ns,
                    struct error *why)
{
    double rate_hz = a->survey.sample_rate_hz;
    *t0_ns = a->turn.start_ns + (int64_t)(1e9 * (double)sample / rate_hz);
    int64_t end_ns = *t0_ns + (int64_t)(1e9 * (double)a->n_ping / rate_hz);
    int err = a->clock->sleep_until_ns(a->clock->state, end_ns);
    return err ? error_say(why, err, "the wait for a ping was interrupted") : 0;
}

static int play_next(struct array_wav *a, struct array_ping *out, struct error *why)
{
    const struct recording *r = recording_of(a);
    size_t index, n;
    int64_t t0_ns;
    const struct emission *e = next_emission(a, &index);
    if (!e && !a->play.any)
        return error_say(why, -EINVAL,
                         "none of the speakers asked for (scan.speakers) is "
                         "in the recording");
    if (!e)
        return error_say(why, -ENODATA, "the recording has ended");
    const struct emission *first = recording_emissions(r, &n);
    int err = wait_for(a, a->play.passed + e->sample - first->sample, &t0_ns, why);
    if (!err)
        err = recording_read_emission(r, a->play.next, a->ping, a->clipped, a->not_finite,
                                      why);
    if (err)
        return err;
    fill_ping(a, index, 0, out);
    out->frame = a->play.frames + e->frame - first->frame + 1;
    out->valid = e->valid;
    out->temperature_c = e->temperature_c;
    out->t0_ns = t0_ns;
    a->play.down = e->down;
    a->play.any = true;
    a->play.next++;
    return 0;
}

static int wav_next(void *state, struct array_ping *out, struct error *why)
{
    struct array_wav *a = state;
    return a->shot.endless ? play_next(a, out, why) : next_slot(a, out, why);
}

/* When it was recorded, all speakers took their turns. */
static bool wav_is_down(void *state, size_t k)
{
    const struct array_wav *a = state;
    return a->shot.endless ? a->play.down
                           : survey_is_down(&a->survey, a->shot.speakers[k]);
}

const struct array_ops array_wav_ops = {.scheme = "wav",
                                        .open = wav_open,
                                        .survey = wav_survey,
                                        .fire = wav_fire,
                                        .next = wav_next,
                                        .is_down = wav_is_down,
                                        .close = wav_close};
