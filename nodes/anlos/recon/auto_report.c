/* nodes/anlos/recon/auto_report.c -- what auto has seen and decided, in report.json and
 * in words. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/recon/auto.h"
#include "nodes/rt/export.h"

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
