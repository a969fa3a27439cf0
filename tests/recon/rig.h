/* SPDX-License-Identifier: MIT */
/* tests/recon/rig.h -- a small array on a stage, its echoes, and their image. */
#ifndef ANLOS_TESTS_RECON_RIG_H
#define ANLOS_TESTS_RECON_RIG_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "recon/detection/peak.h"
#include "recon/imaging/imager.h"
#include "recon/planning/trace_set.h"
#include "tests/recon/reference.h"

#define RIG_MAX 64

struct rig { /* do not copy: geometry points into it */
    struct geometry geometry;
    double speakers_m[RIG_MAX][3], microphones_m[RIG_MAX][3], positions_m[RIG_MAX];
    struct trace_format format;
    double band_hz[2], gate_m[2];
    struct grid grid;
};

/* 4 speakers, 4 microphones on y, 8 positions on x: midpoints on 8 x 10 lines, 0.28 x
 * 0.27 m; traces from 0.7 to 1.75 m; a grid of 21 x 21 x 25 voxels around (0, 0, 1.1). */
void rig_default(struct rig *r);

/* The same with a microphone 3 cm beside each of 8 speakers: 8 x 8 places, 4 x 5 cm
 * apart.
 */
void rig_pairs(struct rig *r);

/* n voxels an axis around a point. */
void rig_look_at(struct rig *r, double x_m, double y_m, double z_m, size_t n,
                 double step_m);

/* Traces over these ranges (half paths). */
void rig_listen(struct rig *r, double near_m, double far_m);

/* Array, grid and gate moved as one. */
void rig_move(struct rig *r, const double by_m[3]);

/* traces [n_microphones][format.n_samples] of one ping. */
void rig_ping(const struct rig *r, size_t position, size_t speaker,
              const struct scatterer *points, size_t n_points, float complex *traces);

/* Of all pings, each microphone heard, on the heap: rig_free_traces it.  It points to the
 * rig's geometry. */
struct trace_set rig_traces(const struct rig *r, const struct scatterer *points,
                            size_t n_points);
void rig_free_traces(struct trace_set *set);

/* An imager of the rig.  The pool is the test's. */
struct imager_config rig_config(const struct rig *r, const char *method,
                                struct pool *pool);
struct imager *rig_imager(const struct rig *r, const char *method, struct pool *pool);
int rig_try(const struct rig *r, const char *method, struct pool *pool,
            struct imager **out, const char **why);

/* Adds all pings, or those from `first` to before `end`. */
void rig_add(const struct rig *r, struct imager *im, const struct scatterer *points,
             size_t n_points);
void rig_add_some(const struct rig *r, struct imager *im, const struct scatterer *points,
                  size_t n_points, size_t first, size_t end);

/* All of it: *image is [grid] on the heap. */
float *rig_image(const struct rig *r, const char *method, const struct scatterer *points,
                 size_t n_points, size_t n_threads);

/* The strongest voxel, fitted; its intensity. */
float rig_peak(const struct rig *r, const float *image, struct peak_fit *out);

/* Largest difference over the larger maximum of two images; NaN when both are dark or
 * anything is not finite. */
double rig_difference(const struct rig *r, const float *a, const float *b);

/* The image of a lone point is where it is: within lateral_m and depth_m. */
void rig_expect_point(const struct rig *r, const char *method, const double at_m[3],
                      double lateral_m, double depth_m);

#endif
