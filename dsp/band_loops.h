/* dsp/band_loops.h -- the loops that band_transform spends its time in, as vector code.
 * Complex values are interleaved as re, im in spectra and planar (all real parts, then
 * all imaginary ones) in tables, so that they load as they lie. */
#ifndef ANLOS_DSP_BAND_LOOPS_H
#define ANLOS_DSP_BAND_LOOPS_H

#include <stddef.h>

#include "dsp/vector.h"

#define BAND_BLOCK (2 * VECTOR_LANES) /* samples that the loops take at once */

/* signal [n_rows][m], n_rows even: rows j and n_rows - j become their difference and
 * their sum, for all streams at once: a row's cosine is the other's turned over, its sine
 * the same. */
void band_rows_fold(float *signal, size_t n_rows, size_t m);

/* One stream before its transform: the cosines' sum over the first half of the folded
 * rows, the sines' over the second, turned by the twiddle.  out [m][2], signal
 * [2 half][m], root [2 half], twiddle [2][m]; m a multiple of BAND_BLOCK. */
void band_rows_mix(float *restrict out, const float *restrict signal, size_t half,
                   const float *restrict root, const float *restrict twiddle, size_t m);

/* y = x h, all [n][2]. */
void band_bins_multiply(float *restrict y, const float *restrict x,
                        const float *restrict h, size_t n);

/* The same of the conjugates, from x downwards: a stream's partner. */
void band_bins_multiply_mirrored(float *restrict y, const float *restrict x,
                                 const float *restrict h, size_t n);

/* y[i] = shift[i] * sum over s of v[s][i] step[i]^s for a block of BAND_BLOCK, by
 * Horner's rule.  y [BAND_BLOCK][2], v [n_streams][stride][2]; step and shift
 * [2][n_table], from the block's first on: step is the phase that a bin is ahead of the
 * one before it. */
void band_block_combine(float *restrict y, const float *restrict v, size_t n_streams,
                        size_t stride, const float *restrict step,
                        const float *restrict shift, size_t n_table);

#endif
