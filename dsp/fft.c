/* SPDX-License-Identifier: MIT */
#include "dsp/fft.h"

/* Measured with FFTW 3.3.10 (SSE2, AVX) at lengths of 800..6000: time for each point is
 * about proportional to this sum over the prime factors.  0: another factor is left. */
static unsigned size_cost(size_t n)
{
    unsigned cost = 1;

    for (; n % 2 == 0; n /= 2)
        cost += 1;
    for (; n % 3 == 0; n /= 3)
        cost += 4;
    for (; n % 5 == 0; n /= 5)
        cost += 6;
    return n == 1 ? cost : 0;
}

size_t fft_size(size_t min, double slack)
{
    size_t best = 0;
    double best_cost = 0.0;

    if (min < 1)
        min = 1;
    for (size_t n = min; !best || (double)n <= slack * (double)min; n++) {
        double cost = (double)size_cost(n) * (double)n;
        if (cost > 0.0 && (!best || cost < best_cost)) {
            best = n;
            best_cost = cost;
        }
    }
    return best;
}

fftwf_plan fft_plan(size_t n, float *in, float *out, int direction)
{
    return fftwf_plan_dft_1d((int)n, (fftwf_complex *)in, (fftwf_complex *)out, direction,
                             FFTW_ESTIMATE | FFTW_PRESERVE_INPUT);
}
