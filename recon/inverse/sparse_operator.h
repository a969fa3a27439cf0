/* SPDX-License-Identifier: MIT */
/* recon/inverse/sparse_operator.h -- coherent forward and adjoint operator between a list
 * of points and all traces, without a matrix.  A point of amplitude 1 sends
 *
 *   y(t) = g p(t - d) exp(-2 pi i fc d)
 *
 * into the trace of a pair: d the two-way delay, p a compressed chirp with a Hann window
 * over the band, g one over both distances.  All traces are weighted by one over the
 * number that share their midpoint, and points so that each column has length 1. */
#ifndef ANLOS_RECON_INVERSE_SPARSE_OPERATOR_H
#define ANLOS_RECON_INVERSE_SPARSE_OPERATOR_H

#include <stdbool.h>

#include "recon/imaging/imager.h"

struct sparse_operator;

/* For at most max_points at a time.  0, -ENOMEM. */
int sparse_operator_create(struct sparse_operator **out, const struct imager_config *cfg,
                           size_t max_points);

/* As imager_add: keeps a copy of the traces. */
void sparse_operator_add(struct sparse_operator *s, size_t position, size_t speaker,
                         const float complex *traces, const bool *masked);
void sparse_operator_reset(struct sparse_operator *s);

/* The points that x stands for from now on; after all traces have been added. */
void sparse_operator_place(struct sparse_operator *s, size_t n, const double (*at_m)[3]);

/* Keeps only those n of the points that are listed, in rising order. */
void sparse_operator_keep(struct sparse_operator *s, size_t n, const size_t *which);

/* x [n] are re im; traces [position][speaker][microphone][n_samples] as they were added;
 * weights in both, so that the pair is exactly adjoint.  Pairs that were not added are 0
 * in forward and do not count in adjoint. */
void sparse_operator_forward(struct sparse_operator *s, const float *x,
                             float complex *traces);
void sparse_operator_adjoint(struct sparse_operator *s, const float complex *traces,
                             float *x);

/* residual = the traces as they were added, without what x sends into them; those that
 * were not added are 0. */
void sparse_operator_residual(struct sparse_operator *s, const float *x,
                              float complex *residual);

/* out = K' y of the traces that were added, weighted like K. */
void sparse_operator_data(struct sparse_operator *s, float *out);

/* out = K' K x, pair by pair and without storing traces. */
void sparse_operator_normal(struct sparse_operator *s, const float *x, float *out);
/* gram [n][re, im][n] = K' K, row by row, for few points: with the pulse's
 * autocorrelation in closed form, as if no trace ended near a point. */
void sparse_operator_gram(struct sparse_operator *s, float *gram);
void sparse_operator_destroy(struct sparse_operator *s);

#endif
