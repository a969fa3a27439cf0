/* SPDX-License-Identifier: MIT */
#include "dsp/deramp.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/band_transform.h"
#include "dsp/fft.h"

/* What of a ping is deramped, in which steps of time, beat and delay, and how an echo is
 * weighted on its way. */
struct deramp_layout {
    struct trace_format format;
    size_t first, n_used;  /* samples of a ping */
    double begin_s, end_s; /* of them, after the emission */
    size_t n_mixed;        /* samples of the band that the mixer turns */
    double mixed_step_s;
    size_t n_beat;     /* of the transform to beats */
    size_t first_beat; /* bin of n_beat; they run on from its end to its beginning */
    size_t n_beats;
    double first_beat_s, beat_s; /* delay of the first beat, from one to the next */
    size_t n_aligned;            /* of the transform of the beats back to time */
    double step_s;               /* of aligned time */
    size_t n_band;               /* steps that the band covers */
    size_t n_range;              /* of the transform of the band to delays */
    size_t first_bin;            /* of it, the one of a trace's sample 0 */
};

/* Of an echo at the gate's far end, at least this part must fall into the ping. */
#define MIN_OVERLAP 0.05

/* Beats beyond the gate's that are kept, in 1 / duration: the ends of the band are
 * blurred by duration / SKIRT where the rest of a beat's skirt is cut off. */
#define SKIRT 64.0

/* Of the samples used: room for what equalising adds before and after. */
#define ROOM             0.0625
#define MAX_OVERSAMPLING 64.0

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

static double deramp_slope_hz_s(const struct deramp_config *c)
{
    return (c->chirp.stop_hz - c->chirp.start_hz) / c->chirp.duration_s;
}

static double ramp(double x) /* 0 to 1 */
{
    return x <= 0.0 ? 0.0 : x >= 1.0 ? 1.0 : 0.5 - 0.5 * cos(M_PI * x);
}

/* Weight of what a ping holds at that time, 0..1: 1 while echoes of the gate last.
 *
 * Sound that the ping's ends cut, a neighbouring emission's, rings into the gate's beats;
 * faded it does not. */
static double deramp_fade(const struct deramp_layout *l, const struct deramp_config *c,
                          double t_s)
{
    double after_s = l->end_s - c->chirp.duration_s - c->gate_s[1];
    double weight = t_s >= 0.0 && t_s < l->end_s ? 1.0 : 0.0;

    if (c->gate_s[0] > 0.0)
        weight *= ramp(t_s / c->gate_s[0]);
    if (after_s > 0.0)
        weight *= ramp((l->end_s - t_s) / after_s);
    return weight;
}

/* The window's, at a step of aligned time. */
static double deramp_band_weight(const struct deramp_layout *l,
                                 const struct deramp_config *c, size_t n)
{
    return window_weight(c->window, (double)n * l->step_s / c->chirp.duration_s);
}

/* What a unit echo of that delay adds up to. */
static double deramp_echo_sum(const struct deramp_layout *l,
                              const struct deramp_config *c, double delay_s)
{
    double sum = 0.0;

    for (size_t n = 0; n < l->n_band; n++)
        sum += deramp_band_weight(l, c, n) *
               deramp_fade(l, c, (double)n * l->step_s + delay_s);
    return sum;
}

/* With the emission that may follow this one: known whole, it is told from a click. */
static int choose_input(struct deramp_layout *l, const struct deramp_config *c)
{
    double fs = c->sample_rate_hz, first = ceil(c->latency_samples);
    double needed = (2.0 * c->chirp.duration_s + c->gate_s[1]) * fs;

    if (first + 2.0 > (double)c->n_samples)
        return -ERANGE;
    l->first = (size_t)first;
    l->n_used = c->n_samples - l->first;
    if (needed < (double)l->n_used)
        l->n_used = (size_t)ceil(needed);
    l->begin_s = (first - c->latency_samples) / fs;
    l->end_s = l->begin_s + (double)l->n_used / fs;
    return 0;
}

static double skirt_hz(const struct deramp_config *c)
{
    return SKIRT / c->chirp.duration_s;
}

/* Mixed is at a rate at which no beat of the emission before or after this one is taken
 * for one of the gate's. */
static int choose_transform(struct deramp_layout *l, struct band_transform_config *cfg,
                            const struct deramp_config *c)
{
    double fs = c->sample_rate_hz, slope = fabs(deramp_slope_hz_s(c));
    double width_hz = slope * c->chirp.duration_s;
    double low_hz = fmin(c->chirp.start_hz, c->chirp.stop_hz);
    double high_hz = fmax(c->chirp.start_hz, c->chirp.stop_hz);
    size_t n_chirp = chirp_length(&c->chirp, fs);
    size_t n = l->n_used > n_chirp ? l->n_used : n_chirp;
    struct band_transform_layout layout;

    *cfg = (struct band_transform_config){
        .n_min = (size_t)ceil((1.0 + ROOM) * (double)n) + 1,
        .band = {low_hz / fs, high_hz / fs},
        .oversampling = (width_hz + slope * c->gate_s[1] + 2.0 * skirt_hz(c)) / width_hz,
        .span = (double)l->n_used,
    };

    if (cfg->oversampling > MAX_OVERSAMPLING)
        return -ERANGE;
    int err = band_layout_choose(&layout, cfg);
    if (err)
        return err;
    l->n_mixed = layout.n_output;
    l->mixed_step_s = 1.0 / (layout.rate * fs);
    return 0;
}

static void choose_beats(struct deramp_layout *l, const struct deramp_config *c)
{
    double slope = fabs(deramp_slope_hz_s(c));
    size_t n_band = (size_t)ceil(c->chirp.duration_s / l->mixed_step_s) + 1;

    l->n_beat = fft_size(l->n_mixed > n_band ? l->n_mixed : n_band, 1.1);
    double beat_hz = 1.0 / ((double)l->n_beat * l->mixed_step_s);
    double low = floor((slope * c->gate_s[0] - skirt_hz(c)) / beat_hz);
    double high = ceil((slope * c->gate_s[1] + skirt_hz(c)) / beat_hz);
    l->n_beats = (size_t)(high - low) + 1;
    l->beat_s = beat_hz / slope;
    l->first_beat_s = low * l->beat_s;
    l->first_beat = (size_t)(low < 0.0 ? low + (double)l->n_beat : low);
    l->n_aligned = fft_size(l->n_beats, 1.1);
    l->step_s = 1.0 / (beat_hz * (double)l->n_aligned);
    l->n_band = (size_t)floor(c->chirp.duration_s / l->step_s + 1e-9) + 1;
}

static int choose_format(struct deramp_layout *l, const struct deramp_config *c)
{
    double step_hz = fabs(deramp_slope_hz_s(c)) * l->step_s;
    double n = fmax(ceil(c->rate_hz / step_hz - 1e-6), (double)l->n_band);
    struct trace_format *f = &l->format;

    if (n > INT32_MAX / 4)
        return -EINVAL;
    l->n_range = fft_size((size_t)n, 1.05);
    f->rate_hz = (double)l->n_range * step_hz;
    f->carrier_hz = 0.5 * (c->chirp.start_hz + c->chirp.stop_hz);
    l->first_bin = (size_t)ceil((c->gate_s[0] - l->first_beat_s) * f->rate_hz - 1e-6);
    f->t0_s = l->first_beat_s + (double)l->first_bin / f->rate_hz;
    if (c->gate_s[1] < f->t0_s)
        return -EINVAL;
    f->n_samples = (size_t)floor((c->gate_s[1] - f->t0_s) * f->rate_hz + 1e-6) + 1;
    return 0;
}

/* And the transform that takes the band of a ping.  0, or as deramp_create. */
static int deramp_layout_choose(struct deramp_layout *l,
                                struct band_transform_config *transform,
                                const struct deramp_config *c)
{
    double whole = 0.0;
    int err = config_is_valid(c) ? choose_input(l, c) : -EINVAL;

    if (!err)
        err = choose_transform(l, transform, c);
    if (err)
        return err;
    choose_beats(l, c);
    err = choose_format(l, c);
    if (err)
        return err;
    for (size_t n = 0; n < l->n_band; n++)
        whole += deramp_band_weight(l, c, n);
    return deramp_echo_sum(l, c, c->gate_s[1]) >= MIN_OVERLAP * whole ? 0 : -ERANGE;
}

/* Of a sweep's spectrum: the emission's, half of it at its ends, is not taken for less.
 */
#define MIN_TONE 0.25

struct deramp {
    struct deramp_layout layout;
    size_t n_channels;
    struct band_transform *transform;
    size_t n_filters;        /* 1: all microphones are flat */
    size_t n_filter;         /* bins of the transform */
    float complex *filters;  /* [n_filters][n_filter]: from emission to sweep */
    float *mixer;            /* [n_mixed][2]: fades, conjugate chirp */
    float *deskew;           /* [n_beats][2] */
    float *window;           /* [n_band] */
    float *turn;             /* [format.n_samples][2] */
    float *mixed, *spectrum; /* [n_beat][2]; mixed is 0 from n_mixed on */
    float *beats, *aligned;  /* [n_aligned][2]; beats are 0 from n_beats on */
    float *band, *range;     /* [n_range][2]; the band is 0 from n_band on */
    fftwf_plan beat, align, compress;
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

static int arrays_create(struct deramp *d)
{
    const struct deramp_layout *l = &d->layout;

    d->filters = fftwf_malloc(d->n_filters * d->n_filter * sizeof(*d->filters));
    d->mixer = fftwf_malloc(2 * l->n_mixed * sizeof(float));
    d->deskew = fftwf_malloc(2 * l->n_beats * sizeof(float));
    d->window = fftwf_malloc(l->n_band * sizeof(float));
    d->turn = fftwf_malloc(2 * l->format.n_samples * sizeof(float));
    d->mixed = fftwf_malloc(2 * l->n_beat * sizeof(float));
    d->spectrum = fftwf_malloc(2 * l->n_beat * sizeof(float));
    d->beats = fftwf_malloc(2 * l->n_aligned * sizeof(float));
    d->aligned = fftwf_malloc(2 * l->n_aligned * sizeof(float));
    d->band = fftwf_malloc(2 * l->n_range * sizeof(float));
    d->range = fftwf_malloc(2 * l->n_range * sizeof(float));
    if (!d->filters || !d->mixer || !d->deskew || !d->window || !d->turn || !d->mixed ||
        !d->spectrum || !d->beats || !d->aligned || !d->band || !d->range)
        return -ENOMEM;
    memset(d->mixed, 0, 2 * l->n_beat * sizeof(float));
    memset(d->beats, 0, 2 * l->n_aligned * sizeof(float));
    memset(d->band, 0, 2 * l->n_range * sizeof(float));
    return 0;
}

/* Beats are counted by the delays they stand for: of a rising chirp they are negative
 * frequencies. */
static int plans_create(struct deramp *d, bool rising)
{
    const struct deramp_layout *l = &d->layout;
    int to_delay = rising ? FFTW_BACKWARD : FFTW_FORWARD;
    int to_time = rising ? FFTW_FORWARD : FFTW_BACKWARD;

    d->beat = fft_plan(l->n_beat, d->mixed, d->spectrum, to_delay);
    d->align = fft_plan(l->n_aligned, d->beats, d->aligned, to_time);
    d->compress = fft_plan(l->n_range, d->band, d->range, to_delay);
    return d->beat && d->align && d->compress ? 0 : -ENOMEM;
}

/* An echo of delay tau leaves the mixer as exp(-2 pi i (f0 tau + k tau t - k tau^2 / 2))
 * from t = tau on.  The deskewing filter removes the last term, the residual video phase,
 * and brings it forward by tau: exp(-2 pi i (f0 + k t) tau) from t = 0 on. */
static void phases_fill(struct deramp *d, const struct deramp_config *c)
{
    const struct deramp_layout *l = &d->layout;
    double slope = deramp_slope_hz_s(c);
    struct band_transform_layout band;

    band_transform_layout(d->transform, &band);
    double scale = 1.0 / ((double)band.length * (double)l->n_beat);
    double carrier_hz = band.carrier * c->sample_rate_hz;
    for (size_t i = 0; i < l->n_mixed; i++) {
        double after_s = (double)i * l->mixed_step_s, t = l->begin_s + after_s;
        complex_polar(d->mixer + 2 * i, scale * deramp_fade(l, c, t),
                      carrier_hz * after_s -
                          chirp_phase_rad(&c->chirp, t) / (2.0 * M_PI));
    }
    for (size_t b = 0; b < l->n_beats; b++) {
        double tau = l->first_beat_s + (double)b * l->beat_s;
        complex_polar(d->deskew + 2 * b, 1.0, slope * tau * (l->begin_s - 0.5 * tau));
    }
    for (size_t n = 0; n < l->n_band; n++)
        d->window[n] = (float)deramp_band_weight(l, c, n);
    for (size_t i = 0; i < l->format.n_samples; i++) {
        double tau = l->format.t0_s + (double)i / l->format.rate_hz;
        complex_polar(d->turn + 2 * i, 1.0 / deramp_echo_sum(l, c, tau),
                      (c->chirp.start_hz - l->format.carrier_hz) * tau);
    }
}

/* The spectrum of a sweep without beginning and end, by stationary phase: that of the
 * emission without the ripple that its ends add (Klauder 1960). */
static double complex sweep(const struct deramp_config *c, double f_hz)
{
    double slope = deramp_slope_hz_s(c), off_hz = f_hz - c->chirp.start_hz;
    double phase = chirp_phase_rad(&c->chirp, 0.0) + copysign(M_PI / 4.0, slope) -
                   M_PI * off_hz * off_hz / slope;

    return 0.5 * c->sample_rate_hz / sqrt(fabs(slope)) * cexp(I * phase);
}

static bool in_band(const struct deramp_config *c, double f_hz)
{
    return f_hz >= fmin(c->chirp.start_hz, c->chirp.stop_hz) &&
           f_hz <= fmax(c->chirp.start_hz, c->chirp.stop_hz);
}

/* From the emission as a microphone hears it to the sweep. */
static int filters_fill(struct deramp *d, const struct deramp_config *c)
{
    size_t n = chirp_length(&c->chirp, c->sample_rate_hz);
    float *chirp = malloc(n * sizeof(*chirp));
    struct band_transform_layout band;

    if (!chirp)
        return -ENOMEM;
    chirp_generate(&c->chirp, c->sample_rate_hz, chirp);
    band_transform_layout(d->transform, &band);
    band_transform_forward(d->transform, chirp, n);
    free(chirp);
    for (size_t q = 0; q < d->n_filters * d->n_filter; q++) {
        size_t k = q % d->n_filter, stream = k / band.n_bins, bin = k % band.n_bins;
        double f_hz = c->sample_rate_hz *
                      band_transform_frequency(d->transform, stream, bin);
        double complex s = band_transform_bin(d->transform, stream, bin);
        double complex to = sweep(c, f_hz), g;
        double least = MIN_TONE * cabs(to);
        g = 2.0 * to * conj(s) / fmax(creal(s * conj(s)), least * least);
        if (c->microphones)
            g *= microphone_correction(c->microphones[q / d->n_filter], f_hz);
        d->filters[q] = in_band(c, f_hz) ? (float complex)g : 0.0f;
    }
    return 0;
}

int deramp_format_of(const struct deramp_config *c, struct trace_format *out)
{
    struct band_transform_config transform;
    struct deramp_layout l = {.n_used = 0};

    if (!out || !c)
        return -EINVAL;
    int err = deramp_layout_choose(&l, &transform, c);
    *out = l.format;
    return err;
}

int deramp_create(struct deramp **out, const struct deramp_config *c)
{
    struct band_transform_config transform;
    struct band_transform_layout band;
    struct deramp *d;
    int err;

    if (!out || !c)
        return -EINVAL;
    d = calloc(1, sizeof(*d));
    if (!d)
        return -ENOMEM;
    err = deramp_layout_choose(&d->layout, &transform, c);
    if (!err)
        err = band_transform_create(&d->transform, &transform);
    if (err)
        goto fail;
    band_transform_layout(d->transform, &band);
    d->n_channels = c->n_channels;
    d->n_filters = c->microphones ? c->n_channels : 1;
    d->n_filter = band.n_streams * band.n_bins;
    err = arrays_create(d);
    if (!err)
        err = plans_create(d, deramp_slope_hz_s(c) > 0.0);
    if (!err)
        err = filters_fill(d, c);
    if (err)
        goto fail;
    phases_fill(d, c);
    *out = d;
    return 0;
fail:
    deramp_destroy(d);
    return err;
}

void deramp_format(const struct deramp *d, struct trace_format *out)
{
    *out = d->layout.format;
}

/* Only positive frequencies come out of the transform: mixing a real signal would keep
 * the sum of the frequencies beside their difference, and part of it lies in the gate. */
static void mix(struct deramp *d, const float *x, const float complex *filter)
{
    const struct deramp_layout *l = &d->layout;

    band_transform_forward(d->transform, x, l->n_used);
    band_transform_inverse(d->transform, filter, (float complex *)d->mixed);
    for (size_t i = 0; i < l->n_mixed; i++)
        complex_multiply(d->mixed + 2 * i, d->mixer + 2 * i);
    fftwf_execute(d->beat);
}

/* The choice of beats is the low-pass: only those of the gate's delays are taken. */
static void align(struct deramp *d)
{
    const struct deramp_layout *l = &d->layout;
    size_t k = l->first_beat;

    for (size_t b = 0; b < l->n_beats; b++) {
        memcpy(d->beats + 2 * b, d->spectrum + 2 * k, 2 * sizeof(float));
        complex_multiply(d->beats + 2 * b, d->deskew + 2 * b);
        k = k + 1 < l->n_beat ? k + 1 : 0;
    }
    fftwf_execute(d->align);
}

static void compress(struct deramp *d, float *trace)
{
    const struct deramp_layout *l = &d->layout;

    for (size_t n = 0; n < l->n_band; n++) {
        d->band[2 * n] = d->window[n] * d->aligned[2 * n];
        d->band[2 * n + 1] = d->window[n] * d->aligned[2 * n + 1];
    }
    fftwf_execute(d->compress);
    memcpy(trace, d->range + 2 * l->first_bin, 2 * l->format.n_samples * sizeof(float));
    for (size_t i = 0; i < l->format.n_samples; i++)
        complex_multiply(trace + 2 * i, d->turn + 2 * i);
}

void deramp_execute(struct deramp *d, const float *rx, size_t rx_stride,
                    float complex *restrict y)
{
    const struct deramp_layout *l = &d->layout;

    for (size_t i = 0; i < d->n_channels; i++) {
        size_t row = d->n_filters > 1 ? i : 0;
        mix(d, rx + i * rx_stride + l->first, d->filters + row * d->n_filter);
        align(d);
        compress(d, (float *)(y + i * l->format.n_samples));
    }
}

void deramp_destroy(struct deramp *d)
{
    if (!d)
        return;
    const fftwf_plan plans[] = {d->beat, d->align, d->compress};
    float *const arrays[] = {d->mixer,    d->deskew, d->window,  d->turn, d->mixed,
                             d->spectrum, d->beats,  d->aligned, d->band, d->range};
    for (size_t i = 0; i < sizeof(plans) / sizeof(*plans); i++)
        if (plans[i])
            fftwf_destroy_plan(plans[i]);
    for (size_t i = 0; i < sizeof(arrays) / sizeof(*arrays); i++)
        fftwf_free(arrays[i]);
    fftwf_free(d->filters);
    band_transform_destroy(d->transform);
    free(d);
}
