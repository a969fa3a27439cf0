/* SPDX-License-Identifier: MIT */
#include "recon/detection/occupancy.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/cfar_map.h"
#include "dsp/rank.h"
#include "dsp/special.h"

#define COMES_S     10.0  /* one comes in so long a time, somewhere */
#define STAYS_S     0.5   /* and is heard for so long */
#define SPEED_M_S   5.0   /* at most */
#define HEARD       0.4   /* of the pings */
#define MOST_RATIO  400.0 /* that one ping may tell of a block */
#define MOST_ODDS   1e3
#define LEAST_ODDS  0.1 /* of a block, to be looked at */
#define MOST_SPREAD 0.4 /* of odds to either side in one go */
#define AGE_S       1.0
#define NOW_S       0.1 /* powers of a few pings, of which one may be anything */
/* No mean of echoes is brighter than that of their powers: of these, without the 5 dB
 * that what is over others is doubted by besides (recon/tracking/object_tracker.c). */
#define HOLE_SHARE   0.32f
#define LEAST_LATELY 0.18f  /* after 2 of 10 s: before, who comes is all there was */
#define MOST_SIDE    0.16   /* of a source, where it is as far away for most... */
#define FEW_SIDE     0.016  /* ...or for few of the elements */
#define SIDE_M       0.3    /* the depth of a person, and the length of a smear */
#define OWN_M        0.9    /* of a source, in which it is itself */
#define SIDE_TELLS   1.0    /* over the level of a ring, from which on it counts */
#define NEAR_M       1.2    /* of somebody else... */
#define TRACE        0.1    /* ...what has so much of his odds is where he may be, too */
#define FEW_CELLS    8      /* of a ring tell no median */
#define FLOOR        0.5    /* of the median ring, under which none lies */
#define RARE         2e-3   /* of the powers of a ring... */
#define RAREST       1e-4   /* ...and of all */
#define KEEP         0.97   /* of what was learnt of the noise... */
#define FIT_EVERY    32     /* ...in so many pings */
#define ENOUGH       2500.0 /* powers of a ring */
#define BINS         400
#define BIN          0.05 /* of the median */
#define LEAST_SHAPE  0.3
#define MOST_SHAPE   4.0
#define LEARNS_UNDER 10.0 /* odds, for its ring to tell of noise */
#define RINGS        4    /* to either side that it does not, either */
#define MAP_RISE     1.1  /* of what noise exceeds as often as a map tells of */
#define MAP_FACTOR   4.0  /* over what a map knows besides */

static const double signals[] = {4.0, 12.0, 36.0, 108.0, 324.0}; /* over the noise */

/* Powers over the median of their ring, and what they are like. */
struct noise {
    float histogram[BINS];
    double learnt;
    double shape, median, often; /* the last two over the mean */
};

struct sight_of_block {        /* from the array */
    double range_m, toward[3]; /* unit */
};

/* Means of NOW_S and OCCUPANCY_LATELY_S. */
struct brightness {
    float now, lately;             /* over what is around, which who passes raises, */
    float now_power, lately_power; /* and as it is */
};

struct occupancy {
    struct grid blocks;
    size_t n, n_rings;
    float *odds, *spread;      /* [n] */
    float *power;              /* [n] over the median of noise... */
    struct brightness *bright; /* [n] */
    float now_of,
        lately_of; /* what their means are of: less than 1 before so long has passed */
    bool *held;    /* [n] */
    struct cfar_map *map;
    size_t *order, *ring_of; /* [n]: blocks by rings, and whose ring */
    size_t *first;           /* [n_rings + 1] in order */
    float *sorted;           /* [n] */
    double *level;           /* [n_rings] */
    struct sidelobe_array array;
    struct sight_of_block *sights; /* [n] */
    float *beside;       /* [n] power: what is brighter elsewhere may look like it */
    bool *taken;         /* [n_rings] */
    struct noise *noise; /* [n_rings] */
    struct noise all;    /* of all rings together */
    unsigned pings;      /* since shapes were fitted */
    int64_t stamp_ns;
    bool began;
};

static void place(const struct grid *g, size_t block, double at_m[3])
{
    size_t at[3];

    grid_place(g, block, at);
    for (int a = 0; a < 3; a++)
        at_m[a] = g->origin_m[a] + g->step_m[a] * (double)at[a];
}

/* The power over its mean that a part of the noise is brighter than. */
static double power_at(double shape, double part)
{
    double low = 0.0, high = 64.0;

    for (int i = 0; i < 40; i++) {
        double middle = 0.5 * (low + high);
        if (special_gamma_q(shape, shape * middle) > part)
            low = middle;
        else
            high = middle;
    }
    return high;
}

static void set_shape(struct noise *n, double shape)
{
    n->shape = shape;
    n->median = power_at(shape, 0.5);
    n->often = power_at(shape, CFAR_MAP_RARE);
}

static void look_from_array(struct occupancy *o)
{
    for (size_t i = 0; i < o->n; i++) {
        struct sight_of_block *s = &o->sights[i];
        place(&o->blocks, i, s->toward);
        s->range_m = hypot(hypot(s->toward[0], s->toward[1]), s->toward[2]);
        for (int a = 0; a < 3 && s->range_m > 0.0; a++)
            s->toward[a] /= s->range_m;
    }
}

/* Rings are as wide as a block is deep. */
static int lay_rings(struct occupancy *o)
{
    for (size_t i = 0; i < o->n; i++) {
        o->ring_of[i] = (size_t)(o->sights[i].range_m / o->blocks.step_m[2]);
        if (o->ring_of[i] >= o->n_rings)
            o->n_rings = o->ring_of[i] + 1;
    }
    o->first = calloc(o->n_rings + 2, sizeof *o->first);
    o->level = calloc(o->n_rings, sizeof *o->level);
    o->taken = calloc(o->n_rings, sizeof *o->taken);
    o->noise = calloc(o->n_rings, sizeof *o->noise);
    if (!o->first || !o->level || !o->taken || !o->noise)
        return -ENOMEM;
    for (size_t r = 0; r < o->n_rings; r++)
        set_shape(&o->noise[r], 1.0);
    for (size_t i = 0; i < o->n; i++)
        o->first[o->ring_of[i] + 2]++;
    for (size_t r = 0; r < o->n_rings; r++)
        o->first[r + 2] += o->first[r + 1];
    for (size_t i = 0; i < o->n; i++)
        o->order[o->first[o->ring_of[i] + 1]++] = i;
    return 0;
}

int occupancy_create(struct occupancy **out, const struct grid *blocks,
                     const struct sidelobe_array *array)
{
    struct occupancy *o = calloc(1, sizeof *o);

    if (!o)
        return -ENOMEM;
    o->blocks = *blocks;
    o->n = grid_size(blocks);
    o->array = *array;
    o->beside = calloc(o->n, sizeof *o->beside);
    o->sights = calloc(o->n, sizeof *o->sights);
    o->odds = calloc(o->n, sizeof *o->odds);
    o->spread = calloc(o->n, sizeof *o->spread);
    o->power = calloc(o->n, sizeof *o->power);
    o->bright = calloc(o->n, sizeof *o->bright);
    o->held = calloc(o->n, sizeof *o->held);
    o->order = calloc(o->n, sizeof *o->order);
    o->ring_of = calloc(o->n, sizeof *o->ring_of);
    o->sorted = calloc(o->n, sizeof *o->sorted);
    int err = cfar_map_create(&o->map, o->n);
    if (!err && (!o->odds || !o->spread || !o->power || !o->bright || !o->held ||
                 !o->order || !o->ring_of || !o->sorted || !o->beside || !o->sights))
        err = -ENOMEM;
    if (!err) {
        look_from_array(o);
        err = lay_rings(o);
    }
    if (err) {
        occupancy_destroy(o);
        return err;
    }
    *out = o;
    return 0;
}

void occupancy_destroy(struct occupancy *o)
{
    if (!o)
        return;
    cfar_map_destroy(o->map);
    free(o->odds);
    free(o->spread);
    free(o->power);
    free(o->bright);
    free(o->held);
    free(o->order);
    free(o->ring_of);
    free(o->first);
    free(o->sorted);
    free(o->beside);
    free(o->sights);
    free(o->level);
    free(o->taken);
    free(o->noise);
    free(o);
}

void occupancy_reset(struct occupancy *o)
{
    memset(o->odds, 0, o->n * sizeof *o->odds);
    memset(o->bright, 0, o->n * sizeof *o->bright);
    o->now_of = o->lately_of = 0.0f;
    cfar_map_reset(o->map);
    o->began = false;
}

/* -- noise ------------------------------------------------------------------------------
 */

static float ring_median(struct occupancy *o, size_t ring, const float *power)
{
    size_t n = 0;

    for (size_t k = o->first[ring]; k < o->first[ring + 1]; k++)
        if (power[o->order[k]] > 0.0f)
            o->sorted[n++] = power[o->order[k]];
    return n >= FEW_CELLS ? rank_smallest(o->sorted, n, (n + 1) / 2) : 0.0f;
}

/* The median of each ring, or of it and its neighbours where that is more, and not far
 * under that of all: a ring may be a third empty, or be heard by few. */
static void measure_rings(struct occupancy *o, const float *power)
{
    size_t n = 0;
    double before = 0.0;

    for (size_t r = 0; r < o->n_rings; r++)
        o->level[r] = (double)ring_median(o, r, power);
    for (size_t r = 0; r < o->n_rings; r++)
        if (o->level[r] > 0.0)
            o->sorted[n++] = (float)o->level[r];
    double least = n ? FLOOR * (double)rank_smallest(o->sorted, n, (n + 1) / 2) : 0.0;
    for (size_t r = 0; r < o->n_rings; r++) {
        double own = o->level[r], after = r + 1 < o->n_rings ? o->level[r + 1] : 0.0;
        o->level[r] = fmax(fmax(own, (before + own + after) / 3.0), least);
        before = own;
    }
}

/* Rings with something in them, and those beside them, tell of no noise. */
static void take_rings(struct occupancy *o)
{
    memset(o->taken, 0, o->n_rings * sizeof *o->taken);
    for (size_t i = 0; i < o->n; i++) {
        size_t ring = o->ring_of[i];
        if (o->odds[i] < (float)LEARNS_UNDER)
            continue;
        for (size_t r = ring > RINGS ? ring - RINGS : 0; r <= ring + RINGS; r++)
            if (r < o->n_rings)
                o->taken[r] = true;
    }
}

/* Of the gamma distributions the one whose rare powers lie as far over its median.  Where
 * a tail is none of a shape's that is a lower one: the careful error. */
static double fit_shape(const struct noise *n, double part)
{
    double above = 0.0, low = LEAST_SHAPE, high = MOST_SHAPE;
    size_t bin = BINS;

    while (bin > 0 && above < part * n->learnt)
        above += (double)n->histogram[--bin];
    double rare = BIN * (double)(bin + 1);
    for (int i = 0; i < 20; i++) {
        double shape = 0.5 * (low + high);
        if (special_gamma_q(shape, shape * rare * power_at(shape, 0.5)) > part)
            low = shape;
        else
            high = shape;
    }
    return high;
}

static void forget(struct noise *n)
{
    n->learnt *= KEEP;
    for (int b = 0; b < BINS; b++)
        n->histogram[b] *= (float)KEEP;
}

static void add(struct noise *n, float power)
{
    double bin = (double)power / BIN;

    n->histogram[bin < BINS - 1 ? (size_t)bin : BINS - 1] += 1.0f;
    n->learnt += 1.0;
}

/* A ring's own powers are too few to tell the rarest: how much rarer than their shape
 * lets them be these are is taken from all rings. */
static void fit_shapes(struct occupancy *o)
{
    double heavier = fmin(fit_shape(&o->all, RAREST) / fit_shape(&o->all, RARE), 1.0);

    for (size_t r = 0; r < o->n_rings; r++) {
        struct noise *n = &o->noise[r];
        if (n->learnt > ENOUGH)
            set_shape(n, fmax(heavier * fit_shape(n, RARE), LEAST_SHAPE));
        forget(n);
    }
    forget(&o->all);
    o->pings = 0;
}

static void learn_shapes(struct occupancy *o)
{
    take_rings(o);
    for (size_t i = 0; i < o->n; i++) {
        size_t ring = o->ring_of[i];
        if (!(o->power[i] > 0.0f) || o->taken[ring])
            continue;
        add(&o->noise[ring], o->power[i]);
        add(&o->all, o->power[i]);
    }
    if (++o->pings >= FIT_EVERY)
        fit_shapes(o);
}

/* What is so bright is imaged wherever it is as far away: for most elements, or faintly
 * for few of them.  What is farther than some of them hear is imaged by the others. */
static void shine(struct occupancy *o, size_t source, double power)
{
    const struct sight_of_block *from = &o->sights[source];
    double farthest_m = from->range_m;

    for (int a = 0; a < 3; a++)
        farthest_m += o->array.half_m[a] * fabs(from->toward[a]);
    for (size_t i = 0; i < o->n; i++) {
        const struct sight_of_block *to = &o->sights[i];
        double off_m = fabs(to->range_m - from->range_m), reach_m = SIDE_M, away2 = 0.0;
        for (int a = 0; a < 3; a++) {
            double way_m = to->range_m * to->toward[a] - from->range_m * from->toward[a];
            away2 += way_m * way_m;
            reach_m += o->array.half_m[a] * fabs(to->toward[a] - from->toward[a]);
        }
        if (off_m > reach_m || away2 < OWN_M * OWN_M)
            continue;
        bool most = off_m < SIDE_M || farthest_m > o->array.gate_m;
        double shines = (most ? MOST_SIDE : FEW_SIDE) * power;
        o->beside[i] = fmaxf(o->beside[i], (float)shines);
    }
}

static void look_beside(struct occupancy *o, const float *power)
{
    memset(o->beside, 0, o->n * sizeof *o->beside);
    for (size_t r = 0; r < o->n_rings; r++) {
        size_t source = o->order[o->first[r]];
        if (o->first[r] == o->first[r + 1])
            continue;
        for (size_t k = o->first[r]; k < o->first[r + 1]; k++)
            if (power[o->order[k]] > power[source])
                source = o->order[k];
        if (MOST_SIDE * (double)power[source] > SIDE_TELLS * o->level[r])
            shine(o, source, (double)power[source]);
    }
}

/* -- odds -------------------------------------------------------------------------------
 */

static void spread_along(const struct occupancy *o, int axis, float share,
                         const float *from, float *to)
{
    const struct grid *g = &o->blocks;
    size_t stride = axis == 0 ? 1 : axis == 1 ? g->n[0] : g->n[0] * g->n[1];

    for (size_t i = 0; i < o->n; i++) {
        size_t at = i / stride % g->n[axis];
        float below = at > 0 ? from[i - stride] : 0.0f;
        float above = at + 1 < g->n[axis] ? from[i + stride] : 0.0f;
        to[i] = from[i] + share * (below + above - 2.0f * from[i]);
    }
}

/* What is somewhere may have gone on by any way up to SPEED_M_S times the time. */
static void move(struct occupancy *o, double dt_s)
{
    for (int a = 0; a < 3; a++) {
        double way = SPEED_M_S * dt_s / o->blocks.step_m[a];
        double share = o->blocks.n[a] > 1 ? way * way / 6.0 : 0.0;
        int times = (int)ceil(share / MOST_SPREAD);
        for (int k = 0; k < times; k++) {
            float *odds = o->odds;
            spread_along(o, a, (float)(share / times), odds, o->spread);
            o->odds = o->spread;
            o->spread = odds;
        }
    }
}

/* Gamma distributed power of the same shape and 1 + s times the mean, against noise. */
static double ratio(double shape, double power)
{
    double sum = 0.0;

    for (size_t s = 0; s < sizeof signals / sizeof *signals; s++)
        sum += exp(shape * (power * signals[s] / (1.0 + signals[s]) - log1p(signals[s])));
    sum /= (double)(sizeof signals / sizeof *signals);
    return 1.0 - HEARD + HEARD * fmin(sum, MOST_RATIO);
}

void occupancy_step(struct occupancy *o, const float *power, int64_t stamp_ns)
{
    double dt_s = o->began ? 1e-9 * (double)(stamp_ns - o->stamp_ns) : 0.0;

    if (o->began && !(dt_s > 0.0 && dt_s <= AGE_S)) {
        occupancy_reset(o);
        dt_s = 0.0;
    }
    o->began = true;
    o->stamp_ns = stamp_ns;
    move(o, dt_s);
    measure_rings(o, power);
    look_beside(o, power);
    float share = (float)(1.0 - exp(-dt_s / OCCUPANCY_LATELY_S));
    float now_share = (float)(1.0 - exp(-dt_s / NOW_S));
    o->now_of += now_share * (1.0f - o->now_of);
    o->lately_of += share * (1.0f - o->lately_of);
    double comes = dt_s / COMES_S / (double)o->n, stays = exp(-dt_s / STAYS_S);
    for (size_t i = 0; i < o->n; i++) {
        double level = o->level[o->ring_of[i]] + (double)o->beside[i];
        double odds = (double)o->odds[i] * stays + comes;
        o->power[i] = power[i] > 0.0f ? (float)((double)power[i] / level) : 0.0f;
        if (o->power[i] > 0.0f) {
            const struct noise *n = &o->noise[o->ring_of[i]];
            double mostly = cfar_map_at(o->map, i) * n->median - MAP_RISE * n->often;
            odds *= ratio(n->shape, (double)o->power[i] * n->median /
                                        (1.0 + MAP_FACTOR * fmax(mostly, 0.0)));
        }
        o->odds[i] = (float)fmin(odds, MOST_ODDS);
        struct brightness *b = &o->bright[i];
        b->now += now_share * (o->power[i] - b->now);
        b->lately += share * (o->power[i] - b->lately);
        b->now_power += now_share * (power[i] - b->now_power);
        b->lately_power += share * (power[i] - b->lately_power);
    }
    learn_shapes(o);
}

void occupancy_learn(struct occupancy *o, const double (*held)[3], size_t n,
                     double held_m)
{
    for (size_t i = 0; i < o->n; i++) {
        double at_m[3];
        place(&o->blocks, i, at_m);
        o->held[i] = false;
        for (size_t k = 0; k < n; k++)
            o->held[i] |= geometry_distance(at_m, held[k]) < held_m;
    }
    if (o->began)
        cfar_map_learn(o->map, o->power, o->held, o->stamp_ns);
}

/* -- places -----------------------------------------------------------------------------
 */

/* The odds that something is within reach_m, and their middle; 0 where they are what
 * those of somebody beside have spread to. */
static double gather(const struct occupancy *o, const double at_m[3], double reach_m,
                     double middle_m[3])
{
    double sum = 0.0, by_m[3] = {0.0}, p_m[3], own = 0.0, most = 0.0;

    for (size_t i = 0; i < o->n; i++) {
        double odds = (double)o->odds[i];
        place(&o->blocks, i, p_m);
        double away_m = geometry_distance(p_m, at_m);
        if (away_m < NEAR_M)
            most = fmax(most, odds);
        if (away_m > reach_m)
            continue;
        own = fmax(own, odds);
        sum += odds;
        for (int a = 0; a < 3; a++)
            by_m[a] += odds * p_m[a];
    }
    for (int a = 0; a < 3; a++)
        middle_m[a] = sum > 0.0 ? by_m[a] / sum : at_m[a];
    return own < TRACE * most ? 0.0 : sum;
}

double occupancy_near(const struct occupancy *o, const double at_m[3], double reach_m)
{
    double middle_m[3], odds = gather(o, at_m, reach_m, middle_m);

    return odds / (1.0 + odds);
}

/* By that of both which has it brighter: beside somebody bright nobody stands out, and
 * what he has left where he was does once he is gone. */
double occupancy_lately(const struct occupancy *o, const double at_m[3], double reach_m)
{
    struct brightness most = {.now = 0.0f};
    double share = (double)o->now_of / (double)fmaxf(o->lately_of, LEAST_LATELY), p_m[3];

    for (size_t i = 0; i < o->n; i++) {
        const struct brightness *b = &o->bright[i];
        place(&o->blocks, i, p_m);
        if (geometry_distance(p_m, at_m) > reach_m)
            continue;
        most.now = fmaxf(most.now, b->now);
        most.lately = fmaxf(most.lately, b->lately);
        most.now_power = fmaxf(most.now_power, b->now_power);
        most.lately_power = fmaxf(most.lately_power, b->lately_power);
    }
    if (!(most.now > 0.0f && most.now_power > 0.0f))
        return 0.0;
    return share * (double)fmaxf(most.lately / most.now,
                                 HOLE_SHARE * most.lately_power / most.now_power);
}

/* The likeliest block within apart_m; of equals the first. */
static bool leads(const struct occupancy *o, size_t block, double apart_m)
{
    double at_m[3], p_m[3];

    place(&o->blocks, block, at_m);
    for (size_t i = 0; i < o->n; i++) {
        bool above = o->odds[i] > o->odds[block] ||
                     (o->odds[i] == o->odds[block] && i < block);
        if (!above)
            continue;
        place(&o->blocks, i, p_m);
        if (geometry_distance(p_m, at_m) < apart_m)
            return false;
    }
    return true;
}

static void insert(struct occupancy_spot *spots, size_t *n, size_t max,
                   const struct occupancy_spot *spot)
{
    size_t at = *n;

    while (at > 0 && spots[at - 1].probability < spot->probability)
        at--;
    if (at == max)
        return;
    *n += *n < max;
    memmove(spots + at + 1, spots + at, (*n - at - 1) * sizeof *spots);
    spots[at] = *spot;
}

size_t occupancy_spots(const struct occupancy *o, double probability, double apart_m,
                       struct occupancy_spot *out, size_t max)
{
    size_t n = 0;

    for (size_t i = 0; i < o->n; i++) {
        struct occupancy_spot spot;
        double at_m[3];
        if (o->odds[i] < (float)LEAST_ODDS || !leads(o, i, apart_m))
            continue;
        place(&o->blocks, i, at_m);
        double odds = gather(o, at_m, 0.5 * apart_m, spot.at_m);
        spot.probability = odds / (1.0 + odds);
        if (spot.probability >= probability)
            insert(out, &n, max, &spot);
    }
    return n;
}
