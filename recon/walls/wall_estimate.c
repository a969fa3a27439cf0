/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_estimate.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "recon/geometry.h"

#define LEAST_HEARD  9     /* pairs: so few do not agree on three numbers by chance */
#define GUESSES_MOST 12    /* looked into for each list */
#define SURER        0.2   /* share of the pairs */
#define EXPLAINED_M  0.035 /* echoes this near to a wall's path are its; its main lobe */
#define BEND_M       0.5   /* how much farther it bends on (bench_bends) */

static const double tolerance_m[2] = {0.08, 0.012};

/* -- a small thing near the array -------------------------------------------------------
 *
 * It returns every pair's sound too, and some of it where a plane would: by way of one
 * point (s to p to m) and not of an image source.  Whichever explains more of the echoes
 * is there. */

#define ROUNDS      8
#define POINT_HEARD 6 /* pairs, at least */
#define LEAST_PIVOT 1e-4

struct near_reflector {
    double at_m[3];
    double rms_m;   /* of the residuals of paths */
    size_t n_heard; /* pairs that hear it */
};

/* By way of the point, and how that grows when the point moves. */
static double path_by(const struct wall_echo *e, const double at[3], double slope[3])
{
    double in = geometry_distance(e->speaker_m, at);
    double out = geometry_distance(at, e->microphone_m), growth = 0.0;
    for (int a = 0; a < 3; a++) {
        slope[a] = (at[a] - e->speaker_m[a]) / fmax(in, 1e-6) +
                   (at[a] - e->microphone_m[a]) / fmax(out, 1e-6);
        growth -= slope[a] * e->velocity_m_s[a];
    }
    return in + out + e->lag_s * growth;
}

/* The echo of the pair that begins at *i; *i moves on to the next pair.  How far it is
 * from the point's path. */
static double nearest(const struct near_reflector *t, const struct wall_echo *echoes,
                      size_t n, size_t *i, double slope[3])
{
    uint32_t pair = echoes[*i].pair;
    double path_m = path_by(&echoes[*i], t->at_m, slope), best = INFINITY;
    for (; *i < n && echoes[*i].pair == pair; (*i)++)
        if (fabs(echoes[*i].path_m - path_m) < fabs(best))
            best = echoes[*i].path_m - path_m;
    return best;
}

static int improve_once(struct near_reflector *t, const struct wall_echo *echoes,
                        size_t n, double tolerance)
{
    double a[9] = {0.0}, b[3] = {0.0}, sum = 0.0;
    t->n_heard = 0;
    for (size_t i = 0; i < n;) {
        double slope[3], r = nearest(t, echoes, n, &i, slope);
        if (fabs(r) > tolerance)
            continue;
        double u = r / tolerance, weight = (1.0 - u * u) * (1.0 - u * u);
        t->n_heard++;
        sum += r * r;
        for (int p = 0; p < 3; p++) {
            b[p] += weight * slope[p] * r;
            for (int q = 0; q < 3; q++)
                a[3 * p + q] += weight * slope[p] * slope[q];
        }
    }
    if (t->n_heard < POINT_HEARD)
        return -EDOM;
    t->rms_m = sqrt(sum / (double)t->n_heard);
    normal_equations_solve(3, a, b, LEAST_PIVOT);
    for (int p = 0; p < 3; p++)
        t->at_m[p] += b[p];
    return 0;
}

/* Improves t->at_m, a first guess: reweighted least squares over the echo of each pair
 * that comes nearest, within tolerance_m[0] at first and tolerance_m[1] at last.  What
 * the places of the elements do not tell stays as guessed.  The array's own motion is
 * left out but for what the chirp makes of it.  0, or -EDOM: fewer than 6 pairs. */
static int near_reflector_improve(struct near_reflector *t,
                                  const struct wall_echo *echoes, size_t n)
{
    int err = 0;
    for (int k = 0; !err && k < ROUNDS; k++) {
        double part = (double)k / (ROUNDS - 2.0);
        err =
            improve_once(t, echoes, n,
                         fmax(tolerance_m[1],
                              tolerance_m[0] + part * (tolerance_m[1] - tolerance_m[0])));
    }
    return err;
}

/* -- walls ------------------------------------------------------------------------------
 */

void wall_estimate_default(struct wall_estimate_config *cfg)
{
    *cfg = (struct wall_estimate_config){
        .prior = {.vertical = true,
                  .vertical_rad = 2.0 * M_PI / 180.0,
                  .sound_speed = 1e-3,
                  .delay_m = 2e-3},
        .reach_m = {0.1, 5.0},
        .least_share = 0.5,
        .rms_m = 0.006,
        .turn_rad = 10.0 * M_PI / 180.0,
        .tilt_rad = 40.0 * M_PI / 180.0,
        .aside_rad = 65.0 * M_PI / 180.0,
    };
}

struct search {
    const struct wall_estimate_config *cfg;
    struct wall_echo *left; /* echoes that nothing explains yet */
    size_t n_left, n_pairs;
    double centre_m[3], aperture_m;
    bool *chosen; /* [n_left] */
    struct wall_estimates *out;
};

static void measure_array(struct search *s)
{
    double low[3] = {INFINITY, INFINITY, INFINITY};
    double high[3] = {-INFINITY, -INFINITY, -INFINITY}, square = 0.0;
    for (size_t i = 0; i < s->n_left; i++)
        for (int a = 0; a < 3; a++) {
            const struct wall_echo *e = &s->left[i];
            low[a] = fmin(low[a], fmin(e->speaker_m[a], e->microphone_m[a]));
            high[a] = fmax(high[a], fmax(e->speaker_m[a], e->microphone_m[a]));
        }
    for (int a = 0; a < 3; a++) {
        s->centre_m[a] = 0.5 * (low[a] + high[a]);
        square += (high[a] - low[a]) * (high[a] - low[a]);
    }
    s->aperture_m = sqrt(square);
}

static bool explains(const struct wall *const *walls, size_t n, const struct wall_echo *e)
{
    return fabs(e->path_m - wall_echo_path_m(e, walls, n)) < EXPLAINED_M;
}

/* By the wall alone, and by its corners with the ground and the walls found before. */
static bool is_explained(const struct search *s, const struct wall *w,
                         const struct wall_echo *e)
{
    if (explains(&w, 1, e))
        return true;
    for (size_t i = 0; i <= s->out->n; i++) {
        const struct wall *other = i < s->out->n ? &s->out->list[i].wall
                                                 : &s->cfg->ground;
        if (other == w || (i == s->out->n && !s->cfg->has_ground))
            continue;
        const struct wall *const there[2] = {w, other}, *const back[2] = {other, w};
        if (explains(there, 2, e) || explains(back, 2, e))
            return true;
    }
    return false;
}

static void take_away(struct search *s, const struct wall *w)
{
    size_t kept = 0;
    for (size_t i = 0; i < s->n_left; i++)
        if (!is_explained(s, w, &s->left[i]))
            s->left[kept++] = s->left[i];
    s->n_left = kept;
}

/* The echoes that a guess which came to nothing was made of, so that the next is another.
 */
static void take_away_chosen(struct search *s)
{
    size_t kept = 0;
    for (size_t i = 0; i < s->n_left; i++)
        if (!s->chosen[i])
            s->left[kept++] = s->left[i];
    s->n_left = kept;
}

static void foot_of(const struct search *s, const struct wall *w, double out[3])
{
    wall_mirror(w, s->centre_m, out);
    for (int a = 0; a < 3; a++)
        out[a] = 0.5 * (out[a] + s->centre_m[a]);
}

/* Would the sound between the array and the middle of one have to pass another? */
static bool is_behind(const struct search *s, const struct wall *w,
                      const struct wall *other)
{
    double foot[3], along;
    foot_of(s, w, foot);
    return wall_crosses(other, s->centre_m, foot, &along);
}

static bool is_hidden(const struct search *s, const struct wall *w)
{
    for (size_t i = 0; i < s->out->n; i++)
        if (is_behind(s, w, &s->out->list[i].wall))
            return true;
    return false;
}

/* A nearer wall may be found after what is seen in it; if that is heard by many more, it
 * stays. */
static void drop_hidden_by(struct search *s, const struct wall *w, double share)
{
    size_t kept = 0;
    for (size_t i = 0; i < s->out->n; i++) {
        if (s->out->list[i].share < share + SURER &&
            is_behind(s, &s->out->list[i].wall, w))
            s->out->n_rejected++;
        else
            s->out->list[kept++] = s->out->list[i];
    }
    s->out->n = kept;
}

/* What only some of the pairs hear has to fit the better: among the echoes of a room some
 * are where any plane has them. */
static double rms_limit_m(const struct wall_estimate_config *cfg, double share)
{
    return cfg->rms_m * fmin(fmax((share - 0.4) / 0.4, 0.4), 1.0);
}

/* Does a thing where the wall is nearest explain the echoes better than the wall? */
static bool is_thing(const struct search *s, const struct wall_fit *fit)
{
    struct near_reflector t = {.n_heard = 0};
    foot_of(s, &fit->wall, t.at_m);
    if (near_reflector_improve(&t, s->left, s->n_left))
        return false;
    return t.n_heard > fit->n_heard ||
           (t.n_heard == fit->n_heard && t.rms_m < fit->rms_m);
}

/* An array hears its own length of a wall; an object is mirrored up to some metres
 * aside of that, where a facade that bends here may have bent back, or a pillar has
 * turned away.  Told as a plane, its turn is as uncertain as that. */
static double turn_of_bend(const struct wall_fit *fit)
{
    return fabs(fit->curvature_1_m) * BEND_M;
}

static void judge(struct search *s, struct wall_fit *fit)
{
    const struct wall_estimate_config *cfg = s->cfg;
    struct wall *w = &fit->wall;
    double share = (double)fit->n_heard / (double)s->n_pairs;
    bool bends = turn_of_bend(fit) > cfg->turn_rad;
    wall_face(w);
    w->covariance[0] += turn_of_bend(fit) * turn_of_bend(fit);
    bool fits = fit->n_heard >= LEAST_HEARD && share >= cfg->least_share &&
                fit->rms_m <= rms_limit_m(cfg, share);
    bool known = sqrt(w->covariance[0]) <= cfg->turn_rad &&
                 sqrt(w->covariance[3]) <= cfg->turn_rad;
    if (fits && known && w->distance_m > cfg->reach_m[0] &&
        w->distance_m < cfg->reach_m[1]) {
        if (w->normal[2] < cos(cfg->aside_rad) ||
            fabs(w->normal[1]) > sin(cfg->tilt_rad) || is_hidden(s, w) ||
            is_thing(s, fit)) {
            s->out->n_rejected++;
        } else {
            drop_hidden_by(s, w, share);
            s->out->list[s->out->n++] = (struct wall_estimate){*w, fit->rms_m, share};
        }
        take_away(s, w);
        return;
    }
    if (fits && bends) {
        s->out->n_bent++;
        s->out->curvature_1_m = fit->curvature_1_m;
    } else if (fits && !known) {
        s->out->n_undetermined++;
    }
    take_away_chosen(s);
}

static int find_walls(struct search *s)
{
    const struct wall_estimate_config *cfg = s->cfg;
    const struct wall_search search = {.upright = cfg->prior.vertical,
                                       .reach_m = {cfg->reach_m[0], cfg->reach_m[1]},
                                       .aperture_m = s->aperture_m,
                                       .tilt_rad = cfg->tilt_rad};
    size_t least = (size_t)ceil(cfg->least_share * (double)s->n_pairs);
    for (int k = 0; k < GUESSES_MOST && s->out->n < WALL_ESTIMATE_MAX; k++) {
        struct wall_fit fit = {.n_heard = 0};
        size_t agree;
        int err = wall_search_best(&search, s->left, s->n_left, &fit.wall, &agree);
        if (err)
            return err;
        if (agree < LEAST_HEARD || 2 * agree < least)
            return 0; /* between two directions some votes go beside */
        err = wall_fit_improve(&fit, &cfg->prior, s->left, s->n_left, tolerance_m,
                               s->chosen);
        if (err == -ENOMEM)
            return err;
        if (!err) {
            judge(s, &fit);
        } else {
            if (agree >= least)
                s->out->n_undetermined++;
            take_away(s, &fit.wall);
        }
    }
    return 0;
}

int wall_estimate(struct wall_estimates *out, const struct wall_estimate_config *cfg,
                  const struct wall_echo *echoes, size_t n, size_t n_pairs)
{
    struct search s = {.cfg = cfg, .n_left = n, .n_pairs = n_pairs, .out = out};
    *out = (struct wall_estimates){.n = 0};
    if (!n || !n_pairs)
        return 0;
    s.left = malloc(n * sizeof *s.left);
    s.chosen = calloc(n, sizeof *s.chosen);
    int err = s.left && s.chosen ? 0 : -ENOMEM;
    if (!err) {
        memcpy(s.left, echoes, n * sizeof *s.left);
        measure_array(&s);
        if (cfg->has_ground) { /* of the ground alone */
            size_t kept = 0;
            const struct wall *ground = &cfg->ground;
            for (size_t i = 0; i < n; i++)
                if (!explains(&ground, 1, &s.left[i]))
                    s.left[kept++] = s.left[i];
            s.n_left = kept;
        }
        err = find_walls(&s);
    }
    free(s.left);
    free(s.chosen);
    return err;
}
