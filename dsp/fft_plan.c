#include "dsp/fft_plan.h"

fftwf_plan fft_plan(size_t n, float *in, float *out, int direction)
{
    return fftwf_plan_dft_1d((int)n, (fftwf_complex *)in, (fftwf_complex *)out, direction,
                             FFTW_ESTIMATE | FFTW_PRESERVE_INPUT);
}
