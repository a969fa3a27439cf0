/* SPDX-License-Identifier: MIT */
/* nodes/anlos/speed_error/case.h -- one way to image a scene, and what it costs and errs:
 * from both recordings in memory to the volume, as `anlos recon` does between reading and
 * detection. */
#ifndef ANLOS_NODES_ANLOS_SPEED_ERROR_CASE_H
#define ANLOS_NODES_ANLOS_SPEED_ERROR_CASE_H

#include "nodes/anlos/speed_error/scene.h"
#include "nodes/anlos/speed_error/score.h"

#define BENCH_NOTE_SIZE 192

struct bench_case {
    const char *method;
    const char *varied;     /* the parameter that differs from the base point */
    size_t speaker_stride;  /* every how many speakers; microphones are all used */
    size_t position_stride; /* and stage positions */
    double step;            /* of the grid, in -6 dB widths of a point */
    double band_hz[2];      /* 0, 0: the chirp's */
    size_t iterations;      /* at most; 0: the method's own number */
    double budget_s;        /* of auto, which also chooses its step; 0: none */
    double error_m;         /* the same */
    bool in_time_of_fast;   /* of auto: its budget is what `fast` takes, plan and image */
    size_t threads;
};

struct bench_cost { /* wall seconds, of the fastest of some runs */
    double plan_s;  /* once: transforms, tables, memory */
    double compress_s;
    double look_s; /* of auto, at the scene */
    double stack_s, image_s;
    double total_s;      /* of these four */
    double cpu_s;        /* of the same on all threads */
    double memory_bytes; /* at most, beyond the recordings; NaN: not known here */
};

struct bench_result {
    char scene[64];
    struct bench_case c;
    enum bench_state { BENCH_DONE, BENCH_SKIPPED, BENCH_IMPOSSIBLE } state;
    char note[BENCH_NOTE_SIZE]; /* why it is not done, or what auto chose */
    size_t voxels, pairs;
    struct bench_cost cost;
    struct bench_score score;
};

/* The grid of a step: the midpoints' aperture and 5 cm around, 25 cm of depth around what
 * is there.  A step in x that divides the stage's, where it is near one that does.
 * 0, -EINVAL, -EFBIG. */
int bench_case_grid(struct grid *out, const struct bench_scene *s, double step);

/* What a run of `c` takes after one that took `known`: work that grows with pings and
 * with voxels, or for methods that go over all pairs of both, with their product.
 * Both times are totals; threads share all. */
double bench_case_predict(const struct bench_case *c, size_t voxels, size_t pairs,
                          const struct bench_result *known);

/* Runs it and scores its image; again while less than patience_s has passed, for the
 * fastest.  A method that cannot image this is no failure, but result BENCH_IMPOSSIBLE.
 * 0, -EINTR, -ENOMEM, other negative errno. */
int bench_case_run(struct bench_result *out, const struct bench_scene *s,
                   const struct bench_case *c, double patience_s, struct error *why);

#endif
