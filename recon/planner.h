/* recon/planner.h -- `--method auto`: from what a scene is like (recon/probe) and what
 * the user can spend, the method, the pairs, the band, the depth and the steps of its
 * image.  Every combination is given a time and an error beforehand; the cheapest that is
 * exact enough is taken, or the best that time allows.
 *
 * Error: standard deviation of a small object's position across the line of sight, the
 * worst of the strong ones; the root of the sum of squares of
 *   noise     width / sqrt(8 ln 4 SNR)            (Cramer-Rao, the image's own SNR)
 *   elements  sigma R sqrt(12 / N) / D            (N elements over an aperture D)
 *   moveout   `fast` without dip moveout: recon/moveout_error.h; an image that falls
 *             apart: width / 4
 *   steps     0.6 step^3 / width^2                (peak between voxels; measured)
 *   power     `incoherent`: 0.03 of its width     (measured)
 * Time: recon/planner_time.h, times how much slower this machine was at compressing. */
#ifndef ANLOS_RECON_PLANNER_H
#define ANLOS_RECON_PLANNER_H

#include "recon/imager.h"
#include "recon/planner_time.h"
#include "recon/probe.h"

struct planner_config {
    const struct trace_set *set;
    const struct probe *probe;
    const struct grid *grid; /* the whole image, with the steps of resolution */
    size_t n_threads;
    double slowness; /* of this machine: compression's time over
                      * planner_compress_s */
    double budget_s; /* for stacking and imaging; INFINITY: none */
    double error_m;  /* 0: none, as good as can be had for the time */
    bool keep_grid;  /* the volume was asked for: neither depth nor steps change */
};

enum { PLANNER_CANDIDATES = 64, PLANNER_WORDS = 160 };

struct planner_candidate {
    const char *method;
    bool dip;       /* fast: with dip moveout */
    double coarser; /* steps, times those of the whole image */
    size_t stride;  /* every so manieth speaker */
    double time_s, error_m;
    char why_not[PLANNER_WORDS]; /* empty: this one is taken */
};

struct plan {
    const char *method;
    bool dip; /* fast: with dip moveout */
    size_t stride;
    double band_hz[2];
    struct grid grid;
    double time_s, error_m;
    char because[PLANNER_WORDS];
    struct planner_candidate candidates[PLANNER_CANDIDATES];
    size_t n_candidates;
};

void planner_decide(struct plan *out, const struct planner_config *cfg);

#endif
