/* SPDX-License-Identifier: MIT */
/* Normal moveout, dip moveout and stack of one scan: 8192 traces of a column of 16
 * speakers and 16 microphones at 32 positions, to 32 x 31 co-located ones.  `paper`'s way
 * (powers, a ping's pairs of equal midpoint folded) at about 250 and 500 samples of log
 * time, and `fast`'s with its phase. */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "recon/coherent/zero_offset.h"

#define POSITIONS   32
#define ELEMENTS    16
#define PITCH_M     0.0625
#define SPEED_M_S   343.0
#define MAX_THREADS 2
#define RUNS        9

struct load {
    const char *name;
    bool power;
    double band_hz[2], gate_s[2];
};

static const struct load loads[] = {
    {"powers", true, {2000.0, 11000.0}, {0.006, 0.021}},
    {"powers", true, {2000.0, 20000.0}, {0.006, 0.021}},
    {"traces", false, {2000.0, 20000.0}, {0.006, 0.021}},
};

struct bench {
    double speakers_m[ELEMENTS][3], microphones_m[ELEMENTS][3], positions_m[POSITIONS];
    struct geometry geometry;
    struct zero_offset_config cfg;
    struct zero_offset *zero_offset;
    float complex *traces; /* [POSITIONS][ELEMENTS][ELEMENTS][in.n_samples] */
    float *out;
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

static void lay_out(struct bench *b)
{
    for (int i = 0; i < ELEMENTS; i++) {
        b->speakers_m[i][1] = b->microphones_m[i][1] = PITCH_M * i;
        b->microphones_m[i][0] = 0.05;
    }
    for (int i = 0; i < POSITIONS; i++)
        b->positions_m[i] = i / (POSITIONS - 1.0);
    b->geometry = (struct geometry){
        .sound_speed_m_s = SPEED_M_S,
        .n_speakers = ELEMENTS,
        .n_microphones = ELEMENTS,
        .n_positions = POSITIONS,
        .speakers_m = (const double(*)[3])b->speakers_m,
        .microphones_m = (const double(*)[3])b->microphones_m,
        .stage_axis = {1.0, 0.0, 0.0},
        .stage_positions_m = b->positions_m,
    };
}

static int prepare(struct bench *b, const struct load *l)
{
    double width_hz = l->band_hz[1] - l->band_hz[0];
    struct trace_format f = {
        .t0_s = l->gate_s[0],
        .rate_hz = 2.0 * width_hz,
        .carrier_hz = 0.5 * (l->band_hz[0] + l->band_hz[1]),
        .n_samples = (size_t)ceil(2.0 * width_hz * (l->gate_s[1] - l->gate_s[0])),
    };
    b->cfg = (struct zero_offset_config){
        .geometry = &b->geometry,
        .in = f,
        .band_hz = {l->band_hz[0], l->band_hz[1]},
        .power = l->power,
        .mute_s = l->gate_s[0],
        .out = f,
    };
    size_t n = (size_t)POSITIONS * ELEMENTS * ELEMENTS * f.n_samples;
    b->traces = malloc(n * sizeof *b->traces);
    b->out = malloc((size_t)POSITIONS * 2 * ELEMENTS * f.n_samples * 2 * sizeof *b->out);
    if (!b->traces || !b->out)
        return -ENOMEM;
    unsigned seed = 1;
    for (size_t i = 0; i < 2 * n; i++) {
        seed = seed * 1664525u + 1013904223u;
        ((float *)b->traces)[i] = (float)(seed >> 8) / 8388608.0f - 1.0f;
    }
    return 0;
}

static void add_position(void *ctx, size_t position, size_t thread)
{
    const struct bench *b = ctx;
    size_t n = ELEMENTS * b->cfg.in.n_samples;
    (void)thread;
    for (size_t j = 0; j < ELEMENTS; j++)
        zero_offset_add(b->zero_offset, position, j,
                        b->traces + (position * ELEMENTS + j) * n, NULL);
}

static int measure(struct bench *b, size_t threads)
{
    double add_s[RUNS], stack_s[RUNS], cpu_s[RUNS], planned_s = clock_s(CLOCK_MONOTONIC);
    const char *why = "";
    int err = pool_create(&b->cfg.pool, threads);
    if (err)
        return err;
    err = zero_offset_create(&b->zero_offset, &b->cfg, &why);
    planned_s = clock_s(CLOCK_MONOTONIC) - planned_s;
    for (int r = 0; !err && r < RUNS; r++) {
        zero_offset_reset(b->zero_offset);
        double began_s = clock_s(CLOCK_MONOTONIC);
        pool_run(b->cfg.pool, POSITIONS, add_position, b);
        add_s[r] = clock_s(CLOCK_MONOTONIC) - began_s;
        cpu_s[r] = clock_s(CLOCK_PROCESS_CPUTIME_ID);
        began_s = clock_s(CLOCK_MONOTONIC);
        zero_offset_stack(b->zero_offset, b->out);
        stack_s[r] = clock_s(CLOCK_MONOTONIC) - began_s;
        cpu_s[r] = clock_s(CLOCK_PROCESS_CPUTIME_ID) - cpu_s[r];
    }
    zero_offset_destroy(b->zero_offset);
    pool_destroy(b->cfg.pool);
    if (err)
        return err;
    qsort(add_s, RUNS, sizeof *add_s, compare);
    qsort(stack_s, RUNS, sizeof *stack_s, compare);
    qsort(cpu_s, RUNS, sizeof *cpu_s, compare);
    printf("  %zu thread(s): stack min %.1f ms, median %.1f ms (processor time min %.1f "
           "ms); adding min %.1f ms; planned in %.0f ms\n",
           threads, 1e3 * stack_s[0], 1e3 * stack_s[RUNS / 2], 1e3 * cpu_s[0],
           1e3 * add_s[0], 1e3 * planned_s);
    return 0;
}

int main(void)
{
    static struct bench b;
    int err = 0;
    lay_out(&b);
    for (size_t i = 0; !err && i < sizeof loads / sizeof *loads; i++) {
        err = prepare(&b, &loads[i]);
        if (!err)
            printf("%s of %zu samples, %g to %g kHz\n", loads[i].name, b.cfg.in.n_samples,
                   1e-3 * loads[i].band_hz[0], 1e-3 * loads[i].band_hz[1]);
        for (size_t threads = 1; !err && threads <= MAX_THREADS; threads++)
            err = measure(&b, threads);
        free(b.traces);
        free(b.out);
    }
    if (err)
        fprintf(stderr, "bench_zero_offset: %s\n", strerror(-err));
    return err ? 1 : 0;
}
