#include "nodes/scan/route.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

int route_open(struct route *out, const Anlos__Survey *survey)
{
    size_t n = survey->n_stage_positions_m;

    *out =
        (struct route){.n_positions = n,
                       .positions_m = calloc(n, sizeof *out->positions_m),
                       .speakers = calloc(survey->n_speakers_m, sizeof *out->speakers)};
    if (!out->positions_m || !out->speakers) {
        route_clear(out);
        return -ENOMEM;
    }
    memcpy(out->positions_m, survey->stage_positions_m, n * sizeof *out->positions_m);
    return 0;
}

size_t route_nearest(const struct route *r, const struct ledger *l, Anlos__Pass pass,
                     size_t from)
{
    size_t best = r->n_positions;
    double best_m = INFINITY;

    for (size_t i = 0; i < r->n_positions; i++) {
        double distance_m = fabs(r->positions_m[i] - r->positions_m[from]);
        if (distance_m < best_m && route_missing(r, l, pass, i)) {
            best = i;
            best_m = distance_m;
        }
    }
    return best;
}

size_t route_missing(const struct route *r, const struct ledger *l, Anlos__Pass pass,
                     size_t position)
{
    return ledger_missing(l, pass, position, r->speakers);
}

void route_clear(struct route *r)
{
    free(r->positions_m);
    free(r->speakers);
    *r = (struct route){.n_positions = 0};
}
