/* SPDX-License-Identifier: MIT */
#include "tests/recon/turntable.h"

#include <math.h>
#include <string.h>

void turntable_default(struct turntable *t)
{
    memset(t, 0, sizeof *t);
    t->band_hz[0] = 10000.0;
    t->band_hz[1] = 30000.0;
    for (int k = 0; k < TURNTABLE_PINGS; k++) {
        double a = 2.0 * M_PI * k / TURNTABLE_PINGS, z = -0.15 + 0.05 * (k % 7);
        const double ping[2][3] = {
            {0.85 * cos(a), 0.85 * sin(a), z},
            {0.85 * cos(a) - 0.07 * sin(a), 0.85 * sin(a) + 0.07 * cos(a), z + 0.01}};
        memcpy(t->pings_m[k], ping, sizeof ping);
    }
    t->geometry = (struct geometry){
        .sound_speed_m_s = 343.0,
        .n_speakers = 1,
        .n_microphones = 1,
        .n_positions = TURNTABLE_PINGS,
        .speakers_m = (const double(*)[3])t->origin_m,
        .microphones_m = (const double(*)[3])t->origin_m,
        .stage_axis = {1.0, 0.0, 0.0},
        .stage_positions_m = t->zeros_m,
        .pings_m = (const double(*)[2][3])t->pings_m,
    };
}

void turntable_traces(const struct turntable *t, const struct trace_format *f,
                      const struct scatterer *points, size_t n_points, float complex *out)
{
    for (size_t k = 0; k < TURNTABLE_PINGS; k++)
        reference_trace(f, t->band_hz, t->geometry.sound_speed_m_s, t->pings_m[k][0],
                        t->pings_m[k][1], points, n_points, out + k * f->n_samples);
}

static double mean_square(const struct turntable *t, const double from[3])
{
    double sum = 0.0;
    for (size_t k = 0; k < TURNTABLE_PINGS; k++)
        for (int a = 0; a < 3; a++)
            sum += pow(0.5 * (t->pings_m[k][0][a] + t->pings_m[k][1][a]) - from[a], 2.0);
    return sum / TURNTABLE_PINGS;
}

double turntable_amplitude(const struct turntable *t, const struct scatterer *points,
                           size_t n_points, const double at_m[3])
{
    double complex sum = 0.0;
    for (size_t k = 0; k < TURNTABLE_PINGS; k++) {
        const double *s = t->pings_m[k][0], *m = t->pings_m[k][1];
        double delay_s = (reference_distance(s, at_m) + reference_distance(m, at_m)) /
                         t->geometry.sound_speed_m_s;
        for (size_t p = 0; p < n_points; p++) {
            double rs = reference_distance(s, points[p].at_m);
            double rm = reference_distance(m, points[p].at_m);
            sum += points[p].gain / (rs * rm) *
                   reference_echo(t->band_hz, 0.0,
                                  (rs + rm) / t->geometry.sound_speed_m_s, delay_s);
        }
    }
    return sqrt(mean_square(t, at_m)) * cabs(sum) / TURNTABLE_PINGS;
}
