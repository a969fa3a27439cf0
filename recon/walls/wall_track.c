/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_track.h"

#include <math.h>
#include <string.h>

#include "dsp/normal_equations.h"

#define SURE      0.9
#define GONE      0.1
#define FIRST     0.5  /* existence of what was seen once */
#define GATE      16.3 /* chi squared, 3 degrees of freedom, 1 in 1000 */
#define NEAR_RAD  0.2  /* what is as near as this is the same wall, whatever the */
#define NEAR_M    0.25 /* covariances say: it is taken anew */
#define LEAST_VAR 1e-9

void wall_track_default(struct wall_track_config *cfg)
{
    *cfg = (struct wall_track_config){.seen = 0.8,
                                      .false_alarm = 0.05,
                                      .lost_s = 3.0,
                                      .lost_m = 0.3,
                                      .drift_m = 0.002,
                                      .drift_rad = 0.001,
                                      .per_way = 0.03,
                                      .per_turn = 0.05,
                                      .turn_per_m = 0.01,
                                      .blind_m_s = 1.5,
                                      .blind_rad_s = 0.3};
}

/* Of a covariance, kept off singular. */
static void invert(const double c[6], double out[3][3])
{
    double full[3][3];
    wall_unfold(c, full);
    for (int p = 0; p < 3; p++)
        full[p][p] += LEAST_VAR;
    for (int p = 0; p < 3; p++) {
        double copy[9], column[3] = {p == 0, p == 1, p == 2};
        memcpy(copy, full, sizeof copy);
        normal_equations_solve(3, copy, column, 0.0);
        for (int q = 0; q < 3; q++)
            out[q][p] = column[q];
    }
}

static void fold_up(const double m[3][3], double out[6])
{
    for (int a = 0, q = 0; a < 3; a++)
        for (int b = a; b < 3; b++, q++)
            out[q] = 0.5 * (m[a][b] + m[b][a]);
}

void wall_intersect(const double a[6], const double b[6], double out[6],
                    double gain[3][3])
{
    double trace_a = a[0] + a[3] + a[5] + LEAST_VAR;
    double trace_b = b[0] + b[3] + b[5] + LEAST_VAR;
    double weight = trace_b / (trace_a + trace_b); /* of a */
    double inverse_a[3][3], inverse_b[3][3], sum[3][3], joined[3][3], folded[6];
    invert(a, inverse_a);
    invert(b, inverse_b);
    for (int p = 0; p < 3; p++)
        for (int q = 0; q < 3; q++) {
            inverse_b[p][q] *= 1.0 - weight;
            sum[p][q] = weight * inverse_a[p][q] + inverse_b[p][q];
        }
    for (int p = 0; p < 3; p++) {
        double copy[9], column[3] = {p == 0, p == 1, p == 2};
        memcpy(copy, sum, sizeof copy);
        normal_equations_solve(3, copy, column, 0.0);
        for (int q = 0; q < 3; q++)
            joined[q][p] = column[q];
    }
    for (int p = 0; p < 3; p++)
        for (int q = 0; q < 3; q++) {
            gain[p][q] = 0.0;
            for (int i = 0; i < 3; i++)
                gain[p][q] += joined[p][i] * inverse_b[i][q];
        }
    fold_up((const double(*)[3])joined, folded);
    memcpy(out, folded, sizeof folded); /* may be a or b */
}

static void lose(struct wall_tracks *t, size_t i)
{
    if (t->list[i].confirmed) {
        t->n_lost++;
        t->lost_id = t->list[i].id;
    }
    memmove(&t->list[i], &t->list[i + 1], (t->n - i - 1) * sizeof t->list[i]);
    t->n--;
}

void wall_tracks_predict(struct wall_tracks *t, const struct wall_track_config *cfg,
                         const struct wall_motion *m)
{
    static const double up[3] = {0.0, 1.0, 0.0};
    double blind_m = m->known ? 0.0 : cfg->blind_m_s * m->dt_s;
    double blind_rad = m->known ? 0.0 : cfg->blind_rad_s * m->dt_s;
    double way = cfg->per_way * m->way_m, turn = cfg->per_turn * m->turn_rad;
    double grown = cfg->turn_per_m * cfg->turn_per_m * m->way_m;
    double turn2 = cfg->drift_rad * cfg->drift_rad * m->dt_s + turn * turn +
                   grown * m->way_m + blind_rad * blind_rad;
    double distance2 = cfg->drift_m * cfg->drift_m * m->dt_s + way * way +
                       blind_m * blind_m;
    for (size_t i = 0; i < t->n;) {
        struct wall_track *w = &t->list[i];
        wall_move(&w->wall, up, m->r, m->t, &w->wall);
        wall_face(&w->wall);
        w->wall.covariance[0] += turn2;
        w->wall.covariance[5] += distance2;
        w->unseen_s += m->dt_s;
        if (w->unseen_s > cfg->lost_s ||
            w->wall.covariance[5] > cfg->lost_m * cfg->lost_m)
            lose(t, i);
        else
            i++;
    }
}

static double mahalanobis2(const struct wall *a, const struct wall *b,
                           const double difference[3])
{
    double sum[6], inverse[3][3], d2 = 0.0;
    for (int q = 0; q < 6; q++)
        sum[q] = a->covariance[q] + b->covariance[q];
    invert(sum, inverse);
    for (int q = 0; q < 9; q++)
        d2 += difference[q / 3] * inverse[q / 3][q % 3] * difference[q % 3];
    return d2;
}

/* The track that is nearest to what was seen and not taken yet, or t->n. */
static size_t nearest(const struct wall_tracks *t, const struct wall *seen,
                      const bool *taken, bool *agrees)
{
    size_t best = t->n;
    double least = INFINITY;
    for (size_t i = 0; i < t->n; i++) {
        double change[3];
        if (taken[i])
            continue;
        wall_difference(&t->list[i].wall, seen, change);
        double d2 = mahalanobis2(&t->list[i].wall, seen, change);
        bool near = hypot(change[0], change[1]) < NEAR_RAD && fabs(change[2]) < NEAR_M;
        if (d2 >= least || !(d2 < GATE || near))
            continue;
        least = d2;
        best = i;
        *agrees = d2 < GATE;
    }
    return best;
}

static void join(struct wall *w, const struct wall *seen)
{
    double change[3], gain[3][3], joined[3];
    wall_difference(w, seen, change);
    wall_intersect(w->covariance, seen->covariance, w->covariance, gain);
    for (int p = 0; p < 3; p++)
        joined[p] = gain[p][0] * change[0] + gain[p][1] * change[1] +
                    gain[p][2] * change[2];
    wall_turn(w, joined, w);
}

/* Bayes, for odds that change by a factor. */
static double updated(double existence, double factor)
{
    double odds = factor * existence / (1.0 - fmin(existence, 0.999));
    return fmin(odds / (1.0 + odds), 0.999);
}

static void add(struct wall_tracks *t, uint32_t id, const struct wall *w)
{
    if (t->n == WALL_TRACKS_MAX) {
        size_t weakest = 0;
        for (size_t i = 1; i < t->n; i++)
            if (t->list[i].existence < t->list[weakest].existence)
                weakest = i;
        lose(t, weakest);
    }
    t->list[t->n++] = (struct wall_track){.id = id, .wall = *w, .existence = FIRST};
}

void wall_tracks_update(struct wall_tracks *t, const struct wall_track_config *cfg,
                        const struct wall *seen, size_t n)
{
    bool taken[WALL_TRACKS_MAX] = {false}, used[WALL_TRACKS_MAX] = {false};
    n = n < WALL_TRACKS_MAX ? n : WALL_TRACKS_MAX;
    for (size_t k = 0; k < n; k++) {
        bool agrees = false;
        size_t i = nearest(t, &seen[k], taken, &agrees);
        if (i == t->n)
            continue;
        struct wall_track *w = &t->list[i];
        if (agrees)
            join(&w->wall, &seen[k]);
        else
            w->wall = seen[k];
        taken[i] = used[k] = true;
        w->unseen_s = 0.0;
        w->existence = updated(w->existence, cfg->seen / cfg->false_alarm);
        w->confirmed = w->confirmed || w->existence >= SURE;
    }
    for (size_t i = t->n; i-- > 0;) {
        struct wall_track *w = &t->list[i];
        if (taken[i])
            continue;
        w->existence =
            updated(w->existence, (1.0 - cfg->seen) / (1.0 - cfg->false_alarm));
        if (w->existence < GONE)
            lose(t, i);
    }
    for (size_t k = 0; k < n; k++)
        if (!used[k])
            add(t, ++t->last_id, &seen[k]);
}

const struct wall_track *wall_tracks_find(const struct wall_tracks *t, uint32_t id)
{
    for (size_t i = 0; i < t->n; i++)
        if (t->list[i].id == id)
            return &t->list[i];
    return NULL;
}

void wall_tracks_put(struct wall_tracks *t, uint32_t id, const struct wall *w)
{
    const struct wall_track *there = wall_tracks_find(t, id);
    if (!there)
        add(t, id, w);
    size_t i = there ? (size_t)(there - t->list) : t->n - 1;
    t->list[i].wall = *w;
    t->list[i].existence = 0.999;
    t->list[i].unseen_s = 0.0;
    t->list[i].confirmed = true;
}

void wall_tracks_keep(struct wall_tracks *t, const uint32_t *ids, size_t n)
{
    for (size_t i = t->n; i-- > 0;) {
        size_t k = 0;
        while (k < n && ids[k] != t->list[i].id)
            k++;
        if (k == n)
            lose(t, i);
    }
}
