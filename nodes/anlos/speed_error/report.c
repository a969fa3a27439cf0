/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/speed_error/report.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>

#include "dsp/error.h"
#include "nodes/anlos/recon/auto.h"
#include "nodes/anlos/speed_error/results.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_chart.h"

/* What figures were measured on. */

#ifdef __clang__
#define COMPILER __VERSION__ /* says its name itself */
#else
#define COMPILER "gcc " __VERSION__
#endif

static void find_processor(char *text, size_t size)
{
    FILE *f = fopen("/proc/cpuinfo", "r");
    char line[256];
    snprintf(text, size, "unknown processor");
    while (f && fgets(line, sizeof line, f)) {
        const char *value = strchr(line, ':');
        if (strncmp(line, "model name", 10) || !value)
            continue;
        value += 1 + strspn(value + 1, " \t");
        snprintf(text, size, "%.*s", (int)strcspn(value, "\n"), value);
        break;
    }
    if (f)
        fclose(f);
}

/* "AMD EPYC 7763, 2 processors, Linux 6.1; gcc 12.2.0; FFTW 3.3.10". */
static void bench_machine(char *text, size_t size)
{
    char processor[128];
    struct utsname system = {.sysname = "?"};
    size_t n = usage_default_threads();
    find_processor(processor, sizeof processor);
    uname(&system);
    snprintf(text, size, "%s, %zu processor%s, %s %s; %s; %s", processor, n,
             n == 1 ? "" : "s", system.sysname, system.release, COMPILER, fftwf_version);
}

#define WORSE 1.1 /* times the error of fast: more, and auto has chosen badly */

void bench_table_setting(const struct bench_case *c, char *text, size_t size)
{
    if (c->in_time_of_fast && !(c->budget_s > 0.0))
        snprintf(text, size, "in the time of fast");
    else if (c->in_time_of_fast)
        snprintf(text, size, "in the time of fast, %.0f ms", 1e3 * c->budget_s);
    else if (c->budget_s > 0.0)
        snprintf(text, size, "within %g ms", 1e3 * c->budget_s);
    else if (c->error_m > 0.0)
        snprintf(text, size, "error %g cm", 100.0 * c->error_m);
    else if (!strcmp(c->method, recon_auto_name))
        snprintf(text, size, "no goal");
    else
        snprintf(text, size, "step %.2f", c->step);
    if (c->speaker_stride > 1)
        text_add(text, size, ", ", "1/%zu of the speakers", c->speaker_stride);
    if (c->position_stride > 1)
        text_add(text, size, ", ", "1/%zu of the positions", c->position_stride);
    if (c->band_hz[1] > 0.0)
        text_add(text, size, ", ", "%g-%g kHz", 1e-3 * c->band_hz[0],
                 1e-3 * c->band_hz[1]);
    if (c->iterations)
        text_add(text, size, ", ", "%zu iterations", c->iterations);
    text_add(text, size, ", ", "%zu thread%s", c->threads, c->threads == 1 ? "" : "s");
}

static void put_row(FILE *f, const struct bench_result *r)
{
    const struct bench_score *s = &r->score;
    char setting[160];
    bench_table_setting(&r->c, setting, sizeof setting);
    fprintf(f, "| `%s` | %s | %.3f | %.3f |", r->c.method, setting, r->cost.total_s,
            r->cost.plan_s);
    if (isfinite(r->cost.memory_bytes))
        fprintf(f, " %.0f |", 1e-6 * r->cost.memory_bytes);
    else
        fputs(" |", f);
    if (isnan(s->iou))
        fprintf(f, " %.3f | %.1f x %.1f x %.1f | %.1f |\n", 100.0 * s->lateral_m,
                100.0 * s->width_m[0], 100.0 * s->width_m[1], 100.0 * s->width_m[2],
                s->sidelobe_db);
    else
        fprintf(f, " %.3f | %.3f |\n", s->iou, s->correlation);
}

static void put_head(FILE *f, bool points)
{
    fputs("| method | parameters | time s | planning s | memory MB |", f);
    fputs(points ? " lateral cm | widths cm | sidelobe dB |\n" : " IoU | correlation |\n",
          f);
    fputs("|---|---|---|---|---|---|---|", f);
    fputs(points ? "---|\n" : "\n", f);
}

static int by_time(const void *a, const void *b)
{
    const struct bench_result *x = *(const struct bench_result *const *)a;
    const struct bench_result *y = *(const struct bench_result *const *)b;
    return (x->cost.total_s > y->cost.total_s) - (x->cost.total_s < y->cost.total_s);
}

static int put_front(FILE *f, const struct bench_results *b, const char *scene)
{
    bool *front = calloc(b->n, sizeof *front);
    const struct bench_result **sorted = calloc(b->n, sizeof(void *));
    size_t n = 0;
    if (front && sorted) {
        bench_results_front(b, scene, front);
        for (size_t i = 0; i < b->n; i++)
            if (front[i])
                sorted[n++] = &b->r[i];
        qsort(sorted, n, sizeof *sorted, by_time);
        fputs("\nNothing is both faster and less wrong than these (Pareto front):\n\n",
              f);
        put_head(f, n && isnan(sorted[0]->score.iou));
        for (size_t i = 0; i < n; i++)
            put_row(f, sorted[i]);
    }
    int err = front && sorted ? 0 : -ENOMEM;
    free(front);
    free(sorted);
    return err;
}

/* In the unit of bench_score_error. */
static void put_error(FILE *f, const struct bench_result *r)
{
    fprintf(f, isnan(r->score.iou) ? " %.3f cm |" : " %.3f |",
            bench_score_error(&r->score));
}

/* The error that was allowed, in the unit of bench_score_error; of letters it is none. */
static double goal_of(const struct bench_result *r)
{
    return isnan(r->score.iou) ? 100.0 * r->c.error_m : 0.0;
}

/* Is auto worth it?  What is less exact than fast was asked to be no more exact. */
static void put_automatic(FILE *f, const struct bench_results *b, const char *scene)
{
    bool headed = false;
    for (size_t i = 0; i < b->n; i++) {
        const struct bench_result *r = &b->r[i];
        char setting[160];
        if (!bench_result_counts(r, scene) || strcmp(r->c.method, recon_auto_name))
            continue;
        if (!headed)
            fprintf(f,
                    "\n`auto` in the time that `fast` takes (plan and image) beside "
                    "`fast`; with other\ngoals beside the best that any parameters of "
                    "`fast` gave in the time it took, picked\nby those who know the "
                    "truth (error: %s):\n\n"
                    "| goal | chose | time s | error | fast: time s | error | worse by "
                    "10%% |\n|---|---|---|---|---|---|---|\n",
                    isnan(r->score.iou) ? "mean lateral" : "1 - IoU");
        headed = true;
        bench_table_setting(&r->c, setting, sizeof setting);
        fprintf(f, "| %s | %s | %.3f |", setting, r->note, r->cost.total_s);
        put_error(f, r);
        const struct bench_result *rival = bench_results_rival(b, r);
        if (!rival) {
            fputs(" none so soon | | no |\n", f);
            continue;
        }
        fprintf(f, " %.3f |", rival->cost.total_s);
        put_error(f, rival);
        double limit = fmax(WORSE * bench_score_error(&rival->score), goal_of(r));
        fputs(bench_score_error(&r->score) > limit ? " yes |\n" : " no |\n", f);
    }
}

static void put_not_done(FILE *f, const struct bench_results *b, const char *scene)
{
    bool any = false;
    for (size_t i = 0; i < b->n; i++) {
        const struct bench_result *r = &b->r[i];
        char setting[160];
        if (r->state == BENCH_DONE || strcmp(r->scene, scene))
            continue;
        if (!any)
            fputs("\nNot done:\n\n", f);
        any = true;
        bench_table_setting(&r->c, setting, sizeof setting);
        fprintf(f, "- `%s`, %s: %s\n", r->c.method, setting, r->note);
    }
}

static int put_scene(FILE *f, const struct bench_results *b, const char *scene)
{
    bool headed = false;
    fprintf(f, "\n## %s\n\nThe base point of each method:\n\n", scene);
    for (size_t i = 0; i < b->n; i++) {
        const struct bench_result *r = &b->r[i];
        if (!bench_result_counts(r, scene) || strcmp(r->c.varied, "base"))
            continue;
        if (!headed)
            put_head(f, isnan(r->score.iou));
        headed = true;
        put_row(f, r);
    }
    put_automatic(f, b, scene);
    int err = put_front(f, b, scene);
    put_not_done(f, b, scene);
    return err;
}

static void put_growth(FILE *f, const struct bench_results *b)
{
    bool headed = false;
    for (size_t i = 0; i < b->n; i++) {
        const struct bench_result *r = &b->r[i];
        if (strncmp(r->c.varied, "growth", 6) || r->state != BENCH_DONE)
            continue;
        if (!headed)
            fputs("\n## Growth\n\n"
                  "| method | of | work | voxels | pairs | time s | memory MB |\n"
                  "|---|---|---|---|---|---|---|\n",
                  f);
        headed = true;
        fprintf(f, "| `%s` | %s | %.0f | %zu | %zu | %.3f | %.0f |\n", r->c.method,
                r->c.varied + strlen("growth, "), bench_plan_work(&r->c), r->voxels,
                r->pairs, r->cost.total_s, 1e-6 * r->cost.memory_bytes);
    }
}

static void put_noise(FILE *f, const struct bench_noise *noise)
{
    const char *m = noise->methods;
    fprintf(f,
            "\n## Noise\n\nOne point, lateral error in cm, rms over %zu seeds, over raw "
            "signal to noise:\n\n| method |",
            noise->n_seeds);
    for (size_t k = 0; k < noise->n_levels; k++)
        fprintf(f, " %g dB |", noise->snr_db[k]);
    fputs("\n|---|", f);
    for (size_t k = 0; k < noise->n_levels; k++)
        fputs("---|", f);
    for (size_t i = 0; i < noise->n_methods; i++, m += strlen(m) + 1) {
        fprintf(f, "\n| `%s` |", m);
        for (size_t k = 0; k < noise->n_levels; k++)
            fprintf(f, " %.3g |", 100.0 * noise->lateral_m[i][k]);
    }
    fputs("\n| Cramer-Rao bound |", f);
    for (size_t k = 0; k < noise->n_levels; k++)
        fprintf(f, " %.3g |", 100.0 * noise->unknown[k].lateral_m);
    fputs("\n", f);
}

int bench_table_write(const struct bench_results *b, const struct bench_noise *noise,
                      const char *remark, const char *folder, struct error *why)
{
    struct export_file e;
    char machine[512];
    int err = export_file_open(&e, folder, "speed-error.md", why);
    if (err)
        return err;
    bench_machine(machine, sizeof machine);
    fprintf(e.f,
            "# Speed against error\n\n%s\n\nTime is from both recordings in memory to "
            "the volume, the fastest of some runs; step is the grid's, in -6 dB widths "
            "of a point. Every run is in speed-error.csv.\n",
            machine);
    if (remark)
        fprintf(e.f, "\n**%s**\n", remark);
    for (size_t i = 0; !err && i < b->n; i++) {
        bool seen = false;
        for (size_t k = 0; k < i; k++)
            seen = seen || !strcmp(b->r[k].scene, b->r[i].scene);
        if (!seen)
            err = put_scene(e.f, b, b->r[i].scene);
    }
    put_growth(e.f, b);
    if (noise && noise->n_seeds)
        put_noise(e.f, noise);
    return err ? export_file_abandon(&e, err, why) : export_file_commit(&e, why);
}

/* -- the pictures, each as SVG and PNG --------------------------------------------------
 */

#define MAX_METHODS 16
#define LEAST_ERROR 1e-3 /* of a logarithmic axis */

static const enum chart_style marks[] = {CHART_POINTS,   CHART_SQUARES, CHART_TRIANGLES,
                                         CHART_DIAMONDS, CHART_CROSSES, CHART_RINGS};

#define MARKS (sizeof marks / sizeof *marks)

/* Points of one or more series, one behind the other. */
struct drawing {
    size_t n, room;
    double *x, *y;
    size_t n_series, first[2 * MAX_METHODS + 4];
    struct chart_series series[2 * MAX_METHODS + 4];
    struct chart chart;
};

static int drawing_begin(struct drawing *d, size_t room)
{
    memset(d, 0, sizeof *d);
    d->room = room;
    d->x = malloc((room + 1) * sizeof *d->x);
    d->y = malloc((room + 1) * sizeof *d->y);
    for (int a = 0; a < 2; a++) {
        d->chart.min[a] = INFINITY;
        d->chart.max[a] = -INFINITY;
        d->chart.logarithmic[a] = true;
    }
    d->chart.legend_beside = true;
    return d->x && d->y ? 0 : -ENOMEM;
}

static void drawing_series(struct drawing *d, const char *name, enum chart_style style,
                           int colour)
{
    d->first[d->n_series] = d->n;
    d->series[d->n_series++] =
        (struct chart_series){.name = name, .style = style, .colour = colour};
}

static void drawing_point(struct drawing *d, double x, double y)
{
    if (d->n == d->room || !isfinite(x) || !isfinite(y))
        return;
    d->x[d->n] = x;
    d->y[d->n++] = y;
    d->chart.min[0] = fmin(d->chart.min[0], x);
    d->chart.max[0] = fmax(d->chart.max[0], x);
    d->chart.min[1] = fmin(d->chart.min[1], y);
    d->chart.max[1] = fmax(d->chart.max[1], y);
}

/* Room around what is drawn. */
static void widen(struct chart *c, int axis, double factor)
{
    if (c->logarithmic[axis]) {
        c->min[axis] /= factor;
        c->max[axis] *= factor;
    } else {
        double room = (factor - 1.0) * (c->max[axis] - c->min[axis]);
        c->min[axis] -= room;
        c->max[axis] += room;
    }
}

/* Draws what has points and lets it go. */
static int drawing_end(struct drawing *d, const char *folder, const char *name,
                       struct error *why)
{
    int err = 0;
    for (size_t i = 0; i < d->n_series; i++) {
        size_t end = i + 1 < d->n_series ? d->first[i + 1] : d->n;
        d->series[i].x = d->x + d->first[i];
        d->series[i].y = d->y + d->first[i];
        d->series[i].n = end - d->first[i];
        bool line = d->series[i].style == CHART_LINE ||
                    d->series[i].style == CHART_DASHED;
        if (d->series[i].n < (line ? 2 : 1))
            d->series[i].name = NULL; /* nothing of it is seen */
    }
    d->chart.series = d->series;
    d->chart.n_series = d->n_series;
    if (d->n)
        err = export_chart(folder, name, &d->chart, why);
    free(d->x);
    free(d->y);
    return err;
}

/* Names of methods in the order of their first runs. */
static size_t list_methods(const struct bench_results *b, const char *names[MAX_METHODS])
{
    size_t n = 0;
    for (size_t i = 0; i < b->n; i++) {
        bool seen = false;
        for (size_t k = 0; k < n; k++)
            seen = seen || !strcmp(names[k], b->r[i].c.method);
        if (!seen && n < MAX_METHODS)
            names[n++] = b->r[i].c.method;
    }
    return n;
}

/* -- error over time --------------------------------------------------------------------
 */

static double drawn_error(const struct bench_result *r)
{
    return fmax(bench_score_error(&r->score), LEAST_ERROR);
}

/* As stairs: up to the next point, what was reached before is the best. */
static int draw_front(struct drawing *d, const struct bench_results *b, const char *scene)
{
    bool *front = calloc(b->n, sizeof *front);
    const struct bench_result **sorted = calloc(b->n, sizeof(void *));
    size_t n = 0;
    if (front && sorted)
        bench_results_front(b, scene, front);
    for (size_t i = 0; front && sorted && i < b->n; i++)
        if (front[i])
            sorted[n++] = &b->r[i];
    if (n)
        qsort(sorted, n, sizeof *sorted, by_time);
    drawing_series(d, "Pareto front", CHART_LINE, CHART_COLOURS - 1);
    for (size_t i = 0; i < n; i++) {
        if (i)
            drawing_point(d, sorted[i]->cost.total_s, drawn_error(sorted[i - 1]));
        drawing_point(d, sorted[i]->cost.total_s, drawn_error(sorted[i]));
    }
    drawing_series(d, NULL, CHART_RINGS, CHART_COLOURS - 1);
    for (size_t i = 0; i < n; i++)
        drawing_point(d, sorted[i]->cost.total_s, drawn_error(sorted[i]));
    int err = front && sorted ? 0 : -ENOMEM;
    free(front);
    free(sorted);
    return err;
}

int bench_chart_scene(const struct bench_results *b, const char *scene,
                      const char *folder, struct error *why)
{
    const char *methods[MAX_METHODS];
    size_t n = list_methods(b, methods);
    bool letters = false;
    struct drawing d;
    char name[96], title[96];
    int err = drawing_begin(&d, 4 * b->n);
    if (!err)
        err = draw_front(&d, b, scene);
    for (size_t m = 0; !err && m < n; m++) {
        drawing_series(&d, methods[m], marks[m % (MARKS - 1)],
                       (int)(m % (CHART_COLOURS - 1)));
        for (size_t i = 0; i < b->n; i++) {
            const struct bench_result *r = &b->r[i];
            if (!bench_result_counts(r, scene) || strcmp(r->c.method, methods[m]))
                continue;
            letters = letters || isfinite(r->score.iou);
            drawing_point(&d, r->cost.total_s, drawn_error(r));
        }
    }
    snprintf(title, sizeof title, "Error over time: %.64s", scene);
    snprintf(name, sizeof name, "speed-error-%.64s", scene);
    d.chart.title = title;
    d.chart.label[0] = "time from recordings to image (s)";
    d.chart.label[1] = letters ? "1 - IoU" : "mean lateral error (cm)";
    widen(&d.chart, 0, 1.3);
    widen(&d.chart, 1, 1.3);
    if (err)
        error_say(why, err, "out of memory");
    int drawn = drawing_end(&d, folder, name, why);
    return err ? err : drawn;
}

/* -- noise ------------------------------------------------------------------------------
 */

static int draw_noise(const struct bench_noise *b, bool depth, const char *folder,
                      struct error *why)
{
    struct drawing d;
    if (drawing_begin(&d, (2 * b->n_methods + 1) * b->n_levels)) {
        free(d.x);
        free(d.y);
        return error_say(why, -ENOMEM, "out of memory");
    }
    const char *m = b->methods;
    for (size_t i = 0; i < b->n_methods; i++, m += strlen(m) + 1) {
        for (int marked = 0; marked < 2; marked++) {
            drawing_series(&d, marked ? m : NULL, marked ? marks[i % MARKS] : CHART_LINE,
                           (int)(i % (CHART_COLOURS - 1)));
            for (size_t k = 0; k < b->n_levels; k++)
                drawing_point(&d, b->snr_db[k],
                              1e3 * (depth ? b->depth_m : b->lateral_m)[i][k]);
        }
    }
    double least = d.chart.min[1]; /* the bound may leave below */
    drawing_series(&d, "Cram\303\251r-Rao bound", CHART_DASHED, CHART_COLOURS - 1);
    for (size_t k = 0; k < b->n_levels; k++)
        drawing_point(&d, b->snr_db[k],
                      1e3 * (depth ? b->unknown[k].depth_m : b->unknown[k].lateral_m));
    d.chart.min[1] = 0.5 * least;
    d.chart.logarithmic[0] = false;
    d.chart.title = depth ? "Depth error of one point in noise"
                          : "Lateral error of one point in noise";
    d.chart.label[0] = "raw signal to noise (dB)";
    d.chart.label[1] = depth ? "rms depth error (mm)" : "rms lateral error (mm)";
    widen(&d.chart, 0, 1.02);
    widen(&d.chart, 1, 1.5);
    return drawing_end(&d, folder, depth ? "noise-depth" : "noise-lateral", why);
}

int bench_chart_noise(const struct bench_noise *b, const char *folder, struct error *why)
{
    int err = draw_noise(b, false, folder, why);
    return err ? err : draw_noise(b, true, folder, why);
}

/* -- growth -----------------------------------------------------------------------------
 */

static int draw_growth(const struct bench_results *b, bool memory, const char *folder,
                       struct error *why)
{
    static const char *const kinds[2] = {"growth, voxels", "growth, pairs"};
    const char *methods[MAX_METHODS];
    char names[MAX_METHODS][2][64];
    size_t n = list_methods(b, methods);
    struct drawing d;
    if (drawing_begin(&d, 2 * b->n)) {
        free(d.x);
        free(d.y);
        return error_say(why, -ENOMEM, "out of memory");
    }
    for (size_t m = 0; m < n; m++) {
        for (int kind = 0; kind < 2; kind++) {
            snprintf(names[m][kind], sizeof names[m][kind], "%.32s, %s", methods[m],
                     kinds[kind] + strlen("growth, "));
            drawing_series(&d, names[m][kind], kind ? CHART_DASHED : CHART_LINE,
                           (int)(m % (CHART_COLOURS - 1)));
            for (size_t i = 0; i < b->n; i++) {
                const struct bench_result *r = &b->r[i];
                if (r->state == BENCH_DONE && !strcmp(r->c.varied, kinds[kind]) &&
                    !strcmp(r->c.method, methods[m]))
                    drawing_point(&d, bench_plan_work(&r->c),
                                  memory ? 1e-6 * r->cost.memory_bytes : r->cost.total_s);
            }
        }
    }
    d.chart.title = memory ? "Growth of memory" : "Growth of time";
    d.chart.label[0] = "work, relative to the least";
    d.chart.label[1] = memory ? "memory beside the recordings (MB)" : "time (s)";
    widen(&d.chart, 0, 1.1);
    widen(&d.chart, 1, 1.3);
    return drawing_end(&d, folder, memory ? "growth-memory" : "growth-time", why);
}

int bench_chart_growth(const struct bench_results *b, const char *folder,
                       struct error *why)
{
    int err = draw_growth(b, false, folder, why);
    return err ? err : draw_growth(b, true, folder, why);
}
