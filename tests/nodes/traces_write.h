/* SPDX-License-Identifier: MIT */
/* tests/nodes/traces_write.h -- a turntable's echoes in closed form as a MATLAB file for
 * `anlos recon --traces`.  Include after cmocka.h. */
#ifndef ANLOS_TESTS_NODES_TRACES_WRITE_H
#define ANLOS_TESTS_NODES_TRACES_WRITE_H

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "tests/nodes/mat_write.h"
#include "tests/recon/turntable.h"

struct traces_write {
    struct trace_format format;
    const double *rate_hz; /* what the file says of it; NULL: the truth */
    const char *leave_out; /* a variable's name */
    bool v73, turned;      /* turned: [sample][ping] and [3][ping] */
    bool real, doubles, conjugate, short_rx;
    bool silent[TURNTABLE_PINGS], nan[TURNTABLE_PINGS];
    const double *gains; /* [TURNTABLE_PINGS] of the echoes; NULL: 1 */
    float (*noise)(double t_s, unsigned ping); /* added; NULL: none */
    const double *band_hz;                     /* [2] what the file says; NULL: nothing */
};

static inline void traces_write_variable(mat_t *mat, const struct traces_write *w,
                                         const char *name, enum matio_classes class,
                                         size_t rows, size_t columns, void *re, void *im)
{
    if (!w->leave_out || strcmp(w->leave_out, name))
        mat_put(mat, name, class, w->turned ? columns : rows, w->turned ? rows : columns,
                re, im);
}

static inline void traces_write_places(mat_t *mat, const struct traces_write *w,
                                       const struct turntable *t, const char *name,
                                       int which)
{
    static double at[3 * TURNTABLE_PINGS];
    size_t n = w->short_rx && which ? TURNTABLE_PINGS - 1 : TURNTABLE_PINGS;
    for (size_t k = 0; k < n; k++)
        for (size_t a = 0; a < 3; a++)
            at[w->turned ? 3 * k + a : a * n + k] = t->pings_m[k][which][a];
    traces_write_variable(mat, w, name, MAT_C_DOUBLE, n, 3, at, NULL);
}

static inline void traces_write_traces(mat_t *mat, const struct traces_write *w,
                                       const float complex *traces)
{
    size_t n = TURNTABLE_PINGS, samples = w->format.n_samples;
    float *re = malloc(2 * n * samples * sizeof *re), *im = re + n * samples;
    double *wide = malloc(n * samples * sizeof *wide);
    for (size_t k = 0; k < n; k++)
        for (size_t i = 0; i < samples; i++) {
            size_t at = w->turned ? k * samples + i : i * n + k;
            float complex x = w->silent[k] ? 0.0f : traces[k * samples + i];
            if (w->gains)
                x *= (float)w->gains[k];
            if (w->noise && !w->silent[k])
                x += w->noise((double)i / w->format.rate_hz, (unsigned)k);
            re[at] = w->nan[k] && i == samples / 2 ? NAN : crealf(x);
            im[at] = w->conjugate ? -cimagf(x) : cimagf(x);
            wide[at] = (double)re[at];
        }
    traces_write_variable(mat, w, "traces", w->doubles ? MAT_C_DOUBLE : MAT_C_SINGLE, n,
                          samples, w->doubles ? (void *)wide : re, w->real ? NULL : im);
    free(re);
    free(wide);
}

static inline void traces_write(const struct traces_write *w, const struct turntable *t,
                                const char *path, const struct scatterer *points,
                                size_t n_points)
{
    double rate_hz = w->rate_hz ? *w->rate_hz : w->format.rate_hz;
    double t0_s = w->format.t0_s, carrier_hz = w->format.carrier_hz, c = 343.0;
    float complex *traces =
        malloc(TURNTABLE_PINGS * w->format.n_samples * sizeof *traces);
    turntable_traces(t, &w->format, points, n_points, traces);
    mat_t *mat = Mat_CreateVer(path, NULL, w->v73 ? MAT_FT_MAT73 : MAT_FT_MAT5);
    traces_write_traces(mat, w, traces);
    traces_write_places(mat, w, t, "tx_m", 0);
    traces_write_places(mat, w, t, "rx_m", 1);
    traces_write_variable(mat, w, "fs_hz", MAT_C_DOUBLE, 1, 1, &rate_hz, NULL);
    traces_write_variable(mat, w, "t0_s", MAT_C_DOUBLE, 1, 1, &t0_s, NULL);
    traces_write_variable(mat, w, "fc_hz", MAT_C_DOUBLE, 1, 1, &carrier_hz, NULL);
    traces_write_variable(mat, w, "c_m_s", MAT_C_DOUBLE, 1, 1, &c, NULL);
    if (w->band_hz)
        traces_write_variable(mat, w, "band_hz", MAT_C_DOUBLE, 1, 2, (void *)w->band_hz,
                              NULL);
    Mat_Close(mat);
    free(traces);
}

#endif
