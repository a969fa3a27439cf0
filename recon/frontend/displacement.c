/* SPDX-License-Identifier: MIT */
#include "recon/frontend/displacement.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "dsp/rank.h"
#include "recon/frontend/echo_shift.h"
#include "recon/geometry.h"
#include "recon/inverse/symmetric.h"

#define HUBER         1.345 /* 95 % as good as least squares on a normal */
#define MAD_TO_SIGMA  1.4826
#define LEAST_SIGMA_M 1e-4 /* arrivals are not believed to be better */
#define PRIOR_M       0.05 /* of a displacement, each axis */
#define PLACED_M      5e-3 /* how well the survey knows where an element stands */
#define TOLD_M        2e-3 /* solutions that differ by less along an axis tell it */
#define AS_GOOD       9.0  /* of the cost, which is chi square: three sigmas */
#define BESIDE_M      0.02 /* of a line still counts as on it */
#define LEAST_GAIN    50.0
#define SIGMAS        6.0
#define LEAST_PAIRS   4
#define AGREE         0.25 /* of the pairs' median deviation, is left at most */
#define LEAST_WAY     1e-3 /* of the squares of paths' directions along the first axis */
#define STEPS         15
#define TURNS         3 /* of all that is fitted together */
#define MOST_MOVED    8
/* Who is placed by hand may be some millimetres off: at the start an element is told only
 * when it is farther than that, and farther than the others scatter. */
#define START_M       0.015
#define START_SCATTER 5.0
#define START_LEARNT  0.75 /* of the pairs that are heard */
/* A reference that was learnt so shortly before a displacement is told is of what had
 * moved already. */
#define LEARNT_ROUNDS (DISPLACEMENT_CONFIRM + DISPLACEMENT_RING / 2 + 1)

enum { ZERO, SPEED, WIND, COMMON = WIND + 3 };

struct element {
    double at_m[3], by_m[3]; /* as surveyed; as fitted in this round */
    struct displacement_of said, heard;
    unsigned agreed; /* rounds in a row that do not say what is said */
    bool taken;      /* in this round */
    bool at_start;   /* it stood elsewhere at the start */
    uint64_t since;  /* the round from which on it is said to have moved */
    double places_m[DISPLACEMENT_CONFIRM][3]; /* of its last rounds with one, */
    unsigned n_placed;                        /* that many in a row */
    double best_m[3];                         /* by the newest, with what is not told */
};

struct pair {
    double ring_s[DISPLACEMENT_FIRST], reference_s; /* NaN: not learnt */
    unsigned n, age; /* arrivals in the ring; rounds since the newest */
    double grown_m;  /* in this round: the path against the reference; NaN */
    double left_m;   /* of that, without what is common */
    bool heard;      /* ever */
};

struct displacement {
    size_t n_speakers, n_microphones, n_elements;
    double sound_speed_m_s, sigma_m, common[COMMON];
    struct element *elements; /* [n_elements], speakers first */
    struct pair *pairs;       /* [n_speakers][n_microphones] */
    double *scratch;          /* [pairs], and as much again */
    bool *sounded;            /* [n_speakers], in this round */
    bool blows[3];            /* along that axis wind changes most paths */
    bool started;             /* where all stood at the start is judged */
    double least_m;           /* by which who is told has moved */
    double start_sigma_m;     /* how paths scattered about the survey then */
    uint64_t round;
    struct echo_shift *shift;
    struct echo_path *echoes; /* [n_echoes] of the element that is placed */
    size_t n_echoes;
    double echo_sigma_m;
};

/* Across a line it would only change the paths of what stands beside the line, and be
 * taken for where that went. */
static void see_winds(struct displacement *d)
{
    for (int k = 0; k < 3; k++) {
        size_t n = 0;
        for (size_t j = 0; j < d->n_speakers; j++)
            for (size_t i = d->n_speakers; i < d->n_elements; i++)
                d->scratch[n++] = fabs(d->elements[i].at_m[k] - d->elements[j].at_m[k]);
        d->blows[k] = rank_median(d->scratch, n) > BESIDE_M;
    }
}

int displacement_create(struct displacement **out, const struct survey *s)
{
    struct displacement *d = calloc(1, sizeof *d);
    size_t n_pairs = s->n_speakers * s->n_microphones;

    *out = NULL;
    if (!d)
        return -ENOMEM;
    d->n_speakers = s->n_speakers;
    d->n_microphones = s->n_microphones;
    d->n_elements = s->n_speakers + s->n_microphones;
    d->sound_speed_m_s = s->sound_speed_m_s;
    d->elements = calloc(d->n_elements, sizeof *d->elements);
    d->pairs = calloc(n_pairs, sizeof *d->pairs);
    d->scratch = calloc(2 * n_pairs, sizeof *d->scratch);
    d->sounded = calloc(s->n_speakers, sizeof *d->sounded);
    d->echoes = calloc(d->n_elements, sizeof *d->echoes);
    if (!d->elements || !d->pairs || !d->scratch || !d->sounded || !d->echoes ||
        echo_shift_create(&d->shift, s)) {
        displacement_destroy(d);
        return -ENOMEM;
    }
    for (size_t e = 0; e < d->n_elements; e++)
        memcpy(d->elements[e].at_m,
               e < s->n_speakers ? s->speakers_m[e] : s->microphones_m[e - s->n_speakers],
               sizeof d->elements[e].at_m);
    for (size_t p = 0; p < n_pairs; p++)
        d->pairs[p].reference_s = NAN;
    d->least_m = DISPLACEMENT_LEAST_M;
    see_winds(d);
    *out = d;
    return 0;
}

/* -- a round ----------------------------------------------------------------------------
 */

static const struct element *speaker_of(const struct displacement *d, size_t pair)
{
    return &d->elements[pair / d->n_microphones];
}

static const struct element *microphone_of(const struct displacement *d, size_t pair)
{
    return &d->elements[d->n_speakers + pair % d->n_microphones];
}

static double median_delay(const struct pair *p, unsigned n)
{
    double sorted[DISPLACEMENT_FIRST];

    memcpy(sorted, p->ring_s, n * sizeof *sorted);
    return rank_median(sorted, n);
}

static void grow(struct displacement *d)
{
    for (size_t i = 0; i < d->n_speakers * d->n_microphones; i++) {
        struct pair *p = &d->pairs[i];
        p->grown_m = NAN;
        if (isnan(p->reference_s) || p->n < DISPLACEMENT_RING || p->age++)
            continue;
        p->grown_m = d->sound_speed_m_s *
                     (median_delay(p, DISPLACEMENT_RING) - p->reference_s);
    }
}

/* What the displacement of both ends makes of a path. */
static double moved_m(const double from_m[3], const double from_by_m[3],
                      const double to_m[3], const double to_by_m[3], double way[3])
{
    double was[3], sum = 0.0, before = 0.0;

    for (int k = 0; k < 3; k++) {
        was[k] = to_m[k] - from_m[k];
        way[k] = was[k] + to_by_m[k] - from_by_m[k];
        before += was[k] * was[k];
        sum += way[k] * way[k];
    }
    for (int k = 0; k < 3; k++)
        way[k] /= fmax(sqrt(sum), 1e-9);
    return sqrt(sum) - sqrt(before);
}

static double explained_m(const struct displacement *d, size_t pair)
{
    const struct element *j = speaker_of(d, pair), *i = microphone_of(d, pair);
    double way[3];

    return moved_m(j->at_m, j->by_m, i->at_m, i->by_m, way);
}

static void common_row(const struct displacement *d, size_t pair, double row[COMMON])
{
    const struct element *j = speaker_of(d, pair), *i = microphone_of(d, pair);

    row[ZERO] = 1.0;
    row[SPEED] = geometry_distance(j->at_m, i->at_m);
    for (int k = 0; k < 3; k++)
        row[WIND + k] = d->blows[k] ? i->at_m[k] - j->at_m[k] : 0.0;
}

/* 1 up to the knee, then as of the absolute. */
static double huber_weight(double deviation)
{
    return fmin(1.0, HUBER / fmax(fabs(deviation), 1e-9));
}

static double huber_cost(double deviation)
{
    double x = fabs(deviation);
    return x < HUBER ? x * x : 2.0 * HUBER * x - HUBER * HUBER;
}

/* How pairs scatter about what is common. */
static double scatter_m(struct displacement *d)
{
    size_t n = 0;

    for (size_t i = 0; i < d->n_speakers * d->n_microphones; i++)
        if (!isnan(d->pairs[i].grown_m))
            d->scratch[n++] = fabs(d->pairs[i].left_m - explained_m(d, i));
    return n ? fmax(MAD_TO_SIGMA * rank_median(d->scratch, n), LEAST_SIGMA_M)
             : LEAST_SIGMA_M;
}

static void take_common_out(struct displacement *d)
{
    for (size_t i = 0; i < d->n_speakers * d->n_microphones; i++) {
        double row[COMMON];
        common_row(d, i, row);
        d->pairs[i].left_m = d->pairs[i].grown_m;
        for (int k = 0; k < COMMON; k++)
            d->pairs[i].left_m -= d->common[k] * row[k];
    }
    d->sigma_m = scatter_m(d);
}

/* With what moved as it is fitted by now. */
static void fit_common(struct displacement *d)
{
    /* How much of each there may be: 1 m, 5 % of the speed, a tenth of it as wind. */
    static const double before[COMMON] = {1.0, 0.05, 0.1, 0.1, 0.1};

    for (int step = 0; step < STEPS; step++) {
        double m[COMMON * COMMON] = {0}, b[COMMON] = {0}, row[COMMON];
        for (size_t i = 0; i < d->n_speakers * d->n_microphones; i++) {
            const struct pair *p = &d->pairs[i];
            if (isnan(p->grown_m))
                continue;
            double off_m = (p->left_m - explained_m(d, i)) / d->sigma_m;
            double w = step ? huber_weight(off_m) : 1.0;
            common_row(d, i, row);
            for (int k = 0; k < COMMON; k++) {
                b[k] += w * row[k] * (p->grown_m - explained_m(d, i));
                for (int l = 0; l < COMMON; l++)
                    m[k * COMMON + l] += w * row[k] * row[l];
            }
        }
        for (int k = 0; k < COMMON; k++)
            m[k * (COMMON + 1)] += d->sigma_m * d->sigma_m / (before[k] * before[k]);
        normal_equations_solve(COMMON, m, b, 0.0);
        memcpy(d->common, b, sizeof b);
        take_common_out(d);
    }
}

/* -- one element ------------------------------------------------------------------------
 */

struct solution {
    double by_m[3], cost;
    double information[9]; /* [3][3] */
};

/* The other end of an element's k-th pair, and the pair. */
static const struct element *other_end(const struct displacement *d, size_t e, size_t k,
                                       size_t *pair)
{
    bool speaks = e < d->n_speakers;

    *pair = speaks ? e * d->n_microphones + k : k * d->n_microphones + e - d->n_speakers;
    return speaks ? microphone_of(d, *pair) : speaker_of(d, *pair);
}

static size_t pairs_of(const struct displacement *d, size_t e)
{
    return e < d->n_speakers ? d->n_microphones : d->n_speakers;
}

/* What a path says of by_m: its cost, and where wanted its slopes, which go up with it.
 */
static double weigh(double off, double sigma_m, const double way[3], double *information,
                    double *slope)
{
    double w = huber_weight(off) / sigma_m;

    for (int a = 0; information && a < 3; a++) {
        slope[a] -= w * off * way[a];
        for (int b = 0; b < 3; b++)
            information[3 * a + b] += w / sigma_m * way[a] * way[b];
    }
    return huber_cost(off);
}

static double echo_off(const struct displacement *d, size_t e, size_t k,
                       const double by_m[3], double way[3])
{
    static const double none[3] = {0};
    const struct echo_path *p = &d->echoes[k];

    return (p->grown_m - moved_m(p->from_m, none, d->elements[e].at_m, by_m, way)) /
           d->echo_sigma_m;
}

static double look(const struct displacement *d, size_t e, const double by_m[3],
                   double *information, double *slope)
{
    double cost = 0.0;

    for (int k = 0; k < 3; k++)
        cost += by_m[k] * by_m[k] / (PRIOR_M * PRIOR_M);
    if (information) {
        memset(information, 0, 9 * sizeof *information);
        for (int k = 0; k < 3; k++) {
            information[4 * k] = 1.0 / (PRIOR_M * PRIOR_M);
            slope[k] = by_m[k] / (PRIOR_M * PRIOR_M);
        }
    }
    for (size_t k = 0; k < pairs_of(d, e); k++) {
        size_t pair;
        double way[3];
        const struct element *other = other_end(d, e, k, &pair);
        if (isnan(d->pairs[pair].grown_m))
            continue;
        double off = (d->pairs[pair].left_m -
                      moved_m(other->at_m, other->by_m, d->elements[e].at_m, by_m, way)) /
                     d->sigma_m;
        cost += weigh(off, d->sigma_m, way, information, slope);
    }
    for (size_t k = 0; k < d->n_echoes; k++) {
        double way[3], off = echo_off(d, e, k, by_m, way);
        cost += weigh(off, d->echo_sigma_m, way, information, slope);
    }
    return cost;
}

/* Downhill from by_m. */
static void descend(const struct displacement *d, size_t e, struct solution *s)
{
    double damping = 1e-3, slope[3];

    s->cost = look(d, e, s->by_m, s->information, slope);
    for (int step = 0; step < STEPS && damping < 1e6; step++) {
        double m[9], next_m[3], by[3] = {-slope[0], -slope[1], -slope[2]};
        memcpy(m, s->information, sizeof m);
        for (int k = 0; k < 3; k++)
            m[4 * k] *= 1.0 + damping;
        normal_equations_solve(3, m, by, 0.0);
        for (int k = 0; k < 3; k++)
            next_m[k] = s->by_m[k] + by[k];
        if (look(d, e, next_m, NULL, NULL) < s->cost) {
            memcpy(s->by_m, next_m, sizeof next_m);
            s->cost = look(d, e, s->by_m, s->information, slope);
            damping /= 10.0;
        } else {
            damping *= 10.0;
        }
    }
}

static double length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static void add_way(double m[6], const double way[3])
{
    for (int a = 0, i = 0; a < 3; a++)
        for (int b = a; b < 3; b++)
            m[i++] += way[a] * way[b];
}

/* Along which its paths go, most of all first; how many they are: along the others hardly
 * any goes. */
static int axes_of(const struct displacement *d, size_t e, double axes[3][3])
{
    static const double none[3] = {0};
    double m[6] = {0}, way[3], value[3];
    int n = 1;

    for (size_t k = 0; k < pairs_of(d, e); k++) {
        size_t pair;
        const struct element *other = other_end(d, e, k, &pair);
        moved_m(other->at_m, none, d->elements[e].at_m, none, way);
        add_way(m, way);
    }
    for (size_t k = 0; k < d->n_echoes; k++) {
        moved_m(d->echoes[k].from_m, none, d->elements[e].at_m, none, way);
        add_way(m, way);
    }
    symmetric_axes(m, value, axes);
    while (n < 3 && value[n] > LEAST_WAY * value[0])
        n++;
    return n;
}

enum { STARTS = 7 };

/* From where it is and to all sides; the best comes first. */
static void search(const struct displacement *d, size_t e, double axes[3][3],
                   struct solution s[STARTS])
{
    for (int i = 0; i < STARTS; i++) {
        double side = i % 2 ? 0.01 : -0.01;
        for (int k = 0; k < 3; k++)
            s[i].by_m[k] = i ? side * axes[(i - 1) / 2][k] : 0.0;
        descend(d, e, &s[i]);
        if (s[i].cost < s[0].cost) {
            struct solution better = s[i];
            s[i] = s[0];
            s[0] = better;
        }
    }
}

static double along(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* What all that fit as well share, along the first n_axes. */
static void tell(int n_axes, double axes[3][3], const struct solution s[STARTS],
                 struct displacement_of *out)
{
    double m[9], to[3], across = 0.0;

    *out = (struct displacement_of){.size_m = length(s[0].by_m)};
    for (int k = 0; k < 3; k++) {
        double low = INFINITY, high = -INFINITY, best = along(axes[k], s[0].by_m);
        for (int i = 0; i < STARTS; i++)
            if (s[i].cost < s[0].cost + AS_GOOD) {
                low = fmin(low, along(axes[k], s[i].by_m));
                high = fmax(high, along(axes[k], s[i].by_m));
            }
        bool told = high - low <= TOLD_M;
        if (!told)
            across += best * best;
        for (int a = 0; told && k < n_axes && a < 3; a++)
            out->by_m[a] += best * axes[k][a];
    }
    out->across_m = sqrt(across);
    memcpy(m, s[0].information, sizeof m);
    for (int k = 0; k < 3; k++)
        to[k] = s[0].by_m[k] / fmax(out->size_m, 1e-9);
    double b[3] = {to[0], to[1], to[2]};
    normal_equations_solve(3, m, b, 0.0);
    out->sigma_m = sqrt(fmax(along(to, b), 0.0));
}

static double median_left_m(const struct displacement *d, size_t e, const double by_m[3],
                            size_t *n)
{
    double *left_m = d->scratch + d->n_speakers * d->n_microphones, way[3];

    *n = 0;
    for (size_t k = 0; k < pairs_of(d, e); k++) {
        size_t pair;
        const struct element *other = other_end(d, e, k, &pair);
        if (!isnan(d->pairs[pair].grown_m))
            left_m[(*n)++] =
                fabs(d->pairs[pair].left_m -
                     moved_m(other->at_m, other->by_m, d->elements[e].at_m, by_m, way));
    }
    return rank_median(left_m, *n);
}

/* How many of its pairs say so: what the nearest one alone says is as well of where that
 * one's other end stood before the start. */
static size_t count_gaining(const struct displacement *d, size_t e, const double by_m[3])
{
    size_t n = 0;

    for (size_t k = 0; k < pairs_of(d, e); k++) {
        size_t pair;
        double way[3];
        const struct element *other = other_end(d, e, k, &pair);
        double left_m = d->pairs[pair].left_m;
        double moved = moved_m(other->at_m, other->by_m, d->elements[e].at_m, by_m, way);
        n += !isnan(d->pairs[pair].grown_m) &&
             huber_cost(left_m / d->sigma_m) >
                 huber_cost((left_m - moved) / d->sigma_m) + 1.0;
    }
    return n;
}

/* How much less there is to explain when it has moved; 0: it has not. */
static double judge(const struct displacement *d, size_t e, struct displacement_of *out,
                    double by_m[3])
{
    static const double none[3] = {0};
    struct solution s[STARTS];
    double axes[3][3], before = look(d, e, none, NULL, NULL);
    size_t n;
    double before_m = median_left_m(d, e, none, &n);

    *out = (struct displacement_of){.moved = false};
    if (n < LEAST_PAIRS || before < LEAST_GAIN)
        return 0.0;
    int n_axes = axes_of(d, e, axes);
    search(d, e, axes, s);
    tell(n_axes, axes, s, out);
    memcpy(by_m, s[0].by_m, sizeof s[0].by_m);
    double after_m = median_left_m(d, e, by_m, &n);
    bool fits = after_m < fmax(AGREE * before_m, 2.0 * d->sigma_m);
    bool far = out->size_m > fmax(d->least_m, SIGMAS * out->sigma_m);
    /* Paths across grow with the square: with where it stood before the start, too. */
    out->sigma_m =
        hypot(out->sigma_m, PLACED_M * out->across_m / fmax(out->size_m, PLACED_M));
    bool most = before - s[0].cost > fmax(LEAST_GAIN, 0.5 * before);
    out->moved = fits && far && most && count_gaining(d, e, by_m) >= LEAST_PAIRS;
    return out->moved ? before - s[0].cost : 0.0;
}

/* -- all of them ------------------------------------------------------------------------
 */

/* The one that explains most of what is left; false: nothing does. */
static bool take_one(struct displacement *d)
{
    struct displacement_of of;
    double gain, most = 0.0, by_m[3];
    struct element *best = NULL;

    for (size_t e = 0; e < d->n_elements; e++) {
        if (d->elements[e].taken)
            continue;
        gain = judge(d, e, &of, by_m);
        if (gain > most) {
            most = gain;
            best = &d->elements[e];
            best->heard = of;
        }
    }
    if (!best)
        return false;
    best->taken = true;
    return true;
}

static void fit_together(struct displacement *d)
{
    for (int turn = 0; turn < TURNS; turn++) {
        for (size_t e = 0; e < d->n_elements; e++) {
            struct element *one = &d->elements[e];
            double by_m[3];
            if (!one->taken)
                continue;
            memset(one->by_m, 0, sizeof one->by_m);
            one->taken = judge(d, e, &one->heard, by_m) > 0.0;
            if (one->taken)
                memcpy(one->by_m, by_m, sizeof by_m);
        }
        fit_common(d);
    }
}

/* -- where it stands now ----------------------------------------------------------------
 */

/* Do the paths over the wall agree where it is, and do solutions that fit as well, and
 * what is not known of the best, leave them as they are? */
static bool is_placed(const struct displacement *d, size_t e,
                      const struct solution s[STARTS])
{
    double *off_m = d->scratch, way[3], mean[3] = {0}, m[9], b[3];

    for (size_t k = 0; k < d->n_echoes; k++) {
        off_m[k] = fabs(echo_off(d, e, k, s[0].by_m, way)) * d->echo_sigma_m;
        for (int a = 0; a < 3; a++)
            mean[a] += way[a] / (double)d->n_echoes;
    }
    for (int i = 1; i < STARTS; i++) {
        const double to[3] = {s[i].by_m[0] - s[0].by_m[0], s[i].by_m[1] - s[0].by_m[1],
                              s[i].by_m[2] - s[0].by_m[2]};
        if (s[i].cost < s[0].cost + AS_GOOD &&
            fabs(along(mean, to)) > DISPLACEMENT_PLACED_M)
            return false;
    }
    memcpy(m, s[0].information, sizeof m);
    memcpy(b, mean, sizeof b);
    normal_equations_solve(3, m, b, 0.0);
    return along(mean, b) < DISPLACEMENT_PLACED_M * DISPLACEMENT_PLACED_M &&
           rank_median(off_m, d->n_echoes) <
               fmax(2.0 * d->echo_sigma_m, DISPLACEMENT_PLACED_M);
}

/* The mean of the last rounds, when they agree. */
static void settle_place(struct element *one, struct displacement_of *now)
{
    double *newest = one->places_m[one->n_placed % DISPLACEMENT_CONFIRM], mean[3] = {0};

    memcpy(newest, now->by_m, sizeof one->places_m[0]);
    now->placed = ++one->n_placed >= DISPLACEMENT_CONFIRM;
    for (int r = 0; now->placed && r < DISPLACEMENT_CONFIRM; r++)
        for (int k = 0; k < 3; k++)
            mean[k] += one->places_m[r][k] / DISPLACEMENT_CONFIRM;
    for (int r = 0; now->placed && r < DISPLACEMENT_CONFIRM; r++)
        if (geometry_distance(one->places_m[r], mean) > DISPLACEMENT_PLACED_M)
            now->placed = false;
    if (now->placed)
        memcpy(now->by_m, mean, sizeof mean);
}

/* By what was heard in this round, and the echoes of a wall that was heard before, or for
 * who stood elsewhere at the start of one as it is now; without a wall only where
 * straight paths go all ways. */
static void place(struct displacement *d, size_t e)
{
    struct element *one = &d->elements[e];
    uint64_t before = one->since > LEARNT_ROUNDS ? one->since - LEARNT_ROUNDS : 0;
    struct displacement_of now = one->heard;
    struct solution s[STARTS];
    double axes[3][3], sigma_m = d->sigma_m;
    bool known;

    d->n_echoes = one->at_start ? echo_shift_surveyed(d->shift, e, d->round, d->echoes,
                                                      &d->echo_sigma_m)
                                : echo_shift_paths(d->shift, e, d->round, before,
                                                   d->echoes, &d->echo_sigma_m);
    if (d->n_echoes < LEAST_PAIRS)
        d->n_echoes = 0;
    int n_axes = axes_of(d, e, axes);
    if (d->n_echoes || one->at_start) {
        /* Against the survey straight paths err by where their other ends stand. */
        if (one->at_start)
            d->sigma_m = hypot(sigma_m, d->start_sigma_m);
        search(d, e, axes, s);
        tell(n_axes, axes, s, &now);
        now.moved = true;
        known = d->n_echoes ? is_placed(d, e, s) : n_axes == 3 && now.across_m == 0.0;
        memcpy(one->best_m, s[0].by_m, sizeof one->best_m);
        d->n_echoes = 0;
        d->sigma_m = sigma_m;
    } else {
        known = n_axes == 3 && now.across_m == 0.0;
        memcpy(one->best_m, one->by_m, sizeof one->best_m);
    }
    now.at_start = one->at_start;
    if (known && now.sigma_m < DISPLACEMENT_PLACED_M)
        settle_place(one, &now);
    else
        one->n_placed = 0;
    one->said = now;
}

static bool is_heard(const struct displacement *d, size_t e)
{
    size_t n = 0, pair;

    for (size_t k = 0; k < pairs_of(d, e); k++) {
        other_end(d, e, k, &pair);
        n += !isnan(d->pairs[pair].grown_m);
    }
    return n >= LEAST_PAIRS;
}

static void settle(struct displacement *d)
{
    for (size_t e = 0; e < d->n_elements; e++) {
        struct element *one = &d->elements[e];
        bool moved = one->taken;
        if (!is_heard(d, e))
            continue;
        one->agreed = moved != one->said.moved ? one->agreed + 1 : 0;
        if (one->agreed >= DISPLACEMENT_CONFIRM) {
            one->agreed = 0;
            one->said.moved = moved;
            one->since = d->round;
            one->n_placed = 0;
        }
        if (one->said.moved && moved)
            place(d, e);
        else if (!one->said.moved)
            one->said = (struct displacement_of){.moved = false};
    }
}

/* Who has moved, by what the pairs have grown. */
static void find_moved(struct displacement *d, double least_m, double scatter)
{
    for (size_t e = 0; e < d->n_elements; e++) {
        d->elements[e].taken = false;
        memset(d->elements[e].by_m, 0, sizeof d->elements[e].by_m);
    }
    memset(d->common, 0, sizeof d->common);
    take_common_out(d);
    fit_common(d);
    d->least_m = fmax(least_m, scatter * d->sigma_m);
    for (int n = 0; n < MOST_MOVED && take_one(d); n++)
        fit_together(d);
}

static bool has_learnt(const struct displacement *d)
{
    size_t heard = 0, learnt = 0;

    for (size_t i = 0; i < d->n_speakers * d->n_microphones; i++) {
        heard += d->pairs[i].heard;
        learnt += !isnan(d->pairs[i].reference_s);
    }
    return learnt >= COMMON + LEAST_PAIRS &&
           (double)learnt > START_LEARNT * (double)heard;
}

/* Who stands far beside the survey was moved before, and is as if it were so now: what
 * its pairs are held against is taken back to where the survey has it. */
static void judge_start(struct displacement *d)
{
    for (size_t i = 0; i < d->n_speakers * d->n_microphones; i++) {
        struct pair *p = &d->pairs[i];
        p->grown_m = d->sound_speed_m_s * p->reference_s -
                     geometry_distance(speaker_of(d, i)->at_m, microphone_of(d, i)->at_m);
    }
    find_moved(d, START_M, START_SCATTER);
    for (size_t i = 0; i < d->n_speakers * d->n_microphones; i++)
        d->pairs[i].reference_s -= explained_m(d, i) / d->sound_speed_m_s;
    for (size_t e = 0; e < d->n_elements; e++)
        d->elements[e].at_start = d->elements[e].taken;
    d->start_sigma_m = d->sigma_m;
}

static void conclude(struct displacement *d)
{
    size_t heard = 0;

    if (!d->started && has_learnt(d)) {
        d->started = true;
        judge_start(d);
    }
    grow(d);
    for (size_t i = 0; i < d->n_speakers * d->n_microphones; i++)
        heard += !isnan(d->pairs[i].grown_m);
    if (heard < COMMON + LEAST_PAIRS)
        return;
    find_moved(d, DISPLACEMENT_LEAST_M, 0.0);
    settle(d);
}

void displacement_wall(struct displacement *d, const struct wall_gate *wall)
{
    echo_shift_wall(d->shift, wall);
}

void displacement_take(struct displacement *d, size_t speaker, const double *delay_s,
                       const double *echo_s)
{
    if (d->sounded[speaker]) { /* the round is over */
        conclude(d);
        memset(d->sounded, 0, d->n_speakers * sizeof *d->sounded);
        d->round++;
    }
    if (echo_s)
        echo_shift_take(d->shift, d->round, speaker, echo_s);
    d->sounded[speaker] = true;
    for (size_t m = 0; m < d->n_microphones; m++) {
        struct pair *p = &d->pairs[speaker * d->n_microphones + m];
        bool learns = isnan(p->reference_s);
        if (isnan(delay_s[m]))
            continue;
        p->ring_s[p->n % (learns ? DISPLACEMENT_FIRST : DISPLACEMENT_RING)] = delay_s[m];
        p->n++;
        p->age = 0;
        p->heard = true;
        if (learns && p->n == DISPLACEMENT_FIRST) {
            p->reference_s = median_delay(p, DISPLACEMENT_FIRST);
            p->n = DISPLACEMENT_RING;
        }
    }
}

/* As heard, wherever it went along what is not told: so its paths are now. */
static void went(const struct element *one, const double at_m[3], double by_m[3])
{
    bool heard = one->said.moved && geometry_distance(one->at_m, at_m) > 0.0;

    for (int k = 0; k < 3; k++)
        by_m[k] = heard ? one->best_m[k] : at_m[k] - one->at_m[k];
}

void displacement_stand(struct displacement *d, const struct survey *s)
{
    double speaker_m[3], microphone_m[3], way[3];

    for (size_t j = 0; j < d->n_speakers; j++)
        for (size_t i = 0; i < d->n_microphones; i++) {
            const struct element *from = &d->elements[j];
            const struct element *to = &d->elements[d->n_speakers + i];
            went(from, s->speakers_m[j], speaker_m);
            went(to, s->microphones_m[i], microphone_m);
            d->pairs[j * d->n_microphones + i].reference_s +=
                moved_m(from->at_m, speaker_m, to->at_m, microphone_m, way) /
                d->sound_speed_m_s;
        }
    for (size_t e = 0; e < d->n_elements; e++) {
        struct element *one = &d->elements[e];
        const double *at_m = e < s->n_speakers ? s->speakers_m[e]
                                               : s->microphones_m[e - s->n_speakers];
        if (geometry_distance(one->at_m, at_m) > 0.0) {
            one->said = (struct displacement_of){.moved = false};
            one->agreed = one->n_placed = 0;
            if (one->at_start)
                echo_shift_forget(d->shift, e);
            one->at_start = false;
        }
        memcpy(one->at_m, at_m, sizeof one->at_m);
    }
    see_winds(d);
    echo_shift_stand(d->shift, s);
}

const struct displacement_of *displacement_speaker(const struct displacement *d,
                                                   size_t speaker)
{
    return &d->elements[speaker].said;
}

const struct displacement_of *displacement_microphone(const struct displacement *d,
                                                      size_t microphone)
{
    return &d->elements[d->n_speakers + microphone].said;
}

void displacement_destroy(struct displacement *d)
{
    if (!d)
        return;
    free(d->elements);
    free(d->pairs);
    free(d->scratch);
    free(d->sounded);
    free(d->echoes);
    echo_shift_destroy(d->shift);
    free(d);
}
