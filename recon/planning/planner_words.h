/* recon/planning/planner_words.h -- inside recon/planning/planner: why a way was taken,
 * and why not the others. */
#ifndef ANLOS_RECON_PLANNING_PLANNER_WORDS_H
#define ANLOS_RECON_PLANNING_PLANNER_WORDS_H

#include "recon/planning/planner.h"

struct planning {
    const struct planner_config *cfg;
    struct plan *plan;
    double goal_m; /* an error that is small enough */
};

bool planner_is_exact(const struct planning *p, const struct planner_candidate *c);
bool planner_is_affordable(const struct planning *p, const struct planner_candidate *c);

/* Fills in why_not of all but the best, and because. */
void planner_explain(const struct planning *p, const struct planner_candidate *best);

#endif
