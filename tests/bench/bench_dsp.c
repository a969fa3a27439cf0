/* SPDX-License-Identifier: MIT */
/* Pulse compression of one recording: 512 pings of 16 channels, slots of 3000 samples.
 * A ping is as long as the last echo's chirp (what `anlos recon` compresses), or holds
 * the next emission whole (while the air of the background drifts, recon/tail.h). */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "dsp/pool.h"
#include "dsp/pulse_compress.h"

#define N_PINGS     512
#define N_CHANNELS  16
#define N_ECHO      4200 /* 25 ms and a chirp */
#define N_WHOLE     6000
#define N_RUNS      9
#define MAX_THREADS 2

struct job {
    struct pulse_compress *pc[MAX_THREADS];
    size_t n_samples;
    const float *rx;  /* [N_PINGS][N_CHANNELS][n_samples] */
    float complex *y; /* [N_PINGS][N_CHANNELS][n] */
    size_t n;
};

static double clock_s(clockid_t clock)
{
    struct timespec t;

    clock_gettime(clock, &t);
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

    pulse_compress_execute(j->pc[thread], j->rx + item * N_CHANNELS * j->n_samples,
                           j->n_samples, j->y + item * N_CHANNELS * j->n);
}

static int measure(struct job *j, size_t n_threads)
{
    double wall_s[N_RUNS], cpu_s[N_RUNS];
    struct pool *pool;
    int err = pool_create(&pool, n_threads);

    if (err)
        return err;
    for (size_t r = 0; r < N_RUNS; r++) {
        wall_s[r] = clock_s(CLOCK_MONOTONIC);
        cpu_s[r] = clock_s(CLOCK_PROCESS_CPUTIME_ID);
        pool_run(pool, N_PINGS, compress_ping, j);
        wall_s[r] = clock_s(CLOCK_MONOTONIC) - wall_s[r];
        cpu_s[r] = clock_s(CLOCK_PROCESS_CPUTIME_ID) - cpu_s[r];
    }
    pool_destroy(pool);
    qsort(wall_s, N_RUNS, sizeof(*wall_s), compare);
    qsort(cpu_s, N_RUNS, sizeof(*cpu_s), compare);
    printf("  %zu thread(s): min %.1f ms, median %.1f ms; processor time min %.1f ms\n",
           n_threads, 1e3 * wall_s[0], 1e3 * wall_s[N_RUNS / 2], 1e3 * cpu_s[0]);
    return 0;
}

/* A ping of so many samples, by 1 thread and by 2. */
static int run(const char *what, size_t n_samples, const float *rx)
{
    struct pulse_compress_config cfg = {
        .sample_rate_hz = 48000.0,
        .n_samples = n_samples,
        .chirp = {2000.0, 20000.0, 0.0625, false},
        .window = WINDOW_HANN,
        .gate_s = {0.006, 0.025},
        .oversampling = 2.0,
        .n_channels = N_CHANNELS,
    };
    struct job j = {.n_samples = n_samples, .rx = rx};
    struct trace_format format;
    double planned_s = clock_s(CLOCK_MONOTONIC);
    int err = 0;

    for (size_t i = 0; i < MAX_THREADS && !err; i++)
        err = pulse_compress_create(&j.pc[i], &cfg);
    if (err)
        goto done;
    planned_s = clock_s(CLOCK_MONOTONIC) - planned_s;
    pulse_compress_format(j.pc[0], &format);
    printf("pulse compression, %d traces of %zu samples (%s), to %zu at %.0f Hz, planned "
           "in %.1f ms\n",
           N_PINGS * N_CHANNELS, n_samples, what, format.n_samples, format.rate_hz,
           1e3 * planned_s / MAX_THREADS);
    j.n = format.n_samples;
    j.y = calloc(N_PINGS * N_CHANNELS * j.n, sizeof(*j.y));
    err = j.y ? 0 : -ENOMEM;
    for (size_t n = 1; n <= MAX_THREADS && !err; n++)
        err = measure(&j, n);
done:
    free(j.y);
    for (size_t i = 0; i < MAX_THREADS; i++)
        pulse_compress_destroy(j.pc[i]);
    return err;
}

int main(void)
{
    size_t n_rx = (size_t)N_PINGS * N_CHANNELS * N_WHOLE;
    float *rx = malloc(n_rx * sizeof(*rx));
    unsigned seed = 1;
    int err = rx ? 0 : -ENOMEM;

    for (size_t i = 0; i < n_rx && !err; i++) {
        seed = seed * 1664525u + 1013904223u;
        rx[i] = (float)(seed >> 8) / 8388608.0f - 1.0f;
    }
    if (!err)
        err = run("echo", N_ECHO, rx);
    if (!err)
        err = run("whole", N_WHOLE, rx);
    free(rx);
    if (err)
        fprintf(stderr, "bench_dsp: %s\n", strerror(-err));
    return err ? 1 : 0;
}
