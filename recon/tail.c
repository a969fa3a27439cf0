/* SPDX-License-Identifier: MIT */
#include "recon/tail.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>

#define MARGIN_SAMPLES 64.0
#define MARGIN_M       0.5

struct box {
    double min[3], max[3];
};

static struct box box_of(const double (*p)[3], size_t n)
{
    struct box b = {{DBL_MAX, DBL_MAX, DBL_MAX}, {-DBL_MAX, -DBL_MAX, -DBL_MAX}};
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 3; a++) {
            b.min[a] = fmin(b.min[a], p[i][a]);
            b.max[a] = fmax(b.max[a], p[i][a]);
        }
    return b;
}

/* Where the elements get to while the stage moves, or ping by ping. */
static struct box swept(const struct survey *s, bool microphones)
{
    const double(*p)[3] =
        (const double(*)[3])(microphones ? s->microphones_m : s->speakers_m);
    size_t n = microphones ? s->n_microphones : s->n_speakers;
    struct box rest = box_of(p, n), b = rest;
    if (s->pings_m) {
        b = box_of((const double(*)[3]) & s->pings_m[0][microphones], 1);
        for (size_t k = 0; k < s->n_positions; k++)
            for (int a = 0; a < 3; a++) {
                b.min[a] = fmin(b.min[a], s->pings_m[k][microphones][a]);
                b.max[a] = fmax(b.max[a], s->pings_m[k][microphones][a]);
            }
        return b;
    }
    size_t ends = s->n_positions + s->continuous; /* it goes on for one more round */
    double on_m = s->n_positions > 1 && s->continuous
                      ? s->stage_positions_m[1] - s->stage_positions_m[0]
                      : 0.0;
    for (size_t k = 0; k < ends; k++)
        for (int a = 0; a < 3; a++) {
            double d = s->stage_positions_m[k < s->n_positions ? k : k - 1];
            d = (d + (k < s->n_positions ? 0.0 : on_m)) * s->stage_axis[a];
            b.min[a] = fmin(b.min[a], rest.min[a] + d);
            b.max[a] = fmax(b.max[a], rest.max[a] + d);
        }
    return b;
}

static struct box imaged(const struct survey *s, const struct box *array)
{
    struct box b;
    for (int a = 0; a < 3; a++) {
        b.min[a] = s->has_volume ? s->volume_m[a][0] : array->min[a] - MARGIN_M;
        b.max[a] = s->has_volume ? s->volume_m[a][1] : array->max[a] + MARGIN_M;
    }
    if (!s->has_volume) {
        double far = s->has_gate ? s->gate_m[1] : TAIL_DEFAULT_FAR_M;
        b.max[2] = array->max[2] + far;
    }
    return b;
}

static double longest_m(const struct box *a, const struct box *b)
{
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        double d = fmax(fabs(b->max[i] - a->min[i]), fabs(a->max[i] - b->min[i]));
        sum += d * d;
    }
    return sqrt(sum);
}

size_t tail_echo_samples(const struct survey *s)
{
    if (!s->n_speakers || !s->n_microphones)
        return 0;
    struct box speakers = swept(s, false), microphones = swept(s, true);
    struct box target = imaged(s, &microphones);
    double path_m = longest_m(&speakers, &target) + longest_m(&microphones, &target);
    if (s->has_gate)
        path_m = fmax(path_m, 2 * s->gate_m[1]);
    if (survey_overlaps(s)) /* what comes later belongs to the next emission */
        path_m = fmin(path_m,
                      (double)s->slot_samples / s->sample_rate_hz * s->sound_speed_m_s);
    double needed = s->latency_samples + MARGIN_SAMPLES +
                    (path_m / s->sound_speed_m_s + s->chirp_duration_s) *
                        s->sample_rate_hz -
                    (double)s->slot_samples;
    if (!(needed > 0))
        return 0;
    if (survey_overlaps(s))
        return (size_t)ceil(needed);
    return needed < (double)s->slot_samples ? (size_t)ceil(needed) : s->slot_samples;
}

/* When the next emission has been heard directly.  It begins with a click, and the
 * whitening matched filter (dsp/pulse_compress.h) takes that for echoes unless it hears
 * the rest. */
static double next_emission_samples(const struct survey *s)
{
    struct box speakers = swept(s, false), microphones = swept(s, true);
    double direct_m = longest_m(&speakers, &microphones);
    return s->latency_samples + MARGIN_SAMPLES +
           (direct_m / s->sound_speed_m_s + s->chirp_duration_s) * s->sample_rate_hz;
}

size_t tail_samples(const struct survey *s)
{
    size_t echo = tail_echo_samples(s);
    if (survey_overlaps(s))
        return echo;
    double needed = next_emission_samples(s);
    if (echo == 0 || needed < (double)echo)
        return echo;
    return needed < (double)s->slot_samples ? (size_t)ceil(needed) : s->slot_samples;
}
