/* SPDX-License-Identifier: MIT */
/* tests/recon/turntable.h -- a speaker and a microphone that go around points on a
 * circle, as on a turntable, and their echoes in closed form. */
#ifndef ANLOS_TESTS_RECON_TURNTABLE_H
#define ANLOS_TESTS_RECON_TURNTABLE_H

#include "recon/geometry.h"
#include "tests/recon/reference.h"

#define TURNTABLE_PINGS 180

struct turntable { /* do not copy: geometry points into it */
    struct geometry geometry;
    double pings_m[TURNTABLE_PINGS][2][3];
    double origin_m[1][3], zeros_m[TURNTABLE_PINGS];
    double band_hz[2];
};

/* Radius 0.85 m, height -0.15 to 0.15 m, microphone 7 cm beside the speaker; 10 to 30
 * kHz. */
void turntable_default(struct turntable *t);

/* Traces [TURNTABLE_PINGS][f->n_samples]. */
void turntable_traces(const struct turntable *t, const struct trace_format *f,
                      const struct scatterer *points, size_t n_points,
                      float complex *out);

/* What coherent back-projection shows at a voxel when every ping counts the same: rms
 * distance times the mean of the traces at their delays. */
double turntable_amplitude(const struct turntable *t, const struct scatterer *points,
                           size_t n_points, const double at_m[3]);

#endif
