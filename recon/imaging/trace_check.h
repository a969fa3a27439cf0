/* SPDX-License-Identifier: MIT */
/* recon/imaging/trace_check.h -- whether a trace can be summed with others: one sample
 * that is no number would spoil every voxel that it reaches, and in a Fourier transform
 * all. */
#ifndef ANLOS_RECON_IMAGING_TRACE_CHECK_H
#define ANLOS_RECON_IMAGING_TRACE_CHECK_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#define TRACE_LOUDEST 1e13f

/* Both parts of all samples are numbers and below TRACE_LOUDEST: louder is no echo, and
 * sums of its square would overflow.  Cost: one pass. */
bool trace_check(const float complex *trace, size_t n);

#endif
