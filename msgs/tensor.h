/* SPDX-License-Identifier: MIT */
/* msgs/tensor.h -- float32 and complex64 arrays inside messages. */
#ifndef ANLOS_MSGS_TENSOR_H
#define ANLOS_MSGS_TENSOR_H

#include <complex.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/tensor.pb-c.h"

#define TENSOR_MAX_DIMS 3

/* Storage for a Tensor that borrows its data: nothing is copied until it is packed.
 * Use: struct tensor_view v; msg.samples = tensor_borrow_f32(&v, x, 2, n_mics, n). */
struct tensor_view {
    Anlos__Tensor message;
    uint32_t shape[TENSOR_MAX_DIMS];
};

/* x must outlive the packing.  n_dims (1..TENSOR_MAX_DIMS) extents of type size_t follow;
 * what does not fit a Tensor becomes an empty one of type NONE. */
Anlos__Tensor *tensor_borrow_f32(struct tensor_view *v, const float *x, int n_dims, ...);
Anlos__Tensor *tensor_borrow_c64(struct tensor_view *v, const float complex *x,
                                 int n_dims, ...);

/* The data of a received tensor, checked: type, n_dims, no extent 0, and data of exactly
 * that size.  extents[n_dims] are written.  The pointer is into the message and aligned
 * for float (protobuf-c allocates bytes of their own).  NULL: it does not hold. */
const float *tensor_f32(const Anlos__Tensor *t, int n_dims, size_t *extents);
const float complex *tensor_c64(const Anlos__Tensor *t, int n_dims, size_t *extents);

#endif
