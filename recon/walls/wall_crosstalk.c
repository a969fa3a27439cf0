/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_crosstalk.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/fft.h"

#define RIDGE 1e-4 /* of the power of an arrival */
#define SLACK 1.2

struct wall_crosstalk {
    size_t n_trace, n_direct;    /* samples of a trace, and of direct sound */
    size_t n_windows, begins[2]; /* direct sound: of this slot, and of the next */
    size_t n_fft;
    float *solve[2];          /* [n_direct][2 n_direct][re, im]: own, other to other */
    float complex *leaves[2]; /* [n_fft]: spectrum of what a filter makes of the other */
    float complex *time, *frequency; /* [n_fft] */
    fftwf_plan forth, back;
};

struct responses {
    size_t n_trace;
    float complex *by[2][2]; /* [2 n_trace - 1]: filter, chirp; by lag, 0 in the middle */
};

/* The trace that a filter makes of a chirp that arrives at a delay. */
static void sound(const struct wall_crosstalk_config *cfg, int filter, int chirp,
                  double delay_s, float *ping, float complex *trace)
{
    const struct chirp *c = &cfg->chirps[chirp];
    double start = cfg->latency_samples + delay_s * cfg->sample_rate_hz;
    for (size_t i = 0; i < cfg->n_samples; i++) {
        double t = ((double)i - start) / cfg->sample_rate_hz;
        ping[i] = t >= 0.0 && t < c->duration_s ? (float)cos(chirp_phase_rad(c, t))
                                                : 0.0f;
    }
    pulse_compress_execute(cfg->filters[filter], ping, cfg->n_samples, trace);
}

/* Negative lags from a chirp that arrives as late as a ping holds it whole: longer than
 * a chirp lasts there is nothing. */
static void respond(const struct wall_crosstalk_config *cfg, const struct trace_format *f,
                    int filter, int chirp, float *ping, float complex *out)
{
    size_t last = f->n_samples - 1;
    double late_s = ((double)cfg->n_samples - cfg->latency_samples) /
                        cfg->sample_rate_hz -
                    cfg->chirps[chirp].duration_s;
    size_t late = (size_t)fmin(fmax(late_s * f->rate_hz, 0.0), (double)last);
    double angle = 2.0 * M_PI * f->carrier_hz * (double)late / f->rate_hz;
    float complex turn = (float complex)(cos(angle) + I * sin(angle));
    sound(cfg, filter, chirp, (double)late / f->rate_hz, ping, out + last);
    for (size_t lag = 1; lag <= last; lag++)
        out[last - lag] = lag <= late ? turn * out[last + late - lag] : 0.0f;
    sound(cfg, filter, chirp, 0.0, ping, out + last);
}

/* In place: the lower triangle of a Hermitian positive a [n][n] becomes its factor. */
static int factor(size_t n, double complex *a)
{
    for (size_t j = 0; j < n; j++) {
        for (size_t i = j; i < n; i++) {
            double complex sum = a[i * n + j];
            for (size_t k = 0; k < j; k++)
                sum -= a[i * n + k] * conj(a[j * n + k]);
            if (i == j && !(creal(sum) > 0.0))
                return -EINVAL;
            a[i * n + j] = i == j ? sqrt(creal(sum)) : sum / a[j * n + j];
        }
    }
    return 0;
}

/* x = (L L')^-1 x */
static void solve(size_t n, const double complex *l, double complex *x)
{
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < i; k++)
            x[i] -= l[i * n + k] * x[k];
        x[i] /= l[i * n + i];
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++)
            x[i] -= conj(l[k * n + i]) * x[k];
        x[i] /= l[i * n + i];
    }
}

static float complex response_at(const struct responses *r, int filter, int chirp,
                                 ptrdiff_t lag)
{
    return r->by[filter][chirp][(ptrdiff_t)r->n_trace - 1 + lag];
}

/* What both filters make of both chirps' arrivals in a window, [up, down] of each, and
 * its normal equations. */
static void fill(double complex *g, double complex *normal, size_t n_direct,
                 const struct responses *r)
{
    size_t n = 2 * n_direct;
    for (size_t i = 0; i < n * n; i++) {
        ptrdiff_t at = (ptrdiff_t)(i / n % n_direct), from = (ptrdiff_t)(i % n_direct);
        g[i] = (double complex)response_at(r, i / n >= n_direct, i % n >= n_direct,
                                           at - from);
    }
    memset(normal, 0, n * n * sizeof *normal);
    for (size_t k = 0; k < n; k++)
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j <= i; j++)
                normal[i * n + j] += conj(g[k * n + i]) * g[k * n + j];
    for (size_t i = 0; i < n; i++)
        normal[i * n + i] += RIDGE;
}

/* (G'G + ridge)^-1 G', of which each filter's rows are those of the other chirp. */
static int plan_solution(struct wall_crosstalk *x, const struct responses *r)
{
    size_t k = x->n_direct, n = 2 * k;
    double complex *g = malloc(n * n * sizeof *g), *normal = malloc(n * n * sizeof *g);
    double complex *z = malloc(n * sizeof *z);
    int err = g && normal && z ? 0 : -ENOMEM;
    if (!err) {
        fill(g, normal, k, r);
        err = factor(n, normal);
    }
    for (size_t unknown = 0; !err && unknown < n; unknown++) {
        int own = unknown < k; /* the filter whose other chirp this is of */
        float *to = x->solve[own] + (unknown % k) * n * 2;
        memset(z, 0, n * sizeof *z);
        z[unknown] = 1.0;
        solve(n, normal, z);
        for (size_t j = 0; j < n; j++) {
            double complex sum = 0.0;
            for (size_t i = 0; i < n; i++)
                sum += g[j * n + i] * z[i];
            size_t from = ((j < k) == (own == 0) ? 0 : k) + j % k;
            to[2 * from] = (float)creal(sum);
            to[2 * from + 1] = (float)-cimag(sum);
        }
    }
    free(g);
    free(normal);
    free(z);
    return err;
}

static void plan_leaves(struct wall_crosstalk *x, int own, const struct responses *r)
{
    ptrdiff_t last = (ptrdiff_t)x->n_trace - 1;
    memset(x->time, 0, x->n_fft * sizeof *x->time);
    for (ptrdiff_t lag = -last; lag <= last; lag++)
        x->time[lag < 0 ? (ptrdiff_t)x->n_fft + lag : lag] =
            response_at(r, own, 1 - own, lag) / (float)x->n_fft;
    fftwf_execute(x->forth);
    memcpy(x->leaves[own], x->frequency, x->n_fft * sizeof *x->frequency);
}

static int plan(struct wall_crosstalk *x, const struct wall_crosstalk_config *cfg,
                const struct trace_format *f)
{
    size_t n = 2 * x->n_trace - 1;
    float complex *all = malloc(4 * n * sizeof *all);
    float *ping = malloc(cfg->n_samples * sizeof *ping);
    struct responses r = {.n_trace = x->n_trace};
    int err = all && ping ? 0 : -ENOMEM;
    for (int k = 0; !err && k < 4; k++) {
        r.by[k / 2][k % 2] = all + (size_t)k * n;
        respond(cfg, f, k / 2, k % 2, ping, r.by[k / 2][k % 2]);
    }
    if (!err)
        err = plan_solution(x, &r);
    for (int own = 0; !err && own < 2; own++)
        plan_leaves(x, own, &r);
    free(all);
    free(ping);
    return err;
}

static int allocate(struct wall_crosstalk *x)
{
    x->time = fftwf_alloc_complex(x->n_fft);
    x->frequency = fftwf_alloc_complex(x->n_fft);
    for (int k = 0; k < 2; k++) {
        x->solve[k] = calloc(4 * x->n_direct * x->n_direct, sizeof *x->solve[k]);
        x->leaves[k] = calloc(x->n_fft, sizeof *x->leaves[k]);
        if (!x->solve[k] || !x->leaves[k])
            return -ENOMEM;
    }
    if (!x->time || !x->frequency)
        return -ENOMEM;
    x->forth = fft_plan(x->n_fft, (float *)x->time, (float *)x->frequency, FFTW_FORWARD);
    x->back = fft_plan(x->n_fft, (float *)x->frequency, (float *)x->time, FFTW_BACKWARD);
    return x->forth && x->back ? 0 : -ENOMEM;
}

int wall_crosstalk_create(struct wall_crosstalk **out,
                          const struct wall_crosstalk_config *cfg)
{
    struct trace_format f, down;
    pulse_compress_format(cfg->filters[0], &f);
    pulse_compress_format(cfg->filters[1], &down);
    double direct = ceil(cfg->direct_s * f.rate_hz) + 1.0;
    double next = floor(cfg->slot_s * f.rate_hz);
    bool hears_next = next + 1.0 < (double)f.n_samples;
    if (f.t0_s != 0.0 || down.t0_s != 0.0 || f.n_samples != down.n_samples ||
        f.rate_hz != down.rate_hz || f.carrier_hz != down.carrier_hz ||
        !(direct < fmin(next, (double)f.n_samples)) ||
        (hears_next && next + direct > (double)f.n_samples))
        return -EINVAL;
    struct wall_crosstalk *x = calloc(1, sizeof *x);
    if (!x)
        return -ENOMEM;
    x->n_trace = f.n_samples;
    x->n_direct = (size_t)direct;
    x->n_windows = hears_next ? 2 : 1;
    x->begins[1] = hears_next ? (size_t)next : 0;
    x->n_fft = fft_size(2 * f.n_samples - 1, SLACK);
    int err = allocate(x);
    if (!err)
        err = plan(x, cfg, &f);
    if (err)
        wall_crosstalk_destroy(x);
    else
        *out = x;
    return err;
}

/* y = m x of complex numbers as [re, im]; adds. */
static void multiply(size_t n_rows, size_t n, const float *m, size_t stride,
                     const float *x, float *y)
{
    for (size_t i = 0; i < n_rows; i++, m += stride) {
        float re = 0.0f, im = 0.0f;
        for (size_t j = 0; j < 2 * n; j += 2) {
            re += m[j] * x[j] - m[j + 1] * x[j + 1];
            im += m[j] * x[j + 1] + m[j + 1] * x[j];
        }
        y[2 * i] += re;
        y[2 * i + 1] += im;
    }
}

void wall_crosstalk_remove(struct wall_crosstalk *x, int k, float complex *restrict own,
                           const float complex *restrict other)
{
    size_t n = x->n_direct, stride = 4 * n;
    memset(x->time, 0, x->n_fft * sizeof *x->time);
    for (size_t w = 0; w < x->n_windows; w++) {
        size_t at = x->begins[w];
        float *arrivals = (float *)(x->time + at);
        multiply(n, n, x->solve[k], stride, (const float *)(own + at), arrivals);
        multiply(n, n, x->solve[k] + 2 * n, stride, (const float *)(other + at),
                 arrivals);
    }
    fftwf_execute(x->forth);
    for (size_t i = 0; i < x->n_fft; i++)
        x->frequency[i] *= x->leaves[k][i];
    fftwf_execute(x->back);
    for (size_t i = 0; i < x->n_trace; i++)
        own[i] -= x->time[i];
}

void wall_crosstalk_destroy(struct wall_crosstalk *x)
{
    if (!x)
        return;
    if (x->forth)
        fftwf_destroy_plan(x->forth);
    if (x->back)
        fftwf_destroy_plan(x->back);
    fftwf_free(x->time);
    fftwf_free(x->frequency);
    for (int k = 0; k < 2; k++) {
        free(x->solve[k]);
        free(x->leaves[k]);
    }
    free(x);
}
