#include "nodes/anlos/speed_error/chart.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/speed_error/results.h"
#include "nodes/rt/export_chart.h"

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

static int by_time(const void *a, const void *b)
{
    const struct bench_result *x = *(const struct bench_result *const *)a;
    const struct bench_result *y = *(const struct bench_result *const *)b;
    return (x->cost.total_s > y->cost.total_s) - (x->cost.total_s < y->cost.total_s);
}

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
