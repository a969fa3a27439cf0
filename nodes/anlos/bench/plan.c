#include "nodes/anlos/bench/plan.h"

#include <math.h>
#include <string.h>

#include "nodes/anlos/recon/auto.h"

#define BASE_STEP  0.28 /* of a width: 3.6 voxels in a point, as grid_default has it */
#define QUICK_STEP 0.45
#define KHZ        1e3

/* What differs from the base point, which has every speaker and position, the step above,
 * the chirp's band, the method's own iterations and all threads.  0: as there. */
struct row {
    const char *varied;
    const char *method; /* NULL: all, of auto only the base */
    bool quick;         /* also in a quick run */
    double step;
    size_t speaker_stride, position_stride;
    double band_hz[2];
    size_t iterations, threads;
    double budget_s, error_m;
    bool in_time_of_fast;
};

static const struct row rows[] = {
    {.varied = "grid", .step = 0.80, .quick = true},
    {.varied = "grid", .step = 0.56},
    {.varied = "grid", .step = 0.40},
    {.varied = "speakers", .speaker_stride = 8},
    {.varied = "speakers", .speaker_stride = 4, .quick = true},
    {.varied = "speakers", .speaker_stride = 2, .quick = true},
    {.varied = "positions", .position_stride = 4},
    {.varied = "positions", .position_stride = 2},
    {.varied = "base", .quick = true},
    {.varied = "iterations", .method = "iterative", .iterations = 10, .quick = true},
    {.varied = "iterations", .method = "iterative", .iterations = 40},
    {.varied = "iterations", .method = "sparse", .iterations = 10},
    {.varied = "iterations", .method = "sparse", .iterations = 40},
    {.varied = "equal time", .method = "auto", .in_time_of_fast = true, .quick = true},
    {.varied = "budget", .method = "auto", .budget_s = 0.05},
    {.varied = "budget", .method = "auto", .budget_s = 0.1, .quick = true},
    {.varied = "budget", .method = "auto", .budget_s = 0.2},
    {.varied = "budget", .method = "auto", .budget_s = 0.5},
    {.varied = "error", .method = "auto", .error_m = 0.02},
    {.varied = "error", .method = "auto", .error_m = 0.005},
    {.varied = "error", .method = "auto", .error_m = 0.001},
    {.varied = "band", .band_hz = {2 * KHZ, 14 * KHZ}, .quick = true},
    {.varied = "band", .band_hz = {2 * KHZ, 9 * KHZ}},
    {.varied = "band", .band_hz = {8 * KHZ, 20 * KHZ}},
    {.varied = "threads", .threads = 1, .quick = true},
    {.varied = "threads", .threads = 2},
    {.varied = "threads", .threads = 4},
    {.varied = "threads", .threads = 8},
    {.varied = "grid", .step = 0.20},
};

/* Of `fast` alone: everything that makes it faster, together. */
static const double product_steps[] = {0.8, 0.56, 0.4};
static const size_t product_strides[] = {4, 2};
static const double product_top_hz[] = {20 * KHZ, 14 * KHZ};

static struct bench_case base_case(const char *method, size_t threads, bool quick)
{
    return (struct bench_case){.method = method,
                               .varied = "base",
                               .speaker_stride = 1,
                               .position_stride = 1,
                               .step = quick ? QUICK_STEP : BASE_STEP,
                               .threads = threads};
}

static struct bench_case row_case(const struct row *r, struct bench_case c)
{
    c.varied = r->varied;
    c.step = r->step > 0.0 ? r->step : c.step;
    c.speaker_stride = r->speaker_stride ? r->speaker_stride : 1;
    c.position_stride = r->position_stride ? r->position_stride : 1;
    memcpy(c.band_hz, r->band_hz, sizeof c.band_hz);
    c.iterations = r->iterations;
    c.budget_s = r->budget_s;
    c.error_m = r->error_m;
    c.in_time_of_fast = r->in_time_of_fast;
    c.threads = r->threads ? r->threads : c.threads;
    return c;
}

static size_t add_product(struct bench_case *out, struct bench_case c)
{
    size_t n = 0;
    c.varied = "product";
    for (size_t b = 0; b < sizeof product_top_hz / sizeof *product_top_hz; b++)
        for (size_t p = 0; p < sizeof product_strides / sizeof *product_strides; p++)
            for (size_t g = 0; g < sizeof product_steps / sizeof *product_steps; g++) {
                c.step = product_steps[g];
                c.speaker_stride = product_strides[p];
                c.band_hz[0] = 2 * KHZ;
                c.band_hz[1] = product_top_hz[b];
                out[n++] = c;
            }
    return n;
}

static bool is_of(const struct row *r, const char *method)
{
    if (r->method)
        return !strcmp(r->method, method);
    return strcmp(method, recon_auto_name) || !strcmp(r->varied, "base");
}

size_t bench_plan(struct bench_case *out, const char *method, size_t threads, bool quick)
{
    struct bench_case base = base_case(method, threads, quick);
    size_t n = 0;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct row *r = &rows[i];
        if ((quick && !r->quick) || !is_of(r, method) ||
            (r->threads && r->threads >= threads))
            continue;
        out[n++] = row_case(r, base);
    }
    if (!strcmp(method, "fast") && !quick)
        n += add_product(out + n, base);
    return n;
}

void bench_plan_growth(struct bench_case *out, const char *method, size_t threads)
{
    for (int i = 0; i < 3; i++) {
        struct bench_case voxels = base_case(method, threads, false), pairs = voxels;
        voxels.varied = "growth, voxels";
        voxels.step = BASE_STEP * cbrt(pow(4.0, 2 - i));
        out[i] = voxels;
        pairs.varied = "growth, pairs";
        pairs.step = QUICK_STEP;
        pairs.speaker_stride = pairs.position_stride = (size_t)4 >> i;
        out[3 + i] = pairs;
    }
}

double bench_plan_work(const struct bench_case *c)
{
    if (!strcmp(c->varied, "growth, pairs"))
        return 16.0 / (double)(c->speaker_stride * c->position_stride);
    return 16.0 * pow(BASE_STEP / c->step, 3.0);
}
