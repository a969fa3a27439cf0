/* SPDX-License-Identifier: MIT */
/* recon/walls/wall_crosstalk.h -- up- and down-chirps that sound at the same time, told
 * apart better than the matched filter does.  What that leaves of the other chirp is low,
 * 1 / (duration x bandwidth), but spread over all delays; and the other speaker's direct
 * sound is so much louder than any wall that its remains hide them.
 *
 * Direct sound arrives soon after an emission.  So all that arrives there, of both
 * chirps, is estimated by least squares from what both filters give there (regularised:
 * Tikhonov 1963), which is linear and planned once; and what a filter makes of the other
 * chirp's is taken away at all delays.  The same for the next slot's emissions, whose
 * direct sound the filters meet before that slot begins.
 *
 * A later echo loses of its amplitude about what direct_s is of a chirp's duration: as
 * much of it looks like the other chirp's direct sound.  It stays where it is. */
#ifndef ANLOS_RECON_WALLS_WALL_CROSSTALK_H
#define ANLOS_RECON_WALLS_WALL_CROSSTALK_H

#include <complex.h>
#include <stddef.h>

#include "dsp/pulse_compress.h"

struct wall_crosstalk_config {
    struct pulse_compress *filters[2]; /* of one flat channel, up and down, whose traces
                                          begin at delay 0; used to plan, not kept */
    struct chirp chirps[2];            /* theirs */
    double sample_rate_hz, latency_samples;
    size_t n_samples; /* of a ping */
    double direct_s;  /* of delay; after this no direct sound arrives */
    double slot_s; /* delay at which the next slot begins.  If traces reach as far, they
                      have to reach direct_s beyond */
};

struct wall_crosstalk;

/* 0, -EINVAL (filters of different traces, or of too short ones), -ENOMEM. */
int wall_crosstalk_create(struct wall_crosstalk **out,
                          const struct wall_crosstalk_config *cfg);

/* Takes what the other chirp left off own [n_samples of the traces], the trace of filter
 * k, with the help of the other filter's of the same recording.  Takes some 80 us where
 * direct sound lasts 3 ms.  One instance a thread. */
void wall_crosstalk_remove(struct wall_crosstalk *x, int k, float complex *restrict own,
                           const float complex *restrict other);
void wall_crosstalk_destroy(struct wall_crosstalk *x);

#endif
