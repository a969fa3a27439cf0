#include "dsp/polarity.h"

#include <errno.h>
#include <stdlib.h>

#define ITERATIONS 50

static double complex phasor(double complex z)
{
    double a = cabs(z);
    return a > 0.0 ? z / a : 0.0;
}

/* out[n_out] = the phases that follow from known[n_known] of the other kind; a pair's
 * peak is at i * stride_out + k * stride_known. */
static void follow(size_t n_out, size_t stride_out, size_t n_known, size_t stride_known,
                   const double complex *peaks, const double complex *known,
                   double complex *out)
{
    for (size_t i = 0; i < n_out; i++) {
        double complex sum = 0.0;
        for (size_t k = 0; k < n_known; k++)
            sum += phasor(peaks[i * stride_out + k * stride_known]) * conj(known[k]);
        out[i] = phasor(sum);
    }
}

/* The phase that most are near to: the one of them with the greatest sum of projections
 * that are not negative.  A mean would vanish where half are inverted. */
static double complex majority(const double complex *phases, size_t n)
{
    double complex best = 1.0;
    double most = -1.0;
    for (size_t i = 0; i < n; i++) {
        double sum = 0.0;
        for (size_t k = 0; k < n; k++) {
            double along = creal(phases[k] * conj(phases[i]));
            sum += along > 0.0 ? along : 0.0;
        }
        if (cabs(phases[i]) > 0.0 && sum > most + 1e-9) {
            most = sum;
            best = phases[i];
        }
    }
    return best;
}

static void judge(const double complex *phases, size_t n, bool *inverted)
{
    double complex usual = majority(phases, n);
    for (size_t i = 0; i < n; i++)
        inverted[i] = creal(phases[i] * conj(usual)) < 0.0;
}

int polarity_find(size_t n_speakers, size_t n_microphones, const double complex *peaks,
                  bool *speaker_inverted, bool *microphone_inverted)
{
    double complex *speakers = calloc(n_speakers, sizeof *speakers);
    double complex *microphones = calloc(n_microphones, sizeof *microphones);
    int err = speakers && microphones ? 0 : -ENOMEM;
    /* A start that no pattern of signs is orthogonal to. */
    for (size_t m = 0; !err && m < n_microphones; m++)
        microphones[m] = cexp(I * 0.1 * (double)m / (double)n_microphones) *
                         phasor(peaks[m] != 0.0 ? peaks[m] : 1.0);
    for (int k = 0; !err && k < ITERATIONS; k++) {
        follow(n_speakers, n_microphones, n_microphones, 1, peaks, microphones, speakers);
        follow(n_microphones, 1, n_speakers, n_microphones, peaks, speakers, microphones);
    }
    if (!err) {
        judge(speakers, n_speakers, speaker_inverted);
        judge(microphones, n_microphones, microphone_inverted);
    }
    free(speakers);
    free(microphones);
    return err;
}
