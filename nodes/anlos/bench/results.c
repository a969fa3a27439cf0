#include "nodes/anlos/bench/results.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char columns[] =
    "scene,method,varied,speakers,positions,step_widths,band_low_hz,band_high_hz,"
    "iterations,budget_ms,error_goal_cm,threads,voxels,pairs,state,plan_s,compress_s,"
    "look_s,stack_s,image_s,total_s,"
    "cpu_s,memory_mb,lateral_cm,lateral_worst_cm,depth_cm,width_x_cm,width_y_cm,"
    "width_z_cm,sidelobe_db,iou,correlation,note\n";

int bench_results_open(struct bench_results *b, const char *folder, struct complaint *why)
{
    char path[PATH_MAX];
    *b = (struct bench_results){0};
    if (snprintf(path, sizeof path, "%s/speed-error.csv", folder) >= (int)sizeof path)
        return complain(why, -ENAMETOOLONG, "%s: path too long", folder);
    unlink(path); /* and not through a link that somebody has put there */
    b->csv = fopen(path, "wxe");
    if (!b->csv)
        return complain(why, -errno, "%s: %s", path, strerror(errno));
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
                      struct complaint *why)
{
    if (b->n == b->room) {
        size_t room = b->room ? 2 * b->room : 64;
        struct bench_result *more = realloc(b->r, room * sizeof *more);
        if (!more)
            return complain(why, -ENOMEM, "out of memory");
        b->r = more;
        b->room = room;
    }
    b->r[b->n++] = *r;
    put_result(b->csv, r);
    return fflush(b->csv) ? complain(why, -errno, "speed-error.csv: %s", strerror(errno))
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
