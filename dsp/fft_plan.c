#include "dsp/fft_plan.h"

#define PLAN_LIMIT_S 0.1

fftwf_plan fft_plan(size_t n, float *in, float *out, int direction)
{
    fftwf_complex *a = (fftwf_complex *)in, *b = (fftwf_complex *)out;
    fftwf_plan plan;

    plan = fftwf_plan_dft_1d((int)n, a, b, direction,
                             FFTW_MEASURE | FFTW_PRESERVE_INPUT | FFTW_WISDOM_ONLY);
    if (plan)
        return plan;
    fftwf_set_timelimit(PLAN_LIMIT_S);
    plan = fftwf_plan_dft_1d((int)n, a, b, direction, FFTW_MEASURE | FFTW_PRESERVE_INPUT);
    fftwf_set_timelimit(FFTW_NO_TIMELIMIT);
    return plan;
}
