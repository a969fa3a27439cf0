/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "recon/tracking/assignment.h"
#include "recon/tracking/track_state.h"

#define NEVER       1e6 /* a cost that no sum of others reaches */
#define RESTS_LOOKS 2.0 /* by then what moves at 0.6 m/s is told from it */

_Static_assert(TRACKS_MAX <= ASSIGNMENT_ROWS, "");
_Static_assert(TRACK_DETECTIONS + TRACKS_MAX <= ASSIGNMENT_COLUMNS, "");

static double distance_m(const struct track_position *a, const struct track_position *b)
{
    return hypot(a->at_m[0] - b->at_m[0], a->at_m[1] - b->at_m[1]);
}

bool track_rests_elsewhere(const struct tracker *t, const struct track_scan *scan,
                           size_t track, size_t detection)
{
    const struct track_rest *r = &t->tracks[track].rest;

    return scan->standing_left && r->looks >= RESTS_LOOKS &&
           track_rest_misfit(r) < TRACK_REST_MISFIT &&
           track_rest_distance2(r, &t->looks[detection]) > TRACK_REST_GATE2;
}

/* Negative logarithms of how much likelier an assignment is than clutter and an object
 * that is not there: joint integrated association (Musicki and Evans 2004), of which the
 * best single hypothesis is taken. */
static void fill_costs(struct tracker *t, const struct track_scan *scan)
{
    size_t n_columns = scan->n + t->n;

    for (size_t i = 0; i < t->n; i++) {
        const struct track *k = &t->tracks[i];
        double seen = t->cfg.detection_probability * k->life.existence;
        double *cost = t->cost + i * n_columns;
        for (size_t j = 0; j < scan->n; j++) {
            struct track_match m = track_body_match(k, &t->positions[j], NULL);
            bool mirrored = scan->detections[j].mirror != 0;
            bool near = m.distance2 < t->cfg.gate2 && !k->merged &&
                        mirrored == (k->mirror.id != 0) &&
                        !track_rests_elsewhere(t, scan, i, j);
            cost[j] = near ? -log(fmax(seen * m.density / scan->clutter_m2, 1e-300))
                           : NEVER;
        }
        for (size_t other = 0; other < t->n; other++)
            cost[scan->n + other] = other == i ? -log(1.0 - seen) : NEVER;
    }
}

/* How far a detection is from a track's own; INFINITY: it is none of it. */
static double apart_m(const struct tracker *t, const struct track_scan *scan, size_t i,
                      size_t own, size_t detection)
{
    const struct track_detection *d = &scan->detections[own];

    if (t->tracks[i].body.n)
        return track_body_gap_m(&t->tracks[i], &t->positions[detection]);
    double reach_m = t->cfg.join_m + 0.5 * hypot(d->extent_m[0], d->extent_m[1]);
    double away_m = distance_m(&t->positions[own], &t->positions[detection]);
    return away_m < reach_m ? away_m : INFINITY;
}

/* The nearest of the tracks that were assigned detections. */
static size_t neighbour(const struct tracker *t, const struct track_scan *scan,
                        const size_t *mine, size_t detection)
{
    double nearest_m = INFINITY;
    size_t owner = TRACK_NONE;

    for (size_t i = 0; i < t->n; i++) {
        if (mine[i] == TRACK_NONE)
            continue;
        double away_m = apart_m(t, scan, i, mine[i], detection);
        if (away_m < nearest_m && !track_rests_elsewhere(t, scan, i, detection)) {
            nearest_m = away_m;
            owner = i;
        }
    }
    return owner;
}

void track_associate(struct tracker *t, const struct track_scan *scan, size_t *mine,
                     size_t *whose)
{
    size_t column[ASSIGNMENT_ROWS];

    fill_costs(t, scan);
    assignment_solve(t->n, scan->n + t->n, t->cost, column);
    for (size_t j = 0; j < scan->n; j++)
        whose[j] = TRACK_NONE;
    for (size_t i = 0; i < t->n; i++) {
        mine[i] = column[i] < scan->n ? column[i] : TRACK_NONE;
        if (mine[i] != TRACK_NONE)
            whose[mine[i]] = i;
    }
    for (size_t j = 0; j < scan->n; j++)
        if (whose[j] == TRACK_NONE)
            whose[j] = neighbour(t, scan, mine, j);
}

static void add_position(struct track_position *sum, const struct track_position *p,
                         double share)
{
    for (int a = 0; a < 2; a++) {
        sum->at_m[a] += share * p->at_m[a];
        sum->middle_m[a] += share * p->middle_m[a];
        for (int b = 0; b < 2; b++) {
            sum->covariance_m2[a][b] += share * p->covariance_m2[a][b];
            sum->walker_m2[a][b] += share * p->walker_m2[a][b];
        }
    }
    sum->lag_s += share * p->lag_s;
    sum->height_m += share * p->height_m;
    sum->height_m2 += share * p->height_m2;
    sum->height_assumed |= p->height_assumed;
}

/* From the lowest to the highest of all boxes, along the vehicle's axes. */
static void measure_extent(const struct track_scan *scan, const size_t *whose,
                           size_t owner, double extent_m[3])
{
    for (int a = 0; a < 3; a++) {
        double low = INFINITY, high = -INFINITY;
        for (size_t j = 0; j < scan->n; j++) {
            const struct track_detection *d = &scan->detections[j];
            if (whose[j] != owner)
                continue;
            low = fmin(low, d->position_m[a] - 0.5 * d->extent_m[a]);
            high = fmax(high, d->position_m[a] + 0.5 * d->extent_m[a]);
        }
        extent_m[a] = high - low;
    }
}

void track_gather(const struct tracker *t, const struct track_scan *scan,
                  const size_t *whose, size_t owner, struct track_position *middle,
                  double extent_m[3], double *existence, size_t *detection)
{
    double power = 0.0, strongest = 0.0;

    memset(middle, 0, sizeof *middle);
    *existence = 0.0;
    for (size_t j = 0; j < scan->n; j++) {
        const struct track_detection *d = &scan->detections[j];
        if (whose[j] != owner)
            continue;
        power += d->power;
        *existence = fmax(*existence, d->existence);
        if (d->power > strongest) {
            strongest = d->power;
            *detection = j;
        }
    }
    for (size_t j = 0; j < scan->n; j++)
        if (whose[j] == owner)
            add_position(middle, &t->positions[j], scan->detections[j].power / power);
    for (size_t j = 0; j < scan->n; j++) {
        double share = scan->detections[j].power / power;
        for (int a = 0; whose[j] == owner && a < 2; a++)
            for (int b = 0; b < 2; b++) {
                double scatter_m2 = share * (t->positions[j].at_m[a] - middle->at_m[a]) *
                                    (t->positions[j].at_m[b] - middle->at_m[b]);
                middle->covariance_m2[a][b] += scatter_m2;
                middle->walker_m2[a][b] += scatter_m2;
            }
    }
    measure_extent(scan, whose, owner, extent_m);
}
