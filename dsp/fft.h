/* SPDX-License-Identifier: MIT */
/* dsp/fft.h -- FFTW plans of one complex transform, and lengths that it transforms fast.
 *
 * Plans are made by rule and not by measurement: what FFTW measures depends on what else
 * the machine does at that moment, and another plan rounds otherwise.  The same recording
 * is to give the same bytes.  At the lengths that fft_size chooses a measured plan is no
 * faster. */
#ifndef ANLOS_DSP_FFT_H
#define ANLOS_DSP_FFT_H

#include <fftw3.h>
#include <stddef.h>

/* A plan from in to out ([n] complex, from fftwf_malloc, not the same) that keeps in's
 * contents when it runs.  Takes some 0.1 ms.  FFTW's planner is not thread-safe, and
 * neither is this.  direction: FFTW_FORWARD, FFTW_BACKWARD.  NULL: no memory. */
fftwf_plan fft_plan(size_t n, float *in, float *out, int direction);

/* The length 2^a 3^b 5^c in min .. slack * min that should be cheapest; the smallest one
 * from min on when there is none in that range.  min >= 1, slack >= 1. */
size_t fft_size(size_t min, double slack);

#endif
