/* SPDX-License-Identifier: MIT */
/* nodes/rt/export_projection.h -- an image as pictures: its maxima along each axis, in
 * dB, with axes in metres, a colour bar, and a cross at each detection (virtual
 * position). */
#ifndef ANLOS_NODES_RT_EXPORT_PROJECTION_H
#define ANLOS_NODES_RT_EXPORT_PROJECTION_H

#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "msgs/detections.pb-c.h"
#include "recon/grid.h"

/* FOLDER/projection_xy.png, projection_xz.png, projection_yz.png.  detections may be
 * NULL. */
int export_projections(const char *folder, const struct grid *grid,
                       const float *intensity, const Anlos__DetectionList *detections,
                       struct error *why);

/* One of them, 0..EXPORT_PROJECTIONS-1: threads may draw different ones at once. */
#define EXPORT_PROJECTIONS 3
int export_projection(const char *folder, size_t which, const struct grid *grid,
                      const float *intensity, const Anlos__DetectionList *detections,
                      struct error *why);

/* The same, two thirds as large, as a PNG in *png, which free() frees.  0, -ENOMEM. */
int export_projection_png(size_t which, const struct grid *grid, const float *intensity,
                          const Anlos__DetectionList *detections, uint8_t **png,
                          size_t *size);

/* The maximum of a volume along one of its axes. */
struct projection { /* across and up: the picture's axes, 0..2 for x, y, z */
    int axis[2];
    size_t n[2];
    double origin_m[2], step_m[2];
    float *value; /* [n[1]][n[0]], up rising */
};

/* volume [nz][ny][nx], >= 0; across != up.  Clear with projection_clear.  0, -ENOMEM. */
int projection_create(struct projection *out, const struct grid *grid,
                      const float *volume, int across, int up);

/* The picture on w x h pixels, which cover the cells up to their outer edges: out[h][w],
 * row 0 on top.  Catmull-Rom between samples, the border's value outside, never below 0.
 * 0, -ENOMEM. */
int projection_resample(const struct projection *p, size_t w, size_t h, float *out);

void projection_clear(struct projection *p);

/* A perceptual colour map, from black over purple and orange to pale yellow: equal steps
 * look equally large, in grey too.  t and rgb: 0..1; t outside is held inside.  A
 * polynomial fit of "inferno" (S. van der Walt and N. Smith 2015; fit by M. Zucker), both
 * dedicated to the public. */
void colour_at(double t, double rgb[3]);

/* The intensity that is drawn brightest, 0 dB: the image's brightest, but 30 dB above its
 * median at least.  Noise, whose maximum is 10 to 13 dB above the median, so stays dark
 * where nothing else is.  The median is of what is imaged at all (above 0); where that is
 * less than half of intensity [n], there is none, 0.  noise: the median; may be NULL.
 * 0, -ENOMEM. */
int colour_full_scale(double *out, double *noise, const float *intensity, size_t n,
                      double brightest);

#endif
