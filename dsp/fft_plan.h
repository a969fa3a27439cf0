/* dsp/fft_plan.h -- FFTW plans of one complex transform, measured in bounded time. */
#ifndef ANLOS_DSP_FFT_PLAN_H
#define ANLOS_DSP_FFT_PLAN_H

#include <fftw3.h>
#include <stddef.h>

/* A plan from in to out ([n] complex, from fftwf_malloc, not the same) that keeps in's
 * contents when it runs and spoils both while it is made.  What wisdom knows is used;
 * else FFTW measures for 0.1 s at most.  FFTW's planner is not thread-safe, and neither
 * is this.  direction: FFTW_FORWARD, FFTW_BACKWARD.  NULL: no memory. */
fftwf_plan fft_plan(size_t n, float *in, float *out, int direction);

#endif
