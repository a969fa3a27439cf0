/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/confocal/traces.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/fft.h"

#define PADDING  1.3  /* keeps a trace's end from its beginning */
#define TAPER    0.05 /* of a trace, at both ends */
#define PARTS    64   /* of the spectrum, in which the band is looked for */
#define FAINTEST 1e-6 /* of the largest power */
#define LOWEST   0.1  /* of the highest frequency: slower changes are no edges */
#define LEAST    0.1  /* of the sampled band is used in any case */

struct spectrum {
    size_t n;               /* of the transform */
    float *in, *out;        /* [n] complex */
    float *taper;           /* [samples] */
    fftwf_plan forth, back; /* back: from out to in */
    size_t low, high;       /* bins of the band */
};

static void spectrum_clear(struct spectrum *x)
{
    fftwf_destroy_plan(x->forth);
    fftwf_destroy_plan(x->back);
    fftwf_free(x->in);
    fftwf_free(x->out);
    free(x->taper);
}

static int spectrum_create(struct spectrum *x, size_t samples)
{
    memset(x, 0, sizeof *x);
    x->n = fft_size((size_t)ceil(PADDING * (double)samples) + 8, 1.1);
    x->in = fftwf_malloc(2 * x->n * sizeof *x->in);
    x->out = fftwf_malloc(2 * x->n * sizeof *x->out);
    x->taper = malloc(samples * sizeof *x->taper);
    if (!x->in || !x->out || !x->taper)
        return -ENOMEM;
    x->forth = fft_plan(x->n, x->in, x->out, FFTW_FORWARD);
    x->back = fft_plan(x->n, x->out, x->in, FFTW_BACKWARD);
    for (size_t i = 0; i < samples; i++) {
        double edge = fmin((double)i + 0.5, (double)(samples - i) - 0.5);
        double part = fmin(edge / (TAPER * (double)samples), 1.0);
        x->taper[i] = (float)(0.5 - 0.5 * cos(M_PI * part));
    }
    return x->forth && x->back ? 0 : -ENOMEM;
}

/* The spectrum of the trace at a place, x->out. */
static void transform_place(struct spectrum *x, const struct confocal_scan *s,
                            size_t place)
{
    const float *counts = s->counts + place * s->n;
    double mean = 0.0;
    memset(x->in, 0, 2 * x->n * sizeof *x->in);
    for (size_t i = 0; i < s->n; i++) {
        x->in[2 * i] = counts[i] > 0.0f ? sqrtf(counts[i]) : 0.0f;
        mean += x->in[2 * i];
    }
    mean /= (double)s->n;
    for (size_t i = 0; i < s->n; i++)
        x->in[2 * i] = x->taper[i] * (x->in[2 * i] - (float)mean);
    fftwf_execute(x->forth);
}

/* part[PARTS]: mean power of the parts of the spectrum up to half the rate.  Migration
 * sums all traces, so that what stands out of the noise by a small part of it counts. */
static int choose_band(struct spectrum *x, const double *part, size_t n_traces)
{
    double noise = 0.0, most = 0.0;
    size_t last = 0;
    for (size_t p = 0; p < PARTS; p++) {
        most = fmax(most, part[p]);
        if (p >= PARTS - PARTS / 4)
            noise += part[p] / (PARTS / 4);
    }
    double least = fmax(noise * (1.0 + 1.0 / sqrt((double)n_traces)), FAINTEST * most);
    if (!(most > 0.0))
        return -ENODATA;
    while (last < PARTS && part[last] > least)
        last++;
    double high = fmax((double)last / PARTS, LEAST) * 0.5 * (double)x->n;
    x->high = (size_t)fmin(fmax(high, 8.0), (double)(x->n / 2 - 1));
    x->low = (size_t)fmax(LOWEST * (double)x->high, 1.0);
    return x->high > x->low + 2 ? 0 : -ENODATA;
}

static int find_band(struct spectrum *x, const struct confocal_scan *s)
{
    double part[PARTS] = {0};
    size_t count[PARTS] = {0}, half = x->n / 2, n_traces = s->nx * s->ny;
    for (size_t q = 0; q < n_traces; q++) {
        transform_place(x, s, q);
        for (size_t b = 1; b < half; b++) {
            double re = x->out[2 * b], im = x->out[2 * b + 1];
            part[b * PARTS / half] += re * re + im * im;
            count[b * PARTS / half]++;
        }
    }
    for (size_t p = 0; p < PARTS; p++)
        part[p] /= (double)(count[p] ? count[p] : 1);
    return choose_band(x, part, n_traces);
}

/* The band with a Hann window, its middle at frequency 0. */
static void shift_band(struct spectrum *x)
{
    size_t middle = (x->low + x->high) / 2;
    memcpy(x->in, x->out, 2 * x->n * sizeof *x->in);
    memset(x->out, 0, 2 * x->n * sizeof *x->out);
    for (size_t b = x->low; b <= x->high; b++) {
        double at = (double)(b - x->low) / (double)(x->high - x->low);
        float w = (float)((0.5 - 0.5 * cos(2.0 * M_PI * at)) / (double)x->n);
        float *to = x->out + 2 * ((b + x->n - middle) % x->n);
        to[0] = w * x->in[2 * b];
        to[1] = w * x->in[2 * b + 1];
    }
}

/* A bin's phase counts from sample 0; the carrier's from time 0. */
static void convert(struct spectrum *x, const struct confocal_scan *s,
                    struct confocal_traces *t)
{
    double turns = t->format.carrier_hz * t->format.t0_s;
    double angle = -2.0 * M_PI * (turns - floor(turns));
    float c = (float)cos(angle), d = (float)sin(angle);
    for (size_t q = 0; q < s->nx * s->ny; q++) {
        size_t ix = q % s->nx, iy = q / s->nx;
        float *out = (float *)(t->traces + (ix * s->ny + iy) * s->n);
        transform_place(x, s, q);
        shift_band(x);
        fftwf_execute(x->back);
        for (size_t i = 0; i < s->n; i++) {
            float re = x->in[2 * i], im = x->in[2 * i + 1];
            out[2 * i] = re * c - im * d;
            out[2 * i + 1] = re * d + im * c;
        }
    }
}

int confocal_traces_create(struct confocal_traces *t, const struct confocal_scan *s,
                           struct error *why)
{
    struct spectrum x;
    memset(t, 0, sizeof *t);
    int err = spectrum_create(&x, s->n);
    if (!err)
        err = find_band(&x, s);
    if (err == -ENODATA)
        error_say(why, err, "rect_data: does not change over time in the gate");
    if (!err) {
        double rate_hz = 0.5 * CONFOCAL_LIGHT_M_S / s->range_step_m;
        double bin_hz = rate_hz / (double)x.n;
        t->format = (struct trace_format){
            .t0_s = 2.0 * s->range_m / CONFOCAL_LIGHT_M_S,
            .rate_hz = rate_hz,
            .carrier_hz = (double)((x.low + x.high) / 2) * bin_hz,
            .n_samples = s->n,
        };
        t->band_hz[0] = (double)x.low * bin_hz;
        t->band_hz[1] = (double)x.high * bin_hz;
        t->traces = malloc(s->nx * s->ny * s->n * sizeof *t->traces);
        err = t->traces ? 0 : -ENOMEM;
    }
    if (!err)
        convert(&x, s, t);
    if (err == -ENOMEM)
        error_say(why, err, "out of memory");
    spectrum_clear(&x);
    return err;
}

void confocal_traces_clear(struct confocal_traces *t)
{
    free(t->traces);
    memset(t, 0, sizeof *t);
}
