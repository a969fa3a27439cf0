/* nodes/anlos/bench/automatic.h -- a run of `auto`: what `anlos recon --method auto` does
 * between reading and detection, on pings in memory. */
#ifndef ANLOS_NODES_ANLOS_BENCH_AUTOMATIC_H
#define ANLOS_NODES_ANLOS_BENCH_AUTOMATIC_H

#include "nodes/anlos/bench/case.h"
#include "nodes/anlos/bench/pings.h"

struct bench_image {
    struct grid grid;
    float *intensity; /* [nz][ny][nx]; free() it */
    char chosen[BENCH_NOTE_SIZE];
};

/* From recordings to volume once.  pings: its grid is the whole image, from which the
 * planner may depart.  Time: all that a method which is told what to do need not do
 * counts, also the planning of a second compression; only what is planned once for every
 * method (compression, the method's own tables) does not.  0, -ENOTSUP, -EINVAL, -EINTR,
 * -ENOMEM. */
int bench_automatic(struct bench_image *out, struct bench_cost *cost,
                    const struct bench_pings_config *pings, const struct bench_case *c,
                    struct complaint *why);

#endif
