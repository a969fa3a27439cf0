#include "dsp/cfar.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"

#define SHAPE_STEP                                                                       \
    0.05 /* of its logarithm: what is nearer is the same, factors are dear */

#define RARE     1e-4 /* how bright noise is that often, or as often as it may alarm... */
#define FAR_OVER 2.0  /* ...times this is too bright for noise */

enum { MEMORY = 32768, PARTS = 2 };

struct cfar {
    struct cfar_config cfg;
    struct cfar_noise noise;
    struct cfar_noise_curve curve; /* of ordered ones */
    double over_level;             /* the noise's mean */
    double tail_factor;            /* of a heavy tail... */
    double no_noise;               /* ...and what is brighter was no noise */
    size_t most;                   /* training cells */
    double *factor;                /* [most + 1]; NAN: not known yet */
    float *sample;                 /* [most] */
    float *ratio;  /* [MEMORY] newest powers over their levels, of noise mostly */
    float *sorted; /* [MEMORY], scratch */
    size_t n_ratios, next_ratio, images;
};

int cfar_kind_from_name(const char *name, enum cfar_kind *out)
{
    static const char *const names[] = {"off", "averaging", "ordered"};

    for (unsigned i = 0; i < sizeof names / sizeof *names; i++) {
        if (strcmp(name, names[i]) == 0) {
            *out = (enum cfar_kind)i;
            return 0;
        }
    }
    return -EINVAL;
}

static bool is_valid(const struct cfar_config *c)
{
    bool ok = c->false_alarm_rate >= 1e-12 && c->false_alarm_rate <= 0.5;

    ok = ok && (c->kind == CFAR_AVERAGING ||
                (c->kind == CFAR_ORDERED && c->rank > 0.0 && c->rank < 1.0));
    for (int a = 0; a < 3; a++)
        ok = ok && c->n[a] && c->pitch[a] && c->guard[a] < c->n[a] + c->pitch[a] &&
             c->training[a] <= 1024;
    return ok;
}

/* Cells on either side along an axis, the guard's among them. */
static size_t reach(const struct cfar_config *c, int axis)
{
    return c->n[axis] == 1 ? 0 : c->guard[axis] / c->pitch[axis] + c->training[axis];
}

static void set_shape(struct cfar *c, double shape)
{
    c->noise.shape = shape;
    if (c->cfg.kind == CFAR_ORDERED)
        cfar_noise_curve(&c->curve, shape);
    c->over_level = c->cfg.kind == CFAR_ORDERED ? cfar_noise_over_rank(shape, c->cfg.rank)
                                                : 1.0;
    for (size_t n = 0; n <= c->most; n++)
        c->factor[n] = NAN;
}

int cfar_create(struct cfar **out, const struct cfar_config *cfg)
{
    size_t most = 1;

    if (!is_valid(cfg))
        return -EINVAL;
    for (int a = 0; a < 3; a++)
        most *= 2 * reach(cfg, a) + 1;
    if (most <= CFAR_MIN_TRAINING)
        return -EINVAL;
    struct cfar *c = calloc(1, sizeof *c);
    if (!c)
        return -ENOMEM;
    *c = (struct cfar){.cfg = *cfg, .most = most};
    c->factor = malloc((most + 1) * sizeof *c->factor);
    c->sample = malloc((most + 1) * sizeof *c->sample);
    c->ratio = malloc(MEMORY * sizeof *c->ratio);
    c->sorted = malloc(MEMORY * sizeof *c->sorted);
    if (!c->factor || !c->sample || !c->ratio || !c->sorted) {
        cfar_destroy(c);
        return -ENOMEM;
    }
    set_shape(c, 1.0);
    c->no_noise = INFINITY;
    *out = c;
    return 0;
}

static size_t rank_of(const struct cfar *c, size_t n)
{
    size_t k = (size_t)ceil(c->cfg.rank * (double)n);

    return k < 1 ? 1 : k > n ? n : k;
}

static double factor_at_rate(const struct cfar *c, size_t n, double rate)
{
    return c->cfg.kind == CFAR_ORDERED
               ? cfar_noise_ordered(&c->curve, n, rank_of(c, n), rate)
               : cfar_noise_averaging(c->noise.shape, n, rate);
}

double cfar_factor(const struct cfar *c, size_t n)
{
    if (n > c->most)
        n = c->most;
    if (isnan(c->factor[n]))
        c->factor[n] = factor_at_rate(c, n, c->cfg.false_alarm_rate);
    if (!c->noise.heavy)
        return c->factor[n];
    /* Of what is rarer than one of all that was seen, the seen says little. */
    return c->cfg.false_alarm_rate * (double)c->n_ratios >= 1.0
               ? c->tail_factor
               : fmax(c->factor[n], c->tail_factor);
}

/* The training cells of a cell into c->sample, but for those that nothing was imaged in;
 * returns how many. */
static size_t train(struct cfar *c, const float *image, size_t cell)
{
    const struct cfar_config *g = &c->cfg;
    const ptrdiff_t at[3] = {(ptrdiff_t)(cell % g->n[0]),
                             (ptrdiff_t)(cell / g->n[0] % g->n[1]),
                             (ptrdiff_t)(cell / (g->n[0] * g->n[1]))};
    ptrdiff_t first[3], last[3], step[3], guard[3], stride[3] = {1, 1, 1};
    size_t n = 0;

    for (int a = 0; a < 3; a++) {
        ptrdiff_t far = (ptrdiff_t)(reach(g, a) * g->pitch[a]);
        step[a] = (ptrdiff_t)g->pitch[a];
        guard[a] = (ptrdiff_t)g->guard[a];
        first[a] = -far;
        last[a] = far;
        while (at[a] + first[a] < 0)
            first[a] += step[a];
        while (at[a] + last[a] >= (ptrdiff_t)g->n[a])
            last[a] -= step[a];
        stride[a] = a ? stride[a - 1] * (ptrdiff_t)g->n[a - 1] : 1;
    }
    for (ptrdiff_t z = first[2]; z <= last[2]; z += step[2])
        for (ptrdiff_t y = first[1]; y <= last[1]; y += step[1]) {
            bool guarded = labs(y) <= guard[1] && labs(z) <= guard[2];
            const float *row = image + ((ptrdiff_t)cell + z * stride[2] + y * stride[1]);
            for (ptrdiff_t x = first[0]; x <= last[0]; x += step[0]) {
                c->sample[n] = row[x];
                n += row[x] > 0.0f && !(guarded && labs(x) <= guard[0]);
            }
        }
    return n;
}

static double level_of(struct cfar *c, size_t n)
{
    double sum = 0.0;

    if (c->cfg.kind == CFAR_ORDERED)
        return (double)rank_smallest(c->sample, n, rank_of(c, n));
    for (size_t i = 0; i < n; i++)
        sum += (double)c->sample[i];
    return sum / (double)n;
}

struct cfar_level cfar_at(struct cfar *c, const float *image, size_t cell)
{
    struct cfar_level out = {0.0, INFINITY};
    size_t n = train(c, image, cell);

    if (n < CFAR_MIN_TRAINING)
        return out;
    double level = level_of(c, n);
    out.noise = level * c->over_level;
    out.threshold = level * cfar_factor(c, n);
    return out;
}

/* What is far over all noise is not learnt from, as far as noise is known: after the
 * first image.  A limit at the threshold itself would cut off the tail that the threshold
 * is learnt from, image by image. */
static void remember(struct cfar *c, const float *image, size_t cell)
{
    size_t n = train(c, image, cell);
    double level = n < CFAR_MIN_TRAINING ? 0.0 : level_of(c, n);
    float ratio = level > 0.0 ? (float)((double)image[cell] / level) : 0.0f;

    if (!(ratio > 0.0f && isfinite(ratio)) ||
        (c->images > 1 && (double)ratio > c->no_noise))
        return;
    c->ratio[c->next_ratio] = ratio;
    c->next_ratio = (c->next_ratio + 1) % MEMORY;
    c->n_ratios += c->n_ratios < MEMORY;
}

void cfar_learn(struct cfar *c, const float *image)
{
    const struct cfar_config *g = &c->cfg;
    size_t number = 0, part = c->images++;

    for (size_t z = 0; z < g->n[2]; z += g->pitch[2])
        for (size_t y = 0; y < g->n[1]; y += g->pitch[1])
            for (size_t x = 0; x < g->n[0]; x += g->pitch[0])
                if (part == 0 || number++ % PARTS == part % PARTS)
                    remember(c, image, (z * g->n[1] + y) * g->n[0] + x);
    if (c->n_ratios < CFAR_MIN_TRAINING)
        return;
    double shape = cfar_noise_shape(c->ratio, c->n_ratios);
    if (fabs(log(shape / c->noise.shape)) >= SHAPE_STEP)
        set_shape(c, shape);
    const double promised[2] = {factor_at_rate(c, c->most, 1e-2),
                                factor_at_rate(c, c->most, 1e-3)};
    memcpy(c->sorted, c->ratio, c->n_ratios * sizeof *c->ratio);
    cfar_noise_fit_tail(&c->noise, c->sorted, c->n_ratios, promised);
    double rare = fmin(c->cfg.false_alarm_rate, RARE);
    c->no_noise = factor_at_rate(c, c->most, rare);
    if (c->noise.heavy) {
        c->tail_factor = cfar_noise_tail_factor(&c->noise, c->sorted, c->n_ratios,
                                                c->cfg.false_alarm_rate);
        c->no_noise = cfar_noise_tail_factor(&c->noise, c->sorted, c->n_ratios, rare);
    }
    c->no_noise *= FAR_OVER;
}

bool cfar_has_learnt(const struct cfar *c)
{
    return c->images > 0;
}

const struct cfar_noise *cfar_noise(const struct cfar *c)
{
    return &c->noise;
}

void cfar_destroy(struct cfar *c)
{
    if (!c)
        return;
    free(c->factor);
    free(c->sample);
    free(c->ratio);
    free(c->sorted);
    free(c);
}
