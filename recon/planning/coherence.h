/* SPDX-License-Identifier: MIT */
/* recon/planning/coherence.h -- how well the elements stand where the survey says, from
 * the traces alone.  After moveout all pairs with one midpoint hold the same echoes
 * (Lindell 2019, Eq. 11); when an element stands beside its place by e, its echoes are
 * early or late by e / c.  For places that are off by sigma (rms, along the sound) the
 * mean product of the spectra of two such pairs, over their power, falls with frequency
 * as
 *
 *     gamma(f) = A exp(-2 (2 pi f sigma / c)^2)
 *
 * (each pair has two elements, a product four), where A is the echoes' share of the
 * traces' power.  What moves a whole stage position does not show: its pairs move
 * together. */
#ifndef ANLOS_RECON_PLANNING_COHERENCE_H
#define ANLOS_RECON_PLANNING_COHERENCE_H

#include "dsp/pool.h"
#include "recon/planning/trace_set.h"

struct coherence {
    double element_m; /* sigma, at most 0.03; NAN: not to be told from these traces */
    double level;     /* A */
    double floor;     /* what gamma would scatter by if all were noise */
};

#define COHERENCE_POSITIONS 4

/* Is this stage position one of those, COHERENCE_POSITIONS at most, that tell? */
bool coherence_samples(const struct geometry *g, size_t position);

/* From their pairs, the more of them the better.  0, -ENOTSUP (midpoints are not a
 * lattice: recon/coherent/midpoint.h), -EINVAL, -ENOMEM. */
int coherence_measure(struct coherence *out, const struct trace_set *set,
                      struct pool *pool);

#endif
