/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "dsp/error.h"
#include "hal/recording/recording.h"
#include "hal/survey/file.h"
#include "nodes/anlos/calibrate/calibrate.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"
#include "recon/survey.h"

#define RETRIES 5 /* of a position whose pings come invalid */

struct recorder {
    struct session *s;
    struct carrier *carrier; /* NULL: none was named */
    struct export_stage folder;
    uint32_t *speakers; /* 0..n_speakers-1 */
    float *samples;     /* [n_microphones][n_frames]; made with the first ping */
    size_t n_frames;    /* n_speakers slots, and the tail of the last */
    uint64_t *clipped;  /* [n_microphones] */
    size_t retaken;
    double temperature_c; /* of the air, as far as somebody says */
    double loudest;
};

static int check(struct session *s)
{
    char path[PATH_MAX];
    struct stat st;
    const struct calibrate_options *o = s->options;
    int err = session_check(s);
    if (err)
        return err;
    if (!o->folder || !o->folder[0])
        return error_say(&s->why, -EINVAL,
                         "background: --folder DIR is missing, where the recording goes");
    if (s->survey->continuous)
        return error_say(
            &s->why, -EINVAL,
            "background: the stage does not stop, and here it would; let the "
            "scan record it as it goes, by scan: {background: true}");
    if (s->survey->source == SURVEY_LIVE && s->survey->n_positions > 1 && !o->stage)
        return error_say(
            &s->why, -EINVAL,
            "the array has %zu positions: what carries it there? say --stage",
            s->survey->n_positions);
    if (snprintf(path, sizeof path, "%s/survey.yaml", o->folder) < (int)sizeof path &&
        !lstat(path, &st))
        return error_say(&s->why, -EINVAL,
                         "%s exists already; remove it or name another folder", path);
    return 0;
}

static int create(struct recorder *r)
{
    const struct survey *y = r->s->survey;
    r->speakers = malloc(y->n_speakers * sizeof *r->speakers);
    r->clipped = calloc(y->n_microphones, sizeof *r->clipped);
    if (!r->speakers || !r->clipped)
        return error_say(&r->s->why, -ENOMEM, "out of memory");
    for (size_t j = 0; j < y->n_speakers; j++)
        r->speakers[j] = (uint32_t)j;
    return 0;
}

/* A ping goes on into the next one's slot; of the last one that is kept. */
static int add_ping(struct recorder *r, const struct array_ping *ping)
{
    const struct survey *y = r->s->survey;
    size_t slot = y->slot_samples, start = survey_slot_of(y, ping->shot_index) * slot;
    if (!r->samples) {
        r->n_frames = survey_slot_of(y, y->n_speakers - 1) * slot + ping->n_samples;
        r->samples = malloc(y->n_microphones * r->n_frames * sizeof *r->samples);
        if (!r->samples)
            return error_say(&r->s->why, -ENOMEM, "out of memory");
    }
    for (size_t m = 0; m < y->n_microphones; m++) {
        memcpy(r->samples + m * r->n_frames + start, ping->samples + m * ping->n_samples,
               ping->n_samples * sizeof *r->samples);
        r->clipped[m] += ping->clipped[m];
    }
    if (isnan(r->s->options->temperature_c) && !isnan(ping->temperature_c))
        r->temperature_c = ping->temperature_c;
    return 0;
}

/* All speakers in turn.  0, 1 (some pings came invalid), negative errno. */
static int record_once(struct recorder *r, size_t position)
{
    struct session *s = r->s;
    struct array_ping ping;
    const struct array_shot shot = {.pass = PASS_BACKGROUND,
                                    .position = position,
                                    .stage_m = s->survey->stage_positions_m[position],
                                    .speakers = r->speakers,
                                    .n_speakers = s->survey->n_speakers};
    bool invalid = false;
    int err = array_fire(s->array, &shot);
    if (err)
        return error_say(&s->why, err,
                         "position %zu cannot be recorded: %s; an array that plays a "
                         "recording needs a background of it",
                         position, strerror(-err));
    while (!err) {
        err = interrupt_requested() ? error_say(&s->why, -EINTR, "interrupted")
                                    : array_next(s->array, &ping, &s->why);
        if (err == -EINTR && !interrupt_requested())
            err = 0;
        else if (!err) {
            invalid |= !ping.valid;
            err = add_ping(r, &ping);
        }
    }
    return err != -ENODATA ? err : invalid;
}

static int record_position(struct recorder *r, size_t position)
{
    struct session *s = r->s;
    int err = r->carrier ? carrier_move(r->carrier, position, &s->why) : 0;
    if (err)
        return err;
    for (int tries = 0; (err = record_once(r, position)) == 1; tries++) {
        r->retaken++;
        if (tries == RETRIES)
            return error_say(&s->why, -EIO, "position %zu: pings were lost %d times over",
                             position, RETRIES + 1);
    }
    for (size_t i = 0; !err && i < s->survey->n_microphones * r->n_frames; i++)
        r->loudest = fmax(r->loudest, fabs((double)r->samples[i]));
    if (!err)
        err = recording_write(r->folder.path, position, s->survey->n_microphones,
                              r->n_frames, s->survey->sample_rate_hz, r->samples,
                              &s->why);
    return err;
}

/* Timing, air and places as they have been measured.  The samples stay as they were
 * recorded: a slot has the tail of the speaker before in it, so gains and polarity of
 * speakers can only be undone in pings, which whoever plays the recording does. */
static int write_survey(struct recorder *r)
{
    char path[PATH_MAX + 16];
    struct survey y;
    const struct calibrate_options *o = r->s->options;
    if (survey_copy(&y, r->s->survey) < 0)
        return error_say(&r->s->why, -ENOMEM, "out of memory");
    int err = r->s->existed ? calibration_apply(r->s->calibration, &y, o->out, &r->s->why)
                            : 0;
    y.temperature_c = r->temperature_c;
    if (!isnan(o->temperature_c))
        y.sound_speed_m_s = survey_humid_sound_speed_m_s(
            o->temperature_c,
            isnan(o->humidity_percent) ? 0.5 : o->humidity_percent / 100.0);
    snprintf(path, sizeof path, "%s/survey.yaml", r->folder.path);
    if (!err)
        err = survey_save(&y, path, y.n_responses ? "calibration" : NULL, &r->s->why);
    survey_clear(&y);
    return err;
}

static int record_all(struct recorder *r)
{
    struct session *s = r->s;
    int err = export_stage_begin(&r->folder, s->options->folder, &s->why);
    if (err)
        return err;
    for (size_t k = 0; k < s->survey->n_positions && !err; k++)
        err = record_position(r, k);
    if (!err && r->loudest == 0.0)
        err =
            error_say(&s->why, -ENODATA,
                      "the array records nothing: every sample is 0; look at its input, "
                      "and that it is not muted");
    if (!err)
        err = write_survey(r);
    return export_stage_end(&r->folder, err, &s->why);
}

/* The folder as seen from the calibration file: below it relative, else absolute. */
static int name_folder(struct session *s)
{
    char *folder = realpath(s->options->folder, NULL);
    char *file = realpath(s->options->out, NULL);
    char *slash = file ? strrchr(file, '/') : NULL;
    size_t n = slash ? (size_t)(slash - file) + 1 : 0;
    const char *name = folder;
    if (folder && n && !strncmp(folder, file, n) && folder[n])
        name = folder + n;
    free(s->calibration->background);
    s->calibration->background = name ? strdup(name) : NULL;
    free(file);
    free(folder);
    return s->calibration->background ? 0
                                      : error_say(&s->why, -errno, "%s: %s",
                                                  s->options->folder, strerror(errno));
}

static bool report(const struct recorder *r)
{
    const struct session *s = r->s;
    bool clipped = false;
    printf("background of %s\n", s->options->array);
    printf("  recorded      %zu positions, %zu speakers, %zu microphones\n",
           s->survey->n_positions, s->survey->n_speakers, s->survey->n_microphones);
    if (isnan(r->temperature_c))
        printf("  temperature   not known; say --temperature-c\n");
    else
        printf("  temperature   %.2f C\n", r->temperature_c);
    printf("  loudest       %.1f dB of full scale\n", 20.0 * log10(r->loudest));
    if (r->retaken)
        printf("  retaken       %zu positions, for pings that came invalid\n",
               r->retaken);
    for (size_t m = 0; m < s->survey->n_microphones; m++)
        if (r->clipped[m]) {
            printf("  clipped       microphone %zu, %llu samples\n", m,
                   (unsigned long long)r->clipped[m]);
            clipped = true;
        }
    printf("%s: the recording is in %s, and %s names it\n", clipped ? "bad" : "good",
           s->options->folder, s->options->out);
    return !clipped;
}

int calibrate_background(struct session *s, bool *good)
{
    struct recorder r = {.s = s,
                         .temperature_c = isnan(s->options->temperature_c)
                                              ? s->survey->temperature_c
                                              : s->options->temperature_c};
    int err = check(s);
    if (!err)
        err = create(&r);
    if (!err && s->options->stage)
        err = carrier_open(&r.carrier, s->options->stage, s->survey, &s->why);
    if (!err)
        err = record_all(&r);
    if (!err && !s->existed) /* realpath needs the file */
        err = session_save(s);
    if (!err)
        err = name_folder(s);
    if (!err)
        err = session_save(s);
    if (!err)
        *good = report(&r);
    carrier_close(r.carrier);
    free(r.speakers);
    free(r.clipped);
    free(r.samples);
    return err;
}
