/* SPDX-License-Identifier: MIT */
#include "hal/room/microphones.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "hal/random.h"
#include "hal/survey/response_file.h"

enum { N_POINTS = 200, N_WAVES = 4, STREAM_CURVE = 3, STREAM_GAIN = 4 };
#define LOWEST_HZ 20.0

/* Some waves over the octaves, as housings and membranes make them. */
static void invent(struct survey_response *r, double ripple_db, double highest_hz,
                   struct random *random)
{
    double phase[N_WAVES], cycles[N_WAVES];
    for (int w = 0; w < N_WAVES; w++) {
        phase[w] = 2 * M_PI * random_even(random);
        cycles[w] = 0.5 + 3.5 * random_even(random);
    }
    for (int i = 0; i < N_POINTS; i++) {
        double x = (double)i / (N_POINTS - 1), sum = 0;
        for (int w = 0; w < N_WAVES; w++)
            sum += cos(2 * M_PI * cycles[w] * x + phase[w]);
        r->frequency_hz[i] = LOWEST_HZ * pow(highest_hz / LOWEST_HZ, x);
        r->gain_db[i] = ripple_db * sqrt(2.0 / N_WAVES) * sum;
    }
    r->n_points = N_POINTS;
}

int microphones_invent(struct survey *s, double ripple_db, uint32_t seed)
{
    s->responses = calloc(s->n_microphones, sizeof *s->responses);
    if (!s->responses)
        return -ENOMEM;
    for (size_t m = 0; m < s->n_microphones; m++) {
        struct survey_response *r = &s->responses[m];
        struct random random;
        s->n_responses = m + 1;
        random_seed(&random, (uint64_t[]){seed, STREAM_CURVE, m}, 3);
        snprintf(r->serial, sizeof r->serial, "sim%02zu", m);
        r->frequency_hz = malloc(N_POINTS * sizeof *r->frequency_hz);
        r->gain_db = malloc(N_POINTS * sizeof *r->gain_db);
        if (!r->frequency_hz || !r->gain_db)
            return -ENOMEM;
        invent(r, ripple_db, s->sample_rate_hz / 2, &random);
    }
    return 0;
}

void microphones_respond(const struct survey *s, double level, double gain_db,
                         uint32_t seed, size_t n_bins, double bin_hz, float *out)
{
    struct random random;
    random_seed(&random, (uint64_t[]){seed, STREAM_GAIN}, 2);
    for (size_t m = 0; m < s->n_microphones; m++) {
        double gain = level * pow(10, gain_db * random_normal(&random) / 20);
        for (size_t k = 0; k < n_bins; k++) {
            double curve =
                s->n_responses ? response_gain(&s->responses[m], (double)k * bin_hz) : 1;
            out[m * n_bins + k] = (float)(gain * curve);
        }
    }
}
