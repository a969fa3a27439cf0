#include "nodes/anlos/recon/auto.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/rt/export.h"

#define LEAST_LOOK 0.5 /* of what is left of the budget, that the look may take */

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
    *out = a;
    return 0;
}

void recon_auto_inherit(struct recon_job *job, const struct recon_auto *from)
{
    struct recon_auto *a = job->automatic;
    a->probe = from->probe;
    a->plan = from->plan;
    a->slowness = from->slowness;
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
        a->heard[first + i] = !(masked && masked[i]);
}

/* -- the decision -----------------------------------------------------------------------
 */

/* No time to look: all of it is imaged as if nothing were known. */
static void know_nothing(struct recon_auto *a, const struct grid *grid)
{
    double end_m = grid->origin_m[2] + grid->step_m[2] * (double)(grid->n[2] - 1);
    a->probe = (struct probe){.imaged = !a->set.geometry->pings_m,
                              .depth_m = {grid->origin_m[2], end_m},
                              .coherence = {.element_m = NAN}};
}

static size_t count_heard(const struct recon_auto *a)
{
    size_t n = a->set.geometry->n_positions * trace_set_pairs(&a->set), heard = 0;
    for (size_t q = 0; q < n; q++)
        heard += a->heard[q];
    return heard;
}

static int look(struct recon_auto *a, struct recon_job *job, double left_s)
{
    const struct grid *grid = &job->processing.grid;
    struct stopwatch now = stopwatch_now(false);
    double look_s = a->slowness * planner_probe_s(&a->set, grid, job->options->threads);
    int err = 0;
    if (look_s > LEAST_LOOK * left_s)
        know_nothing(a, grid);
    else
        err = probe_run(&a->probe, &a->set, grid, job->pool);
    stopwatch_lap(&job->stages[RECON_LOOK], &now, false);
    return err;
}

/* How much of the budget is gone. */
static double spent_s(const struct recon_job *job)
{
    return job->stages[RECON_PLAN].wall_s + job->stages[RECON_COMPRESS].wall_s +
           job->stages[RECON_LOOK].wall_s + job->stages[RECON_STACK].wall_s;
}

static void apply(const struct recon_auto *a, struct recon_job *job)
{
    const struct plan *p = &a->plan;
    job->method = p->method;
    job->method_because = p->because;
    job->imaging.dmo = p->dip;
    job->processing.grid = p->grid;
    memcpy(job->processing.band_hz, p->band_hz, sizeof p->band_hz);
}

int recon_auto_decide(struct recon_auto *a, struct recon_job *job, bool *again,
                      struct complaint *why)
{
    const struct recon_options *o = job->options;
    const struct geometry *g = a->set.geometry;
    size_t heard = count_heard(a);
    double nominal_s =
        planner_compress_s(heard / g->n_microphones, g->n_microphones, o->threads);
    double budget_s = o->budget_s > 0.0 ? o->budget_s : INFINITY;
    a->slowness = 1.0;
    if (job->stages[RECON_COMPRESS].wall_s > 0.0 && nominal_s > 0.0)
        a->slowness = job->stages[RECON_COMPRESS].wall_s / nominal_s;
    int err = heard ? look(a, job, budget_s - spent_s(job)) : 0;
    if (err)
        return complain(why, err, "a look at the scene: %s", strerror(-err));
    const struct planner_config planner = {
        .set = &a->set,
        .probe = &a->probe,
        .grid = &job->processing.grid,
        .n_threads = o->threads,
        .slowness = a->slowness,
        .budget_s = budget_s - spent_s(job),
        .error_m = o->error_m,
        .keep_grid = job->survey.has_volume,
    };
    planner_decide(&a->plan, &planner);
    *again = !o->traces && a->plan.band_hz[1] < a->set.band_hz[1];
    apply(a, job);
    return 0;
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

/* -- report -----------------------------------------------------------------------------
 */

static json_t *seen_json(const struct recon_auto *a)
{
    const struct probe *p = &a->probe;
    return json_pack("{so, sI, so, so, so, sb}", "snr_db", export_real(p->snr_db),
                     "objects", (json_int_t)p->n_objects, "depth_m",
                     export_reals(p->depth_m, 2), "element_error_m",
                     export_real(p->coherence.element_m), "bend",
                     export_real(p->scattering.share > 0.0 ? p->scattering.bend : NAN),
                     "mirror", p->specular);
}

static json_t *candidate_json(const struct planner_candidate *c)
{
    json_t *o = json_pack("{ss, sf, sI, so, so}", "method", c->method, "coarser",
                          c->coarser, "every_nth_speaker", (json_int_t)c->stride,
                          "time_s", export_real(c->time_s), "error_m",
                          export_real(c->error_m));
    if (!strcmp(c->method, "fast"))
        json_object_set_new(o, "dmo", json_string(c->dip ? "always" : "never"));
    if (c->why_not[0])
        json_object_set_new(o, "why_not", json_string(c->why_not));
    return o;
}

json_t *recon_auto_report(const struct recon_auto *a, const struct recon_job *job)
{
    const struct plan *p = &a->plan;
    double taken_s = job->stages[RECON_STACK].wall_s + job->stages[RECON_IMAGE].wall_s;
    json_t *all = json_array();
    for (size_t i = 0; i < p->n_candidates; i++)
        json_array_append_new(all, candidate_json(&p->candidates[i]));
    return json_pack(
        "{so, ss, so, so, so, so, so, so, ss}", "seen", seen_json(a), "because",
        p->because, "predicted_s", export_real(p->time_s), "taken_s",
        export_real(taken_s), "predicted_error_m", export_real(p->error_m), "budget_s",
        export_real(job->options->budget_s > 0.0 ? job->options->budget_s : NAN),
        "allowed_error_m",
        export_real(job->options->error_m > 0.0 ? job->options->error_m : NAN),
        "candidates", all, "left_out",
        "confocal, lct, paper: fewer pairs or power alone; sparse: for a few points that "
        "stand closer than the image resolves");
}
