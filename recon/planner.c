#include "recon/planner.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* Positions less certain than this: power alone (Lindell 2019 works on power). */
#define INCOHERENT_M 0.0065

/* With positions uncertain by sigma, waves shorter than so many sigma blur more than they
 * sharpen.  Measured on letters at sigma 5 and 8 mm. */
#define LEAST_WAVE 5.0

#define GOAL        0.03 /* of a point's width */
#define FALLS_APART 0.8  /* rad of phase, rms over the pairs */
#define STRONG_DB   10.0 /* below the strongest: what the error is stated for */
#define POWER_WIDER 2.4  /* times: a point in an image of power */
#define FINE        0.7 /* steps: cost f-k migration little, and halve a position's error */
#define LEAST_STEPS 0.4 /* of a point's width: coarser, and positions suffer */
#define NEARLY      0.9 /* errors this near to each other are the same */
#define MIRROR      3.0 /* times a point's width: a shape to be sharpened */

static const double coarser[] = {0.5, FINE, 1.0, 1.5, 2.0};
static const size_t strides[] = {1, 2, 4};

struct planning {
    const struct planner_config *cfg;
    struct plan *plan;
    struct probe_object middle; /* where the strongest stands, or in the image's middle:
                                 * exact, but for the steps */
    double width_m[3];          /* of a point there */
    double goal_m;
};

static void say(char text[PLANNER_WORDS], const char *format, ...)
    __attribute__((format(printf, 2, 3)));

static void say(char text[PLANNER_WORDS], const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(text, PLANNER_WORDS, format, args);
    va_end(args);
}

/* -- what an image is of ----------------------------------------------------------------
 */

static bool positions_are_lost(const struct probe *p)
{
    return p->coherence.element_m > INCOHERENT_M;
}

static void plan_band(const struct planning *p, double band_hz[2])
{
    const struct trace_set *s = p->cfg->set;
    double sigma_m = p->cfg->probe->coherence.element_m;
    memcpy(band_hz, s->band_hz, sizeof s->band_hz);
    if (!(sigma_m > 0.0) || positions_are_lost(p->cfg->probe))
        return;
    double top_hz = s->geometry->sound_speed_m_s / (LEAST_WAVE * sigma_m);
    band_hz[1] = fmin(band_hz[1], fmax(top_hz, 2.0 * band_hz[0]));
}

/* Planes of the whole image between the probe's depths, with its steps made coarser. */
static void plan_grid(const struct planning *p, double factor, struct grid *out)
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
        out->step_m[a] *= factor;
        out->n[a] = (size_t)floor(extent_m / out->step_m[a] + 1e-6) + 1;
    }
}

/* -- error ------------------------------------------------------------------------------
 */

static double square(double x)
{
    return x * x;
}

/* Lateral, from places of elements that are off. */
static double element_error_m(const struct planning *p, double range_m, size_t stride)
{
    const struct geometry *g = p->cfg->set->geometry;
    double low[3], high[3], sigma_m = p->cfg->probe->coherence.element_m;
    geometry_aperture(g, low, high);
    double aperture_m = fmax(high[1] - low[1], high[0] - low[0]);
    double n = (double)(g->n_speakers / stride + g->n_microphones);
    if (!(sigma_m > 0.0) || !(aperture_m > 0.0))
        return 0.0;
    return sigma_m * range_m * sqrt(12.0 / n) / aperture_m;
}

static double object_error_m(const struct planning *p, const struct planner_candidate *c,
                             const struct probe_object *o)
{
    const struct grid *g = p->cfg->grid;
    bool power = !strcmp(c->method, "incoherent");
    double width_m[3], sum = square(element_error_m(p, o->position_m[2], c->stride));
    geometry_resolution_at(p->cfg->set->geometry, p->cfg->set->band_hz, o->position_m,
                           width_m);
    for (int a = 0; a < 2; a++) {
        if (!isfinite(width_m[a]))
            continue;
        double step_m = c->coarser * g->step_m[a];
        sum += square(o->noise_m[a]) * (double)c->stride;
        sum += square(0.6 * step_m * square(step_m / width_m[a]));
        if (power)
            sum += square(0.03 * POWER_WIDER * width_m[a]);
        if (c->dip ||
            (strcmp(c->method, "fast") != 0 && strcmp(c->method, "iterative") != 0))
            continue;
        sum += square(o->moveout_m[a]);
        if (o->moveout_rad > FALLS_APART)
            sum += square(0.25 * width_m[a]);
    }
    return sqrt(sum);
}

static double error_m(const struct planning *p, const struct planner_candidate *c)
{
    const struct probe *probe = p->cfg->probe;
    double worst_m = object_error_m(p, c, &p->middle);
    for (size_t i = 0; i < probe->n_objects; i++)
        if (probe->objects[i].level_db > probe->snr_db - STRONG_DB)
            worst_m = fmax(worst_m, object_error_m(p, c, &probe->objects[i]));
    return worst_m;
}

static double time_s(const struct planning *p, const struct planner_candidate *c)
{
    struct grid grid;
    plan_grid(p, c->coarser, &grid);
    return p->cfg->slowness * planner_image_s(p->cfg->set, &grid, c->method, c->dip,
                                              c->stride, p->cfg->n_threads);
}

/* -- the choice -------------------------------------------------------------------------
 */

static void add(struct planning *p, const char *method, bool dip, double factor,
                size_t stride)
{
    struct plan *plan = p->plan;
    if (plan->n_candidates == PLANNER_CANDIDATES)
        return;
    struct planner_candidate *c = &plan->candidates[plan->n_candidates++];
    *c = (struct planner_candidate){
        .method = method, .dip = dip, .coarser = factor, .stride = stride};
    c->time_s = time_s(p, c);
    c->error_m = error_m(p, c);
}

/* Something mirror-like and larger than a point. */
static bool has_shape(const struct planning *p)
{
    const struct probe *probe = p->cfg->probe;
    return probe->n_objects &&
           probe->objects[0].extent_m > MIRROR * fmax(p->width_m[0], p->width_m[1]);
}

/* The whole image's steps suit its middle; what is nearer is narrower. */
static bool supports_finer(const struct planning *p)
{
    const double *step_m = p->cfg->grid->step_m;
    return !p->cfg->keep_grid && p->cfg->probe->n_objects &&
           (step_m[0] > LEAST_STEPS * p->width_m[0] ||
            step_m[1] > LEAST_STEPS * p->width_m[1]);
}

/* May steps be so many times those of the whole image? */
static bool may_step(const struct planning *p, double factor)
{
    bool finite = isfinite(p->cfg->budget_s), asked = p->cfg->error_m > 0.0;
    if (factor == 1.0 || p->cfg->keep_grid)
        return factor == 1.0;
    return factor > 1.0 ? finite || asked
                        : asked || (factor != FINE && supports_finer(p));
}

static void list_at(struct planning *p, double factor, size_t stride)
{
    const struct probe *probe = p->cfg->probe;
    bool lost = positions_are_lost(probe);
    if (factor != FINE)
        add(p, lost ? "incoherent" : "backprojection", false, factor, stride);
    if (lost || !probe->imaged || stride > 1)
        return;
    add(p, "fast", false, factor, 1);
    if (!probe->uneven)
        add(p, "fast", true, factor, 1);
    if (isfinite(p->cfg->budget_s) && factor == 1.0 && has_shape(p))
        add(p, "iterative", false, factor, 1);
}

/* Fewer pairs only where time presses. */
static void list(struct planning *p)
{
    size_t n_speakers = p->cfg->set->geometry->n_speakers;
    for (size_t f = 0; f < sizeof coarser / sizeof *coarser; f++) {
        if (!may_step(p, coarser[f]))
            continue;
        list_at(p, coarser[f], 1);
        for (size_t s = 1; s < sizeof strides / sizeof *strides; s++)
            if (isfinite(p->cfg->budget_s) && strides[s] <= n_speakers)
                list_at(p, coarser[f], strides[s]);
    }
}

static bool is_exact(const struct planning *p, const struct planner_candidate *c)
{
    return c->error_m <= p->goal_m;
}

static bool is_affordable(const struct planning *p, const struct planner_candidate *c)
{
    return c->time_s <= p->cfg->budget_s;
}

/* Is a to be preferred to b?  What fits the budget comes first.  Of that, when an error
 * is asked for, the cheapest that keeps it.  Else what is more exact by more than the
 * goal; of what is not, a sharper shape, fine steps and all pairs before coarse and fewer
 * ones, and the cheapest method. */
static bool is_better(const struct planning *p, const struct planner_candidate *a,
                      const struct planner_candidate *b)
{
    bool sharper = !strcmp(a->method, "iterative");
    if (is_affordable(p, a) != is_affordable(p, b))
        return is_affordable(p, a);
    if (!is_affordable(p, a))
        return a->time_s < b->time_s;
    if (p->cfg->error_m > 0.0 && is_exact(p, a) && is_exact(p, b))
        return a->time_s < b->time_s;
    if (p->cfg->error_m > 0.0 && is_exact(p, a) != is_exact(p, b))
        return is_exact(p, a);
    if (p->cfg->error_m > 0.0 &&
        fmin(a->error_m, b->error_m) < NEARLY * fmax(a->error_m, b->error_m))
        return a->error_m < b->error_m;
    if (fabs(a->error_m - b->error_m) > p->goal_m)
        return a->error_m < b->error_m;
    if (sharper != !strcmp(b->method, "iterative"))
        return sharper;
    if (a->coarser != b->coarser)
        return a->coarser < b->coarser;
    if (a->stride != b->stride)
        return a->stride < b->stride;
    return a->time_s < b->time_s;
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

/* Is plain `fast` too far off for what there is? */
static bool needs_dip(const struct planning *p, const struct planner_candidate *best)
{
    for (size_t i = 0; i < p->plan->n_candidates; i++) {
        const struct planner_candidate *c = &p->plan->candidates[i];
        if (strcmp(c->method, "fast") != 0 || c->dip || c->coarser != best->coarser)
            continue;
        return p->cfg->error_m > 0.0 ? !is_exact(p, c)
                                     : c->error_m - best->error_m > p->goal_m;
    }
    return false;
}

static void explain_moderate(const struct planning *p,
                             const struct planner_candidate *best)
{
    char *because = p->plan->because;
    bool iterative = !strcmp(best->method, "iterative");
    if (!iterative && needs_dip(p, best))
        say(because,
            "targets are near or far aside: moveout without dip does not suffice");
    else if (p->cfg->error_m > 0.0)
        say(because, "the cheapest that is exact to %.2f cm", 100.0 * p->goal_m);
    else if (best->coarser > 1.0 || best->stride > 1)
        say(because, "the finest steps and most pairs that fit the budget");
    else if (iterative)
        say(because, "something extended, and time to sharpen it");
    else
        say(because, "the cheapest: no other is more exact by %.2f cm",
            100.0 * p->goal_m);
}

static void explain(const struct planning *p, const struct planner_candidate *best)
{
    const struct probe *probe = p->cfg->probe;
    char *because = p->plan->because;
    if (positions_are_lost(probe))
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

void planner_decide(struct plan *out, const struct planner_config *cfg)
{
    struct planning p = {.cfg = cfg, .plan = out};
    const struct grid *g = cfg->grid;
    memset(out, 0, sizeof *out);
    for (int a = 0; a < 3; a++)
        p.middle.position_m[a] = cfg->probe->n_objects
                                     ? cfg->probe->objects[0].position_m[a]
                                     : g->origin_m[a] +
                                           0.5 * g->step_m[a] * (double)(g->n[a] - 1);
    geometry_resolution_at(cfg->set->geometry, cfg->set->band_hz, p.middle.position_m,
                           p.width_m);
    p.goal_m = cfg->error_m > 0.0 ? cfg->error_m
                                  : GOAL * fmax(p.width_m[0], p.width_m[1]);
    list(&p);
    const struct planner_candidate *best = &out->candidates[0];
    for (size_t i = 1; i < out->n_candidates; i++)
        if (is_better(&p, &out->candidates[i], best))
            best = &out->candidates[i];
    out->method = best->method;
    out->dip = best->dip;
    out->stride = best->stride;
    out->time_s = best->time_s;
    out->error_m = best->error_m;
    plan_band(&p, out->band_hz);
    plan_grid(&p, best->coarser, &out->grid);
    explain_others(&p, best);
    explain(&p, best);
}
