/* SPDX-License-Identifier: MIT */
#include "hal/survey/calibration.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The id of a survey that has nothing but the places of its elements. */
static void name_geometry(const struct survey *s, char *out, size_t size)
{
    struct survey bare = {.n_speakers = s->n_speakers,
                          .speakers_m = s->speakers_m,
                          .n_microphones = s->n_microphones,
                          .microphones_m = s->microphones_m};
    snprintf(out, size, "%016" PRIx64, survey_id(&bare));
}

/* As a recording of a calibrated array has it. */
static bool has_its_places(const struct calibration *c, const struct survey *s)
{
    return c->places_m &&
           !memcmp(s->speakers_m, c->places_m, c->n_speakers * sizeof *c->places_m) &&
           !memcmp(s->microphones_m, c->places_m + c->n_speakers,
                   c->n_microphones * sizeof *c->places_m);
}

int calibration_create(struct calibration **out, size_t n_speakers, size_t n_microphones)
{
    struct calibration *c = calloc(1, sizeof *c);
    *out = NULL;
    if (!c)
        return -ENOMEM;
    c->sample_rate_hz = c->latency_samples = c->temperature_c = NAN;
    c->humidity_percent = c->sound_speed_m_s = c->places_sigma_m = NAN;
    c->n_speakers = n_speakers;
    c->n_microphones = n_microphones;
    c->speakers = calloc(n_speakers, sizeof *c->speakers);
    c->microphones = calloc(n_microphones, sizeof *c->microphones);
    if (!c->speakers || !c->microphones) {
        calibration_destroy(c);
        return -ENOMEM;
    }
    *out = c;
    return 0;
}

void calibration_name(struct calibration *c, const struct survey *s, const char *array)
{
    snprintf(c->array, sizeof c->array, "%s", array);
    name_geometry(s, c->geometry, sizeof c->geometry);
    c->sample_rate_hz = s->sample_rate_hz;
}

int calibration_fits(const struct calibration *c, const struct survey *s,
                     const char *path, struct error *why)
{
    char geometry[sizeof c->geometry];
    if (c->n_speakers != s->n_speakers || c->n_microphones != s->n_microphones)
        return error_say(why, -EINVAL,
                         "%s: made for %zu speakers and %zu microphones, and the array "
                         "has %zu and %zu; calibrate anew",
                         path, c->n_speakers, c->n_microphones, s->n_speakers,
                         s->n_microphones);
    if (c->sample_rate_hz != s->sample_rate_hz)
        return error_say(why, -EINVAL,
                         "%s: made at %g Hz, and the array runs at %g Hz; calibrate anew",
                         path, c->sample_rate_hz, s->sample_rate_hz);
    name_geometry(s, geometry, sizeof geometry);
    if (strcmp(geometry, c->geometry) != 0 && !has_its_places(c, s))
        return error_say(why, -EINVAL,
                         "%s: made with speakers and microphones at other places "
                         "(geometry %s) than this array's (%s); calibrate anew",
                         path, c->geometry, geometry);
    return 0;
}

static int check_moves(const struct calibration *c, const struct survey *s,
                       const char *path, struct error *why)
{
    for (size_t e = 0; c->places_m && e < c->n_speakers + c->n_microphones; e++) {
        bool speaker = e < c->n_speakers;
        size_t i = speaker ? e : e - c->n_speakers;
        const double *at = speaker ? s->speakers_m[i] : s->microphones_m[i];
        double moved = hypot(hypot(c->places_m[e][0] - at[0], c->places_m[e][1] - at[1]),
                             c->places_m[e][2] - at[2]);
        if (!(moved <= CALIBRATION_MAX_MOVE_M))
            return error_say(why, -EINVAL,
                             "%s: places: %s %zu is %.3g m from where the survey has it, "
                             "and at most %g is plausible; measure the survey anew",
                             path, speaker ? "speaker" : "microphone", i, moved,
                             CALIBRATION_MAX_MOVE_M);
    }
    return 0;
}

int calibration_apply(const struct calibration *c, struct survey *s, const char *path,
                      struct error *why)
{
    struct error inner = {.text = ""};
    struct survey set = *s;
    int err = calibration_fits(c, s, path, why);
    if (!err)
        err = check_moves(c, s, path, why);
    if (err)
        return err;
    if (c->places_m) {
        set.speakers_m = c->places_m;
        set.microphones_m = c->places_m + c->n_speakers;
    }
    if (!isnan(c->latency_samples))
        set.latency_samples = c->latency_samples;
    if (!isnan(c->temperature_c))
        set.temperature_c = c->temperature_c;
    if (!isnan(c->sound_speed_m_s))
        set.sound_speed_m_s = c->sound_speed_m_s;
    err = survey_check(&set, &inner);
    if (err)
        return error_say(why, err, "%s: with it the survey is wrong: %.700s", path,
                         inner.text);
    if (c->places_m) {
        memcpy(s->speakers_m, set.speakers_m, s->n_speakers * sizeof *s->speakers_m);
        memcpy(s->microphones_m, set.microphones_m,
               s->n_microphones * sizeof *s->microphones_m);
        set.speakers_m = s->speakers_m;
        set.microphones_m = s->microphones_m;
    }
    *s = set;
    return 0;
}

/* What a channel's samples are to be multiplied by: its gain and polarity undone; 0 for a
 * dead or noisy one, which recon/frontend/channel_check then leaves out. */
static float calibration_factor(const struct calibration_channel *channel)
{
    double factor = pow(10.0, -channel->gain_db / 20.0);
    if (channel->faults & (CALIBRATION_DEAD | CALIBRATION_NOISY))
        return 0.0f;
    return (float)(channel->faults & CALIBRATION_INVERTED ? -factor : factor);
}

void calibration_correct(const struct calibration *c, size_t speaker, size_t n_samples,
                         float *samples)
{
    if (!c)
        return;
    float sent = calibration_factor(&c->speakers[speaker]);
    for (size_t m = 0; m < c->n_microphones; m++) {
        float factor = sent * calibration_factor(&c->microphones[m]);
        for (size_t i = 0; factor != 1.0f && i < n_samples; i++)
            samples[m * n_samples + i] *= factor;
    }
}

void calibration_destroy(struct calibration *c)
{
    if (!c)
        return;
    free(c->speakers);
    free(c->microphones);
    free(c->places_m);
    free(c->background);
    free(c);
}
