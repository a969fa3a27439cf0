/* SPDX-License-Identifier: MIT */
#include "recon/detection/multipath.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "recon/detection/peak.h"

/* By which an echo leaves a body beside the place it is imaged at. */
#define BODY_M      0.05
#define BODY_SIZE_M 0.15 /* what is nearer to each other is one body's */
#define ALIKE_DB    3.0  /* louder than what makes it by more an echo is not */
#define PRIOR       0.5  /* that what can make an echo does: nothing is known of it */
#define OTHERS      1.0  /* objects that are expected where they are not looked for */
#define UNSEEN_M    0.5  /* mean way to what is not seen, and back, over two */
#define GROUND_M    2.0  /* heights over the ground are spread over so much */
#define KNOWN       0.2 /* of the image: what is known no better makes nothing else likely */
#define SHADED      0.7 /* of what stands behind a body nothing is heard */
#define LEAST_COS   0.1 /* what is farther aside is not imaged */

/* A place as the array's middle has it. */
struct sight {
    double u[3];
    double range_m, range_sigma_m;
    double sigma[2]; /* of u, x and y: error, and what is seen of it */
    double error[2]; /* without the latter */
    bool known;      /* where it is */
};

/* One object and all of them; judged: existence, of those that are nearer with what is
 * known of them. */
struct query {
    const struct multipath_config *cfg;
    const struct detection *found;
    const struct sight *at;
    const double *raw, *judged;
    size_t n, g;
    bool straight; /* ask only for what was heard straight, one way of the two */
};

struct cause {
    double likelihood; /* density over range and u, x and y, with its prior */
    enum multipath kind;
    size_t of[2];
};

static struct sight sight_of(const struct multipath_config *cfg,
                             const struct detection *d)
{
    static const int diagonal[3] = {0, 3, 5};
    static const int element[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    struct sight s = {.known = true};
    double variance_m2 = BODY_M * BODY_M, size_m = cbrt(cfg->volume_m3);

    for (int a = 0; a < 3; a++) {
        s.u[a] = d->position_m[a] - cfg->centre_m[a];
        s.range_m = hypot(s.range_m, s.u[a]);
    }
    for (int a = 0; a < 3; a++)
        s.u[a] /= fmax(s.range_m, 1e-9);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3 && !d->at_border; b++)
            variance_m2 += s.u[a] * s.u[b] * d->covariance_m2[element[a][b]];
    s.range_sigma_m = fmin(sqrt(fmax(variance_m2, 0.0)), size_m);
    for (int a = 0; a < 2; a++) {
        double seen_m = 0.5 * d->extent_m[a];
        bool ends = d->at_border & (PEAK_BORDER(a, 0) | PEAK_BORDER(a, 1));
        double error_m = ends ? seen_m : sqrt(d->covariance_m2[diagonal[a]]);
        error_m =
            hypot(error_m, BODY_M); /* at the end of the image: what is seen of it */
        double sigma_m = hypot(error_m, seen_m / sqrt(3.0));
        s.error[a] = fmin(error_m, size_m) / fmax(s.range_m, 1e-9);
        s.sigma[a] = fmin(sigma_m, size_m) / fmax(s.range_m, 1e-9);
        s.known = s.known && error_m < KNOWN * size_m;
    }
    return s;
}

static double normal(double off, double sigma)
{
    return exp(-0.5 * off * off / (sigma * sigma)) / (sqrt(2.0 * M_PI) * sigma);
}

/* How well its direction agrees with one that has these errors. */
static double agree(const struct sight *g, const double u[2], const double sigma[2])
{
    return normal(g->u[0] - u[0], hypot(g->error[0], sigma[0])) *
           normal(g->u[1] - u[1], hypot(g->error[1], sigma[1]));
}

/* What is ga + hb in range and direction: of halves, the mean; of 2 and -1, what a lies
 * in the middle of b and it. */
static double combine(const struct sight *at, double g, const struct sight *a, double h,
                      const struct sight *b, double extra_m)
{
    double u[2], sigma[2], sigma_m;

    for (int i = 0; i < 2; i++) {
        u[i] = g * a->u[i] + h * b->u[i];
        sigma[i] = hypot(g * a->sigma[i], h * b->sigma[i]);
    }
    sigma_m = hypot(hypot(g * a->range_sigma_m, h * b->range_sigma_m), at->range_sigma_m);
    return agree(at, u, sigma) *
           normal(at->range_m - g * a->range_m - h * b->range_m - extra_m, sigma_m);
}

static void consider(struct cause *best, double *sum, enum multipath kind, size_t p,
                     size_t b, double likelihood)
{
    *sum += likelihood;
    if (likelihood > best->likelihood)
        *best = (struct cause){likelihood, kind, {p, b}};
}

/* The nearest places of two boxes: a bounce is between what they turn to each other. */
static double gap_m(const struct detection *a, const struct detection *b)
{
    double sum = 0.0;

    for (int i = 0; i < 3; i++) {
        double reach_m = i == 2 ? 0.0 : 0.5 * (a->extent_m[i] + b->extent_m[i]);
        double off_m = fabs(a->position_m[i] - b->position_m[i]);
        double apart_m = fmax(off_m - reach_m, 0.0);
        sum += apart_m * apart_m;
    }
    return sqrt(sum);
}

/* By way of level ground, whose height follows from the range: only the direction is
 * compared.  once: one way of the two. */
static double by_ground(const struct multipath_config *cfg, const struct sight *g,
                        const struct sight *p, bool once)
{
    double far_m = once ? 2.0 * g->range_m - p->range_m : g->range_m;
    double up_m = p->u[1] * p->range_m;
    double rest = up_m * up_m + far_m * far_m - p->range_m * p->range_m;
    double over_m = 0.5 * (up_m + sqrt(fmax(rest, 0.0)));
    double u[2], sigma[2];

    if (cfg->centre_m[1] + up_m - over_m > cfg->lowest_m || over_m <= BODY_M)
        return 0.0;
    u[0] = p->u[0] * p->range_m / far_m;
    u[1] = (up_m - 2.0 * over_m) / far_m;
    for (int a = 0; a < 2; a++) {
        if (once)
            u[a] = 0.5 * (u[a] + p->u[a]);
        sigma[a] = p->sigma[a];
    }
    return agree(g, u, sigma) / GROUND_M;
}

/* By way of the wall there and straight back, or the other way round. */
static double half_straight(const struct query *q, const struct sight *g, size_t p)
{
    const struct sight *seen = &q->at[p];
    double likelihood = 0.0;

    for (size_t w = 0; w < q->cfg->n_walls; w++) {
        struct sight real = *seen;
        double at_m[3];
        wall_mirror(&q->cfg->walls[w], q->found[p].position_m, at_m);
        real.range_m = geometry_distance(at_m, q->cfg->centre_m);
        for (int a = 0; a < 3; a++)
            real.u[a] = (at_m[a] - q->cfg->centre_m[a]) / fmax(real.range_m, 1e-9);
        likelihood += combine(g, 0.5, seen, 0.5, &real, 0.0);
    }
    return likelihood;
}

/* A body that stands has its feet below it, which are no image of it in the ground. */
static bool is_below(const struct detection *foot, const struct detection *body)
{
    bool below = foot->position_m[1] < body->position_m[1] && body->extent_m[1] > 0.0;

    for (int a = 0; a < 3; a += 2)
        below = below && fabs(foot->position_m[a] - body->position_m[a]) <
                             0.5 * body->extent_m[a] + 2.0 * BODY_M;
    return below;
}

/* Of a body's shadow: 1 in its middle, fading to its ends. */
static double off_middle(const struct sight *g, const struct sight *body)
{
    double x = (g->u[0] - body->u[0]) / body->sigma[0];
    double y = (g->u[1] - body->u[1]) / body->sigma[1];

    return exp(-0.5 * (x * x + y * y));
}

/* What one other object may make of g, and how much of g it hides. */
static void ask_one(const struct query *q, size_t p, struct cause *best, double *sum,
                    double *shade)
{
    const struct sight *g = &q->at[q->g], *from = &q->at[p];
    double behind_m = g->range_m - from->range_m, weight = PRIOR * q->judged[p];
    double behind = agree(g, from->u, from->sigma);
    double ground = by_ground(q->cfg, g, from, false);

    if (!is_below(&q->found[q->g], &q->found[p]))
        ground += by_ground(q->cfg, g, from, true);
    *shade = fmax(*shade, q->judged[p] * SHADED * off_middle(g, from));
    consider(best, sum, MULTIPATH_SHADOW, p, p,
             weight * behind * exp(-behind_m / UNSEEN_M) / UNSEEN_M);
    consider(best, sum, MULTIPATH_FACE, p, p, 0.5 * weight * ground);
}

/* p is nearer than g; b may be farther: an image in a face, if g is half way to it.  The
 * images of one face prove each other, objects or not. */
static void ask_pair(const struct query *q, size_t p, size_t b, struct cause *best,
                     double *sum)
{
    const struct sight *g = &q->at[q->g], *from = &q->at[p], *to = &q->at[b];
    double real = PRIOR * q->judged[p] * q->judged[b];
    double face = PRIOR * q->judged[p] * q->raw[b];
    double gap = gap_m(&q->found[p], &q->found[b]);

    if (to->range_m > g->range_m) {
        consider(best, sum, MULTIPATH_FACE, p, b,
                 face * combine(g, 0.5, from, 0.5, to, 0.0));
        return;
    }
    if (p < b)
        consider(best, sum, MULTIPATH_PAIR, p, b,
                 real * combine(g, 0.5, from, 0.5, to, 0.5 * gap));
    consider(best, sum, MULTIPATH_PAIR, p, b, real * combine(g, 1.0, from, 0.0, to, gap));
    if (to->range_m > from->range_m)
        consider(best, sum, MULTIPATH_FACE, p, b,
                 face * combine(g, 2.0, to, -1.0, from, 0.0));
}

static bool is_apart(const struct query *q, size_t p)
{
    return geometry_distance(q->found[p].position_m, q->found[q->g].position_m) >
           BODY_SIZE_M;
}

static bool may_make(const struct query *q, size_t p)
{
    return p != q->g && q->at[p].known && is_apart(q, p) &&
           q->found[p].level_db > q->found[q->g].level_db - ALIKE_DB;
}

static void judge(const struct query *q, struct detection *d)
{
    const struct sight *g = &q->at[q->g];
    struct cause best = {.likelihood = 0.0};
    double sum = 0.0, shade = 0.0;

    for (size_t p = 0; p < q->n; p++) {
        if (!may_make(q, p))
            continue;
        if (q->straight) {
            consider(&best, &sum, MULTIPATH_FACE, p, p,
                     PRIOR * q->judged[p] * half_straight(q, g, p));
            continue;
        }
        if (q->at[p].range_m >= g->range_m)
            continue;
        ask_one(q, p, &best, &sum, &shade);
        for (size_t b = 0; b < q->n; b++)
            if (b != p && b != q->g && q->at[b].known && is_apart(q, b))
                ask_pair(q, p, b, &best, &sum);
    }
    double object = OTHERS * (1.0 - shade) * g->range_m * g->range_m /
                    (fmax(fabs(g->u[2]), LEAST_COS) * q->cfg->volume_m3);
    d->existence *= object / (object + sum);
    if (sum > object) {
        d->multipath = best.kind;
        memcpy(d->of, best.of, sizeof d->of);
    }
}

void multipath_judge(const struct multipath_config *cfg, struct detection *found,
                     size_t n)
{
    struct sight at[MULTIPATH_MAX];
    double raw[MULTIPATH_MAX], judged[MULTIPATH_MAX];
    bool done[MULTIPATH_MAX] = {false};

    n = n < MULTIPATH_MAX ? n : MULTIPATH_MAX;
    for (size_t i = 0; i < n; i++) {
        at[i] = sight_of(cfg, &found[i]);
        raw[i] = judged[i] = found[i].existence;
    }
    for (size_t k = 0; k < n; k++) { /* from the nearest: what makes echoes is nearer */
        struct query q = {cfg, found, at, raw, judged, n, n, false};
        for (size_t i = 0; i < n; i++)
            if (!done[i] && (q.g == n || at[i].range_m < at[q.g].range_m))
                q.g = i;
        q.n = q.g < cfg->n_plain ? cfg->n_plain : n;
        judge(&q, &found[q.g]);
        judged[q.g] = found[q.g].existence;
        done[q.g] = true;
    }
    for (size_t i = 0; i < n && cfg->n_walls > 0; i++) { /* by what may be farther */
        struct query q = {
            cfg, found, at, raw, judged, i < cfg->n_plain ? cfg->n_plain : n, i, true};
        judge(&q, &found[i]);
    }
}

void multipath_config_fill(struct multipath_config *cfg, const struct geometry *geometry,
                           const struct grid *grid)
{
    double low[3], high[3];

    geometry_aperture(geometry, low, high);
    *cfg = (struct multipath_config){.lowest_m = low[1], .volume_m3 = 1.0};
    for (int a = 0; a < 3; a++) {
        cfg->centre_m[a] = 0.5 * (low[a] + high[a]);
        cfg->volume_m3 *= grid->step_m[a] * (double)grid->n[a];
    }
}
