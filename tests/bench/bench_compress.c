/* SPDX-License-Identifier: MIT */
/* What dsp/band_transform and dsp/lane_fft earn: a ping of 16 channels through
 * dsp/pulse_compress, and through the same matched filter of FFTW's batched transforms
 * alone (real to complex over the ping, the band times a filter, complex to complex to
 * baseband), measured plans, one thread.  Runs of both alternate.
 *
 *     bench_compress [PINGS]         default: 512, one recording */
#include <complex.h>
#include <fftw3.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "dsp/fft.h"
#include "dsp/pulse_compress.h"

enum { CHANNELS = 16, REPLICA = 3000, RUNS = 15, MOST_SAMPLES = 6000 };

/* y = the band of x times a filter, at `points` / `length` of its rate. */
struct plain {
    size_t n_samples, length, n_bins, first, points, n_output;
    float *x;                /* [CHANNELS][length] */
    fftwf_complex *spectrum; /* [CHANNELS][length / 2 + 1] */
    fftwf_complex *band;     /* [CHANNELS][points] */
    fftwf_complex *baseband; /* [CHANNELS][points] */
    float complex *filter;   /* [n_bins] */
    fftwf_plan forward, inverse;
};

static double clock_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int plain_create(struct plain *p, const struct pulse_compress_config *c)
{
    size_t bins, least = REPLICA + (size_t)ceil(c->gate_s[1] * c->sample_rate_hz) + 1;
    int n[1];

    p->n_samples = c->n_samples;
    p->length = fft_size(least > c->n_samples ? least : c->n_samples, 1.15);
    bins = p->length / 2 + 1;
    p->first = (size_t)ceil(c->chirp.start_hz / c->sample_rate_hz * (double)p->length);
    p->n_bins = (size_t)(c->chirp.stop_hz / c->sample_rate_hz * (double)p->length) -
                p->first + 1;
    p->points = fft_size((size_t)ceil(c->oversampling * (double)p->n_bins), 1.15);
    p->n_output = (size_t)((c->gate_s[1] - c->gate_s[0]) * c->sample_rate_hz *
                           (double)p->points / (double)p->length) +
                  1;
    p->x = fftwf_malloc(CHANNELS * p->length * sizeof *p->x);
    p->spectrum = fftwf_malloc(CHANNELS * bins * sizeof *p->spectrum);
    p->band = fftwf_malloc(CHANNELS * p->points * sizeof *p->band);
    p->baseband = fftwf_malloc(CHANNELS * p->points * sizeof *p->baseband);
    p->filter = fftwf_malloc(p->n_bins * sizeof *p->filter);
    if (!p->x || !p->spectrum || !p->band || !p->baseband || !p->filter)
        return -1;
    n[0] = (int)p->length;
    p->forward = fftwf_plan_many_dft_r2c(1, n, CHANNELS, p->x, NULL, 1, n[0], p->spectrum,
                                         NULL, 1, (int)bins, FFTW_MEASURE);
    n[0] = (int)p->points;
    p->inverse = fftwf_plan_many_dft(1, n, CHANNELS, p->band, NULL, 1, n[0], p->baseband,
                                     NULL, 1, n[0], FFTW_BACKWARD,
                                     FFTW_MEASURE | FFTW_PRESERVE_INPUT);
    if (!p->forward || !p->inverse)
        return -1;
    memset(p->x, 0, CHANNELS * p->length * sizeof *p->x);
    memset(p->band, 0, CHANNELS * p->points * sizeof *p->band);
    for (size_t i = 0; i < p->n_bins; i++)
        p->filter[i] = cexpf(I * (float)i) / (float)p->n_bins;
    return 0;
}

static void plain_execute(struct plain *p, const float *rx, float complex *y)
{
    size_t bins = p->length / 2 + 1;

    for (size_t c = 0; c < CHANNELS; c++)
        memcpy(p->x + c * p->length, rx + c * p->n_samples, p->n_samples * sizeof *p->x);
    fftwf_execute(p->forward);
    for (size_t c = 0; c < CHANNELS; c++) {
        const float *s = (const float *)(p->spectrum + c * bins + p->first);
        const float *f = (const float *)p->filter;
        float *b = (float *)(p->band + c * p->points);
        for (size_t k = 0; k < p->n_bins; k++) {
            b[2 * k] = s[2 * k] * f[2 * k] - s[2 * k + 1] * f[2 * k + 1];
            b[2 * k + 1] = s[2 * k] * f[2 * k + 1] + s[2 * k + 1] * f[2 * k];
        }
    }
    fftwf_execute(p->inverse);
    for (size_t c = 0; c < CHANNELS; c++)
        memcpy(y + c * p->n_output, p->baseband + c * p->points, p->n_output * sizeof *y);
}

static void plain_destroy(struct plain *p)
{
    fftwf_destroy_plan(p->forward);
    fftwf_destroy_plan(p->inverse);
    fftwf_free(p->x);
    fftwf_free(p->spectrum);
    fftwf_free(p->band);
    fftwf_free(p->baseband);
    fftwf_free(p->filter);
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static int run(size_t n_samples, size_t pings)
{
    struct pulse_compress_config cfg = {
        .sample_rate_hz = 48000.0,
        .n_samples = n_samples,
        .chirp = {2000.0, 20000.0, 0.0625, false},
        .window = WINDOW_HANN,
        .gate_s = {0.006, 0.025},
        .oversampling = 2.0,
        .n_channels = CHANNELS,
    };
    double ours_s[RUNS], plain_s[RUNS], ratio[RUNS];
    struct pulse_compress *pc = NULL;
    struct plain plain = {0};
    float *rx = calloc(CHANNELS * n_samples, sizeof *rx);
    float complex *y = calloc((size_t)CHANNELS * MOST_SAMPLES, sizeof *y);
    unsigned seed = 1;

    if (!rx || !y || pulse_compress_create(&pc, &cfg) || plain_create(&plain, &cfg)) {
        fprintf(stderr, "bench_compress: out of memory\n");
        return 1;
    }
    for (size_t i = 0; i < CHANNELS * n_samples; i++) {
        seed = seed * 1664525u + 1013904223u;
        rx[i] = (float)(seed >> 8) / 8388608.0f - 1.0f;
    }
    for (int r = 0; r < RUNS; r++) {
        double began_s = clock_s();
        for (size_t i = 0; i < pings; i++)
            pulse_compress_execute(pc, rx, n_samples, y);
        ours_s[r] = clock_s() - began_s;
        began_s = clock_s();
        for (size_t i = 0; i < pings; i++)
            plain_execute(&plain, rx, y);
        plain_s[r] = clock_s() - began_s;
        ratio[r] = plain_s[r] / ours_s[r];
    }
    qsort(ours_s, RUNS, sizeof *ours_s, compare);
    qsort(plain_s, RUNS, sizeof *plain_s, compare);
    qsort(ratio, RUNS, sizeof *ratio, compare);
    printf("%zu pings of %zu samples: dsp/pulse_compress %.1f ms, FFTW (%zu to %zu, %zu "
           "samples out) %.1f ms, ratio %.2f (%.2f to %.2f)\n",
           pings, n_samples, 1e3 * ours_s[RUNS / 2], plain.length, plain.points,
           plain.n_output, 1e3 * plain_s[RUNS / 2], ratio[RUNS / 2], ratio[0],
           ratio[RUNS - 1]);
    plain_destroy(&plain);
    pulse_compress_destroy(pc);
    free(rx);
    free(y);
    return 0;
}

int main(int argc, char **argv)
{
    size_t pings = argc > 1 ? strtoul(argv[1], NULL, 10) : 512;

    return run(4200, pings) || run(6000, pings);
}
