#include "nodes/anlos/bench/case.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/bench/memory.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/stopwatch.h"
#include "nodes/rt/compressor.h"
#include "nodes/rt/processing.h"

#define MARGIN_M       0.05
#define DEPTH_MARGIN_M 0.25
#define MAX_RUNS       7
#define DIVIDES        1.6 /* a step may shrink or grow so much to divide the stage's */

int bench_case_grid(struct grid *out, const struct bench_scene *s, double step)
{
    struct geometry g;
    double min[3], max[3], depth[2], width[3], limits[3][3];
    double band_hz[2] = {fmin(s->survey.chirp_start_hz, s->survey.chirp_stop_hz),
                         fmax(s->survey.chirp_start_hz, s->survey.chirp_stop_hz)};
    processing_geometry(&g, &s->survey);
    if (!bench_truth_depth(&s->truth, depth))
        return -EINVAL;
    geometry_aperture(&g, min, max);
    geometry_resolution(&g, band_hz, 0.5 * (depth[0] + depth[1]) - max[2], width);
    for (int a = 0; a < 3; a++) {
        limits[a][0] = a < 2 ? min[a] - MARGIN_M : depth[0] - DEPTH_MARGIN_M;
        limits[a][1] = a < 2 ? max[a] + MARGIN_M : depth[1] + DEPTH_MARGIN_M;
        limits[a][2] = isfinite(width[a]) ? step * width[a] : limits[a][1] - limits[a][0];
    }
    double pitch_m =
        g.n_positions > 1 ? fabs(g.stage_positions_m[1] - g.stage_positions_m[0]) : 0.0;
    if (fabs(g.stage_axis[0]) > 0.999 && pitch_m * DIVIDES > limits[0][2])
        limits[0][2] = pitch_m / fmax(rint(pitch_m / limits[0][2]), 1.0);
    return grid_from_limits(out, (const double(*)[3])limits);
}

double bench_case_predict(const struct bench_case *c, size_t voxels, size_t pairs,
                          const struct bench_result *known)
{
    double v = (double)voxels / (double)known->voxels;
    double p = (double)pairs / (double)known->pairs;
    double threads = (double)known->c.threads / (double)c->threads;
    bool product = !strcmp(c->method, "backprojection") ||
                   !strcmp(c->method, "incoherent") || !strcmp(c->method, "sparse");
    double image = known->cost.image_s * v * (product ? p : 1.0);
    return threads * (image + (known->cost.compress_s + known->cost.stack_s) * p);
}

/* -- a run ------------------------------------------------------------------------------
 */

struct worker {
    struct compressor *compressor;
    float *difference;     /* [n_microphones][stride], zeros after the recording's end */
    float complex *traces; /* [n_microphones][n] */
    struct stopwatch compress, stack;
};

struct run {
    const struct bench_scene *scene;
    const struct bench_case *c;
    struct survey survey; /* what is used of the scene's */
    struct processing processing;
    struct imager_options options;
    size_t stride; /* frames of the recording, or more where the last ping's end lies */
    struct pool *pool;
    struct imager *imager;
    struct worker *workers; /* [c->threads] */
    float *intensity;
};

/* Keeps every so manieth of both. */
static void thin_out(struct survey *s, const struct bench_case *c)
{
    size_t n = 0;
    for (size_t j = 0; j < s->n_speakers; j += c->speaker_stride)
        memmove(s->speakers_m[n++], s->speakers_m[j], sizeof *s->speakers_m);
    s->n_speakers = n;
    n = 0;
    for (size_t k = 0; k < s->n_positions; k += c->position_stride)
        s->stage_positions_m[n++] = s->stage_positions_m[k];
    s->n_positions = n;
}

static int plan_survey(struct run *r, struct complaint *why)
{
    struct grid grid;
    int err = bench_case_grid(&grid, r->scene, r->c->step);
    if (err)
        return complain(why, err, "a grid of %g widths: %s", r->c->step, strerror(-err));
    if (survey_copy(&r->survey, &r->scene->survey))
        return complain(why, -ENOMEM, "out of memory");
    if (r->survey.pings_m)
        return complain(why, -EINVAL, "expected an array that a stage carries");
    thin_out(&r->survey, r->c);
    r->survey.has_gate = false;
    r->survey.has_volume = true;
    for (int a = 0; a < 3; a++) {
        double *v = r->survey.volume_m[a];
        v[0] = grid.origin_m[a];
        v[1] = v[0] + grid.step_m[a] * (double)(grid.n[a] - 1);
        v[2] = grid.step_m[a];
    }
    err = processing_plan(&r->processing, &r->survey, why);
    if (!err && r->c->band_hz[1] > 0.0)
        memcpy(r->processing.band_hz, r->c->band_hz, sizeof r->c->band_hz);
    imager_options_default(&r->options);
    if (r->c->iterations) {
        r->options.iterations = r->c->iterations;
        r->processing.imaging = &r->options;
    }
    return err;
}

static int plan_worker(struct run *r, struct worker *w, struct trace_format *format,
                       struct complaint *why)
{
    size_t n_mics = r->survey.n_microphones;
    int err = compressor_create(&w->compressor, &r->processing, &r->survey,
                                COMPRESSION_MATCHED_FILTER, WINDOW_HANN, why);
    if (err)
        return err;
    compressor_format(w->compressor, format);
    w->difference = calloc(n_mics * r->stride, sizeof *w->difference);
    w->traces = malloc(n_mics * format->n_samples * sizeof *w->traces);
    return w->difference && w->traces ? 0 : complain(why, -ENOMEM, "out of memory");
}

static int plan(struct run *r, struct complaint *why)
{
    struct trace_format format;
    int err = plan_survey(r, why);
    if (err)
        return err;
    size_t last = (r->survey.n_speakers - 1) * r->c->speaker_stride;
    size_t end = last * r->survey.slot_samples + r->processing.ping_samples;
    r->stride = end > r->scene->frames ? end : r->scene->frames;
    r->workers = calloc(r->c->threads, sizeof *r->workers);
    r->intensity = calloc(grid_size(&r->processing.grid), sizeof *r->intensity);
    if (!r->workers || !r->intensity)
        return complain(why, -ENOMEM, "out of memory");
    err = pool_create(&r->pool, r->c->threads);
    if (err)
        return complain(why, err, "%zu threads: %s", r->c->threads, strerror(-err));
    for (size_t t = 0; !err && t < r->c->threads; t++)
        err = plan_worker(r, &r->workers[t], &format, why);
    if (!err)
        err = processing_imager(&r->imager, &r->processing, r->c->method, &format,
                                r->pool, why);
    return err;
}

static void release(struct run *r)
{
    imager_destroy(r->imager);
    for (size_t t = 0; r->workers && t < r->c->threads; t++) {
        compressor_destroy(r->workers[t].compressor);
        free(r->workers[t].difference);
        free(r->workers[t].traces);
    }
    free(r->workers);
    free(r->intensity);
    pool_destroy(r->pool);
    survey_clear(&r->survey);
}

/* Scene less background, from frame `from` to `to` of each microphone. */
static void subtract(const struct run *r, float *out, size_t position, size_t from,
                     size_t to)
{
    size_t frames = r->scene->frames, n_mics = r->survey.n_microphones;
    size_t start = position * n_mics * frames;
    to = to < frames ? to : frames;
    if (from >= to)
        return;
    for (size_t i = 0; i < n_mics; i++) {
        const float *a = r->scene->scene + start + i * frames;
        float *o = out + i * r->stride;
        if (!r->scene->background) {
            memcpy(o + from, a + from, (to - from) * sizeof *o);
            continue;
        }
        const float *b = r->scene->background + start + i * frames;
        for (size_t q = from; q < to; q++)
            o[q] = a[q] - b[q];
    }
}

static void process_position(void *ctx, size_t position, size_t thread)
{
    struct run *r = ctx;
    struct worker *w = &r->workers[thread];
    size_t done = 0;
    struct stopwatch now = stopwatch_now(true);
    if (interrupt_requested())
        return;
    for (size_t j = 0; j < r->survey.n_speakers; j++) {
        size_t start = j * r->c->speaker_stride * r->survey.slot_samples;
        size_t end = start + r->processing.ping_samples;
        subtract(r, w->difference, position * r->c->position_stride,
                 done > start ? done : start, end);
        done = end;
        compressor_execute(w->compressor, w->difference + start, r->stride, w->traces);
        stopwatch_lap(&w->compress, &now, true);
        imager_add(r->imager, position, j, w->traces, NULL);
        stopwatch_lap(&w->stack, &now, true);
    }
}

/* Once from recordings to volume. */
static struct bench_cost once(struct run *r)
{
    struct bench_cost cost = {0};
    struct stopwatch all = {0}, pings = {0}, image = {0};
    double compress_s = 0.0, stack_s = 0.0;
    for (size_t t = 0; t < r->c->threads; t++)
        r->workers[t].compress = r->workers[t].stack = (struct stopwatch){0};
    imager_reset(r->imager);
    struct stopwatch now = stopwatch_now(false), began = now;
    pool_run(r->pool, r->survey.n_positions, process_position, r);
    stopwatch_lap(&pings, &now, false);
    imager_image(r->imager, r->intensity);
    stopwatch_lap(&image, &now, false);
    stopwatch_lap(&all, &began, false);
    for (size_t t = 0; t < r->c->threads; t++) {
        compress_s += r->workers[t].compress.wall_s;
        stack_s += r->workers[t].stack.wall_s;
    }
    double share = compress_s + stack_s > 0.0 ? compress_s / (compress_s + stack_s) : 0.0;
    cost.compress_s = pings.wall_s * share;
    cost.stack_s = pings.wall_s - cost.compress_s;
    cost.image_s = image.wall_s;
    cost.total_s = all.wall_s;
    cost.cpu_s = all.cpu_s;
    return cost;
}

static int measure(struct bench_result *out, struct run *r, double patience_s,
                   struct complaint *why)
{
    double spent_s = 0.0, plan_s = out->cost.plan_s;
    for (int i = 0; i < MAX_RUNS && (!i || spent_s < patience_s); i++) {
        struct bench_cost cost = once(r);
        if (interrupt_requested())
            return complain(why, -EINTR, "interrupted");
        if (!i || cost.total_s < out->cost.total_s)
            out->cost = cost;
        spent_s += cost.total_s;
    }
    out->cost.plan_s = plan_s;
    double window_m[4];
    struct geometry g;
    processing_geometry(&g, &r->scene->survey);
    bench_score_window(window_m, &g);
    int err = bench_score(&out->score, &r->scene->truth, window_m, &r->processing.grid,
                          r->intensity);
    return err ? complain(why, err, "errors: %s", strerror(-err)) : 0;
}

int bench_case_run(struct bench_result *out, const struct bench_scene *s,
                   const struct bench_case *c, double patience_s, struct complaint *why)
{
    struct run r = {.scene = s, .c = c};
    *out = (struct bench_result){.c = *c};
    memcpy(out->scene, s->name, sizeof out->scene);
    double held = bench_memory_begin();
    struct stopwatch planning = {0}, now = stopwatch_now(false);
    int err = plan(&r, why);
    stopwatch_lap(&planning, &now, false);
    out->cost.plan_s = planning.wall_s;
    out->voxels = grid_size(&r.processing.grid);
    out->pairs = r.survey.n_speakers * r.survey.n_microphones * r.survey.n_positions;
    if (err == -ENOTSUP || err == -EINVAL) {
        out->state = BENCH_IMPOSSIBLE;
        snprintf(out->note, sizeof out->note, "%.180s", why->text);
        err = 0;
    } else if (!err) {
        err = measure(out, &r, patience_s, why);
        out->cost.memory_bytes = bench_memory_end(held);
    }
    release(&r);
    return err;
}
