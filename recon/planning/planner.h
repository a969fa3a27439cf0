/* SPDX-License-Identifier: MIT */
/* recon/planning/planner.h -- `--method auto`: from what a scene is like
 * (recon/planning/probe) and what the user can spend, the method, the pairs, the band,
 * the depth, the steps and the iterations of its image.  Every combination is given a
 * time and an error beforehand; the cheapest that is exact enough is taken, or the best
 * that time allows. */
#ifndef ANLOS_RECON_PLANNING_PLANNER_H
#define ANLOS_RECON_PLANNING_PLANNER_H

#include "recon/imaging/imager.h"
#include "recon/planning/probe.h"

struct planner_config {
    const struct trace_set *set;
    const struct probe *probe;
    const struct grid *grid; /* the whole image, with the steps of resolution */
    size_t n_threads;
    double slowness;     /* of this machine; times what planner_*_s say */
    double compress_s;   /* that it still takes to compress all pings; 0: it is done */
    size_t least_stride; /* not more pairs than these: the others were not compressed */
    double budget_s;     /* for what is still to be done; INFINITY: none */
    double error_m;      /* 0: none, as good as can be had for the time */
    bool keep_grid;      /* the volume was asked for: neither depth nor steps change */
};

#define PLANNER_INCOHERENT_M 0.0065 /* positions less certain than this: power alone */

enum { PLANNER_CANDIDATES = 640, PLANNER_WORDS = 160 };

struct planner_candidate {
    const char *method;
    bool dip;          /* fast: with dip moveout */
    double sharpen;    /* fast: recon/coherent/fk.h */
    double coarser;    /* steps, times those of the whole image; below 1 only lateral */
    double deeper;     /* and in depth times this as well, 1 at most */
    double top_hz;     /* fast: of the traces' band, up to here */
    size_t stride;     /* every n-th speaker */
    size_t iterations; /* iterative: at most */
    double time_s, error_m;
    double own_m; /* error but for places of elements, which no way can change */
    char why_not[PLANNER_WORDS]; /* empty: this one is taken */
};

struct plan {
    const char *method;
    bool dip;       /* fast: with dip moveout */
    double sharpen; /* fast: recon/coherent/fk.h */
    size_t stride;
    size_t iterations;  /* iterative: at most */
    double band_hz[2];  /* that is imaged */
    double reliable_hz; /* waves of sounds above this are shorter than places of elements
                         * allow: traces are better without; else the band's top */
    struct grid grid;
    double time_s, error_m;
    char because[PLANNER_WORDS];
    struct planner_candidate candidates[PLANNER_CANDIDATES];
    size_t n_candidates;
};

void planner_decide(struct plan *out, const struct planner_config *cfg);

/* What its steps take, in s: their operations, by rates that were measured once, on one
 * machine. */

/* Compression of so many pings. */
double planner_compress_s(size_t n_pings, size_t n_microphones, size_t n_threads);

/* A look at the scene (recon/planning/probe) that is to be imaged on this grid, by every
 * n-th speaker. */
double planner_probe_s(const struct trace_set *set, const struct grid *grid,
                       size_t stride, size_t n_threads);

/* How the elements stand (recon/planning/coherence), from every n-th speaker's traces. */
double planner_coherence_s(const struct trace_set *set, size_t stride, size_t n_threads);

/* Stack and image by a method (dip: `fast` with dip moveout) of every n-th speaker's
 * traces; `incoherent`: of what scatters; `iterative`: before the first iteration. */
double planner_image_s(const struct trace_set *set, const struct grid *grid,
                       const char *method, bool dip, size_t stride, size_t n_threads);

/* An iteration of `iterative`. */
double planner_iteration_s(const struct grid *grid, size_t n_threads);

/* The same by `incoherent`, of mirrors. */
double planner_mirror_s(const struct trace_set *set, size_t n_threads);

#endif
