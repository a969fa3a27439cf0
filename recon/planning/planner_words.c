#include "recon/planning/planner_words.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define FAR_OFF 1.1 /* times the error of what was chosen */

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
        if (!planner_is_affordable(p, c))
            say(c->why_not, "takes %.1f ms, %.1f are left", 1e3 * c->time_s,
                1e3 * fmax(p->cfg->budget_s, 0.0));
        else if (p->cfg->error_m > 0.0 && !planner_is_exact(p, c))
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

void planner_explain(const struct planning *p, const struct planner_candidate *best)
{
    const struct probe *probe = p->cfg->probe;
    char *because = p->plan->because;
    explain_others(p, best);
    if (probe->coherence.element_m > PLANNER_INCOHERENT_M)
        say(because, "element positions are uncertain by %.1f mm: phase says nothing",
            1e3 * probe->coherence.element_m);
    else if (!planner_is_affordable(p, best))
        say(because, "nothing fits the budget: the cheapest of all");
    else if (!probe->imaged)
        say(because, "fast needs midpoints on a lattice before the image");
    else if (p->cfg->error_m > 0.0 && !planner_is_exact(p, best))
        say(because, "no way is exact to %.2f cm: the best of %s", 100.0 * p->goal_m,
            isfinite(p->cfg->budget_s) ? "those that fit the budget" : "all");
    else
        explain_moderate(p, best);
}
