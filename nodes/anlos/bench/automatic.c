#include "nodes/anlos/bench/automatic.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/recon/auto.h"
#include "nodes/anlos/stopwatch.h"

struct automatic {
    struct bench_pings_config cfg;
    struct recon_options options;
    struct recon_job job; /* of which recon_auto sees what a recording's job has */
    struct bench_cost *cost;
};

/* Compressed and kept by an automatic that is there, or by a new one. */
static int keep_traces(struct automatic *a, struct complaint *why)
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
static int keep_traces_again(struct automatic *a, struct complaint *why)
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

static int decide(struct automatic *a, struct complaint *why)
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

static int plan_image(struct automatic *a, struct bench_image *out, struct complaint *why)
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
        err = complain(why, -ENOMEM, "out of memory");
    stopwatch_lap(&planning, &now, false);
    a->cost->plan_s += planning.wall_s;
    return err;
}

static int make_image(struct automatic *a, float *intensity, struct complaint *why)
{
    struct stopwatch *stages = a->job.stages, now = stopwatch_now(false);
    int err = recon_auto_feed(a->job.automatic, &a->job, why);
    stopwatch_lap(&stages[RECON_STACK], &now, false);
    if (!err)
        imager_image(a->job.imager, intensity);
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

int bench_automatic(struct bench_image *out, struct bench_cost *cost,
                    const struct bench_pings_config *pings, const struct bench_case *c,
                    struct complaint *why)
{
    struct automatic a = {0};
    struct stopwatch all = {0}, now = stopwatch_now(false);
    *out = (struct bench_image){0};
    prepare(&a, pings, c, cost);
    int err = keep_traces(&a, why);
    if (!err)
        err = decide(&a, why);
    if (!err && interrupt_requested())
        err = complain(why, -EINTR, "interrupted");
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
