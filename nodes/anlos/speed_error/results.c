/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/speed_error/results.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "dsp/list.h"
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

static const char columns[] =
    "scene,method,varied,speakers,positions,step_widths,band_low_hz,band_high_hz,"
    "iterations,budget_ms,error_goal_cm,threads,voxels,pairs,state,plan_s,compress_s,"
    "look_s,stack_s,image_s,total_s,"
    "cpu_s,memory_mb,lateral_cm,lateral_worst_cm,depth_cm,width_x_cm,width_y_cm,"
    "width_z_cm,sidelobe_db,iou,correlation,note\n";

int bench_results_open(struct bench_results *b, const char *folder, struct error *why)
{
    char path[PATH_MAX];
    *b = (struct bench_results){0};
    if (snprintf(path, sizeof path, "%s/speed-error.csv", folder) >= (int)sizeof path)
        return error_say(why, -ENAMETOOLONG, "%s: path too long", folder);
    unlink(path); /* and not through a link that somebody has put there */
    b->csv = fopen(path, "wxe");
    if (!b->csv)
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    fputs(columns, b->csv);
    return 0;
}

/* Empty where there is no number. */
static void put(FILE *f, const char *format, double value)
{
    fputc(',', f);
    if (isfinite(value))
        fprintf(f, format, value);
}

static void put_goal(FILE *f, double goal)
{
    put(f, "%g", goal > 0.0 ? goal : NAN);
}

static void put_measured(FILE *f, const struct bench_result *r)
{
    const struct bench_cost *c = &r->cost;
    const struct bench_score *s = &r->score;
    const double seconds[] = {c->plan_s,  c->compress_s, c->look_s, c->stack_s,
                              c->image_s, c->total_s,    c->cpu_s};
    const double centimetres[] = {s->lateral_m,  s->lateral_worst_m, s->depth_m,
                                  s->width_m[0], s->width_m[1],      s->width_m[2]};
    for (size_t i = 0; i < sizeof seconds / sizeof *seconds; i++)
        put(f, "%.5f", seconds[i]);
    put(f, "%.1f", 1e-6 * c->memory_bytes);
    for (size_t i = 0; i < sizeof centimetres / sizeof *centimetres; i++)
        put(f, "%.4f", 100.0 * centimetres[i]);
    put(f, "%.2f", s->sidelobe_db);
    put(f, "%.4f", s->iou);
    put(f, "%.4f", s->correlation);
}

static void put_result(FILE *f, const struct bench_result *r)
{
    static const char *const states[] = {"done", "skipped", "impossible"};
    const struct bench_case *c = &r->c;
    fprintf(f, "%s,%s,\"%s\",1/%zu,1/%zu,%g,", r->scene, c->method, c->varied,
            c->speaker_stride, c->position_stride, c->step);
    if (c->band_hz[1] > 0.0)
        fprintf(f, "%g,%g,", c->band_hz[0], c->band_hz[1]);
    else
        fputs(",,", f);
    if (c->iterations)
        fprintf(f, "%zu", c->iterations);
    put_goal(f, 1e3 * c->budget_s);
    put_goal(f, 100.0 * c->error_m);
    fprintf(f, ",%zu,%zu,%zu,%s", c->threads, r->voxels, r->pairs, states[r->state]);
    if (r->state == BENCH_DONE)
        put_measured(f, r);
    else
        fputs(",,,,,,,,,,,,,,,,,", f);
    fputs(",\"", f);
    for (const char *q = r->note; *q; q++)
        fputc(*q == '"' ? '\'' : *q, f);
    fputs("\"\n", f);
}

int bench_results_add(struct bench_results *b, const struct bench_result *r,
                      struct error *why)
{
    if (list_grow(&b->r, b->n, &b->room, sizeof *b->r))
        return error_say(why, -ENOMEM, "out of memory");
    b->r[b->n++] = *r;
    put_result(b->csv, r);
    return fflush(b->csv) ? error_say(why, -errno, "speed-error.csv: %s", strerror(errno))
                          : 0;
}

bool bench_result_counts(const struct bench_result *r, const char *scene)
{
    return r->state == BENCH_DONE && !strcmp(r->scene, scene) &&
           strncmp(r->c.varied, "growth", 6) && isfinite(bench_score_error(&r->score));
}

void bench_results_front(const struct bench_results *b, const char *scene, bool *front)
{
    for (size_t i = 0; i < b->n; i++) {
        double error = bench_score_error(&b->r[i].score);
        front[i] = bench_result_counts(&b->r[i], scene);
        for (size_t k = 0; front[i] && k < b->n; k++) {
            if (k == i || !bench_result_counts(&b->r[k], scene))
                continue;
            double other = bench_score_error(&b->r[k].score);
            double faster_s = b->r[i].cost.total_s - b->r[k].cost.total_s;
            if (faster_s >= 0.0 && other <= error && (faster_s > 0.0 || other < error))
                front[i] = false;
        }
    }
}

const struct bench_result *bench_results_fast(const struct bench_results *b,
                                              const char *scene)
{
    for (size_t i = 0; i < b->n; i++)
        if (bench_result_counts(&b->r[i], scene) && !strcmp(b->r[i].c.method, "fast") &&
            !strcmp(b->r[i].c.varied, "base"))
            return &b->r[i];
    return NULL;
}

const struct bench_result *bench_results_rival(const struct bench_results *b,
                                               const struct bench_result *r)
{
    const struct bench_result *best = NULL;
    if (r->c.in_time_of_fast)
        return bench_results_fast(b, r->scene);
    for (size_t i = 0; i < b->n; i++) {
        const struct bench_result *f = &b->r[i];
        if (!bench_result_counts(f, r->scene) || strcmp(f->c.method, "fast") ||
            f->cost.total_s > r->cost.total_s)
            continue;
        if (!best || bench_score_error(&f->score) < bench_score_error(&best->score))
            best = f;
    }
    return best;
}

void bench_results_close(struct bench_results *b)
{
    if (b->csv)
        fclose(b->csv);
    free(b->r);
    memset(b, 0, sizeof *b);
}
