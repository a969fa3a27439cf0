#include "nodes/anlos/recon/auto.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/recon/auto_look.h"
#include "nodes/anlos/recon/auto_pace.h"
#include "nodes/anlos/usage.h"
#include "recon/trace_check.h"

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
    a->taken = calloc(n / g->n_microphones, sizeof *a->taken);
    if (!a->traces || !a->heard || !a->taken) {
        recon_auto_destroy(a);
        return complain(why, -ENOMEM, "out of memory: auto keeps all %zu traces", n);
    }
    a->set.traces = a->traces;
    a->set.heard = a->heard;
    a->whole = job->processing.grid;
    a->whole_band_hz = a->set.band_hz[1];
    int err = probe_assume(&a->unknown, &a->set, &a->whole);
    if (!err)
        err = recon_auto_pace_create(&a->pace, a, job);
    if (err) {
        recon_auto_destroy(a);
        return complain(why, err, "out of memory");
    }
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
    recon_auto_pace_follow(a->pace, recon_auto_pace_stride(from->pace));
    job->method_because = a->plan.because;
}

static bool wants(void *ctx, size_t position, size_t speaker)
{
    const struct recon_auto *a = ctx;
    return !a->taken[position * a->set.geometry->n_speakers + speaker] &&
           recon_auto_pace_wants(a->pace, position, speaker);
}

static void keep(void *ctx, size_t position, size_t speaker, const float complex *traces,
                 const bool *masked)
{
    struct recon_auto *a = ctx;
    const struct geometry *g = a->set.geometry;
    size_t n = a->set.format.n_samples, n_mic = g->n_microphones;
    size_t first = (position * g->n_speakers + speaker) * n_mic;
    recon_auto_pace_done(a->pace, position);
    memcpy(a->traces + first * n, traces, n_mic * n * sizeof *traces);
    for (size_t i = 0; i < n_mic; i++)
        a->heard[first + i] = !(masked && masked[i]) && trace_check(traces + i * n, n);
    a->taken[first / n_mic] = true;
}

struct recon_sink recon_auto_sink(struct recon_auto *a)
{
    return (struct recon_sink){keep, a, wants};
}

/* -- time -------------------------------------------------------------------------------
 */

size_t recon_auto_threads(const struct recon_job *job)
{
    size_t cores = usage_default_threads();
    return job->options->threads < cores ? job->options->threads : cores;
}

double recon_auto_spent_s(const struct recon_job *job)
{
    return job->stages[RECON_PLAN].wall_s + job->stages[RECON_COMPRESS].wall_s +
           job->stages[RECON_LOOK].wall_s + job->stages[RECON_STACK].wall_s;
}

/* Where all threads work, or nearly all the time. */
static double shared_s(const struct recon_job *job, int stage)
{
    return job->stages[stage].cpu_s / (double)recon_auto_threads(job);
}

double recon_auto_left_s(const struct recon_job *job)
{
    const struct stopwatch *plan = &job->stages[RECON_PLAN];
    double spent_s = fmin(plan->wall_s, plan->cpu_s) + shared_s(job, RECON_COMPRESS) +
                     shared_s(job, RECON_STACK) + shared_s(job, RECON_LOOK);
    return job->options->budget_s > 0.0 ? job->options->budget_s - spent_s : INFINITY;
}

static void thin_out(const struct recon_auto *a, size_t stride)
{
    const struct geometry *g = a->set.geometry;
    size_t n = g->n_positions * trace_set_pairs(&a->set);
    for (size_t q = 0; q < n; q++)
        if (q / g->n_microphones % g->n_speakers % stride)
            a->heard[q] = false;
}

static size_t count(const bool *these, size_t n)
{
    size_t sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += these[i];
    return sum;
}

/* -- the decision -----------------------------------------------------------------------
 */

static void apply(const struct recon_auto *a, struct recon_job *job)
{
    const struct plan *p = &a->plan;
    job->method = p->method;
    job->method_because = p->because;
    job->imaging.dmo = p->dip;
    job->imaging.sharpen = p->sharpen;
    if (p->iterations)
        job->imaging.iterations = p->iterations;
    job->processing.grid = p->grid;
    memcpy(job->processing.band_hz, p->band_hz, sizeof p->band_hz);
}

static void decide(struct recon_auto *a, struct recon_job *job)
{
    const struct planner_config planner = {
        .set = &a->set,
        .probe = &a->probe,
        .grid = &a->whole,
        .n_threads = recon_auto_threads(job),
        .slowness = a->slowness,
        .least_stride = recon_auto_pace_stride(a->pace),
        .budget_s = recon_auto_left_s(job),
        .error_m = job->options->error_m,
        .keep_grid = job->survey.has_volume,
    };
    planner_decide(&a->plan, &planner);
}

/* A narrower band takes another compression, where there is time for it. */
static bool wants_other_band(struct recon_auto *a, const struct recon_job *job)
{
    if (a->plan.reliable_hz >= a->set.band_hz[1])
        return false;
    if (!job->options->traces &&
        a->plan.time_s + shared_s(job, RECON_COMPRESS) <= recon_auto_left_s(job))
        return true;
    if (!job->options->traces)
        memcpy(a->plan.band_hz, a->set.band_hz, sizeof a->plan.band_hz);
    return false;
}

/* Of how this machine compares: what has been compressed so far. */
static void take_pace(struct recon_auto *a, const struct recon_job *job)
{
    const struct geometry *g = a->set.geometry;
    size_t pings = count(a->taken, g->n_positions * g->n_speakers);
    double nominal_s =
        planner_compress_s(pings, g->n_microphones, recon_auto_threads(job));
    a->slowness = 1.0;
    if (shared_s(job, RECON_COMPRESS) > 0.0 && nominal_s > 0.0)
        a->slowness = shared_s(job, RECON_COMPRESS) / nominal_s;
}

/* Power needs every speaker: of fewer mirrors are not told from what scatters. */
static bool wants_more(struct recon_auto *a, const struct recon_job *job)
{
    if (!recon_auto_is_lost(a) || recon_auto_pace_stride(a->pace) == 1 ||
        job->options->traces)
        return false;
    recon_auto_pace_follow(a->pace, 1);
    return true;
}

int recon_auto_decide(struct recon_auto *a, struct recon_job *job,
                      enum recon_auto_next *next, struct complaint *why)
{
    size_t n = a->set.geometry->n_positions * trace_set_pairs(&a->set);
    bool heard = count(a->heard, n) > 0;
    struct stopwatch now = stopwatch_now(false);
    int err = 0;
    *next = RECON_AUTO_MORE;
    take_pace(a, job);
    if (heard && !a->stands)
        err = recon_auto_look_at_elements(a, job);
    stopwatch_lap(&job->stages[RECON_LOOK], &now, false);
    if (!err && wants_more(a, job))
        return 0;
    thin_out(a, recon_auto_pace_stride(a->pace));
    if (!err && heard)
        err = recon_auto_look(a, job);
    stopwatch_lap(&job->stages[RECON_LOOK], &now, false);
    if (err)
        return complain(why, err, "a look at the scene: %s", strerror(-err));
    decide(a, job);
    *next = wants_other_band(a, job) ? RECON_AUTO_OTHER_BAND : RECON_AUTO_IMAGE;
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

int recon_auto_feed(const struct recon_auto *a, struct recon_job *job,
                    struct complaint *why)
{
    thin_out(a, a->plan.stride);
    int err = trace_set_feed(&a->set, job->imager, job->pool);
    return err ? complain(why, err, "out of memory") : 0;
}

void recon_auto_destroy(struct recon_auto *a)
{
    if (!a)
        return;
    recon_auto_pace_destroy(a->pace);
    free(a->traces);
    free(a->heard);
    free(a->taken);
    free(a);
}
