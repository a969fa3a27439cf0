/* SPDX-License-Identifier: MIT */
#include "recon/planning/coherence.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/fft.h"
#include "dsp/vector.h"
#include "recon/coherent/midpoint.h"
#include "recon/coherent/nmo.h"

#define SIGMA_STEP_M 0.00025
#define SIGMA_MOST_M 0.03
#define CERTAIN      4.0 /* times the floor: less is noise */
#define SLACK        1.2
#define QUIET        32 /* samples of a stretch of noise */
#define HOP          8  /* from stretch to stretch: beside an echo one fits in */
#define EDGE         8  /* samples left out at either end */

struct gather {              /* of one stage position; one a thread */
    float complex *trace;    /* [n_bins] */
    float complex *sum;      /* [ny][n_bins] over the pairs of a line of midpoints */
    double *length, *square; /* [ny][n_bins] of |Z|, of |Z|^2 */
    size_t *n;               /* [ny] */
    double *product, *most;  /* [n_bins] of all positions: of Z Z'*, of |Z| |Z'| */
    double products;         /* how many */
    double *power;           /* [n_samples] of traces */
};

struct work {
    const struct trace_set *set;
    struct midpoints *midpoints;
    struct nmo *nmo;
    fftwf_plan plan;
    struct gather *gathers; /* [threads] */
    size_t n_bins, n_positions;
};

static int gather_create(struct gather *g, size_t ny, size_t n_bins, size_t n_samples)
{
    g->trace = fftwf_malloc(n_bins * sizeof *g->trace);
    g->sum = malloc(ny * n_bins * sizeof *g->sum);
    g->length = malloc(ny * n_bins * sizeof *g->length);
    g->square = malloc(ny * n_bins * sizeof *g->square);
    g->n = malloc(ny * sizeof *g->n);
    g->product = calloc(n_bins, sizeof *g->product);
    g->most = calloc(n_bins, sizeof *g->most);
    g->power = calloc(n_samples, sizeof *g->power);
    return g->trace && g->sum && g->length && g->square && g->n && g->product &&
                   g->most && g->power
               ? 0
               : -ENOMEM;
}

static void gather_clear(struct gather *g)
{
    fftwf_free(g->trace);
    free(g->sum);
    free(g->length);
    free(g->square);
    free(g->n);
    free(g->product);
    free(g->most);
    free(g->power);
}

static void work_clear(struct work *w, size_t threads)
{
    for (size_t t = 0; w->gathers && t < threads; t++)
        gather_clear(&w->gathers[t]);
    free(w->gathers);
    if (w->plan)
        fftwf_destroy_plan(w->plan);
    nmo_destroy(w->nmo);
    midpoints_destroy(w->midpoints);
}

static size_t count_samples(const struct geometry *g)
{
    return g->n_positions < COHERENCE_POSITIONS ? g->n_positions : COHERENCE_POSITIONS;
}

static size_t sampled(const struct geometry *g, size_t item)
{
    return item * g->n_positions / count_samples(g);
}

bool coherence_samples(const struct geometry *g, size_t position)
{
    for (size_t i = 0; i < count_samples(g); i++)
        if (sampled(g, i) == position)
            return true;
    return false;
}

static int work_create(struct work *w, const struct trace_set *set, size_t threads,
                       const char **why)
{
    const struct geometry *g = set->geometry;
    *w = (struct work){.set = set};
    int err = midpoints_create(&w->midpoints, g, why);
    if (err)
        return err;
    struct nmo_config nmo = {
        .sound_speed_m_s = g->sound_speed_m_s,
        .in = set->format,
        .out = set->format,
        .mute_s = 2.0 * set->gate_m[0] / g->sound_speed_m_s,
        .band_hz = set->band_hz[1] - set->band_hz[0],
        .n_offsets = w->midpoints->n_offsets,
        .half_offset_m = w->midpoints->half_offset_m,
    };
    err = nmo_create(&w->nmo, &nmo);
    w->n_bins = fft_size(set->format.n_samples, SLACK);
    w->n_positions = count_samples(g);
    w->gathers = calloc(threads, sizeof *w->gathers);
    if (!err && !w->gathers)
        err = -ENOMEM;
    for (size_t t = 0; !err && t < threads; t++)
        err = gather_create(&w->gathers[t], w->midpoints->ny, w->n_bins,
                            set->format.n_samples);
    if (err)
        return err;
    w->plan = fftwf_plan_dft_1d((int)w->n_bins, w->gathers[0].trace, w->gathers[0].trace,
                                FFTW_FORWARD, FFTW_ESTIMATE);
    return w->plan ? 0 : -ENOMEM;
}

VECTOR_CLONES
static void add_power(size_t n, const float *restrict in, double *restrict power)
{
    for (size_t q = 0; q < n; q++)
        power[q] += (double)(in[2 * q] * in[2 * q] + in[2 * q + 1] * in[2 * q + 1]);
}

VECTOR_CLONES
static void add_spectrum(size_t n, const float *restrict z, float *restrict sum,
                         double *restrict length, double *restrict square)
{
    for (size_t k = 0; k < n; k++) {
        float re = z[2 * k], im = z[2 * k + 1], own = re * re + im * im;
        sum[2 * k] += re;
        sum[2 * k + 1] += im;
        length[k] += (double)sqrtf(own);
        square[k] += (double)own;
    }
}

/* A pair's spectrum into the sums of its midpoint. */
static void add_pair(const struct work *w, struct gather *g, size_t position, size_t pair)
{
    const struct trace_set *s = w->set;
    size_t pairs = trace_set_pairs(s), n = s->format.n_samples;
    size_t y = w->midpoints->iy[position * pairs + pair];
    const float complex *in = s->traces + (position * pairs + pair) * n;
    add_power(n, (const float *)in, g->power);
    memset(g->trace, 0, w->n_bins * sizeof *g->trace);
    nmo_stack(w->nmo, w->midpoints->offset[pair], in, g->trace);
    fftwf_execute_dft(w->plan, g->trace, g->trace);
    add_spectrum(w->n_bins, (const float *)g->trace, (float *)(g->sum + y * w->n_bins),
                 g->length + y * w->n_bins, g->square + y * w->n_bins);
    g->n[y]++;
}

/* |sum|^2 - sum of squares: all products of two different pairs.  They are compared with
 * the products of their lengths, so that what some pairs hear more loudly counts for
 * nothing. */
static void close_gathers(const struct work *w, struct gather *g)
{
    for (size_t y = 0; y < w->midpoints->ny; y++) {
        const float *sum = (const float *)(g->sum + y * w->n_bins);
        const double *length = g->length + y * w->n_bins;
        const double *square = g->square + y * w->n_bins;
        if (g->n[y] < 2)
            continue;
        for (size_t k = 0; k < w->n_bins; k++) {
            double re = sum[2 * k], im = sum[2 * k + 1];
            g->product[k] += re * re + im * im - square[k];
            g->most[k] += length[k] * length[k] - square[k];
        }
        g->products += (double)(g->n[y] * (g->n[y] - 1));
    }
}

static void measure_position(void *ctx, size_t item, size_t thread)
{
    struct work *w = ctx;
    struct gather *g = &w->gathers[thread];
    size_t pairs = trace_set_pairs(w->set), ny = w->midpoints->ny;
    size_t position = sampled(w->set->geometry, item);
    memset(g->sum, 0, ny * w->n_bins * sizeof *g->sum);
    memset(g->length, 0, ny * w->n_bins * sizeof *g->length);
    memset(g->square, 0, ny * w->n_bins * sizeof *g->square);
    memset(g->n, 0, ny * sizeof *g->n);
    for (size_t p = 0; p < pairs; p++)
        if (w->set->heard[position * pairs + p])
            add_pair(w, g, position, p);
    close_gathers(w, g);
}

static double bin_hz(const struct work *w, size_t k)
{
    double n = (double)w->n_bins, at = (double)k;
    return w->set->format.carrier_hz +
           w->set->format.rate_hz * (at < 0.5 * n ? at : at - n) / n;
}

static double quietest_power(const double *power, size_t n)
{
    double least = INFINITY;
    for (size_t from = 0; from + QUIET <= n; from += HOP) {
        double sum = 0.0;
        for (size_t q = from; q < from + QUIET; q++)
            sum += power[q];
        least = fmin(least, sum / QUIET);
    }
    return least;
}

/* Of the echoes in the power of the traces, from the quietest stretch: the echoes' gain
 * with range, which moveout puts on, weighs both. */
static double echo_share(const struct work *w, const struct gather *all)
{
    const struct trace_format *f = &w->set->format;
    double sum = 0.0, weight = 0.0;
    if (f->n_samples < QUIET + 2 * EDGE)
        return 0.0;
    for (size_t q = EDGE; q < f->n_samples - EDGE; q++) {
        double t = f->t0_s + (double)q / f->rate_hz;
        sum += t * t * all->power[q];
        weight += t * t;
    }
    double noise = quietest_power(all->power + EDGE, f->n_samples - 2 * EDGE);
    return sum > 0.0 ? fmax(1.0 - noise * weight / sum, 0.0) : 0.0;
}

static double misfit(const struct work *w, const struct gather *all, double level,
                     double sigma_m)
{
    double sum = 0.0;
    double k_m = 2.0 * M_PI * sigma_m / w->set->geometry->sound_speed_m_s;
    for (size_t k = 0; k < w->n_bins; k++) {
        double f = bin_hz(w, k);
        if (f < w->set->band_hz[0] || f > w->set->band_hz[1])
            continue;
        double model = level * exp(-2.0 * pow(k_m * f, 2.0));
        sum += pow(all->product[k] - model * all->most[k], 2.0);
    }
    return sum;
}

static void fit(const struct work *w, const struct gather *all, struct coherence *out)
{
    double least = INFINITY;
    *out = (struct coherence){.element_m = NAN};
    if (!(all->products > 0.0))
        return;
    out->floor = 1.0 / sqrt(all->products);
    out->level = echo_share(w, all);
    if (!(out->level > CERTAIN * out->floor))
        return;
    for (double sigma_m = 0.0; sigma_m <= SIGMA_MOST_M; sigma_m += SIGMA_STEP_M) {
        double here = misfit(w, all, out->level, sigma_m);
        if (!(here < least))
            continue;
        least = here;
        out->element_m = sigma_m;
    }
}

static void gather_join(struct gather *to, const struct gather *from, size_t n_bins,
                        size_t n_samples)
{
    for (size_t k = 0; k < n_bins; k++) {
        to->product[k] += from->product[k];
        to->most[k] += from->most[k];
    }
    for (size_t n = 0; n < n_samples; n++)
        to->power[n] += from->power[n];
    to->products += from->products;
}

int coherence_measure(struct coherence *out, const struct trace_set *set,
                      struct pool *pool)
{
    const char *why;
    struct work w;
    size_t threads = pool_threads(pool);
    int err = work_create(&w, set, threads, &why);
    if (!err) {
        pool_run(pool, w.n_positions, measure_position, &w);
        struct gather *all = &w.gathers[0];
        for (size_t t = 1; t < threads; t++)
            gather_join(all, &w.gathers[t], w.n_bins, set->format.n_samples);
        fit(&w, all, out);
    }
    work_clear(&w, threads);
    return err;
}
