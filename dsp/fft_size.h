/* dsp/fft_size.h -- lengths that FFTW transforms fast. */
#ifndef ANLOS_DSP_FFT_SIZE_H
#define ANLOS_DSP_FFT_SIZE_H

#include <stddef.h>

/* The length 2^a 3^b 5^c in min .. slack * min that should be cheapest; the smallest one
 * from min on when there is none in that range.  min >= 1, slack >= 1. */
size_t fft_size(size_t min, double slack);

#endif
