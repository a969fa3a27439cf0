/* SPDX-License-Identifier: MIT */
/* recon/inverse/admm_subspace.h -- a few directions of earlier steps, kept while a
 * right-hand side moves slowly: 1/2 x' M x - x' r is minimised over all of them at once
 * (Fischer 1998, Projection techniques for iterative solution of Ax = b with successive
 * right-hand sides), so that one product with M a solve does the work of several. */
#ifndef ANLOS_RECON_INVERSE_ADMM_SUBSPACE_H
#define ANLOS_RECON_INVERSE_ADMM_SUBSPACE_H

#include "dsp/pool.h"

#define ADMM_DIRECTIONS 8

struct admm_direction { /* [n] */
    float *p, *mp;      /* mp = M p */
};

struct admm_subspace;

/* 0, -ENOMEM. */
int admm_subspace_create(struct admm_subspace **out, size_t n, struct pool *pool);
void admm_subspace_destroy(struct admm_subspace *s);
void admm_subspace_clear(struct admm_subspace *s);

/* To the minimum over all that is kept: x += d, mx += M d, residual -= M d. */
void admm_subspace_descend(struct admm_subspace *s, float *residual, float *x, float *mx);

/* The room of the next direction, the oldest one's when all is taken; to be filled, and
 * then kept. */
struct admm_direction admm_subspace_next(struct admm_subspace *s);
void admm_subspace_keep(struct admm_subspace *s);

/* When M has changed: all that are kept, for new products, and these taken into account.
 */
size_t admm_subspace_count(const struct admm_subspace *s);
struct admm_direction admm_subspace_at(struct admm_subspace *s, size_t i);
void admm_subspace_renew(struct admm_subspace *s);

#endif
