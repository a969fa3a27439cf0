/* SPDX-License-Identifier: MIT */
#include "recon/planning/planner.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "recon/planning/planner_error.h"

/* With positions uncertain by sigma, waves shorter than so many sigma blur more than they
 * sharpen.  Measured on letters at sigma 5 and 8 mm. */
#define LEAST_WAVE 5.0

#define SHARPEST_M  0.0034 /* elements off by more spoil the shortest waves */
#define FINE        0.7
#define LEAST_STEPS 0.4    /* of a point's width: coarser, and positions suffer */
#define LEAST_DEPTH 0.0625 /* of its depth: steps finer than this tell nothing */
#define POWER_STEPS 1.5    /* times the whole image's are harmless where phase is lost */
#define NEARLY      0.99   /* errors this near to each other are the same */
#define MOST_VOXELS 16e6   /* of steps finer than the whole image's */
#define FAR_OFF     1.1    /* times the error of what was chosen */
#define CERTAIN     0.92   /* of the budget: times are not predicted better */

/* Of `iterative`.  Measured on letters: after 10 their IoU is within 0.01 of what it is
 * in the end, more only bring the residual down. */
#define LEAST_ITERATIONS 10
#define MOST_ITERATIONS  200
#define USUAL_ITERATIONS 30 /* that it takes to converge, of all depths */

static const double coarser[] = {0.5, FINE, 1.0, 1.2, 1.5, 2.0};
static const double deeper[] = {1.0, 0.5, 0.25};
static const double tops[] = {1.0, 0.8, 0.7}; /* of the band's top: waves are the cube */
static const size_t strides[] = {1, 2, 4};

struct planning {
    const struct planner_config *cfg;
    struct plan *plan;
    double goal_m; /* an error that is small enough */
};

/* -- what an image is of ----------------------------------------------------------------
 */

static bool positions_are_lost(const struct probe *p)
{
    return p->coherence.element_m > PLANNER_INCOHERENT_M;
}

static double reliable_hz(const struct planning *p)
{
    const struct trace_set *s = p->cfg->set;
    double sigma_m = p->cfg->probe->coherence.element_m;
    if (!(sigma_m > 0.0) || positions_are_lost(p->cfg->probe))
        return s->band_hz[1];
    double top_hz = s->geometry->sound_speed_m_s / (LEAST_WAVE * sigma_m);
    return fmin(s->band_hz[1], fmax(top_hz, 2.0 * s->band_hz[0]));
}

/* Planes of the whole image between the probe's depths, with its steps made coarser, or
 * finer. */
static void plan_grid(const struct planning *p, const struct planner_candidate *c,
                      struct grid *out)
{
    const struct grid *whole = p->cfg->grid;
    const double *depth_m = p->cfg->probe->depth_m;
    *out = *whole;
    if (p->cfg->keep_grid)
        return;
    double step_m = whole->step_m[2];
    double first = fmax(floor((depth_m[0] - whole->origin_m[2]) / step_m), 0.0);
    double last =
        fmin(ceil((depth_m[1] - whole->origin_m[2]) / step_m), (double)(whole->n[2] - 1));
    out->origin_m[2] += first * step_m;
    out->n[2] = (size_t)fmax(last - first, 0.0) + 1;
    for (int a = 0; a < 3; a++) {
        double extent_m = out->step_m[a] * (double)(out->n[a] - 1);
        out->step_m[a] *= a == 2 ? planner_depth_step(c) : c->coarser;
        out->n[a] = (size_t)floor(extent_m / out->step_m[a] + 1e-6) + 1;
    }
}

static double time_s(const struct planning *p, const struct planner_candidate *c)
{
    const struct planner_config *cfg = p->cfg;
    struct grid grid;
    struct trace_set set = *cfg->set;
    set.band_hz[1] = c->top_hz;
    plan_grid(p, c, &grid);
    double s =
        positions_are_lost(cfg->probe) && cfg->probe->specular
            ? planner_mirror_s(&set, cfg->n_threads)
            : planner_image_s(&set, &grid, c->method, c->dip, c->stride, cfg->n_threads);
    size_t n = c->iterations < USUAL_ITERATIONS ? c->iterations : USUAL_ITERATIONS;
    s += (double)n * planner_iteration_s(&grid, cfg->n_threads);
    return cfg->compress_s / (double)c->stride + cfg->slowness * s;
}

/* That the budget has time for. */
static size_t count_iterations(const struct planning *p, struct planner_candidate c)
{
    struct grid grid;
    c.iterations = 0;
    plan_grid(p, &c, &grid);
    double each_s = p->cfg->slowness * planner_iteration_s(&grid, p->cfg->n_threads);
    double n = floor((CERTAIN * p->cfg->budget_s - time_s(p, &c)) / each_s);
    return (size_t)fmin(fmax(n, LEAST_ITERATIONS), MOST_ITERATIONS);
}

/* -- ways to go -------------------------------------------------------------------------
 */

/* The whole image's steps suit its middle; what is nearer is narrower. */
static bool supports_finer(const struct planning *p)
{
    const double *step_m = p->cfg->grid->step_m;
    const struct probe_object *o = &p->cfg->probe->objects[0];
    return !p->cfg->keep_grid && p->cfg->probe->n_objects &&
           (step_m[0] > LEAST_STEPS * o->width_m[0] ||
            step_m[1] > LEAST_STEPS * o->width_m[1]);
}

/* May steps be so many times those of the whole image? */
static bool may_step(const struct planning *p, double factor)
{
    bool finite = isfinite(p->cfg->budget_s), asked = p->cfg->error_m > 0.0;
    if (factor == 1.0 || p->cfg->keep_grid)
        return factor == 1.0;
    return factor > 1.0 ? finite || asked
                        : asked || ((factor != FINE || finite) && supports_finer(p));
}

/* May planes stand so many times as near to each other? */
static bool may_deepen(const struct planning *p, const struct planner_candidate *c)
{
    const struct planner_config *cfg = p->cfg;
    struct grid grid;
    if (c->deeper == 1.0 || cfg->keep_grid)
        return c->deeper == 1.0;
    plan_grid(p, c, &grid);
    return grid.step_m[2] >= LEAST_DEPTH * planner_object(cfg->probe)->width_m[2] &&
           (double)grid_size(&grid) <= MOST_VOXELS;
}

static void add(const struct planning *p, struct planner_candidate c)
{
    struct plan *plan = p->plan;
    if (plan->n_candidates == PLANNER_CANDIDATES || !may_deepen(p, &c))
        return;
    c.time_s = time_s(p, &c);
    planner_estimate_error(p->cfg, &c);
    plan->candidates[plan->n_candidates++] = c;
}

/* Sharpened or not is a question where it is known what there is. */
static void list_sharpness(const struct planning *p, struct planner_candidate c)
{
    const struct probe *probe = p->cfg->probe;
    bool stands = !(probe->coherence.element_m > SHARPEST_M);
    c.sharpen = PLANNER_SHARPEN;
    if (stands)
        add(p, c);
    c.sharpen = 0.0;
    if (!stands || probe->n_objects)
        add(p, c);
}

static void list_fast(const struct planning *p, struct planner_candidate c)
{
    for (size_t d = 0; d < 2 * sizeof deeper / sizeof *deeper; d++) {
        c.deeper = deeper[d / 2];
        c.dip = d % 2;
        if (!c.dip || !p->cfg->probe->uneven)
            list_sharpness(p, c);
    }
}

/* The top of the band is left out where time presses, rather than steps made coarser. */
static void list_bands(const struct planning *p, struct planner_candidate c)
{
    double top_hz = c.top_hz, low_hz = p->cfg->set->band_hz[0];
    bool pressed = isfinite(p->cfg->budget_s) && c.coarser >= 1.0 &&
                   reliable_hz(p) >= top_hz;
    for (size_t t = 0; t < sizeof tops / sizeof *tops; t++) {
        c.top_hz = tops[t] * top_hz;
        if (t == 0 || (pressed && c.top_hz > 2.0 * low_hz))
            list_fast(p, c);
    }
}

static void list_at(const struct planning *p, double factor, size_t stride)
{
    const struct probe *probe = p->cfg->probe;
    bool stacked = probe->imaged && !positions_are_lost(probe);
    struct planner_candidate any = {.method = "backprojection",
                                    .coarser = factor,
                                    .deeper = 1.0,
                                    .top_hz = p->cfg->set->band_hz[1],
                                    .stride = stride};
    if (factor != FINE)
        add(p, any);
    any.method = "fast";
    if (stacked)
        list_bands(p, any);
    any.method = "iterative";
    if (stacked && stride == 1 && isfinite(p->cfg->budget_s) && factor == 1.0 &&
        planner_sees_shape(probe)) {
        any.iterations = count_iterations(p, any);
        add(p, any);
    }
}

/* Power alone: what is so wide suffers little from coarser steps.  Fewer speakers save
 * nothing there, and mirrors are told by all of them. */
static void list_incoherent(const struct planning *p)
{
    const struct planner_config *cfg = p->cfg;
    struct planner_candidate c = {.method = "incoherent",
                                  .coarser = 1.0,
                                  .deeper = 1.0,
                                  .top_hz = cfg->set->band_hz[1],
                                  .stride = cfg->least_stride};
    add(p, c);
    c.coarser = POWER_STEPS;
    if (isfinite(cfg->budget_s) && !cfg->probe->specular && !cfg->keep_grid)
        add(p, c);
}

/* Fewer pairs only where time presses. */
static void list(const struct planning *p)
{
    const struct planner_config *cfg = p->cfg;
    if (positions_are_lost(cfg->probe)) {
        list_incoherent(p);
        return;
    }
    for (size_t f = 0; f < sizeof coarser / sizeof *coarser; f++) {
        if (!may_step(p, coarser[f]))
            continue;
        for (size_t s = 0; s < sizeof strides / sizeof *strides; s++) {
            bool pressed = isfinite(cfg->budget_s) &&
                           strides[s] <= cfg->set->geometry->n_speakers;
            if (strides[s] == cfg->least_stride ||
                (pressed && strides[s] > cfg->least_stride))
                list_at(p, coarser[f], strides[s]);
        }
    }
}

/* -- the choice -------------------------------------------------------------------------
 */

static bool is_exact(const struct planning *p, const struct planner_candidate *c)
{
    return (p->cfg->error_m > 0.0 ? c->error_m : c->own_m) <= p->goal_m;
}

static bool is_affordable(const struct planning *p, const struct planner_candidate *c)
{
    return c->time_s <= CERTAIN * p->cfg->budget_s;
}

/* Of two that are as exact as each other: where no error was asked for, a budget is there
 * to be spent, on what the error does not tell (sidelobes, what is faint). */
static bool is_cheaper(const struct planning *p, const struct planner_candidate *a,
                       const struct planner_candidate *b)
{
    bool asked = p->cfg->error_m > 0.0;
    if (!asked && a->top_hz != b->top_hz)
        return a->top_hz > b->top_hz;
    if (!asked && a->stride != b->stride)
        return a->stride < b->stride;
    return a->time_s != b->time_s ? a->time_s < b->time_s : a->own_m < b->own_m;
}

/* Is a to be preferred to b?  What fits the budget comes first.  Of that the cheapest
 * that is exact enough, and else the most exact; errors that are nearly the same count as
 * such. */
static bool is_better(const struct planning *p, const struct planner_candidate *a,
                      const struct planner_candidate *b)
{
    if (is_affordable(p, a) != is_affordable(p, b))
        return is_affordable(p, a);
    if (!is_affordable(p, a))
        return a->time_s < b->time_s;
    if (is_exact(p, a) && is_exact(p, b))
        return is_cheaper(p, a, b);
    if (is_exact(p, a) != is_exact(p, b))
        return is_exact(p, a);
    if (fmin(a->own_m, b->own_m) < NEARLY * fmax(a->own_m, b->own_m))
        return a->own_m < b->own_m;
    return is_cheaper(p, a, b);
}

/* -- why it was chosen, and why not the others ------------------------------------------
 */

static void say(char text[PLANNER_WORDS], const char *format, ...)
    __attribute__((format(printf, 2, 3)));

static void say(char text[PLANNER_WORDS], const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(text, PLANNER_WORDS, format, args);
    va_end(args);
}

static void explain_others(const struct planning *p, const struct planner_candidate *best)
{
    for (size_t i = 0; i < p->plan->n_candidates; i++) {
        struct planner_candidate *c = &p->plan->candidates[i];
        if (c == best)
            continue;
        if (!is_affordable(p, c))
            say(c->why_not, "takes %.1f ms, %.1f are left", 1e3 * c->time_s,
                1e3 * fmax(p->cfg->budget_s, 0.0));
        else if (p->cfg->error_m > 0.0 && !is_exact(p, c))
            say(c->why_not, "error %.2f cm, %.2f are allowed", 100.0 * c->error_m,
                100.0 * p->goal_m);
        else if (c->time_s > best->time_s)
            say(c->why_not, "takes %.1f times as long as what was chosen",
                c->time_s / fmax(best->time_s, 1e-9));
        else
            say(c->why_not, "error %.2f cm against %.2f", 100.0 * c->error_m,
                100.0 * best->error_m);
    }
}

/* Is plain `fast` of the same steps too far off for what there is? */
static bool needs_dip(const struct planning *p, const struct planner_candidate *best)
{
    for (size_t i = 0; i < p->plan->n_candidates; i++) {
        const struct planner_candidate *c = &p->plan->candidates[i];
        if (!strcmp(c->method, "fast") && !c->dip && c->coarser == best->coarser &&
            c->deeper == best->deeper && c->stride == best->stride &&
            c->top_hz == best->top_hz && c->sharpen == best->sharpen)
            return c->error_m > fmax(p->goal_m, FAR_OFF * best->error_m);
    }
    return false;
}

static void explain_moderate(const struct planning *p,
                             const struct planner_candidate *best)
{
    char *because = p->plan->because;
    if (!strcmp(best->method, "iterative"))
        say(because, "something extended, and time to sharpen it");
    else if (needs_dip(p, best))
        say(because,
            "targets are near or far aside: moveout without dip does not suffice");
    else if (p->cfg->error_m > 0.0)
        say(because, "the cheapest that is exact to %.2f cm", 100.0 * p->goal_m);
    else if (isfinite(p->cfg->budget_s))
        say(because, "the least error of what fits the budget");
    else
        say(because, "the cheapest: no other is more exact by much");
}

/* Fills in why_not of all but the best, and because. */
static void explain(const struct planning *p, const struct planner_candidate *best)
{
    const struct probe *probe = p->cfg->probe;
    char *because = p->plan->because;
    explain_others(p, best);
    if (probe->coherence.element_m > PLANNER_INCOHERENT_M)
        say(because, "element positions are uncertain by %.1f mm: phase says nothing",
            1e3 * probe->coherence.element_m);
    else if (!is_affordable(p, best))
        say(because, "nothing fits the budget: the cheapest of all");
    else if (!probe->imaged)
        say(because, "fast needs midpoints on a lattice before the image");
    else if (p->cfg->error_m > 0.0 && !is_exact(p, best))
        say(because, "no way is exact to %.2f cm: the best of %s", 100.0 * p->goal_m,
            isfinite(p->cfg->budget_s) ? "those that fit the budget" : "all");
    else
        explain_moderate(p, best);
}

/* -- the plan ---------------------------------------------------------------------------
 */

static void take(const struct planning *p, const struct planner_candidate *best)
{
    struct plan *out = p->plan;
    out->method = best->method;
    out->dip = best->dip;
    out->sharpen = best->sharpen;
    out->stride = best->stride;
    out->iterations = best->iterations;
    out->time_s = best->time_s;
    out->error_m = best->error_m;
    out->reliable_hz = reliable_hz(p);
    out->band_hz[0] = p->cfg->set->band_hz[0];
    out->band_hz[1] = fmin(best->top_hz, out->reliable_hz);
    plan_grid(p, best, &out->grid);
}

void planner_decide(struct plan *out, const struct planner_config *cfg)
{
    struct planning p = {.cfg = cfg, .plan = out};
    const struct probe_object *o = planner_object(cfg->probe);
    memset(out, 0, sizeof *out);
    p.goal_m = cfg->error_m > 0.0 ? cfg->error_m : PLANNER_GOAL * planner_width_m(o);
    list(&p);
    const struct planner_candidate *best = &out->candidates[0];
    for (size_t i = 1; i < out->n_candidates; i++)
        if (is_better(&p, &out->candidates[i], best))
            best = &out->candidates[i];
    take(&p, best);
    explain(&p, best);
}
