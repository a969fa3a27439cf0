/* SPDX-License-Identifier: MIT */
/* recon/planning/planner_time.h -- what a step of `--method auto` takes: its operations,
 * by rates that were measured once, on one machine. */
#ifndef ANLOS_RECON_PLANNING_PLANNER_TIME_H
#define ANLOS_RECON_PLANNING_PLANNER_TIME_H

#include <stdbool.h>

#include "recon/grid.h"
#include "recon/planning/trace_set.h"

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
