#include "dsp/band_plan.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "dsp/band_loops.h"
#include "dsp/lane_fft.h"

#define MAX_STREAMS 32
#define MAX_POINTS  384  /* of 16 channels in a first cache of 48 kB */
#define MAX_EXCESS  1.15 /* of the baseband's rate over what is asked for */

static bool config_is_valid(const struct band_transform_config *c)
{
    return c->n_min >= 1 && c->n_min <= (1u << 26) && c->band[0] >= 0.0 &&
           c->band[1] > c->band[0] && c->band[1] <= 0.5 && c->oversampling >= 1.0 &&
           c->oversampling <= 64.0 && c->span >= 0.0 && c->span < (double)c->n_min;
}

/* The next length that the loops take and lane_fft transforms. */
static size_t stream_size(size_t min)
{
    size_t n = (min + BAND_BLOCK - 1) / BAND_BLOCK * BAND_BLOCK;

    while (!lane_fft_transforms(n))
        n += BAND_BLOCK;
    return n;
}

static double transform_cost_ns(size_t n)
{
    double points = (double)n;

    return (n > MAX_POINTS ? 0.09 : 0.043) * points * log2(points);
}

/* Lengths for R streams, and what each of 16 channels then costs, in ns of a machine of
 * 2023 with AVX-512: transforms, the sum before them and the sum after them. */
static double layout_try(struct band_plan *p, const struct band_transform_config *c,
                         size_t n_streams)
{
    struct band_transform_layout *l = &p->layout;
    double low, high, wanted, streams = (double)n_streams, cost;

    p->n_forward = stream_size((c->n_min + n_streams - 1) / n_streams);
    l->n_streams = n_streams;
    l->length = n_streams * p->n_forward;
    low = fmax(ceil(c->band[0] * (double)l->length - 0.5 - 1e-9), 0.0);
    high = fmax(floor(c->band[1] * (double)l->length - 0.5 + 1e-9), low);
    p->first = (size_t)low / n_streams;
    l->n_bins = (size_t)high / n_streams - p->first + 1;
    wanted =
        fmax(ceil(c->oversampling * (high - low + 1.0) / streams), (double)l->n_bins);
    p->n_inverse = stream_size((size_t)wanted);
    l->rate = (double)p->n_inverse / (double)p->n_forward;
    l->carrier = (floor((low + high) / 2.0) + 0.5) / (double)l->length;
    l->n_output = (size_t)floor(c->span * l->rate + 1e-6) + 1;
    p->n_table = (l->n_output + p->n_inverse - 1) / p->n_inverse * p->n_inverse;
    cost = 0.5 * streams * transform_cost_ns(p->n_forward) +
           streams * transform_cost_ns(p->n_inverse) +
           (0.0072 * streams + 0.1) * (double)l->length +
           (0.058 * streams + 0.1) * (double)l->n_output;
    return (double)p->n_inverse > MAX_EXCESS * wanted ? 10.0 * cost : cost;
}

static void layout_choose(struct band_plan *p, const struct band_transform_config *c)
{
    double best_cost = INFINITY;
    size_t best = 2;

    for (size_t r = 2; r <= MAX_STREAMS; r += 2) {
        double cost = layout_try(p, c, r);
        if (cost < best_cost) {
            best_cost = cost;
            best = r;
        }
    }
    layout_try(p, c, best);
}

static int tables_create(struct band_plan *p)
{
    size_t r = p->layout.n_streams;

    p->roots = fftwf_malloc(r * r / 2 * sizeof(float));
    p->twiddle = fftwf_malloc(r * p->n_forward * sizeof(float));
    p->step = fftwf_malloc(2 * p->n_table * sizeof(float));
    p->shift = fftwf_malloc(2 * p->n_table * sizeof(float));
    return p->roots && p->twiddle && p->step && p->shift ? 0 : -ENOMEM;
}

static void polar_store(float *re, float *im, double cycles)
{
    double a = 2.0 * M_PI * (cycles - floor(cycles));

    *re = (float)cos(a);
    *im = (float)sin(a);
}

static void tables_fill(struct band_plan *p)
{
    const struct band_transform_layout *l = &p->layout;
    size_t r = l->n_streams, m = p->n_forward, n_table = p->n_table;
    double length = (double)l->length, back = (double)(r * p->n_inverse);
    double offset = (double)(r * p->first) + 0.5 - l->carrier * length;

    for (size_t s = 0; s < r / 2; s++) {
        double k = (double)s + 0.5;
        for (size_t i = 0; i < r; i++) {
            float cosine, sine;
            polar_store(&cosine, &sine, -k * (double)i / (double)r);
            p->roots[s * r + i] = i < r / 2 ? cosine : sine;
        }
        for (size_t i = 0; i < m; i++) {
            float *t = p->twiddle + 2 * s * m + i;
            polar_store(&t[0], &t[m], -k * (double)i / length);
        }
    }
    for (size_t i = 0; i < n_table; i++) {
        polar_store(&p->step[i], &p->step[n_table + i], (double)i / back);
        polar_store(&p->shift[i], &p->shift[n_table + i], offset * (double)i / back);
    }
}

int band_plan_init(struct band_plan *p, const struct band_transform_config *c)
{
    int err;

    if (!c || !config_is_valid(c))
        return -EINVAL;
    memset(p, 0, sizeof(*p));
    layout_choose(p, c);
    err = tables_create(p);
    if (err)
        band_plan_clear(p);
    else
        tables_fill(p);
    return err;
}

void band_plan_clear(struct band_plan *p)
{
    fftwf_free(p->roots);
    fftwf_free(p->twiddle);
    fftwf_free(p->step);
    fftwf_free(p->shift);
    p->roots = p->twiddle = p->step = p->shift = NULL; /* it may be cleared again */
}
