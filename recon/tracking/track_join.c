/* SPDX-License-Identifier: MIT */
/* Two tracks that are one: what they have in common, who stands beside a named one, and
 * walkers.  Of bodies: recon/tracking/track_body.c. */
#include <math.h>

#include "recon/tracking/track_state.h"

#define SAME_GATE    9.21 /* 99 of 100 velocities that are the same (chi-squared, 2) */
#define AS_ONE_LOOKS 3.0  /* by then two who cross are apart */

bool track_go_alike(const struct track *a, const struct track *b)
{
    double dv[2], c[2][2];

    for (int i = 0; i < 2; i++) {
        dv[i] = a->filter.state[2 + i] - b->filter.state[2 + i];
        for (int j = 0; j < 2; j++)
            c[i][j] = a->filter.covariance[2 + i][2 + j] +
                      b->filter.covariance[2 + i][2 + j];
    }
    return track_filter_distance2(dv, (const double(*)[2])c) < SAME_GATE;
}

void track_take_over(struct track *k, struct track *other)
{
    k->seen_ns = k->seen_ns > other->seen_ns ? k->seen_ns : other->seen_ns;
    k->moves_ns = k->moves_ns > other->moves_ns ? k->moves_ns : other->moves_ns;
    k->life.existence = fmax(k->life.existence, other->life.existence);
    other->merged = true;
}

/* A body takes in what goes with it by itself (recon/tracking/track_body.h). */
static bool stands_in(const struct tracker *t, const struct track *k,
                      const struct track *named)
{
    const double *at_m = k->filter.state, *its_m = named->filter.state;

    return named->id && !named->body.n && named->state == TRACK_MEASURED &&
           hypot(at_m[0] - its_m[0], at_m[1] - its_m[1]) < t->cfg.join_m;
}

void track_absorb(struct tracker *t)
{
    for (size_t i = 0; i < t->n; i++)
        for (size_t other = 0; !t->tracks[i].id && other < t->n; other++)
            t->tracks[i].merged |= stands_in(t, &t->tracks[i], &t->tracks[other]);
}

static bool walk_as_one(const struct tracker *t, const struct track *k,
                        const struct track *older)
{
    const double *at_m = k->filter.state, *its_m = older->filter.state;

    return older->id && !older->merged && k->placed == older->placed && !k->body.n &&
           !older->body.n && track_outline_is_slow(k) && track_outline_is_slow(older) &&
           hypot(at_m[0] - its_m[0], at_m[1] - its_m[1]) < t->cfg.join_m &&
           track_go_alike(k, older);
}

/* In the middle between both, and as sure as the surer one. */
static void take_in(struct track *older, struct track *k)
{
    struct track_filter *filters[TRACK_FILTERS];
    size_t n = track_filters(older, filters);
    double way_m[2];

    for (int a = 0; a < 2; a++)
        way_m[a] = 0.5 * (k->filter.state[a] - older->filter.state[a]);
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 2; a++)
            filters[i]->state[a] += way_m[a];
    track_take_over(older, k);
}

void track_join_walkers(struct tracker *t, double fresh)
{
    for (size_t i = 1; i < t->n; i++) {
        struct track *k = &t->tracks[i];
        size_t other = 0;
        while (other < i && !(k->id && walk_as_one(t, k, &t->tracks[other])))
            other++;
        k->as_one = other < i ? k->as_one + fresh : 0.0;
        if (k->as_one > AS_ONE_LOOKS)
            take_in(&t->tracks[other], k);
    }
}
