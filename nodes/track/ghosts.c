#include "nodes/track/ghosts.h"

#include <math.h>

#define ABOUT_M 0.3 /* the depth of a person, and the length of a smear */

bool ghosts_may_be(const struct ghost_source *what, const struct ghost_source *sources,
                   size_t n, double margin_db)
{
    for (size_t i = 0; i < n; i++)
        if (fabs(sources[i].range_m - what->range_m) <= ABOUT_M &&
            sources[i].level_db - what->level_db >= margin_db)
            return true;
    return false;
}
