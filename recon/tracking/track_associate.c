/* SPDX-License-Identifier: MIT */
/* recon/tracking/track_associate.c -- the detections of a scan: where they are over
 * ground, which track each belongs to, and what those of one track are together. */
#include <math.h>
#include <string.h>

#include "recon/tracking/assignment.h"
#include "recon/tracking/track_state.h"

#define NEVER       1e6  /* a cost that no sum of others reaches */
#define RESTS_LOOKS 2.0  /* by then what moves at 0.6 m/s is told from it */
#define GLINT_M     0.05 /* of a walker, what is brightest besides wanders so much more */
#define LOUDER      4.0 /* than by the wall that it is followed by: that one takes over */

_Static_assert(TRACKS_MAX <= ASSIGNMENT_ROWS, "");
_Static_assert(TRACK_DETECTIONS + TRACKS_MAX <= ASSIGNMENT_COLUMNS, "");

/* -- over ground ------------------------------------------------------------------------
 */

void track_turn(double angle, const double from[2], double to[2])
{
    double c = cos(angle), s = sin(angle), x = from[0], y = from[1];
    to[0] = c * x - s * y;
    to[1] = s * x + c * y;
}

void track_to_ground(const struct ego_step *pose, const double from[2], double to[2])
{
    track_turn(pose->dyaw, from, to);
    to[0] += pose->dx_m;
    to[1] += pose->dy_m;
}

void track_turn_matrix(double angle, const double from[2][2], double to[2][2])
{
    double c = cos(angle), s = sin(angle), r[2][2] = {{c, -s}, {s, c}}, half[2][2];

    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            half[i][j] = r[i][0] * from[0][j] + r[i][1] * from[1][j];
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            to[i][j] = half[i][0] * r[j][0] + half[i][1] * r[j][1];
}

/* The smaller axis of the ellipse: the longer one has the height, which is not heard. */
static double heard_sigma_m(const double covariance_m2[6])
{
    double half = 0.5 * (covariance_m2[0] - covariance_m2[3]);
    double mean = 0.5 * (covariance_m2[0] + covariance_m2[3]);

    return sqrt(fmax(mean - hypot(half, covariance_m2[1]), 0.0));
}

/* Of whom walks all heights are heard in turn, which his place is filtered of: what stays
 * of it is told (track.c). */
static void of_a_walker(const struct tracker *t, const struct track_detection *d,
                        double fresh, double out_m2[2][2])
{
    double spot_m2 = t->cfg.wander_m * t->cfg.wander_m + GLINT_M * GLINT_M;
    double xy_m2 = d->covariance_m2[1] - d->height_m2[1];
    const double c[2][2] = {
        {(d->covariance_m2[0] - d->height_m2[0] + spot_m2) / fresh, xy_m2 / fresh},
        {xy_m2 / fresh, (d->covariance_m2[3] - d->height_m2[3] + spot_m2) / fresh}};

    track_turn_matrix(t->pose.dyaw, c, out_m2);
}

/* Along the sight of it by the phase, across it by how that turns from element to
 * element: deviations of 430 courses of walkers in another simulator, 0.12 and 0.60,
 * rounded up. */
#define COURSE_ALONG_M_S  0.15
#define COURSE_ACROSS_M_S 0.7

static void take_course(const struct tracker *t, const struct track_detection *d,
                        double fresh, struct track_position *p)
{
    p->velocity_fresh = fresh;
    if (d->course_doubt > 0.0) /* a filter takes it in parts */
        fresh = 1.0;
    double across2 = COURSE_ACROSS_M_S * COURSE_ACROSS_M_S / fresh;
    double less2 = across2 - COURSE_ALONG_M_S * COURSE_ALONG_M_S / fresh;
    double c[2][2];

    p->has_velocity = d->has_course;
    p->velocity_doubt = d->course_doubt;
    track_turn(t->pose.dyaw, d->course_m_s, p->velocity_m_s);
    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 2; b++)
            c[a][b] = (a == b ? across2 : 0.0) - less2 * d->sight[a] * d->sight[b];
    track_turn_matrix(t->pose.dyaw, (const double(*)[2])c, p->velocity_m2_s2);
}

/* What an image says again is worth its fresh part. */
void track_place(struct tracker *t, const struct track_scan *scan, double fresh)
{
    double wander_m2 = t->cfg.wander_m * t->cfg.wander_m, yaw = t->pose.dyaw;
    struct track_rest_look look;

    track_to_ground(&t->pose, scan->array.at_m, look.array_m);
    track_turn(yaw, scan->array.axis, look.axis);
    for (size_t j = 0; j < scan->n; j++) {
        const struct track_detection *d = &scan->detections[j];
        struct track_position *p = &t->positions[j];
        const double c[2][2] = {
            {(d->covariance_m2[0] + wander_m2) / fresh, d->covariance_m2[1] / fresh},
            {d->covariance_m2[1] / fresh, (d->covariance_m2[3] + wander_m2) / fresh}};
        track_to_ground(&t->pose, d->position_m, p->at_m);
        track_turn_matrix(yaw, c, p->covariance_m2);
        of_a_walker(t, d, fresh, p->walker_m2);
        track_turn(yaw, d->middle_m, p->middle_m);
        p->lag_s = d->lag_s;
        p->height_m = d->position_m[2];
        p->height_m2 = d->height_assumed ? d->covariance_m2[5]
                                         : (d->covariance_m2[5] + wander_m2) / fresh;
        p->height_assumed = d->height_assumed;
        take_course(t, d, fresh, p);
        look.along_m = d->along_m;
        look.range_m = d->range_m;
        look.sigma_m = hypot(t->cfg.rest_m, heard_sigma_m(d->covariance_m2));
        t->looks[j] = look;
    }
}

/* -- whose each is ----------------------------------------------------------------------
 */

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

/* What two walls show at one place is one thing, and one detection: the stronger, which
 * the other one goes with.  TRACK_NONE: it goes with none. */
static void find_stronger(const struct tracker *t, const struct track_scan *scan,
                          size_t *stronger)
{
    for (size_t j = 0; j < scan->n; j++) {
        const struct track_detection *d = &scan->detections[j];
        double nearest_m = t->cfg.join_m;
        stronger[j] = TRACK_NONE;
        for (size_t i = 0; i < scan->n; i++) {
            const struct track_detection *other = &scan->detections[i];
            bool walls = d->mirror && other->mirror && d->mirror != other->mirror;
            double away_m = distance_m(&t->positions[i], &t->positions[j]);
            if (!walls || other->power <= d->power || away_m >= nearest_m)
                continue;
            nearest_m = away_m;
            stronger[j] = i;
        }
    }
}

static bool is_beside(const struct tracker *t, const struct track *k, size_t detection)
{
    const double *at_m = t->positions[detection].at_m, *its_m = k->filter.state;

    return hypot(its_m[0] - at_m[0], its_m[1] - at_m[1]) < t->cfg.join_m;
}

/* What is heard beside a walker is he, rather than one who has only begun elsewhere and
 * would have come there as fast as a vehicle. */
static bool is_rather_a_walker(const struct tracker *t, const struct track *begun,
                               size_t detection)
{
    if (begun->id || is_beside(t, begun, detection))
        return false;
    for (size_t i = 0; i < t->n; i++) {
        const struct track *k = &t->tracks[i];
        if (k->id && k->state == TRACK_MEASURED && track_outline_may_walk(k) &&
            is_beside(t, k, detection))
            return true;
    }
    return false;
}

/* Negative logarithms of how much likelier an assignment is than clutter and an object
 * that is not there: joint integrated association (Musicki and Evans 2004), of which the
 * best single hypothesis is taken. */
static void fill_costs(struct tracker *t, const struct track_scan *scan, double fresh,
                       const size_t *stronger)
{
    size_t n_columns = scan->n + t->n;

    for (size_t i = 0; i < t->n; i++) {
        const struct track *k = &t->tracks[i];
        double seen = t->cfg.detection_probability * k->life.existence;
        double *cost = t->cost + i * n_columns;
        for (size_t j = 0; j < scan->n; j++) {
            struct track_match m = track_body_match(k, &t->positions[j], NULL);
            struct track_match as_car = track_passing_match(t, k, scan, j, fresh);
            if (as_car.distance2 < m.distance2)
                m = as_car;
            bool mirrored = scan->detections[j].mirror != 0;
            bool near = m.distance2 < t->cfg.gate2 && !k->merged &&
                        stronger[j] == TRACK_NONE && mirrored == (k->mirror.id != 0) &&
                        !track_rests_elsewhere(t, scan, i, j) &&
                        !is_rather_a_walker(t, k, j);
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

void track_associate(struct tracker *t, const struct track_scan *scan, double fresh,
                     size_t *mine, size_t *whose)
{
    size_t column[ASSIGNMENT_ROWS], stronger[TRACK_DETECTIONS];

    find_stronger(t, scan, stronger);
    fill_costs(t, scan, fresh, stronger);
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
    for (size_t j = 0; j < scan->n; j++) {
        size_t with = j;
        while (stronger[with] != TRACK_NONE)
            with = stronger[with];
        whose[j] = whose[with];
    }
}

/* -- of one owner -----------------------------------------------------------------------
 */

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
                           size_t owner, uint32_t mirror, double extent_m[3])
{
    for (int a = 0; a < 3; a++) {
        double low = INFINITY, high = -INFINITY;
        for (size_t j = 0; j < scan->n; j++) {
            const struct track_detection *d = &scan->detections[j];
            if (whose[j] != owner || d->mirror != mirror)
                continue;
            low = fmin(low, d->position_m[a] - 0.5 * d->extent_m[a]);
            high = fmax(high, d->position_m[a] + 0.5 * d->extent_m[a]);
        }
        extent_m[a] = high - low;
    }
}

/* By way of one wall, or of none. */
static void gather_by(const struct tracker *t, const struct track_scan *scan,
                      const size_t *whose, size_t owner, uint32_t mirror,
                      struct track_position *middle)
{
    double power = 0.0, moving = 0.0;

    memset(middle, 0, sizeof *middle);
    for (size_t j = 0; j < scan->n; j++)
        if (whose[j] == owner && scan->detections[j].mirror == mirror)
            power += scan->detections[j].power;
    for (size_t j = 0; j < scan->n; j++) {
        const struct track_position *p = &t->positions[j];
        if (whose[j] != owner || scan->detections[j].mirror != mirror)
            continue;
        add_position(middle, p, scan->detections[j].power / power);
        if (p->has_velocity && scan->detections[j].power > moving) {
            moving = scan->detections[j].power;
            middle->has_velocity = true;
            middle->velocity_doubt = p->velocity_doubt;
            middle->velocity_fresh = p->velocity_fresh;
            memcpy(middle->velocity_m_s, p->velocity_m_s, sizeof p->velocity_m_s);
            memcpy(middle->velocity_m2_s2, p->velocity_m2_s2, sizeof p->velocity_m2_s2);
        }
    }
    for (size_t j = 0; j < scan->n; j++) {
        double share = scan->detections[j].power / power;
        bool its = whose[j] == owner && scan->detections[j].mirror == mirror;
        for (int a = 0; its && a < 2; a++)
            for (int b = 0; b < 2; b++) {
                double scatter_m2 = share * (t->positions[j].at_m[a] - middle->at_m[a]) *
                                    (t->positions[j].at_m[b] - middle->at_m[b]);
                middle->covariance_m2[a][b] += scatter_m2;
                middle->walker_m2[a][b] += scatter_m2;
            }
    }
}

/* The strongest detection of an owner by way of a wall, or of all; scan->n: none. */
static size_t strongest_by(const struct track_scan *scan, const size_t *whose,
                           size_t owner, const uint32_t *mirror)
{
    size_t best = scan->n;

    for (size_t j = 0; j < scan->n; j++)
        if (whose[j] == owner && (!mirror || scan->detections[j].mirror == *mirror) &&
            (best == scan->n || scan->detections[j].power > scan->detections[best].power))
            best = j;
    return best;
}

void track_gather(const struct tracker *t, const struct track_scan *scan,
                  const size_t *whose, size_t owner, uint32_t followed,
                  struct track_gathered *out)
{
    size_t loudest = strongest_by(scan, whose, owner, NULL);
    size_t usual = strongest_by(scan, whose, owner, &followed);
    bool stays = usual < scan->n &&
                 LOUDER * scan->detections[usual].power > scan->detections[loudest].power;

    out->detection = stays ? usual : loudest;
    uint32_t first = scan->detections[out->detection].mirror;
    out->existence = 0.0;
    for (size_t j = 0; j < scan->n; j++)
        if (whose[j] == owner)
            out->existence = fmax(out->existence, scan->detections[j].existence);
    measure_extent(scan, whose, owner, first, out->extent_m);
    gather_by(t, scan, whose, owner, first, &out->by[0]);
    out->middle = out->by[0];
    out->n_walls = 1;
    for (size_t i = 0; i < scan->n_mirrors && out->n_walls < TRACK_MIRRORS; i++) {
        uint32_t id = scan->mirrors[i].id;
        struct track_position *p = &out->by[out->n_walls];
        if (id == first || strongest_by(scan, whose, owner, &id) == scan->n)
            continue;
        gather_by(t, scan, whose, owner, id, p);
        out->n_walls += track_position_join(&out->middle, p, t->cfg.gate2);
    }
}
