/* SPDX-License-Identifier: MIT */
#include "recon/frontend/echo_shift.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "dsp/rank.h"
#include "recon/geometry.h"

#define HUBER         1.345
#define MAD_TO_SIGMA  1.4826
#define LEAST_SIGMA_M 2e-4 /* a wall is no better than its plaster */
#define LEAST_OTHERS  4    /* that tell what is common */
#define STEPS         10
#define TURN_RAD      0.1 /* by which the wall may be off, one sigma */
#define STALE_ROUNDS  2
#define STANDS_M      0.01
#define STANDS_RAD    0.02

enum { OFFSET, SLOPE, COMMON = SLOPE + 3 };

struct pair {
    double ring_m[ECHO_SHIFT_FIRST]; /* by how much longer than the wall has it */
    double reference_m;              /* NaN: not learnt */
    unsigned n;
    uint64_t heard, learnt; /* in which round last; and wholly */
};

struct echo_shift {
    size_t n_speakers, n_microphones;
    double sound_speed_m_s, (*at_m)[3]; /* [n_speakers + n_microphones] */
    struct wall_gate wall;              /* id 0: none yet */
    bool hears;                         /* its echoes come now */
    struct pair *pairs;                 /* [n_speakers][n_microphones] */
    double *row_m, *left_m; /* [the larger number], scratch: of pairs with one end */
};

int echo_shift_create(struct echo_shift **out, const struct survey *s)
{
    struct echo_shift *e = calloc(1, sizeof *e);
    size_t most = s->n_speakers > s->n_microphones ? s->n_speakers : s->n_microphones;

    *out = NULL;
    if (!e)
        return -ENOMEM;
    e->n_speakers = s->n_speakers;
    e->n_microphones = s->n_microphones;
    e->sound_speed_m_s = s->sound_speed_m_s;
    e->at_m = calloc(s->n_speakers + s->n_microphones, sizeof *e->at_m);
    e->pairs = calloc(s->n_speakers * s->n_microphones, sizeof *e->pairs);
    e->row_m = calloc(most, sizeof *e->row_m);
    e->left_m = calloc(most, sizeof *e->left_m);
    if (!e->at_m || !e->pairs || !e->row_m || !e->left_m) {
        echo_shift_destroy(e);
        return -ENOMEM;
    }
    memcpy(e->at_m, s->speakers_m, s->n_speakers * sizeof *e->at_m);
    memcpy(e->at_m + s->n_speakers, s->microphones_m, s->n_microphones * sizeof *e->at_m);
    *out = e;
    return 0;
}

/* Of a vehicle that stands: it is the estimate that moves. */
static bool is_where_it_was(const struct wall *was, const struct wall *is)
{
    double change[3];

    wall_difference(was, is, change);
    return fabs(change[0]) < STANDS_RAD && fabs(change[1]) < STANDS_RAD &&
           fabs(change[2]) < STANDS_M;
}

void echo_shift_wall(struct echo_shift *e, const struct wall_gate *wall)
{
    bool heard = e->hears;

    e->hears = wall != NULL;
    if (!wall)
        return;
    if (wall->id != e->wall.id)
        for (size_t i = 0; i < e->n_speakers * e->n_microphones; i++)
            e->pairs[i] = (struct pair){.reference_m = NAN};
    else if (heard && is_where_it_was(&e->wall.plane, &wall->plane))
        return;
    e->wall = *wall;
}

static double median_m(const struct pair *p, unsigned n)
{
    double sorted[ECHO_SHIFT_FIRST];

    memcpy(sorted, p->ring_m, n * sizeof *sorted);
    return rank_median(sorted, n);
}

void echo_shift_take(struct echo_shift *e, uint64_t round, size_t speaker,
                     const double *delay_s)
{
    double from_m[3];

    if (!e->hears)
        return;
    wall_mirror(&e->wall.plane, e->at_m[speaker], from_m);
    for (size_t m = 0; m < e->n_microphones; m++) {
        struct pair *p = &e->pairs[speaker * e->n_microphones + m];
        bool learns = isnan(p->reference_m);
        if (isnan(delay_s[m]))
            continue;
        p->ring_m[p->n++ % (learns ? ECHO_SHIFT_FIRST : ECHO_SHIFT_RING)] =
            e->sound_speed_m_s * delay_s[m] -
            geometry_distance(from_m, e->at_m[e->n_speakers + m]);
        p->heard = round;
        if (learns && p->n == ECHO_SHIFT_FIRST) {
            p->reference_m = median_m(p, ECHO_SHIFT_FIRST);
            p->learnt = round;
            p->n = 0;
        }
    }
}

#define SURVEYED UINT64_MAX /* not since a round: against the survey */

static double grown_m(const struct pair *p, uint64_t round, uint64_t since)
{
    bool told = !isnan(p->reference_m) && p->n >= ECHO_SHIFT_RING &&
                round - p->heard < STALE_ROUNDS && p->learnt < since;
    return told
               ? median_m(p, ECHO_SHIFT_RING) - (since == SURVEYED ? 0.0 : p->reference_m)
               : NAN;
}

static double at_common(const double common[COMMON], const double at_m[3])
{
    return common[OFFSET] + common[SLOPE] * at_m[0] + common[SLOPE + 1] * at_m[1] +
           common[SLOPE + 2] * at_m[2];
}

/* Of row_m [n], of elements at at_m, what all but `but` have in common there.  How they
 * scatter about it; NaN: too few say. */
static double fit_others(struct echo_shift *e, size_t n, const double (*at_m)[3],
                         size_t but, double common[COMMON])
{
    double sigma_m = 1e-3;
    size_t used = 0;

    memset(common, 0, COMMON * sizeof *common);
    for (int step = 0; step < STEPS; step++) {
        double m[COMMON][COMMON] = {{0}}, b[COMMON] = {0};
        for (size_t i = 0; i < n; i++) {
            const double row[COMMON] = {1.0, at_m[i][0], at_m[i][1], at_m[i][2]};
            if (i == but || isnan(e->row_m[i]))
                continue;
            double off = (e->row_m[i] - at_common(common, at_m[i])) / sigma_m;
            double w = step ? fmin(1.0, HUBER / fmax(fabs(off), 1e-9)) : 1.0;
            for (int k = 0; k < COMMON; k++) {
                b[k] += w * row[k] * e->row_m[i];
                for (int l = 0; l < COMMON; l++)
                    m[k][l] += w * row[k] * row[l];
            }
        }
        for (int k = 0; k < COMMON; k++)
            m[k][k] += sigma_m * sigma_m / (k == OFFSET ? 1.0 : TURN_RAD * TURN_RAD);
        normal_equations_solve(COMMON, &m[0][0], b, 0.0);
        memcpy(common, b, sizeof b);
        used = 0;
        for (size_t i = 0; i < n; i++)
            if (i != but && !isnan(e->row_m[i]))
                e->left_m[used++] = fabs(e->row_m[i] - at_common(common, at_m[i]));
        if (used < LEAST_OTHERS)
            return NAN;
        sigma_m = fmax(MAD_TO_SIGMA * rank_median(e->left_m, used), LEAST_SIGMA_M);
    }
    return sigma_m;
}

size_t echo_shift_paths(struct echo_shift *e, size_t element, uint64_t round,
                        uint64_t since, struct echo_path *out, double *sigma_m)
{
    bool speaks = element < e->n_speakers;
    size_t n_others = speaks ? e->n_microphones : e->n_speakers;
    size_t n_like = speaks ? e->n_speakers : e->n_microphones;
    size_t own = speaks ? element : element - e->n_speakers, n = 0;
    const double(*like_m)[3] =
        (const double(*)[3])(speaks ? e->at_m : e->at_m + e->n_speakers);
    double squares = 0.0, common[COMMON];

    *sigma_m = NAN;
    for (size_t k = 0; e->hears && k < n_others; k++) {
        for (size_t i = 0; i < n_like; i++) {
            size_t pair = speaks ? i * e->n_microphones + k : k * e->n_microphones + i;
            e->row_m[i] = grown_m(&e->pairs[pair], round, since);
        }
        double sigma = fit_others(e, n_like, like_m, own, common);
        if (isnan(sigma) || isnan(e->row_m[own]))
            continue;
        wall_mirror(&e->wall.plane, e->at_m[speaks ? e->n_speakers + k : k],
                    out[n].from_m);
        out[n++].grown_m = e->row_m[own] - at_common(common, like_m[own]);
        squares += sigma * sigma;
    }
    /* Of a speaker they are of the same pings, and err together; against the survey they
     * err by where the others stand, which is the same in all. */
    if (n)
        *sigma_m = sqrt(speaks || since == SURVEYED ? squares : squares / (double)n);
    return n;
}

size_t echo_shift_surveyed(struct echo_shift *e, size_t element, uint64_t round,
                           struct echo_path *out, double *sigma_m)
{
    return echo_shift_paths(e, element, round, SURVEYED, out, sigma_m);
}

void echo_shift_forget(struct echo_shift *e, size_t element)
{
    for (size_t j = 0; j < e->n_speakers; j++)
        for (size_t m = 0; m < e->n_microphones; m++)
            if (j == element || e->n_speakers + m == element)
                e->pairs[j * e->n_microphones + m] = (struct pair){.reference_m = NAN};
}

/* References are beside what the wall makes of the places then, and stay; what came since
 * is from the new ones. */
void echo_shift_stand(struct echo_shift *e, const struct survey *s)
{
    double was_m[3], is_m[3];

    for (size_t j = 0; j < e->n_speakers; j++) {
        wall_mirror(&e->wall.plane, e->at_m[j], was_m);
        wall_mirror(&e->wall.plane, s->speakers_m[j], is_m);
        for (size_t m = 0; e->wall.id && m < e->n_microphones; m++) {
            struct pair *p = &e->pairs[j * e->n_microphones + m];
            double longer_m = geometry_distance(is_m, s->microphones_m[m]) -
                              geometry_distance(was_m, e->at_m[e->n_speakers + m]);
            for (int k = 0; k < ECHO_SHIFT_FIRST; k++)
                p->ring_m[k] -= longer_m;
        }
    }
    memcpy(e->at_m, s->speakers_m, s->n_speakers * sizeof *e->at_m);
    memcpy(e->at_m + s->n_speakers, s->microphones_m, s->n_microphones * sizeof *e->at_m);
}

void echo_shift_destroy(struct echo_shift *e)
{
    if (!e)
        return;
    free(e->at_m);
    free(e->pairs);
    free(e->row_m);
    free(e->left_m);
    free(e);
}
