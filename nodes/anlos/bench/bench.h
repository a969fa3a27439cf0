/* nodes/anlos/bench/bench.h -- what the benchmarks of `anlos bench` are told, and the
 * benchmarks.  They print as they go. */
#ifndef ANLOS_NODES_ANLOS_BENCH_BENCH_H
#define ANLOS_NODES_ANLOS_BENCH_BENCH_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"

#define BENCH_USUAL_SEEDS ((size_t)-1)

struct bench_options {   /* borrow from argv */
    const char *scenes;  /* names or scene files with commas; NULL: the usual ones */
    const char *methods; /* names with commas; NULL: all */
    const char *recordings, *calibration; /* folders, or NULL */
    const char *launch, *bags, *truth;    /* files of drive, or NULL */
    const char *out;
    double limit_s;
    size_t threads;
    size_t seeds;  /* of noise, 0: none; of drive: drives; BENCH_USUAL_SEEDS */
    double hours;  /* of drive: as many as take so long; 0: seeds says it */
    size_t rounds; /* of drive: of the scene in each */
    size_t jobs;   /* of drive: side by side */
    bool quick;
};

/* 0, -EINTR (what is done is kept), -ENOENT and -EINVAL (scenes, methods, recordings),
 * other negative errno. */
int bench_speed(const struct bench_options *o, struct error *why);
int bench_detection(const struct bench_options *o, struct error *why);
int bench_drive(const struct bench_options *o, struct error *why);

#endif
