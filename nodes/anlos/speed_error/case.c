/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/speed_error/case.h"

#include <errno.h>
#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/pool.h"
#include "nodes/anlos/recon/auto.h"
#include "nodes/anlos/stopwatch.h"
#include "nodes/rt/stop.h"
#include "recon/frontend/compressor.h"
#include "recon/processing.h"

/* -- all pings of a scene in memory, less its background, to be stacked again and again
 */

struct bench_pings_config { /* all outlive the pings */
    const struct bench_scene *scene;
    const struct survey *survey; /* what is used of the scene's: */
    size_t speaker_stride, position_stride;
    const struct processing *processing;
    struct pool *pool;
};

struct worker {
    struct compressor *compressor;
    float *difference;     /* [n_microphones][stride], zeros after the recording's end */
    float complex *traces; /* [n_microphones][n] */
    struct stopwatch compress, sink;
};

struct bench_pings {
    struct bench_pings_config cfg;
    size_t ping_samples;
    size_t stride; /* frames of the recording, or more where the last ping's end lies */
    const struct recon_sink *sink;
    size_t n_workers;
    struct worker *workers; /* [n_workers] */
};

static int plan_worker(struct bench_pings *p, struct worker *w,
                       struct trace_format *format, struct error *why)
{
    size_t n_mics = p->cfg.survey->n_microphones;
    int err = compressor_create(&w->compressor, p->cfg.processing, p->cfg.survey,
                                COMPRESSION_MATCHED_FILTER, WINDOW_HANN, why);
    if (err)
        return err;
    compressor_format(w->compressor, format);
    w->difference = calloc(n_mics * p->stride, sizeof *w->difference);
    w->traces = malloc(n_mics * format->n_samples * sizeof *w->traces);
    return w->difference && w->traces ? 0 : error_say(why, -ENOMEM, "out of memory");
}

static void bench_pings_destroy(struct bench_pings *p)
{
    if (!p)
        return;
    for (size_t t = 0; p->workers && t < p->n_workers; t++) {
        compressor_destroy(p->workers[t].compressor);
        free(p->workers[t].difference);
        free(p->workers[t].traces);
    }
    free(p->workers);
    free(p);
}

/* Plans and allocates, for the length of pings and the band that processing has now.
 * 0, -EINVAL, -ERANGE, -ENOMEM. */
static int bench_pings_create(struct bench_pings **out,
                              const struct bench_pings_config *cfg,
                              struct trace_format *format, struct error *why)
{
    struct bench_pings *p = calloc(1, sizeof *p);
    if (!p)
        return error_say(why, -ENOMEM, "out of memory");
    size_t last = (cfg->survey->n_speakers - 1) * cfg->speaker_stride, frames;
    p->cfg = *cfg;
    p->ping_samples = cfg->processing->ping_samples;
    frames = survey_slot_of(cfg->survey, last) * cfg->survey->slot_samples +
             p->ping_samples;
    p->stride = frames > cfg->scene->frames ? frames : cfg->scene->frames;
    p->n_workers = pool_threads(cfg->pool);
    p->workers = calloc(p->n_workers, sizeof *p->workers);
    int err = p->workers ? 0 : error_say(why, -ENOMEM, "out of memory");
    for (size_t t = 0; !err && t < p->n_workers; t++)
        err = plan_worker(p, &p->workers[t], format, why);
    if (err) {
        bench_pings_destroy(p);
        return err;
    }
    *out = p;
    return 0;
}

/* Scene less background, from frame `from` to `to` of each microphone. */
static void subtract(const struct bench_pings *p, float *out, size_t position,
                     size_t from, size_t to)
{
    const struct bench_scene *scene = p->cfg.scene;
    size_t frames = scene->frames, n_mics = p->cfg.survey->n_microphones;
    size_t start = position * n_mics * frames;
    to = to < frames ? to : frames;
    if (from >= to)
        return;
    for (size_t i = 0; i < n_mics; i++) {
        const float *a = scene->scene + start + i * frames;
        float *o = out + i * p->stride;
        if (!scene->background) {
            memcpy(o + from, a + from, (to - from) * sizeof *o);
            continue;
        }
        const float *b = scene->background + start + i * frames;
        for (size_t q = from; q < to; q++)
            o[q] = a[q] - b[q];
    }
}

static void process_position(void *ctx, size_t position, size_t thread)
{
    struct bench_pings *p = ctx;
    const struct survey *s = p->cfg.survey;
    struct worker *w = &p->workers[thread];
    size_t done = 0;
    struct stopwatch now = stopwatch_now(true);
    if (interrupt_requested())
        return;
    for (size_t j = 0; j < s->n_speakers; j++) {
        size_t emission = j * p->cfg.speaker_stride;
        size_t start = survey_slot_of(s, emission) * s->slot_samples;
        size_t end = start + p->ping_samples;
        if (p->sink->wants && !p->sink->wants(p->sink->ctx, position, j))
            continue;
        subtract(p, w->difference, position * p->cfg.position_stride,
                 done > start ? done : start, end);
        done = end;
        compressor_execute(w->compressor, survey_is_down(s, emission),
                           w->difference + start, p->stride, w->traces);
        stopwatch_lap(&w->compress, &now, true);
        p->sink->take(p->sink->ctx, position, j, w->traces, NULL);
        stopwatch_lap(&w->sink, &now, true);
    }
}

/* All of them; fewer when a person interrupts.  Adds the wall time, in the shares that
 * compression and the sink had of the threads' time, and the threads' processor time. */
static void bench_pings_run(struct bench_pings *p, const struct recon_sink *sink,
                            struct stopwatch *compress, struct stopwatch *keep)
{
    struct stopwatch all = {0}, now = stopwatch_now(false), first = {0}, second = {0};
    p->sink = sink;
    for (size_t t = 0; t < p->n_workers; t++)
        p->workers[t].compress = p->workers[t].sink = (struct stopwatch){0};
    pool_run(p->cfg.pool, p->cfg.survey->n_positions, process_position, p);
    stopwatch_lap(&all, &now, false);
    for (size_t t = 0; t < p->n_workers; t++) {
        first.wall_s += p->workers[t].compress.wall_s;
        first.cpu_s += p->workers[t].compress.cpu_s;
        second.wall_s += p->workers[t].sink.wall_s;
        second.cpu_s += p->workers[t].sink.cpu_s;
    }
    double busy_s = first.wall_s + second.wall_s;
    double share = busy_s > 0.0 ? first.wall_s / busy_s : 0.0;
    compress->wall_s += all.wall_s * share;
    compress->cpu_s += first.cpu_s;
    keep->wall_s += all.wall_s * (1.0 - share);
    keep->cpu_s += second.cpu_s;
}

/* A run of `auto`: what `anlos recon --method auto` does between reading and detection,
 * on pings in memory. */

struct bench_image {
    struct grid grid;
    float *intensity; /* [nz][ny][nx]; free() it */
    char chosen[BENCH_NOTE_SIZE];
};

/* The most memory that a stretch of this process's work held, by what Linux counts
 * (proc(5): clear_refs, VmHWM). */

/* Bytes of a line "NAME:  123 kB" of /proc/self/status. */
static double status_bytes(const char *name)
{
    FILE *f = fopen("/proc/self/status", "r");
    char line[256];
    double kilobytes = NAN;
    size_t n = strlen(name);
    while (f && isnan(kilobytes) && fgets(line, sizeof line, f))
        if (!strncmp(line, name, n) && sscanf(line + n, ": %lf", &kilobytes) != 1)
            break;
    if (f)
        fclose(f);
    return 1024.0 * kilobytes;
}

/* Gives back what is free and starts the count; returns what is held now, in bytes.
 * NaN: this system does not tell. */
static double bench_memory_begin(void)
{
    malloc_trim(0);
    FILE *f = fopen("/proc/self/clear_refs", "w");
    if (!f)
        return NAN;
    int failed = fputs("5", f) < 0; /* forgets the high-water mark */
    failed = fclose(f) || failed;
    return failed ? NAN : status_bytes("VmRSS");
}

/* The most that was held since then, less what was held then. */
static double bench_memory_end(double began)
{
    double most = status_bytes("VmHWM");
    return isnan(most - began) ? NAN : fmax(most - began, 0.0);
}

struct automatic {
    struct bench_pings_config cfg;
    struct recon_options options;
    struct recon_job job; /* of which recon_auto sees what a recording's job has */
    struct bench_cost *cost;
};

/* Compressed and kept by an automatic that is there, or by a new one. */
static int keep_traces(struct automatic *a, struct error *why)
{
    struct recon_job *job = &a->job;
    struct bench_pings *pings = NULL;
    struct stopwatch planning = {0}, now = stopwatch_now(false);
    int err = bench_pings_create(&pings, &a->cfg, &job->format, why);
    if (!err && !job->automatic)
        err = recon_auto_create(&job->automatic, job, why);
    stopwatch_lap(&planning, &now, false);
    a->cost->plan_s += planning.wall_s;
    if (!err) {
        struct recon_sink sink = recon_auto_sink(job->automatic);
        bench_pings_run(pings, &sink, &job->stages[RECON_COMPRESS],
                        &job->stages[RECON_STACK]);
    }
    bench_pings_destroy(pings);
    return err;
}

/* What one that went before has decided stays; to plan anew takes time as well. */
static int keep_traces_again(struct automatic *a, struct error *why)
{
    struct recon_job *job = &a->job;
    struct recon_auto *first = job->automatic;
    struct bench_pings *pings = NULL;
    struct stopwatch *compress = &job->stages[RECON_COMPRESS], now = stopwatch_now(false);
    job->automatic = NULL;
    int err = bench_pings_create(&pings, &a->cfg, &job->format, why);
    if (!err)
        err = recon_auto_create(&job->automatic, job, why);
    stopwatch_lap(compress, &now, false);
    if (!err) {
        recon_auto_inherit(job, first);
        struct recon_sink sink = recon_auto_sink(job->automatic);
        bench_pings_run(pings, &sink, compress, &job->stages[RECON_STACK]);
    }
    bench_pings_destroy(pings);
    recon_auto_destroy(first);
    return err;
}

static int decide(struct automatic *a, struct error *why)
{
    struct recon_job *job = &a->job;
    enum recon_auto_next next;
    int err = recon_auto_decide(job->automatic, job, &next, why);
    if (!err && next == RECON_AUTO_MORE) {
        err = keep_traces(a, why);
        if (!err)
            err = recon_auto_decide(job->automatic, job, &next, why);
    }
    return !err && next == RECON_AUTO_OTHER_BAND ? keep_traces_again(a, why) : err;
}

static int plan_image(struct automatic *a, struct bench_image *out, struct error *why)
{
    struct recon_job *job = &a->job;
    struct stopwatch planning = {0}, now = stopwatch_now(false);
    int err;
    do
        err = processing_imager(&job->imager, &job->processing, job->method, &job->format,
                                job->pool, why);
    while (err == -ENOTSUP && recon_auto_retreat(job->automatic, job));
    out->grid = job->processing.grid;
    if (!err)
        out->intensity = calloc(grid_size(&out->grid), sizeof *out->intensity);
    if (!err && !out->intensity)
        err = error_say(why, -ENOMEM, "out of memory");
    stopwatch_lap(&planning, &now, false);
    a->cost->plan_s += planning.wall_s;
    return err;
}

static int make_image(struct automatic *a, float *intensity, struct error *why)
{
    struct stopwatch *stages = a->job.stages, now = stopwatch_now(false);
    int err = recon_auto_feed(a->job.automatic, &a->job, why);
    stopwatch_lap(&stages[RECON_STACK], &now, false);
    if (!err)
        err = imager_image(a->job.imager, intensity);
    stopwatch_lap(&stages[RECON_IMAGE], &now, false);
    return err;
}

static void tell_choice(const struct automatic *a, char *text)
{
    const struct plan *p = &a->job.automatic->plan;
    bool fast = !strcmp(p->method, "fast");
    char speakers[48] = "";
    if (p->stride > 1)
        snprintf(speakers, sizeof speakers, ", 1/%zu of the speakers", p->stride);
    snprintf(text, BENCH_NOTE_SIZE, "%s%s%s, %g-%g kHz%s, %zu x %zu x %zu voxels",
             p->method, fast && p->dip ? " with dip moveout" : "",
             p->sharpen > 0.0 ? ", sharpened" : "", 1e-3 * p->band_hz[0],
             1e-3 * p->band_hz[1], speakers, p->grid.n[0], p->grid.n[1], p->grid.n[2]);
}

static void prepare(struct automatic *a, const struct bench_pings_config *pings,
                    const struct bench_case *c, struct bench_cost *cost)
{
    a->options = (struct recon_options){
        .threads = c->threads, .budget_s = c->budget_s, .error_m = c->error_m};
    a->job.options = &a->options;
    a->job.survey = *pings->survey;
    a->job.survey.has_volume = false; /* the whole image is no wish of a user */
    a->job.processing = *pings->processing;
    a->job.pool = pings->pool;
    imager_options_default(&a->job.imaging);
    a->job.processing.imaging = &a->job.imaging;
    a->cfg = *pings;
    a->cfg.survey = &a->job.survey;
    a->cfg.processing = &a->job.processing;
    a->cost = cost;
    *cost = (struct bench_cost){0};
}

/* From recordings to volume once.  pings: its grid is the whole image, from which the
 * planner may depart.  Time: all that a method which is told what to do need not do
 * counts, also the planning of a second compression; only what is planned once for every
 * method (compression, the method's own tables) does not.  0, -ENOTSUP, -EINVAL, -EINTR,
 * -ENOMEM. */
static int bench_automatic(struct bench_image *out, struct bench_cost *cost,
                           const struct bench_pings_config *pings,
                           const struct bench_case *c, struct error *why)
{
    struct automatic a = {0};
    struct stopwatch all = {0}, now = stopwatch_now(false);
    *out = (struct bench_image){0};
    prepare(&a, pings, c, cost);
    int err = keep_traces(&a, why);
    if (!err)
        err = decide(&a, why);
    if (!err && interrupt_requested())
        err = error_say(why, -EINTR, "interrupted");
    if (!err)
        err = plan_image(&a, out, why);
    if (!err)
        err = make_image(&a, out->intensity, why);
    if (!err)
        tell_choice(&a, out->chosen);
    stopwatch_lap(&all, &now, false);
    cost->compress_s = a.job.stages[RECON_COMPRESS].wall_s;
    cost->look_s = a.job.stages[RECON_LOOK].wall_s;
    cost->stack_s = a.job.stages[RECON_STACK].wall_s;
    cost->image_s = a.job.stages[RECON_IMAGE].wall_s;
    cost->total_s = cost->compress_s + cost->look_s + cost->stack_s + cost->image_s;
    cost->cpu_s = all.cpu_s;
    imager_destroy(a.job.imager);
    recon_auto_destroy(a.job.automatic);
    return err;
}

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
struct run {
    const struct bench_scene *scene;
    const struct bench_case *c;
    struct survey survey; /* what is used of the scene's */
    struct processing processing;
    struct imager_options options;
    struct pool *pool;
    struct bench_pings_config pings_config;
    struct bench_pings *pings; /* these two not for auto, which makes its own */
    struct imager *imager;
    struct bench_image image;
};

/* Keeps every n-th of both. */
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

static int plan_survey(struct run *r, struct error *why)
{
    struct grid grid;
    int err = bench_case_grid(&grid, r->scene, r->c->step);
    if (err)
        return error_say(why, err, "a grid of %g widths: %s", r->c->step, strerror(-err));
    if (survey_copy(&r->survey, &r->scene->survey))
        return error_say(why, -ENOMEM, "out of memory");
    if (r->survey.pings_m)
        return error_say(why, -EINVAL, "expected an array that a stage carries");
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
    r->processing.ping_samples = r->processing.echo_samples; /* in air that stays */
    if (!err && r->c->band_hz[1] > 0.0)
        memcpy(r->processing.band_hz, r->c->band_hz, sizeof r->c->band_hz);
    imager_options_default(&r->options);
    if (r->c->iterations) {
        r->options.iterations = r->c->iterations;
        r->processing.imaging = &r->options;
    }
    return err;
}

static bool is_automatic(const struct run *r)
{
    return !strcmp(r->c->method, recon_auto_name);
}

static int plan(struct run *r, struct error *why)
{
    struct trace_format format;
    int err = plan_survey(r, why);
    if (err)
        return err;
    err = pool_create(&r->pool, r->c->threads);
    if (err)
        return error_say(why, err, "%zu threads: %s", r->c->threads, strerror(-err));
    pool_stop_by(r->pool, interrupt_stops, NULL);
    r->pings_config = (struct bench_pings_config){
        .scene = r->scene,
        .survey = &r->survey,
        .speaker_stride = r->c->speaker_stride,
        .position_stride = r->c->position_stride,
        .processing = &r->processing,
        .pool = r->pool,
    };
    if (is_automatic(r))
        return 0;
    r->image.grid = r->processing.grid;
    r->image.intensity = calloc(grid_size(&r->image.grid), sizeof *r->image.intensity);
    if (!r->image.intensity)
        return error_say(why, -ENOMEM, "out of memory");
    err = bench_pings_create(&r->pings, &r->pings_config, &format, why);
    if (!err)
        err = processing_imager(&r->imager, &r->processing, r->c->method, &format,
                                r->pool, why);
    return err;
}

static void release(struct run *r)
{
    imager_destroy(r->imager);
    bench_pings_destroy(r->pings);
    free(r->image.intensity);
    pool_destroy(r->pool);
    survey_clear(&r->survey);
}

static void add_to_image(void *ctx, size_t position, size_t speaker,
                         const float complex *traces, const bool *masked)
{
    imager_add(ctx, position, speaker, traces, masked);
}

/* Once from recordings to volume. */
static int once(struct run *r, struct bench_cost *cost, struct error *why)
{
    if (is_automatic(r)) {
        free(r->image.intensity);
        return bench_automatic(&r->image, cost, &r->pings_config, r->c, why);
    }
    struct stopwatch all = {0}, compress = {0}, stack = {0}, image = {0};
    imager_reset(r->imager);
    struct stopwatch began = stopwatch_now(false), now;
    bench_pings_run(r->pings, &(struct recon_sink){add_to_image, r->imager, NULL},
                    &compress, &stack);
    now = stopwatch_now(false);
    int err = imager_image(r->imager, r->image.intensity);
    stopwatch_lap(&image, &now, false);
    stopwatch_lap(&all, &began, false);
    cost->compress_s = compress.wall_s;
    cost->stack_s = stack.wall_s;
    cost->image_s = image.wall_s;
    cost->total_s = all.wall_s;
    cost->cpu_s = all.cpu_s;
    return err;
}

/* A budget can end in another image each time: time and error are of the same run. */
static int keep(struct bench_result *out, const struct run *r,
                const struct bench_cost *cost, struct error *why)
{
    double window_m[4];
    struct geometry g;
    processing_geometry(&g, &r->scene->survey);
    bench_score_window(window_m, &g);
    out->cost = *cost;
    out->voxels = grid_size(&r->image.grid);
    memcpy(out->note, r->image.chosen, sizeof out->note);
    int err = bench_score(&out->score, &r->scene->truth, window_m, &r->image.grid,
                          r->image.intensity);
    return err ? error_say(why, err, "errors: %s", strerror(-err)) : 0;
}

static int measure(struct bench_result *out, struct run *r, double patience_s,
                   struct error *why)
{
    double spent_s = 0.0, plan_s = out->cost.plan_s;
    int err = 0;
    for (int i = 0; !err && i < MAX_RUNS && (!i || spent_s < patience_s); i++) {
        struct bench_cost cost = {0};
        err = once(r, &cost, why);
        cost.plan_s += plan_s;
        if (!err && (!i || cost.total_s < out->cost.total_s))
            err = keep(out, r, &cost, why);
        spent_s += cost.total_s;
    }
    return err;
}

int bench_case_run(struct bench_result *out, const struct bench_scene *s,
                   const struct bench_case *c, double patience_s, struct error *why)
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
    if (!err)
        err = measure(out, &r, patience_s, why);
    if (interrupt_requested())
        err = error_say(why, -EINTR, "interrupted");
    if (err == -ENOTSUP || err == -EINVAL) {
        out->state = BENCH_IMPOSSIBLE;
        snprintf(out->note, sizeof out->note, "%.180s", why->text);
        err = 0;
    } else if (!err) {
        out->cost.memory_bytes = bench_memory_end(held);
    }
    release(&r);
    return err;
}
