#include "nodes/anlos/recon/auto.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/trace_check.h"

/* What a look may take: of what is left of the budget; of it when nothing else calls for
 * one; of the whole image, which it makes smaller. */
#define MOST_LOOK   0.5
#define LITTLE_LOOK 0.1
#define PAYS_LOOK   0.7

#define SUSPICIOUS_M 0.0034 /* elements off by more would be treated otherwise */

const char recon_auto_name[] = "auto";

int recon_auto_create(struct recon_auto **out, const struct recon_job *job,
                      struct complaint *why)
{
    const struct geometry *g = &job->processing.geometry;
    struct recon_auto *a = calloc(1, sizeof *a);
    if (!a)
        return complain(why, -ENOMEM, "out of memory");
    a->set = (struct trace_set){
        .geometry = g,
        .format = job->format,
        .band_hz = {job->processing.band_hz[0], job->processing.band_hz[1]},
        .gate_m = {job->processing.gate_m[0], job->processing.gate_m[1]},
    };
    size_t n = g->n_positions * trace_set_pairs(&a->set);
    a->traces = calloc(n * job->format.n_samples, sizeof *a->traces);
    a->heard = calloc(n, sizeof *a->heard);
    if (!a->traces || !a->heard) {
        recon_auto_destroy(a);
        return complain(why, -ENOMEM, "out of memory: auto keeps all %zu traces", n);
    }
    a->set.traces = a->traces;
    a->set.heard = a->heard;
    a->whole = job->processing.grid;
    a->whole_band_hz = a->set.band_hz[1];
    *out = a;
    return 0;
}

void recon_auto_inherit(struct recon_job *job, const struct recon_auto *from)
{
    struct recon_auto *a = job->automatic;
    a->probe = from->probe;
    a->plan = from->plan;
    a->slowness = from->slowness;
    a->looked = from->looked;
    a->whole_band_hz = from->whole_band_hz;
    a->whole = from->whole;
    job->method_because = a->plan.because;
}

void recon_auto_take(void *ctx, size_t position, size_t speaker,
                     const float complex *traces, const bool *masked)
{
    struct recon_auto *a = ctx;
    const struct geometry *g = a->set.geometry;
    size_t n = a->set.format.n_samples, n_mic = g->n_microphones;
    size_t first = (position * g->n_speakers + speaker) * n_mic;
    memcpy(a->traces + first * n, traces, n_mic * n * sizeof *traces);
    for (size_t i = 0; i < n_mic; i++)
        a->heard[first + i] = !(masked && masked[i]) && trace_check(traces + i * n, n);
}

/* -- the decision -----------------------------------------------------------------------
 */

/* Without a look all of it is imaged, as if nothing were known but how the elements
 * stand. */
static void know_nothing(struct recon_auto *a)
{
    const struct grid *g = &a->whole;
    double end_m = g->origin_m[2] + g->step_m[2] * (double)(g->n[2] - 1);
    a->probe = (struct probe){.imaged = !a->set.geometry->pings_m,
                              .depth_m = {g->origin_m[2], end_m},
                              .coherence = a->probe.coherence};
}

static size_t count_heard(const struct recon_auto *a)
{
    size_t n = a->set.geometry->n_positions * trace_set_pairs(&a->set), heard = 0;
    for (size_t q = 0; q < n; q++)
        heard += a->heard[q];
    return heard;
}

/* Is a look at the scene worth its time?  It is where an error is to be kept, where
 * elements seem to be off, and where it may save most of the image, or is nothing against
 * the budget. */
static bool look_pays(const struct recon_auto *a, const struct recon_job *job,
                      double look_s, double left_s)
{
    const struct recon_options *o = job->options;
    double image_s = a->slowness * planner_image_s(&a->set, &job->processing.grid, "fast",
                                                   false, 1, o->threads);
    if (look_s > MOST_LOOK * left_s)
        return false;
    if (o->error_m > 0.0 || a->probe.coherence.element_m > SUSPICIOUS_M)
        return true;
    if (isfinite(left_s) && look_s < LITTLE_LOOK * left_s)
        return true;
    return !job->survey.has_volume && look_s < PAYS_LOOK * image_s;
}

static int look(struct recon_auto *a, struct recon_job *job, double left_s)
{
    struct stopwatch now = stopwatch_now(false);
    double look_s = a->slowness * planner_probe_s(&a->set, &job->processing.grid,
                                                  job->options->threads);
    int err = 0;
    a->probe.coherence.element_m = NAN;
    if (look_s <= MOST_LOOK * left_s)
        err = coherence_measure(&a->probe.coherence, &a->set, job->pool);
    err = err == -ENOTSUP ? 0 : err;
    a->looked = !err && look_pays(a, job, look_s, left_s);
    if (a->looked)
        err = probe_run(&a->probe, &a->set, &job->processing.grid, job->pool);
    else
        know_nothing(a);
    stopwatch_lap(&job->stages[RECON_LOOK], &now, false);
    return err;
}

double recon_auto_spent_s(const struct recon_job *job)
{
    return job->stages[RECON_PLAN].wall_s + job->stages[RECON_COMPRESS].wall_s +
           job->stages[RECON_LOOK].wall_s + job->stages[RECON_STACK].wall_s;
}

static void apply(const struct recon_auto *a, struct recon_job *job)
{
    const struct plan *p = &a->plan;
    job->method = p->method;
    job->method_because = p->because;
    job->imaging.dmo = a->looked ? p->dip : -1;
    job->processing.grid = p->grid;
    memcpy(job->processing.band_hz, p->band_hz, sizeof p->band_hz);
}

static double left_s(const struct recon_job *job)
{
    double budget_s = job->options->budget_s;
    return budget_s > 0.0 ? budget_s - recon_auto_spent_s(job) : INFINITY;
}

static void decide(struct recon_auto *a, struct recon_job *job)
{
    const struct planner_config planner = {
        .set = &a->set,
        .probe = &a->probe,
        .grid = &a->whole,
        .n_threads = job->options->threads,
        .slowness = a->slowness,
        .budget_s = left_s(job),
        .error_m = job->options->error_m,
        .keep_grid = job->survey.has_volume,
    };
    planner_decide(&a->plan, &planner);
}

/* A narrower band takes another compression, where there is time for it. */
static bool wants_other_band(struct recon_auto *a, const struct recon_job *job)
{
    if (a->plan.band_hz[1] >= a->set.band_hz[1])
        return false;
    double again_s = job->stages[RECON_COMPRESS].wall_s;
    if (!job->options->traces && a->plan.time_s + again_s <= left_s(job))
        return true;
    if (!job->options->traces)
        memcpy(a->plan.band_hz, a->set.band_hz, sizeof a->plan.band_hz);
    return false;
}

int recon_auto_decide(struct recon_auto *a, struct recon_job *job, bool *again,
                      struct complaint *why)
{
    const struct geometry *g = a->set.geometry;
    size_t heard = count_heard(a);
    double nominal_s = planner_compress_s(heard / g->n_microphones, g->n_microphones,
                                          job->options->threads);
    a->slowness = 1.0;
    if (job->stages[RECON_COMPRESS].wall_s > 0.0 && nominal_s > 0.0)
        a->slowness = job->stages[RECON_COMPRESS].wall_s / nominal_s;
    int err = heard ? look(a, job, left_s(job)) : 0;
    if (err)
        return complain(why, err, "a look at the scene: %s", strerror(-err));
    decide(a, job);
    *again = wants_other_band(a, job);
    apply(a, job);
    return 0;
}

bool recon_auto_retreat(struct recon_auto *a, struct recon_job *job)
{
    if (!a->probe.imaged)
        return false;
    if (a->plan.dip)
        a->probe.uneven = true;
    else
        a->probe.imaged = false;
    double band_hz[2] = {a->plan.band_hz[0], a->plan.band_hz[1]};
    decide(a, job);
    memcpy(a->plan.band_hz, band_hz, sizeof band_hz); /* traces have it already */
    apply(a, job);
    return true;
}

static void thin_out(const struct recon_auto *a)
{
    const struct geometry *g = a->set.geometry;
    size_t n = g->n_positions * trace_set_pairs(&a->set);
    for (size_t q = 0; q < n; q++)
        if (q / g->n_microphones % g->n_speakers % a->plan.stride)
            a->heard[q] = false;
}

int recon_auto_feed(const struct recon_auto *a, struct recon_job *job,
                    struct complaint *why)
{
    thin_out(a);
    int err = trace_set_feed(&a->set, job->imager, job->pool);
    return err ? complain(why, err, "out of memory") : 0;
}

void recon_auto_destroy(struct recon_auto *a)
{
    if (!a)
        return;
    free(a->traces);
    free(a->heard);
    free(a);
}
