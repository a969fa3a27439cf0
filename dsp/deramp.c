#include "dsp/deramp.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/fft_plan.h"
#include "dsp/fft_size.h"

/* Of an echo at the gate's far end, at least this part must fall into the slot. */
#define MIN_OVERLAP 0.05

struct deramp {
    struct trace_format format;
    size_t n_channels;
    size_t first, n_slot;      /* samples of a ping that are used */
    size_t n_analytic, n_beat; /* transform lengths */
    size_t first_bin;          /* the range bin of a trace's sample 0 */
    float *mixer;              /* [n_slot][2], window and conjugate chirp */
    float *turn;               /* [format.n_samples][2] */
    float *wave, *spectrum;    /* [n_analytic][2] */
    float *mixed, *beat;       /* [n_beat][2] */
    fftwf_plan forward, backward, range;
};

static void complex_multiply(float *z, const float *w)
{
    float re = z[0] * w[0] - z[1] * w[1], im = z[0] * w[1] + z[1] * w[0];

    z[0] = re;
    z[1] = im;
}

static void complex_polar(float *z, double magnitude, double cycles)
{
    double a = 2.0 * M_PI * (cycles - floor(cycles));

    z[0] = (float)(magnitude * cos(a));
    z[1] = (float)(magnitude * sin(a));
}

static bool config_is_valid(const struct deramp_config *c)
{
    double nyquist_hz = c->sample_rate_hz / 2.0;

    return isfinite(nyquist_hz) && nyquist_hz > 0.0 && c->n_channels && c->n_samples &&
           c->n_samples < INT32_MAX / 4 && c->latency_samples >= 0.0 &&
           c->latency_samples < 1e9 && c->chirp.start_hz >= 0.0 &&
           c->chirp.start_hz <= nyquist_hz && c->chirp.stop_hz >= 0.0 &&
           c->chirp.stop_hz <= nyquist_hz && c->chirp.start_hz != c->chirp.stop_hz &&
           chirp_length(&c->chirp, c->sample_rate_hz) >= 2 && c->gate_s[0] >= 0.0 &&
           c->gate_s[1] > c->gate_s[0] && isfinite(c->gate_s[1]) && c->rate_hz > 0.0 &&
           c->rate_hz <= 64.0 * c->sample_rate_hz;
}

static double slope_hz_s(const struct deramp_config *c)
{
    return (c->chirp.stop_hz - c->chirp.start_hz) / c->chirp.duration_s;
}

static double slot_time_s(const struct deramp *d, const struct deramp_config *c, size_t i)
{
    return ((double)(d->first + i) - c->latency_samples) / c->sample_rate_hz;
}

static double slot_weight(const struct deramp *d, const struct deramp_config *c, size_t i)
{
    return window_weight(c->window, slot_time_s(d, c, i) / c->chirp.duration_s);
}

/* What a unit echo of that delay adds up to: it is absent from the slot's beginning. */
static double slot_overlap(const struct deramp *d, const struct deramp_config *c,
                           double delay_s)
{
    double sum = 0.0;

    for (size_t i = 0; i < d->n_slot; i++)
        if (slot_time_s(d, c, i) >= delay_s)
            sum += slot_weight(d, c, i);
    return sum;
}

static int layout_choose(struct deramp *d, const struct deramp_config *c)
{
    double fs = c->sample_rate_hz, first = ceil(c->latency_samples);
    double slope = fabs(slope_hz_s(c)), n_beat;
    struct trace_format *f = &d->format;
    double whole;

    if (first + 2.0 > (double)c->n_samples)
        return -ERANGE;
    d->first = (size_t)first;
    d->n_slot = (size_t)floor(c->chirp.duration_s * fs - (first - c->latency_samples)) +
                1;
    if (d->n_slot > c->n_samples - d->first)
        d->n_slot = c->n_samples - d->first;
    whole = slot_overlap(d, c, 0.0);
    if (!(whole > 0.0 && slot_overlap(d, c, c->gate_s[1]) >= MIN_OVERLAP * whole))
        return -ERANGE;
    n_beat = fmax(ceil(fs * c->rate_hz / slope - 1e-6), (double)d->n_slot);
    if (n_beat > INT32_MAX / 4)
        return -EINVAL;
    d->n_channels = c->n_channels;
    d->n_beat = fft_size((size_t)n_beat, 1.05);
    /* Room after the slot, for the analytic signal's tails to wrap into. */
    d->n_analytic = fft_size(d->n_slot + d->n_slot / 8 + 1, 1.25);
    f->rate_hz = (double)d->n_beat * slope / fs;
    d->first_bin = (size_t)ceil(c->gate_s[0] * f->rate_hz - 1e-6);
    f->t0_s = (double)d->first_bin / f->rate_hz;
    if (c->gate_s[1] < f->t0_s)
        return -EINVAL;
    f->n_samples = (size_t)floor((c->gate_s[1] - f->t0_s) * f->rate_hz + 1e-6) + 1;
    if (d->first_bin + f->n_samples > d->n_beat)
        return -ERANGE;
    /* The frequency that the echo in the gate's middle has in the slot's middle. */
    f->carrier_hz = c->chirp.start_hz +
                    slope_hz_s(c) * 0.5 *
                        (c->chirp.duration_s - c->gate_s[0] - c->gate_s[1]);
    return 0;
}

static int scratch_create(struct deramp *d, bool rising)
{
    size_t n = 2 * d->n_analytic, m = 2 * d->n_beat;

    d->mixer = fftwf_malloc(2 * d->n_slot * sizeof(float));
    d->turn = fftwf_malloc(2 * d->format.n_samples * sizeof(float));
    d->wave = fftwf_malloc(n * sizeof(float));
    d->spectrum = fftwf_malloc(n * sizeof(float));
    d->mixed = fftwf_malloc(m * sizeof(float));
    d->beat = fftwf_malloc(m * sizeof(float));
    if (!d->mixer || !d->turn || !d->wave || !d->spectrum || !d->mixed || !d->beat)
        return -ENOMEM;
    d->forward = fft_plan(d->n_analytic, d->wave, d->spectrum, FFTW_FORWARD);
    d->backward = fft_plan(d->n_analytic, d->spectrum, d->wave, FFTW_BACKWARD);
    d->range =
        fft_plan(d->n_beat, d->mixed, d->beat, rising ? FFTW_BACKWARD : FFTW_FORWARD);
    if (!d->forward || !d->backward || !d->range)
        return -ENOMEM;
    memset(d->mixed, 0, m * sizeof(float));
    return 0;
}

/* An echo of delay tau leaves the mixer as exp(-2 pi i (f0 tau + k tau t - k tau^2 / 2)).
 * The transform at k tau removes the beat; the turn removes the rest at tau, the
 * residual video phase pi k tau^2 too, and takes the carrier out. */
static void tables_fill(struct deramp *d, const struct deramp_config *c)
{
    double slope = slope_hz_s(c), t0 = slot_time_s(d, c, 0);

    for (size_t i = 0; i < d->n_slot; i++) {
        double phase = chirp_phase_rad(&c->chirp, slot_time_s(d, c, i));
        complex_polar(d->mixer + 2 * i, slot_weight(d, c, i) / (double)d->n_analytic,
                      -phase / (2.0 * M_PI));
    }
    for (size_t i = 0; i < d->format.n_samples; i++) {
        double tau = d->format.t0_s + (double)i / d->format.rate_hz;
        double cycles = slope * tau * t0 +
                        (c->chirp.start_hz - d->format.carrier_hz) * tau -
                        0.5 * slope * tau * tau;
        complex_polar(d->turn + 2 * i, 1.0 / slot_overlap(d, c, tau), cycles);
    }
}

int deramp_create(struct deramp **out, const struct deramp_config *c)
{
    struct deramp *d;
    int err;

    if (!out || !c || !config_is_valid(c))
        return -EINVAL;
    d = calloc(1, sizeof(*d));
    if (!d)
        return -ENOMEM;
    err = layout_choose(d, c);
    if (!err)
        err = scratch_create(d, slope_hz_s(c) > 0.0);
    if (err) {
        deramp_destroy(d);
        return err;
    }
    tables_fill(d, c);
    *out = d;
    return 0;
}

void deramp_format(const struct deramp *d, struct trace_format *out)
{
    *out = d->format;
}

/* Mixing a real signal would keep the sum of the frequencies beside their difference, and
 * part of it lies in the gate: negative frequencies go first. */
static void wave_make_analytic(struct deramp *d, const float *x)
{
    size_t n = d->n_analytic;

    memset(d->wave, 0, 2 * n * sizeof(float));
    for (size_t i = 0; i < d->n_slot; i++)
        d->wave[2 * i] = x[i];
    fftwf_execute(d->forward);
    for (size_t k = 1; k < (n + 1) / 2; k++) {
        d->spectrum[2 * k] *= 2.0f;
        d->spectrum[2 * k + 1] *= 2.0f;
    }
    memset(d->spectrum + 2 * (n / 2 + 1), 0, 2 * (n - n / 2 - 1) * sizeof(float));
    fftwf_execute(d->backward);
}

/* The low-pass is the choice of bins: only beats of the gate's delays are taken. */
void deramp_execute(struct deramp *d, const float *rx, size_t rx_stride,
                    float complex *restrict y)
{
    size_t n = d->format.n_samples;

    for (size_t i = 0; i < d->n_channels; i++) {
        float *trace = (float *)(y + i * n);

        wave_make_analytic(d, rx + i * rx_stride + d->first);
        memcpy(d->mixed, d->wave, 2 * d->n_slot * sizeof(float));
        for (size_t j = 0; j < d->n_slot; j++)
            complex_multiply(d->mixed + 2 * j, d->mixer + 2 * j);
        fftwf_execute(d->range);
        memcpy(trace, d->beat + 2 * d->first_bin, 2 * n * sizeof(float));
        for (size_t j = 0; j < n; j++)
            complex_multiply(trace + 2 * j, d->turn + 2 * j);
    }
}

void deramp_destroy(struct deramp *d)
{
    if (!d)
        return;
    if (d->forward)
        fftwf_destroy_plan(d->forward);
    if (d->backward)
        fftwf_destroy_plan(d->backward);
    if (d->range)
        fftwf_destroy_plan(d->range);
    fftwf_free(d->mixer);
    fftwf_free(d->turn);
    fftwf_free(d->wave);
    fftwf_free(d->spectrum);
    fftwf_free(d->mixed);
    fftwf_free(d->beat);
    free(d);
}
