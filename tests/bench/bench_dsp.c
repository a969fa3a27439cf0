/* Pulse compression of one recording: 512 pings of 16 channels, 3000 + 1200 samples. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "dsp/pool.h"
#include "dsp/pulse_compress.h"

#define N_PINGS     512
#define N_CHANNELS  16
#define N_SAMPLES   4200
#define N_RUNS      9
#define MAX_THREADS 2

struct job {
    struct pulse_compress *pc[MAX_THREADS];
    const float *rx;  /* [N_PINGS][N_CHANNELS][N_SAMPLES] */
    float complex *y; /* [N_PINGS][N_CHANNELS][n] */
    size_t n;
};

static double clock_s(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

static void compress_ping(void *ctx, size_t item, size_t thread)
{
    struct job *j = ctx;

    pulse_compress_execute(j->pc[thread], j->rx + item * N_CHANNELS * N_SAMPLES,
                           N_SAMPLES, j->y + item * N_CHANNELS * j->n);
}

static int run(struct job *j, size_t n_threads)
{
    double t[N_RUNS];
    struct pool *pool;
    int err = pool_create(&pool, n_threads);

    if (err)
        return err;
    for (size_t r = 0; r < N_RUNS; r++) {
        t[r] = clock_s();
        pool_run(pool, N_PINGS, compress_ping, j);
        t[r] = clock_s() - t[r];
    }
    pool_destroy(pool);
    qsort(t, N_RUNS, sizeof(*t), compare);
    printf("pulse compression, %d traces, %zu thread(s): min %.1f ms, median %.1f ms\n",
           N_PINGS * N_CHANNELS, n_threads, 1e3 * t[0], 1e3 * t[N_RUNS / 2]);
    return 0;
}

int main(void)
{
    struct pulse_compress_config cfg = {
        .sample_rate_hz = 48000.0,
        .n_samples = N_SAMPLES,
        .chirp = {2000.0, 20000.0, 0.0625, false},
        .window = WINDOW_HANN,
        .gate_s = {0.006, 0.025},
        .oversampling = 2.0,
        .n_channels = N_CHANNELS,
    };
    struct trace_format format;
    struct job j = {0};
    size_t n_rx = (size_t)N_PINGS * N_CHANNELS * N_SAMPLES;
    float *rx = malloc(n_rx * sizeof(*rx));
    unsigned seed = 1;
    int err = 0;

    for (size_t i = 0; i < MAX_THREADS && !err; i++) {
        double t = clock_s();
        err = pulse_compress_create(&j.pc[i], &cfg);
        printf("create: %.1f ms\n", 1e3 * (clock_s() - t));
    }
    if (err || !rx)
        goto done;
    for (size_t i = 0; i < n_rx; i++) {
        seed = seed * 1664525u + 1013904223u;
        rx[i] = (float)(seed >> 8) / 8388608.0f - 1.0f;
    }
    pulse_compress_format(j.pc[0], &format);
    printf("%zu samples a trace at %.0f Hz\n", format.n_samples, format.rate_hz);
    j.rx = rx;
    j.n = format.n_samples;
    j.y = calloc(N_PINGS * N_CHANNELS * j.n, sizeof(*j.y));
    for (size_t n = 1; n <= MAX_THREADS && j.y && !err; n++)
        err = run(&j, n);
done:
    free(rx);
    free(j.y);
    for (size_t i = 0; i < MAX_THREADS; i++)
        pulse_compress_destroy(j.pc[i]);
    if (err)
        fprintf(stderr, "bench_dsp: error %d\n", err);
    return err ? 1 : 0;
}
