/* SPDX-License-Identifier: MIT */
/* ADMM at the paper's size, a letter and points with noise: milliseconds an iteration,
 * and seconds until the objective is within 1e-3 of the optimum, which is that of a very
 * long run.
 *
 *     bench_iterative [LONG]        iterations of the long run, default 1000 */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#include "recon/imaging/imager.h"
#include "recon/inverse/admm.h"
#include "recon/inverse/iterative.h"
#include "recon/power/lightcone.h"

enum { NX = 32, NY = 31, NZ = 250, CELLS = 500, THREADS = 2 };

#define NEAR_M   0.8
#define STEP_M   0.0094 /* c / 2 over the paper's 18 kHz */
#define NOISE    0.02   /* rms over the data's largest */
#define CLOSE    1e-3   /* to the optimum */
#define GROWTH   1.3    /* from one number of iterations that is tried to the next */
#define LONGEST  1000
#define TIMED    30 /* iterations that are timed */
#define LEAST_OF 3

struct bench {
    struct pool *pool;
    struct admm_config cfg;
    struct lightcone *lightcone; /* NULL: a blur */
    size_t n;
    float *scene, *data, *x;
};

struct spent { /* seconds */
    double wall, cpu;
};

static struct spent now(void)
{
    struct timespec t;
    struct rusage u;
    clock_gettime(CLOCK_MONOTONIC, &t);
    getrusage(RUSAGE_SELF, &u);
    return (struct spent){
        (double)t.tv_sec + 1e-9 * (double)t.tv_nsec,
        (double)(u.ru_utime.tv_sec + u.ru_stime.tv_sec) +
            1e-6 * (double)(u.ru_utime.tv_usec + u.ru_stime.tv_usec),
    };
}

static struct spent since(struct spent began)
{
    struct spent t = now();
    return (struct spent){t.wall - began.wall, t.cpu - began.cpu};
}

/* -- the problem ------------------------------------------------------------------------
 */

static void draw(struct bench *b)
{
    const size_t *n = b->cfg.n;
    for (size_t y = n[1] / 6; y < n[1] - n[1] / 6; y++)
        for (size_t x = n[0] / 6; x < n[0] - n[0] / 6; x++)
            if (x < n[0] / 3 || x >= n[0] - n[0] / 3 || y / 3 == n[1] / 6)
                b->scene[(n[2] / 2 * n[1] + y) * n[0] + x] = 1.0f;
    for (size_t p = 1; p < 4; p++)
        b->scene[((n[2] / 2 + 25 * p) * n[1] + 7 * p) * n[0] + 8 * p] = 8.0f;
}

static void add_noise(struct bench *b)
{
    uint32_t seed = 3;
    float largest = 0.0f;
    for (size_t i = 0; i < b->n; i++)
        largest = fmaxf(largest, fabsf(b->data[i]));
    for (size_t i = 0; i < b->n; i++) {
        double sum = 0.0; /* of 12: variance 1 */
        for (int q = 0; q < 12; q++) {
            seed = seed * 1664525u + 1013904223u;
            sum += (double)seed * 0x1p-32 - 0.5;
        }
        b->data[i] += (float)(NOISE * sum) * largest;
    }
}

static void forward(void *ctx, const float *x, float *y)
{
    lightcone_forward(ctx, x, y);
}

static void adjoint(void *ctx, const float *y, float *x)
{
    lightcone_adjoint(ctx, y, x);
}

static int plan_lightcone(struct bench *b)
{
    const struct lightcone_config cfg = {
        .nx = b->cfg.n[0],
        .ny = b->cfg.n[1],
        .pitch_x_m = 1.0 / 31.0,
        .pitch_y_m = 1.0 / 30.0,
        .nt = b->cfg.n[2],
        .range_m = NEAR_M,
        .range_step_m = STEP_M,
        .snr = 1.0,
        .n_squared = CELLS,
        .pool = b->pool,
    };
    return lightcone_create(&b->lightcone, &cfg);
}

static int plan(struct bench *b, size_t ny, int lightcone)
{
    struct imager_options o;
    imager_options_default(&o);
    b->cfg = (struct admm_config){
        .n = {NX, ny, NZ},
        .l1 = o.l1,
        .tv = o.tv,
        .rho = lightcone ? ITERATIVE_LIGHTCONE_RHO * o.rho : o.rho,
        .pool = b->pool,
    };
    b->n = NX * ny * NZ;
    b->scene = calloc(b->n, sizeof *b->scene);
    b->data = calloc(b->n, sizeof *b->data);
    b->x = calloc(b->n, sizeof *b->x);
    if (!b->scene || !b->data || !b->x)
        return -ENOMEM;
    draw(b);
    return lightcone ? plan_lightcone(b) : 0;
}

static void release(struct bench *b)
{
    lightcone_destroy(b->lightcone);
    b->lightcone = NULL;
    free(b->scene);
    free(b->data);
    free(b->x);
}

/* A quarter, a half and a quarter along one axis: half a voxel^2 of variance. */
static void smear(const struct bench *b, size_t stride)
{
    for (size_t i = 0; i < b->n; i++)
        b->x[i] = b->data[i];
    for (size_t i = stride; i + stride < b->n; i++)
        b->data[i] = 0.25f * b->x[i - stride] + 0.5f * b->x[i] + 0.25f * b->x[i + stride];
}

static void measure(struct bench *b)
{
    size_t layer = b->cfg.n[0] * b->cfg.n[1];
    if (b->lightcone) {
        lightcone_forward(b->lightcone, b->scene, b->data);
    } else {
        for (size_t i = 0; i < b->n; i++)
            b->data[i] = b->scene[i];
        for (int pass = 0; pass < 3; pass++) {
            smear(b, 1);
            smear(b, b->cfg.n[0]);
            smear(b, layer);
        }
    }
    add_noise(b);
}

/* -- runs -------------------------------------------------------------------------------
 */

static int run(struct bench *b, size_t iterations, double tolerance,
               struct admm_result *result, struct spent *solving)
{
    static const double covariance[6] = {1.5, 0.0, 0.0, 1.5, 0.0, 1.5};
    struct admm_operator linear = {b->lightcone, forward, adjoint, b->n};
    struct admm_config cfg = b->cfg;
    struct admm *a;
    cfg.iterations = iterations;
    cfg.tolerance = tolerance;
    cfg.linear = b->lightcone ? &linear : NULL;
    int err = admm_create(&a, &cfg);
    if (err)
        return err;
    if (!b->lightcone)
        admm_blur_gaussian(a, covariance);
    struct spent began = now();
    admm_solve(a, b->data, 0.0, b->x, result);
    *solving = since(began);
    admm_destroy(a);
    return 0;
}

static int time_iterations(struct bench *b)
{
    struct admm_result r;
    double wall_s = INFINITY, cpu_s = INFINITY;
    int err = 0;
    for (int k = 0; !err && k < LEAST_OF; k++) {
        struct spent few, many;
        err = run(b, TIMED / 4, 0.0, &r, &few);
        if (!err)
            err = run(b, TIMED / 4 + TIMED, 0.0, &r, &many);
        wall_s = fmin(wall_s, many.wall - few.wall);
        cpu_s = fmin(cpu_s, many.cpu - few.cpu);
    }
    if (!err)
        printf("  %.2f ms an iteration (%.2f ms of processors)\n", 1e3 * wall_s / TIMED,
               1e3 * cpu_s / TIMED);
    return err;
}

/* Fewer than tried before would have been enough by at most the factor GROWTH. */
static int approach(struct bench *b, double optimum)
{
    struct admm_result r = {.objective = INFINITY};
    struct spent t = {0};
    int err = 0;
    double n = 12.0;
    for (; !err && n < LONGEST; n = ceil(GROWTH * n)) {
        err = run(b, (size_t)n, 0.0, &r, &t);
        if (r.objective <= (1.0 + CLOSE) * optimum)
            break;
    }
    if (!err)
        printf("  %zu iterations, %.3f s (%.3f s of processors): %.2e above the "
               "optimum\n",
               r.iterations, t.wall, t.cpu, r.objective / optimum - 1.0);
    return err;
}

static int stop_by_rule(struct bench *b, double optimum)
{
    struct imager_options o;
    struct admm_result r;
    struct spent t;
    imager_options_default(&o);
    int err = run(b, o.iterations, o.tolerance, &r, &t);
    if (!err)
        printf("  by the rule %zu iterations, %.3f s: %.2e above, residuals %.1e %.1e\n",
               r.iterations, t.wall, r.objective / optimum - 1.0, r.primal, r.dual);
    return err;
}

static int judge(const char *name, size_t ny, int lightcone, size_t longest,
                 struct pool *pool)
{
    struct bench b = {.pool = pool};
    struct admm_result best;
    struct spent t;
    int err = plan(&b, ny, lightcone);
    if (!err) {
        printf("%s, %d x %zu x %d\n", name, NX, ny, NZ);
        measure(&b);
        err = time_iterations(&b);
    }
    if (!err)
        err = run(&b, longest, 0.0, &best, &t);
    if (!err)
        err = approach(&b, best.objective);
    if (!err)
        err = stop_by_rule(&b, best.objective);
    release(&b);
    return err;
}

int main(int argc, char **argv)
{
    size_t longest = argc > 1 ? strtoul(argv[1], NULL, 10) : LONGEST;
    struct pool *pool;
    setvbuf(stdout, NULL, _IOLBF, 0);
    int err = pool_create(&pool, THREADS);
    if (err)
        return 1;
    err = judge("blur", NX, 0, longest, pool);
    if (!err)
        err = judge("light-cone operator", NY, 1, longest, pool);
    if (err)
        fprintf(stderr, "bench_iterative: %s\n", strerror(-err));
    pool_destroy(pool);
    return err ? 1 : 0;
}
