/* SPDX-License-Identifier: MIT */
/* nodes/rt/export.h -- the files that a person or a program looks at.  Each is written
 * under a temporary name and renamed when whole: nothing is left half-written. */
#ifndef ANLOS_NODES_RT_EXPORT_H
#define ANLOS_NODES_RT_EXPORT_H

#include <jansson.h>
#include <limits.h>
#include <stdint.h>

#include "dsp/error.h"
#include "msgs/detections.pb-c.h"
#include "recon/grid.h"

/* Makes the folder (and its parents) or finds it; checks that it can be written.
 * 0, -ENOTDIR, -EACCES, -EROFS, other negative errno. */
int export_folder(const char *folder, struct error *why);

/* 0 when the folder holds none of names[n], not even as a broken link; else -EEXIST: what
 * is there may have taken a day, or a hand, and a mixture is worse. */
int export_vacant(const char *folder, const char *const *names, size_t n,
                  struct error *why);

/* A set of files that appears together: write them into stage->path, then commit moves
 * each into the folder (replacing files of the same name), or abandon removes them, and
 * the folder too if begin made it.  What a process that was killed has left there, the
 * next begin removes. */
struct export_stage {
    char folder[PATH_MAX - 64];
    char path[PATH_MAX];
    size_t existing; /* length of the part of folder that was there before */
    int lock;        /* on path, for as long as its process lives; -1: no locks here */
};
int export_stage_begin(struct export_stage *stage, const char *folder, struct error *why);
int export_stage_commit(struct export_stage *stage, struct error *why);
void export_stage_abandon(struct export_stage *stage);

/* NRRD 5, float32 little endian raw, x fastest, space directions and origin in m. */
int export_nrrd(const char *folder, const char *name, const struct grid *grid,
                const float *intensity, struct error *why);

/* projection_xy.png, projection_xz.png, projection_yz.png: maxima of the intensity in dB
 * with axes in metres, a colour bar, and a cross at each detection (virtual position).
 * detections may be NULL. */
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

/* null, or how the echo came and which objects made it. */
json_t *export_multipath(const Anlos__Detection *d);

/* detections.json. */
int export_detections(const char *folder, const Anlos__DetectionList *detections,
                      struct error *why);

/* Any JSON object under a name, pretty-printed with keys in the order given. */
int export_json(const char *folder, const char *name, const json_t *value,
                struct error *why);

/* A number, or null for what JSON has no number for (NaN, infinities); v[n] as an array
 * of such.  NULL: no memory. */
json_t *export_real(double value);
json_t *export_reals(const double *v, size_t n);

#endif
