#include "dsp/deramp.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/deramp_layout.h"
#include "dsp/fft_plan.h"

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

int deramp_create(struct deramp **out, const struct deramp_config *c)
{
    struct band_transform_layout band;
    struct deramp *d;
    int err;

    if (!out || !c)
        return -EINVAL;
    d = calloc(1, sizeof(*d));
    if (!d)
        return -ENOMEM;
    err = deramp_layout_choose(&d->layout, &d->transform, c);
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
