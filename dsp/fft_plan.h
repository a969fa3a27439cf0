/* dsp/fft_plan.h -- FFTW plans of one complex transform, by rule and not by measurement:
 * what FFTW measures depends on what else the machine does at that moment, and another
 * plan rounds otherwise.  The same recording is to give the same bytes.  At the lengths
 * that fft_size chooses a measured plan is no faster. */
#ifndef ANLOS_DSP_FFT_PLAN_H
#define ANLOS_DSP_FFT_PLAN_H

#include <fftw3.h>
#include <stddef.h>

/* A plan from in to out ([n] complex, from fftwf_malloc, not the same) that keeps in's
 * contents when it runs.  Takes some 0.1 ms.  FFTW's planner is not thread-safe, and
 * neither is this.  direction: FFTW_FORWARD, FFTW_BACKWARD.  NULL: no memory. */
fftwf_plan fft_plan(size_t n, float *in, float *out, int direction);

#endif
