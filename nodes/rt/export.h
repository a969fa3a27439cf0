/* SPDX-License-Identifier: MIT */
/* nodes/rt/export.h -- the files that a person or a program looks at: a file, or a set of
 * them, appears whole or not at all; images as NRRD, lists and figures as JSON.  Pictures
 * are in export_projection.h, export_plan.h and export_chart.h. */
#ifndef ANLOS_NODES_RT_EXPORT_H
#define ANLOS_NODES_RT_EXPORT_H

#include <jansson.h>
#include <limits.h>
#include <stdio.h>

#include "dsp/error.h"
#include "msgs/detections.pb-c.h"
#include "recon/grid.h"

/* A file that is written under a temporary name beside its own. */
struct export_file {
    FILE *f;
    char path[PATH_MAX];
    char temporary[PATH_MAX];
};

/* After success, commit or abandon.  0, or a negative errno and an error. */
int export_file_open(struct export_file *e, const char *folder, const char *name,
                     struct error *why);

/* Flushes and renames; on failure (full disk) the temporary file is removed. */
int export_file_commit(struct export_file *e, struct error *why);

/* Removes the temporary file; err is returned, with an error that names the file. */
int export_file_abandon(struct export_file *e, int err, struct error *why);

/* Makes the folder (and its parents) or finds it; checks that it can be written.
 * 0, -ENOTDIR, -EACCES, -EROFS, other negative errno. */
int export_folder(const char *folder, struct error *why);

/* 0 when the folder holds none of names[n], not even as a broken link; else -EEXIST: what
 * is there may have taken a day, or a hand, and a mixture is worse. */
int export_vacant(const char *folder, const char *const *names, size_t n,
                  struct error *why);

/* A set of files that appears together: write them into stage->path, then end moves each
 * into the folder (replacing files of the same name).  After an error, and when that
 * fails, it removes them, and the folder too if begin made it; why, which may be NULL or
 * empty, is what went wrong, and names the folder then where it named path.  It returns
 * the error.  What a process that was killed has left there, the next begin removes. */
struct export_stage {
    char folder[PATH_MAX - 64];
    char path[PATH_MAX];
    size_t existing; /* length of the part of folder that was there before */
    int lock;        /* on path, for as long as its process lives; -1: no locks here */
};
int export_stage_begin(struct export_stage *stage, const char *folder, struct error *why);
int export_stage_end(struct export_stage *stage, int err, struct error *why);

/* NRRD 5, float32 little endian raw, x fastest, space directions and origin in m. */
int export_nrrd(const char *folder, const char *name, const struct grid *grid,
                const float *intensity, struct error *why);

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
