/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/recon/auto.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "recon/imaging/imager.h"

/* Of a budget may go into learning how the elements stand. */
#define MOST_STAND 0.2

/* Of what is left of it a look may take so much: an image of which it is known what is in
 * it makes up for that, measured from 0.1 to 0.5 s. */
#define MOST_LOOK 0.375

/* -- time -------------------------------------------------------------------------------
 */
/* That can work at the same time. */
static size_t recon_auto_threads(const struct recon_job *job)
{
    size_t cores = usage_default_threads();
    return job->options->threads < cores ? job->options->threads : cores;
}

/* How much of the budget is gone. */
static double recon_auto_spent_s(const struct recon_job *job)
{
    return job->stages[RECON_PLAN].wall_s + job->stages[RECON_COMPRESS].wall_s +
           job->stages[RECON_LOOK].wall_s + job->stages[RECON_STACK].wall_s;
}

/* Where all threads work, or nearly all the time. */
static double shared_s(const struct recon_job *job, int stage)
{
    return job->stages[stage].cpu_s / (double)recon_auto_threads(job);
}

/* Of the budget, as if no other program had held anything up; INFINITY: there is none. */
static double recon_auto_left_s(const struct recon_job *job)
{
    const struct stopwatch *plan = &job->stages[RECON_PLAN];
    double spent_s = fmin(plan->wall_s, plan->cpu_s) + shared_s(job, RECON_COMPRESS) +
                     shared_s(job, RECON_STACK) + shared_s(job, RECON_LOOK);
    return job->options->budget_s > 0.0 ? job->options->budget_s - spent_s : INFINITY;
}

/* -- pace -------------------------------------------------------------------------------
 */
#define COLD    4   /* pings that find caches empty */
#define ENOUGH  16  /* pings to tell the pace from */
#define DEPTH_M 1.0 /* that things are expected to fill */

/* On a budget, how many speakers' pings are to be compressed.
 * The first pings tell what one takes here, in time of the processor, so that what else
 * runs here counts for nothing; the planner then weighs more pairs against finer steps,
 * as if nothing were known of the scene.  Where there is time to, a few stage positions
 * keep all speakers: they tell how the elements stand (recon/planning/coherence). */
struct recon_auto_pace {
    const struct recon_auto *a;
    const struct recon_job *job;
    pthread_mutex_t lock;
    double *began_s; /* [n_positions]: of the ping at work; a thread's own */
    size_t n;        /* pings that were timed, with the cold ones */
    double took_s[ENOUGH];
    struct plan plan;
    atomic_size_t stride, sampled; /* 0: not chosen yet, every ping counts */
};

static void recon_auto_pace_destroy(struct recon_auto_pace *p)
{
    if (!p)
        return;
    pthread_mutex_destroy(&p->lock);
    free(p->began_s);
    free(p);
}

/* job outlives it.  0, -ENOMEM. */
static int recon_auto_pace_create(struct recon_auto_pace **out,
                                  const struct recon_auto *a, const struct recon_job *job)
{
    struct recon_auto_pace *p = calloc(1, sizeof *p);
    if (!p)
        return -ENOMEM;
    pthread_mutex_init(&p->lock, NULL);
    p->a = a;
    p->job = job;
    p->began_s = calloc(a->set.geometry->n_positions, sizeof *p->began_s);
    atomic_init(&p->stride, job->options->budget_s > 0.0 ? 0 : 1);
    atomic_init(&p->sampled, 1);
    if (!p->began_s) {
        recon_auto_pace_destroy(p);
        return -ENOMEM;
    }
    *out = p;
    return 0;
}

/* To compress all speakers of the positions that tell how the elements stand, and to look
 * at them. */
static double samples_s(const struct recon_auto_pace *p, double compress_s,
                        double slowness)
{
    const struct geometry *g = p->a->set.geometry;
    size_t n = 0;
    for (size_t k = 0; k < g->n_positions; k++)
        n += coherence_samples(g, k);
    return compress_s * (double)n / (double)g->n_positions +
           slowness * planner_coherence_s(&p->a->set, 1, recon_auto_threads(p->job));
}

/* How many speakers, of which it is not known yet what they hear: a look comes first
 * where it is worth its time.  That is gone then, and depths that hold nothing need not
 * be imaged. */
static void decide(struct recon_auto_pace *p, struct planner_config planner)
{
    planner_decide(&p->plan, &planner);
    double stride = (double)p->plan.stride;
    double look_s = planner.slowness * planner_probe_s(planner.set, planner.grid,
                                                       p->plan.stride, planner.n_threads);
    if (look_s > MOST_LOOK * (planner.budget_s - planner.compress_s / stride))
        return;
    struct probe seen = p->a->unknown;
    double middle_m = 0.5 * (seen.depth_m[0] + seen.depth_m[1]);
    seen.depth_m[0] = fmax(seen.depth_m[0], middle_m - 0.5 * DEPTH_M);
    seen.depth_m[1] = fmin(seen.depth_m[1], middle_m + 0.5 * DEPTH_M);
    planner.probe = &seen;
    planner.budget_s -= look_s;
    planner_decide(&p->plan, &planner);
}

/* Under the lock. */
static void choose(struct recon_auto_pace *p)
{
    const struct geometry *g = p->a->set.geometry;
    const struct recon_options *o = p->job->options;
    size_t n_pings = g->n_positions * g->n_speakers, threads = recon_auto_threads(p->job);
    double ping_s = rank_median(p->took_s + COLD, p->n - COLD);
    double compress_s = ping_s * (double)n_pings / (double)threads;
    double slowness = compress_s / planner_compress_s(n_pings, g->n_microphones, threads);
    double stand_s = samples_s(p, compress_s, slowness);
    bool sampled = stand_s <= MOST_STAND * o->budget_s;
    const struct stopwatch *plan = &p->job->stages[RECON_PLAN];
    const struct planner_config planner = {
        .set = &p->a->set,
        .probe = &p->a->unknown,
        .grid = &p->a->whole,
        .n_threads = threads,
        .slowness = slowness,
        .compress_s = compress_s,
        .least_stride = 1,
        .budget_s = o->budget_s - fmin(plan->wall_s, plan->cpu_s) -
                    (sampled ? stand_s : 0.0),
        .error_m = o->error_m,
        .keep_grid = p->job->survey.has_volume,
    };
    decide(p, planner);
    if (!sampled)
        atomic_store(&p->sampled, p->plan.stride);
    atomic_store(&p->stride, p->plan.stride);
}

/* Is this ping to be compressed?  Its time counts from here. */
static bool recon_auto_pace_wants(struct recon_auto_pace *p, size_t position,
                                  size_t speaker)
{
    size_t stride = atomic_load(&p->stride);
    if (stride && coherence_samples(p->a->set.geometry, position))
        stride = atomic_load(&p->sampled);
    if (stride)
        return speaker % stride == 0;
    p->began_s[position] = stopwatch_now(true).cpu_s;
    return true;
}

/* It is. */
static void recon_auto_pace_done(struct recon_auto_pace *p, size_t position)
{
    if (atomic_load(&p->stride) || p->began_s[position] == 0.0)
        return; /* traces of a file were never asked for */
    double took_s = stopwatch_now(true).cpu_s - p->began_s[position];
    pthread_mutex_lock(&p->lock);
    if (p->n < ENOUGH)
        p->took_s[p->n++] = took_s;
    if (p->n == ENOUGH && !atomic_load(&p->stride))
        choose(p);
    pthread_mutex_unlock(&p->lock);
}

/* Every n-th speaker was, or will be. */
static size_t recon_auto_pace_stride(const struct recon_auto_pace *p)
{
    size_t stride = atomic_load(&p->stride);
    return stride ? stride : 1;
}

/* And so many of the positions that tell how the elements stand. */
static size_t recon_auto_pace_sampled(const struct recon_auto_pace *p)
{
    return atomic_load(&p->sampled);
}

void recon_auto_pace_follow(struct recon_auto_pace *p, size_t stride)
{
    atomic_store(&p->sampled, stride);
    atomic_store(&p->stride, stride);
}

/* -- how the elements stand -------------------------------------------------------------
 */
/* So far from their places that phase says nothing. */
static bool recon_auto_is_lost(const struct recon_auto *a)
{
    return a->probe.coherence.element_m > PLANNER_INCOHERENT_M;
}

/* How the elements stand: probe.coherence.  0, -EINVAL, -ENOMEM. */
static int recon_auto_look_at_elements(struct recon_auto *a, struct recon_job *job)
{
    size_t sampled = recon_auto_pace_sampled(a->pace);
    double budget_s = job->options->budget_s;
    double stand_s = a->slowness *
                     planner_coherence_s(&a->set, sampled, recon_auto_threads(job));
    int err = 0;
    a->stands = sampled == 1;
    a->probe.coherence.element_m = NAN;
    if (!(budget_s > 0.0) || stand_s <= MOST_STAND * budget_s)
        err = coherence_measure(&a->probe.coherence, &a->set, job->pool);
    return err == -ENOTSUP ? 0 : err;
}

/* -- a look at the scene ----------------------------------------------------------------
 */

/* Without one all of it is imaged, as if nothing were known but how the elements stand
 * and, where that was asked for, whether things mirror. */
static void know_nothing(struct recon_auto *a)
{
    struct probe known = a->probe;
    a->probe = a->unknown;
    a->probe.coherence = known.coherence;
    a->probe.scattering = known.scattering;
    a->probe.specular = known.specular;
}

/* What an image of power takes. */
static double power_s(const struct recon_auto *a, const struct recon_job *job)
{
    size_t threads = recon_auto_threads(job);
    return a->slowness * (a->probe.specular
                              ? planner_mirror_s(&a->set, threads)
                              : planner_image_s(&a->set, &job->processing.grid,
                                                "incoherent", false, 1, threads));
}

/* Is a look at the scene worth its time?  Power takes so long that it always is. */
static bool look_pays(const struct recon_auto *a, const struct recon_job *job,
                      double look_s, double left_s)
{
    if (recon_auto_is_lost(a))
        left_s = fmax(left_s, power_s(a, job));
    return look_s <= MOST_LOOK * left_s;
}

/* The scene, where that is worth its time: fills in the rest of probe, and looked.  0,
 * -EINVAL, -ENOMEM. */
static int recon_auto_look(struct recon_auto *a, struct recon_job *job)
{
    const struct grid *grid = &job->processing.grid;
    double look_s = a->slowness * planner_probe_s(&a->set, grid,
                                                  recon_auto_pace_stride(a->pace),
                                                  recon_auto_threads(job));
    int err =
        recon_auto_is_lost(a) ? probe_scattering(&a->probe, &a->set, grid, job->pool) : 0;
    a->looked = !err && look_pays(a, job, look_s, recon_auto_left_s(job));
    if (a->looked)
        err = probe_run(&a->probe, &a->set, grid,
                        isnan(a->probe.coherence.element_m) ? NULL : &a->probe.coherence,
                        job->pool);
    else
        know_nothing(a);
    return err;
}

const char recon_auto_name[] = "auto";

int recon_auto_create(struct recon_auto **out, const struct recon_job *job,
                      struct error *why)
{
    const struct geometry *g = &job->processing.geometry;
    struct recon_auto *a = calloc(1, sizeof *a);
    if (!a)
        return error_say(why, -ENOMEM, "out of memory");
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
        return error_say(why, -ENOMEM, "out of memory: auto keeps all %zu traces", n);
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
        return error_say(why, err, "out of memory");
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

static void auto_decide(struct recon_auto *a, struct recon_job *job)
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
                      enum recon_auto_next *next, struct error *why)
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
        return error_say(why, err, "a look at the scene: %s", strerror(-err));
    auto_decide(a, job);
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
    auto_decide(a, job);
    memcpy(a->plan.band_hz, band_hz, sizeof band_hz); /* traces have it already */
    apply(a, job);
    return true;
}

int recon_auto_feed(const struct recon_auto *a, struct recon_job *job, struct error *why)
{
    thin_out(a, a->plan.stride);
    int err = trace_set_feed(&a->set, job->imager, job->pool);
    return err ? error_say(why, err, "out of memory") : 0;
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

/* What auto has seen and decided, in report.json and in words. */

#define RIGHT_M 0.0005 /* nearer to their places elements are right */

static double last_depth_m(const struct grid *g)
{
    return g->origin_m[2] + g->step_m[2] * (double)(g->n[2] - 1);
}

/* For what was predicted: the image, once it was decided. */
static double taken_s(const struct recon_auto *a, const struct recon_job *job)
{
    return job->stages[RECON_STACK].wall_s - a->kept_s + job->stages[RECON_IMAGE].wall_s;
}

static json_t *seen_json(const struct recon_auto *a)
{
    const struct probe *p = &a->probe;
    return json_pack("{sb, so, sI, so, so, so, sb}", "looked", a->looked, "snr_db",
                     export_real(p->snr_db), "objects", (json_int_t)p->n_objects,
                     "depth_m", export_reals(p->depth_m, 2), "element_error_m",
                     export_real(p->coherence.element_m), "bend",
                     export_real(p->scattering.share > 0.0 ? p->scattering.bend : NAN),
                     "mirror", p->specular);
}

static json_t *candidate_json(const struct planner_candidate *c)
{
    json_t *o = json_pack("{ss, sf, sf, sI, so, so}", "method", c->method, "coarser",
                          c->coarser, "depth_steps", c->deeper, "every_nth_speaker",
                          (json_int_t)c->stride, "time_s", export_real(c->time_s),
                          "error_m", export_real(c->error_m));
    json_object_set_new(o, "top_hz", json_real(c->top_hz));
    if (!strcmp(c->method, "fast")) {
        json_object_set_new(o, "dmo", json_string(c->dip ? "always" : "never"));
        json_object_set_new(o, "sharpen", json_real(c->sharpen));
    }
    if (c->iterations)
        json_object_set_new(o, "iterations", json_integer((json_int_t)c->iterations));
    if (c->why_not[0])
        json_object_set_new(o, "why_not", json_string(c->why_not));
    return o;
}

/* What is not in the image, in words. */
static json_t *left_out_json(const struct recon_auto *a)
{
    const struct plan *p = &a->plan;
    double first_m = p->grid.origin_m[2], last_m = last_depth_m(&p->grid);
    json_t *list = json_array();
    if (first_m > a->whole.origin_m[2] ||
        last_m < last_depth_m(&a->whole) - p->grid.step_m[2])
        json_array_append_new(
            list, json_sprintf("depths before %.2f and behind %.2f m", first_m, last_m));
    if (p->stride > 1)
        json_array_append_new(list, json_sprintf("speakers but every %zuth", p->stride));
    if (p->band_hz[1] < a->whole_band_hz)
        json_array_append_new(list,
                              json_sprintf("sound above %.1f kHz", 1e-3 * p->band_hz[1]));
    return list;
}

json_t *recon_auto_report(const struct recon_auto *a, const struct recon_job *job)
{
    const struct plan *p = &a->plan;
    const struct recon_options *o = job->options;
    json_t *all = json_array();
    for (size_t i = 0; i < p->n_candidates; i++)
        json_array_append_new(all, candidate_json(&p->candidates[i]));
    return json_pack(
        "{so, ss, so, so, so, so, so, so, so, ss}", "seen", seen_json(a), "because",
        p->because, "predicted_s", export_real(p->time_s), "taken_s",
        export_real(taken_s(a, job)), "predicted_error_m", export_real(p->error_m),
        "budget_s", export_real(o->budget_s > 0.0 ? o->budget_s : NAN), "allowed_error_m",
        export_real(o->error_m > 0.0 ? o->error_m : NAN), "candidates", all, "left_out",
        left_out_json(a), "not_considered",
        "confocal, lct, paper: fewer pairs or power alone; sparse: for a few points that "
        "stand closer than the image resolves");
}

static void print_seen(const struct recon_auto *a)
{
    const struct probe *p = &a->probe;
    double element_m = p->coherence.element_m;
    if (!a->looked) {
        printf("seen: nothing, a look would take more than it saves\n");
        return;
    }
    if (p->n_objects)
        printf("seen: %.0f dB above noise, depths %.2f to %.2f m hold all", p->snr_db,
               p->depth_m[0], p->depth_m[1]);
    else
        printf("seen: nothing above noise");
    if (isnan(element_m))
        printf("; whether elements stand right does not show\n");
    else if (element_m < RIGHT_M)
        printf("; elements stand right to %.1f mm\n", 1e3 * RIGHT_M);
    else
        printf("; elements are off by %.1f mm\n", 1e3 * element_m);
}

void recon_auto_print(const struct recon_auto *a, const struct recon_job *job)
{
    json_t *left_out = left_out_json(a);
    const json_t *text;
    size_t i;
    print_seen(a);
    json_array_foreach(left_out, i, text)
        printf("%s%s", i ? ", " : "left out: ", json_string_value(text));
    printf("%serror %.2g cm, %.1f ms predicted, %.1f taken",
           json_array_size(left_out) ? "; " : "", 100.0 * a->plan.error_m,
           1e3 * a->plan.time_s, 1e3 * taken_s(a, job));
    if (job->options->budget_s > 0.0)
        printf("; of %g ms in all %.1f are spent", 1e3 * job->options->budget_s,
               1e3 * (recon_auto_spent_s(job) + job->stages[RECON_IMAGE].wall_s));
    printf("\n");
    json_decref(left_out);
}
