/* SPDX-License-Identifier: MIT */
#include "tests/recon/array_traces.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define POSITIONS 8

void array_traces_create(struct array_traces *a, size_t n)
{
    struct rig *r = &a->rig;
    memset(a, 0, sizeof *a);
    rig_default(r);
    memset(r->speakers_m, 0, sizeof r->speakers_m);
    memset(r->microphones_m, 0, sizeof r->microphones_m);
    for (size_t i = 0; i < n; i++) {
        double y = n > 1 ? (double)i / (double)(n - 1) : 0.5;
        r->speakers_m[i][1] = r->microphones_m[i][1] = y;
    }
    for (size_t k = 0; k < POSITIONS; k++)
        r->positions_m[k] = (double)k / (POSITIONS - 1);
    r->geometry.n_speakers = r->geometry.n_microphones = n;
    r->geometry.n_positions = POSITIONS;
    rig_listen(r, 1.0, 3.0);
    size_t traces = POSITIONS * n * n;
    a->traces = calloc(traces * r->format.n_samples, sizeof *a->traces);
    a->heard = malloc(traces * sizeof *a->heard);
    for (size_t q = 0; q < traces; q++)
        a->heard[q] = true;
    a->set = (struct trace_set){.geometry = &r->geometry,
                                .format = r->format,
                                .band_hz = {r->band_hz[0], r->band_hz[1]},
                                .gate_m = {r->gate_m[0], r->gate_m[1]},
                                .traces = a->traces,
                                .heard = a->heard};
}

static double normal(unsigned long long *seed)
{
    double u = reference_random(seed), v = reference_random(seed);
    return sqrt(-2.0 * log(u)) * cos(2.0 * M_PI * v);
}

static void draw(double *x, size_t n, double rms, unsigned long long seed)
{
    double sum = 0.0, square = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += x[i] = normal(&seed);
    for (size_t i = 0; i < n; i++) {
        x[i] -= sum / (double)n;
        square += x[i] * x[i];
    }
    for (size_t i = 0; i < n; i++)
        x[i] *= rms / sqrt(square / (double)n);
}

void array_traces_displace(struct array_traces *a, double rms_m)
{
    draw(a->speaker_off_m, a->rig.geometry.n_speakers, rms_m, 3);
    draw(a->microphone_off_m, a->rig.geometry.n_microphones, rms_m, 8);
}

void array_traces_fill(struct array_traces *a, const struct scatterer *points,
                       size_t n_points, double noise)
{
    const struct geometry *g = &a->rig.geometry;
    size_t n = a->rig.format.n_samples, pairs = g->n_speakers * g->n_microphones;
    unsigned long long seed = 21;
    for (size_t q = 0; q < g->n_positions * pairs; q++) {
        double speaker[3], microphone[3];
        size_t j = q % pairs / g->n_microphones, i = q % g->n_microphones;
        geometry_speaker(g, q / pairs, j, speaker);
        geometry_microphone(g, q / pairs, j, i, microphone);
        speaker[2] += a->speaker_off_m[j];
        microphone[2] += a->microphone_off_m[i];
        float complex *trace = a->traces + q * n;
        reference_trace(&a->rig.format, a->rig.band_hz, g->sound_speed_m_s, speaker,
                        microphone, points, n_points, trace);
        for (size_t s = 0; noise > 0.0 && s < n; s++)
            trace[s] +=
                (float complex)(noise * M_SQRT1_2 * (normal(&seed) + I * normal(&seed)));
    }
}

void array_traces_clear(struct array_traces *a)
{
    free(a->traces);
    free(a->heard);
}
