/* SPDX-License-Identifier: MIT */
/* Confocal volumes of 64 x 64 x 512, as in O'Toole 2018 and Lindell 2019 (light): the
 * light-cone transform of powers, and f-k migration of as many complex samples, on 1 and
 * 2 threads. */
#include <complex.h>
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <time.h>

#include "recon/coherent/fk.h"
#include "recon/power/lightcone.h"

#define SIDE        64
#define BINS        512
#define SIZE        ((size_t)SIDE * SIDE * BINS)
#define PITCH_M     0.0156
#define STEP_M      0.0024
#define RUNS        9
#define MAX_THREADS 2

static double clock_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double memory_mb(void)
{
    struct rusage usage = {0};
    getrusage(RUSAGE_SELF, &usage);
    return (double)usage.ru_maxrss / 1024.0;
}

static int by_time(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void report(const char *name, size_t threads, double plan_s, double *run_s)
{
    qsort(run_s, RUNS, sizeof *run_s, by_time);
    printf(
        "%-11s %zu thread%s  min %.1f  median %.1f ms  (planning %.0f ms)  peak so far "
        "%.0f MB\n",
        name, threads, threads == 1 ? " " : "s", 1e3 * run_s[0], 1e3 * run_s[RUNS / 2],
        1e3 * plan_s, memory_mb());
}

static int run_lightcone(struct pool *pool, const float *in, float *out)
{
    const struct lightcone_config cfg = {.nx = SIDE,
                                         .ny = SIDE,
                                         .pitch_x_m = PITCH_M,
                                         .pitch_y_m = PITCH_M,
                                         .nt = BINS,
                                         .range_m = STEP_M,
                                         .range_step_m = STEP_M,
                                         .snr = 3.0,
                                         .pool = pool};
    struct lightcone *l;
    double run_s[RUNS], start_s = clock_s();
    int err = lightcone_create(&l, &cfg);
    double plan_s = clock_s() - start_s;
    for (int i = 0; !err && i < RUNS; i++) {
        start_s = clock_s();
        lightcone_inverse(l, in, out);
        run_s[i] = clock_s() - start_s;
    }
    if (!err) {
        report("light-cone", pool_threads(pool), plan_s, run_s);
        lightcone_destroy(l);
    }
    return err;
}

/* Waves of 2 to 6 pitches, the band that a lattice of that pitch is used with. */
static int run_fk(struct pool *pool, const float complex *in, float *out)
{
    double lines_m[SIDE], run_s[RUNS];
    static float weight[SIDE * SIDE];
    const double c = 3e8, rate_hz = 0.5 * c / STEP_M;
    for (int i = 0; i < SIDE; i++)
        lines_m[i] = PITCH_M * i;
    for (int i = 0; i < SIDE * SIDE; i++)
        weight[i] = 1.0f;
    const double band_hz[2] = {c / (6.0 * PITCH_M), c / (2.0 * PITCH_M)};
    const struct fk_config cfg = {
        .sound_speed_m_s = c,
        .nx = SIDE,
        .ny = SIDE,
        .x_m = lines_m,
        .y_m = lines_m,
        .trace = {.t0_s = 0.2 / c,
                  .rate_hz = rate_hz,
                  .carrier_hz = 0.5 * (band_hz[0] + band_hz[1]),
                  .n_samples = BINS},
        .band_hz = {band_hz[0], band_hz[1]},
        .grid = {{0.0, 0.0, 0.1}, {PITCH_M, PITCH_M, STEP_M}, {SIDE, SIDE, BINS}},
        .pool = pool,
    };
    struct fk *m;
    double start_s = clock_s();
    int err = fk_create(&m, &cfg);
    double plan_s = clock_s() - start_s;
    for (int i = 0; !err && i < RUNS; i++) {
        start_s = clock_s();
        fk_migrate(m, in, weight, out);
        run_s[i] = clock_s() - start_s;
    }
    if (!err) {
        report("f-k", pool_threads(pool), plan_s, run_s);
        fk_destroy(m);
    }
    return err;
}

int main(void)
{
    float complex *in = malloc(SIZE * sizeof *in);
    float *out = malloc(SIZE * sizeof *out);
    uint32_t seed = 1;
    int err = in && out ? 0 : -ENOMEM;
    for (size_t i = 0; !err && i < 2 * SIZE; i++) {
        seed = seed * 1664525u + 1013904223u;
        ((float *)in)[i] = (float)(seed >> 8) * 0x1p-24f;
    }
    for (size_t threads = 1; !err && threads <= MAX_THREADS; threads++) {
        struct pool *pool;
        err = pool_create(&pool, threads);
        if (!err)
            err = run_lightcone(pool, (const float *)in, out);
        if (!err)
            err = run_fk(pool, in, out);
        if (!err)
            pool_destroy(pool);
    }
    free(in);
    free(out);
    if (err)
        fprintf(stderr, "bench_confocal: failed (%d)\n", err);
    return err ? 1 : 0;
}
