#include "nodes/anlos/speed_error/pings.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/stopwatch.h"
#include "recon/compressor.h"

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

int bench_pings_create(struct bench_pings **out, const struct bench_pings_config *cfg,
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

void bench_pings_destroy(struct bench_pings *p)
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
        compressor_execute_either(w->compressor, survey_is_down(s, emission),
                                  w->difference + start, p->stride, w->traces);
        stopwatch_lap(&w->compress, &now, true);
        p->sink->take(p->sink->ctx, position, j, w->traces, NULL);
        stopwatch_lap(&w->sink, &now, true);
    }
}

void bench_pings_run(struct bench_pings *p, const struct recon_sink *sink,
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
