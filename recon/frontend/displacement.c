/* SPDX-License-Identifier: MIT */
#include "recon/frontend/displacement.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"
#include "recon/geometry.h"
#include "recon/inverse/symmetric.h"

#define HUBER         1.345 /* 95 % as good as least squares on a normal */
#define MAD_TO_SIGMA  1.4826
#define LEAST_SIGMA_M 1e-4 /* arrivals are not believed to be better */
#define PRIOR_M       0.05 /* of a displacement, each axis */
#define PLACED_M      5e-3 /* how well the survey knows where an element stands */
#define TOLD_M        2e-3 /* solutions that differ by less along an axis tell it */
#define AS_GOOD       9.0  /* of the cost, which is chi square: three sigmas */
#define LEAST_GAIN    50.0
#define SIGMAS        6.0
#define LEAST_PAIRS   4
#define AGREE         0.25 /* of the pairs' median deviation, is left at most */
#define STEPS         15
#define TURNS         3 /* of all that is fitted together */
#define MOST_MOVED    8

enum { ZERO, SPEED, WIND, COMMON = WIND + 3 };

struct element {
    double at_m[3], by_m[3]; /* as surveyed; as fitted in this round */
    struct displacement_of said, heard;
    unsigned agreed; /* rounds in a row that do not say what is said */
    bool taken;      /* in this round */
};

struct pair {
    double ring_s[DISPLACEMENT_FIRST], reference_s; /* NaN: not learnt */
    unsigned n, age; /* arrivals in the ring; rounds since the newest */
    double grown_m;  /* in this round: the path against the reference; NaN */
    double left_m;   /* of that, without what is common */
};

struct displacement {
    size_t n_speakers, n_microphones, n_elements;
    double sound_speed_m_s, sigma_m, common[COMMON];
    struct element *elements; /* [n_elements], speakers first */
    struct pair *pairs;       /* [n_speakers][n_microphones] */
    double *scratch;          /* [pairs], and as much again */
    bool *sounded;            /* [n_speakers], in this round */
};

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
    if (!d->elements || !d->pairs || !d->scratch || !d->sounded) {
        displacement_destroy(d);
        return -ENOMEM;
    }
    for (size_t e = 0; e < d->n_elements; e++)
        memcpy(d->elements[e].at_m,
               e < s->n_speakers ? s->speakers_m[e] : s->microphones_m[e - s->n_speakers],
               sizeof d->elements[e].at_m);
    for (size_t p = 0; p < n_pairs; p++)
        d->pairs[p].reference_s = NAN;
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
        row[WIND + k] = i->at_m[k] - j->at_m[k];
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

/* m [n][n], positive definite, and b become the solution in b (Cholesky). */
static void solve(double *m, double *b, int n)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = m[i * n + j];
            for (int k = 0; k < j; k++)
                sum -= m[i * n + k] * m[j * n + k];
            m[i * n + j] = i == j ? sqrt(fmax(sum, 1e-300)) : sum / m[j * n + j];
        }
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++)
            b[i] -= m[i * n + k] * b[k];
        b[i] /= m[i * n + i];
    }
    for (int i = n; i-- > 0;) {
        for (int k = i + 1; k < n; k++)
            b[i] -= m[k * n + i] * b[k];
        b[i] /= m[i * n + i];
    }
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
        solve(m, b, COMMON);
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

/* Cost, and where wanted its slopes, which go up with by_m. */
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
        double w = huber_weight(off) / d->sigma_m;
        cost += huber_cost(off);
        for (int a = 0; information && a < 3; a++) {
            slope[a] -= w * off * way[a];
            for (int b = 0; b < 3; b++)
                information[3 * a + b] += w / d->sigma_m * way[a] * way[b];
        }
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
        solve(m, by, 3);
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

/* Along which its paths go, most of all first. */
static void axes_of(const struct displacement *d, size_t e, double axes[3][3])
{
    static const double none[3] = {0};
    double m[6] = {0}, way[3], value[3];

    for (size_t k = 0; k < pairs_of(d, e); k++) {
        size_t pair;
        const struct element *other = other_end(d, e, k, &pair);
        moved_m(other->at_m, none, d->elements[e].at_m, none, way);
        for (int a = 0, i = 0; a < 3; a++)
            for (int b = a; b < 3; b++)
                m[i++] += way[a] * way[b];
    }
    symmetric_axes(m, value, axes);
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

/* What all that fit as well share. */
static void tell(double axes[3][3], const struct solution s[STARTS],
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
        if (high - low > TOLD_M)
            across += best * best;
        for (int a = 0; high - low <= TOLD_M && a < 3; a++)
            out->by_m[a] += best * axes[k][a];
    }
    out->across_m = sqrt(across);
    memcpy(m, s[0].information, sizeof m);
    for (int k = 0; k < 3; k++)
        to[k] = s[0].by_m[k] / fmax(out->size_m, 1e-9);
    double b[3] = {to[0], to[1], to[2]};
    solve(m, b, 3);
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
    axes_of(d, e, axes);
    search(d, e, axes, s);
    tell(axes, s, out);
    memcpy(by_m, s[0].by_m, sizeof s[0].by_m);
    double after_m = median_left_m(d, e, by_m, &n);
    bool fits = after_m < fmax(AGREE * before_m, 2.0 * d->sigma_m);
    bool far = out->size_m > fmax(DISPLACEMENT_LEAST_M, SIGMAS * out->sigma_m);
    /* Paths across grow with the square: with where it stood before the start, too. */
    out->sigma_m =
        hypot(out->sigma_m, PLACED_M * out->across_m / fmax(out->size_m, PLACED_M));
    bool most = before - s[0].cost > fmax(LEAST_GAIN, 0.5 * before);
    out->moved = fits && far && most;
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
        }
        if (one->said.moved && moved)
            one->said = one->heard;
        else if (!one->said.moved)
            one->said = (struct displacement_of){.moved = false};
    }
}

static void conclude(struct displacement *d)
{
    size_t heard = 0;

    for (size_t e = 0; e < d->n_elements; e++) {
        d->elements[e].taken = false;
        memset(d->elements[e].by_m, 0, sizeof d->elements[e].by_m);
    }
    grow(d);
    for (size_t i = 0; i < d->n_speakers * d->n_microphones; i++)
        heard += !isnan(d->pairs[i].grown_m);
    if (heard < COMMON + LEAST_PAIRS)
        return;
    memset(d->common, 0, sizeof d->common);
    take_common_out(d);
    fit_common(d);
    for (int n = 0; n < MOST_MOVED && take_one(d); n++)
        fit_together(d);
    settle(d);
}

void displacement_take(struct displacement *d, size_t speaker, const double *delay_s)
{
    if (d->sounded[speaker]) { /* the round is over */
        conclude(d);
        memset(d->sounded, 0, d->n_speakers * sizeof *d->sounded);
    }
    d->sounded[speaker] = true;
    for (size_t m = 0; m < d->n_microphones; m++) {
        struct pair *p = &d->pairs[speaker * d->n_microphones + m];
        bool learns = isnan(p->reference_s);
        if (isnan(delay_s[m]))
            continue;
        p->ring_s[p->n % (learns ? DISPLACEMENT_FIRST : DISPLACEMENT_RING)] = delay_s[m];
        p->n++;
        p->age = 0;
        if (learns && p->n == DISPLACEMENT_FIRST) {
            p->reference_s = median_delay(p, DISPLACEMENT_FIRST);
            p->n = DISPLACEMENT_RING;
        }
    }
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
    free(d);
}
