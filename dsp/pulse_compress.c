#include "dsp/pulse_compress.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/fft_plan.h"
#include "dsp/fft_size.h"
#include "dsp/vector.h"

/* Whitening: bins this far (in power) below the strongest are not amplified further. */
#define REGULARISER 1e-3
/* A microphone's response is undone by at most 20 dB either way. */
#define MAX_CORRECTION 10.0

struct pulse_compress {
    struct trace_format format;
    size_t n_channels;
    size_t n_replica;
    size_t n_forward, n_inverse; /* transform lengths */
    size_t first, n_input;       /* samples of a ping that are used */
    size_t n_taper;              /* at the end of them */
    size_t first_bin, n_bins;    /* of the band, in the forward transform */
    size_t n_below;              /* of those, below the carrier's */
    size_t n_filters;            /* 1: all microphones are flat */
    float *filters;              /* [n_filters][n_bins][2] */
    float *taper;                /* [n_taper] */
    float *input, *spectrum;     /* [n_forward][2] */
    float *product, *trace;      /* [n_inverse][2] */
    fftwf_plan forward, inverse;
};

/* z = a + i b: two real channels share one complex transform. */
VECTOR_CLONES static void pair_pack(float *restrict z, const float *restrict a,
                                    const float *restrict b, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        z[2 * i] = a[i];
        z[2 * i + 1] = b[i];
    }
}

VECTOR_CLONES static void pair_taper(float *restrict z, const float *restrict taper,
                                     size_t n)
{
    for (size_t i = 0; i < n; i++) {
        z[2 * i] *= taper[i];
        z[2 * i + 1] *= taper[i];
    }
}

/* y[k] = filter[k] * (z[k] + conj(z[-k])): the spectrum of channel a (twice).
 * mirrored points at bin -first: bin -(first + k) is k complex values before it. */
VECTOR_CLONES static void filter_even(float *restrict y, const float *restrict z,
                                      const float *restrict mirrored,
                                      const float *restrict filter, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        const float *m = mirrored - 2 * k;
        float re = z[2 * k] + m[0], im = z[2 * k + 1] - m[1];
        y[2 * k] = re * filter[2 * k] - im * filter[2 * k + 1];
        y[2 * k + 1] = re * filter[2 * k + 1] + im * filter[2 * k];
    }
}

/* y[k] = filter[k] * (z[k] - conj(z[-k])) / i: of channel b (twice). */
VECTOR_CLONES static void filter_odd(float *restrict y, const float *restrict z,
                                     const float *restrict mirrored,
                                     const float *restrict filter, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        const float *m = mirrored - 2 * k;
        float re = z[2 * k + 1] + m[1], im = m[0] - z[2 * k];
        y[2 * k] = re * filter[2 * k] - im * filter[2 * k + 1];
        y[2 * k + 1] = re * filter[2 * k + 1] + im * filter[2 * k];
    }
}

static bool config_is_valid(const struct pulse_compress_config *c)
{
    double nyquist_hz = c->sample_rate_hz / 2.0;

    if (!(isfinite(c->sample_rate_hz) && c->sample_rate_hz > 0.0) || !c->n_channels ||
        !c->n_samples || c->n_samples > INT32_MAX / 4)
        return false;
    if (!(c->latency_samples >= 0.0 && c->latency_samples < 1e9) ||
        !(c->oversampling >= 1.0 && c->oversampling <= 64.0))
        return false;
    if (!(c->gate_s[0] >= 0.0 && c->gate_s[1] > c->gate_s[0] && isfinite(c->gate_s[1])))
        return false;
    if (c->n_replica && !c->replica)
        return false;
    return c->chirp.start_hz >= 0.0 && c->chirp.start_hz <= nyquist_hz &&
           c->chirp.stop_hz >= 0.0 && c->chirp.stop_hz <= nyquist_hz &&
           isfinite(c->chirp.duration_s);
}

static int band_choose(double band_hz[2], const struct pulse_compress_config *c)
{
    band_hz[0] = c->band_hz[0];
    band_hz[1] = c->band_hz[1];
    if (band_hz[0] == 0.0 && band_hz[1] == 0.0) {
        band_hz[0] = fmin(c->chirp.start_hz, c->chirp.stop_hz);
        band_hz[1] = fmax(c->chirp.start_hz, c->chirp.stop_hz);
    }
    if (!(band_hz[0] >= 0.0 && band_hz[1] > band_hz[0] &&
          band_hz[1] <= c->sample_rate_hz / 2.0))
        return -EINVAL;
    return 0;
}

/* Bins whose weight is not zero.  Bin 0 and the Nyquist bin have no phase to speak of. */
static int bins_choose(struct pulse_compress *pc, const double band_hz[2],
                       enum window window, double bin_hz)
{
    double low = band_hz[0] / bin_hz, high = band_hz[1] / bin_hz;
    size_t first = (size_t)ceil(low - 1e-9), last = (size_t)floor(high + 1e-9);

    if (window == WINDOW_HANN) { /* zero at both ends */
        first = (size_t)floor(low + 1e-9) + 1;
        last = (size_t)ceil(high - 1e-9) - 1;
    }
    if (first < 1)
        first = 1;
    if (last > (pc->n_forward - 1) / 2)
        last = (pc->n_forward - 1) / 2;
    if (last < first + 1)
        return -EINVAL;
    pc->first_bin = first;
    pc->n_bins = last - first + 1;
    pc->n_below = pc->n_bins / 2;
    return 0;
}

/* Lengths and formats.  The transform starts at the emission, not at the gate: an echo
 * before the gate must be in it whole, for the cut edge of a strong direct path would
 * spread into the gate.  It is long enough that correlation inside the gate is linear. */
static int layout_choose(struct pulse_compress *pc, const struct pulse_compress_config *c,
                         const double band_hz[2])
{
    double fs = c->sample_rate_hz, first = floor(c->latency_samples);
    double far = c->latency_samples - first + c->gate_s[1] * fs;
    size_t needed, min;
    int err;

    if (pc->n_replica < 2 || pc->n_replica > c->n_samples)
        return -EINVAL;
    if (first + far > (double)c->n_samples)
        return -ERANGE;
    needed = pc->n_replica + (size_t)ceil(far) + 1;
    pc->n_forward = fft_size(needed, 1.25);
    pc->first = (size_t)first;
    pc->n_input = c->n_samples - pc->first;
    if (pc->n_input > pc->n_forward)
        pc->n_input = pc->n_forward;
    err = bins_choose(pc, band_hz, c->window, fs / (double)pc->n_forward);
    if (err)
        return err;
    min = (size_t)ceil(c->oversampling * (double)pc->n_bins);
    pc->n_inverse = fft_size(min, 1.2);
    pc->n_channels = c->n_channels;
    pc->format.t0_s = c->gate_s[0];
    pc->format.rate_hz = fs * (double)pc->n_inverse / (double)pc->n_forward;
    pc->format.carrier_hz = fs * (double)(pc->first_bin + pc->n_below) /
                            (double)pc->n_forward;
    pc->format.n_samples =
        (size_t)floor((c->gate_s[1] - c->gate_s[0]) * pc->format.rate_hz + 1e-6) + 1;
    if (pc->format.n_samples > pc->n_inverse)
        pc->format.n_samples = pc->n_inverse;
    return 0;
}

/* The next emission may begin inside the recording's tail and be cut off at full
 * strength; a soft end keeps it where it is.  What it takes of echoes at the far end of
 * the gate is the chirp's last moment, which the window over the band suppresses anyway;
 * without a window it would show, so there it is left out. */
static int taper_create(struct pulse_compress *pc, enum window window)
{
    size_t n = window == WINDOW_RECTANGULAR ? 0 : pc->n_replica / 24;

    if (n > pc->n_input)
        n = pc->n_input;
    pc->n_taper = n;
    pc->taper = fftwf_malloc((n + 1) * sizeof(float));
    if (!pc->taper)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++)
        pc->taper[i] = (float)(0.5 + 0.5 * cos(M_PI * ((double)i + 0.5) / (double)n));
    return 0;
}

static int scratch_create(struct pulse_compress *pc)
{
    size_t n = 2 * pc->n_forward, m = 2 * pc->n_inverse;

    pc->input = fftwf_malloc(n * sizeof(float));
    pc->spectrum = fftwf_malloc(n * sizeof(float));
    pc->product = fftwf_malloc(m * sizeof(float));
    pc->trace = fftwf_malloc(m * sizeof(float));
    pc->filters = fftwf_malloc(2 * pc->n_filters * pc->n_bins * sizeof(float));
    if (!pc->input || !pc->spectrum || !pc->product || !pc->trace || !pc->filters)
        return -ENOMEM;
    pc->forward = fft_plan(pc->n_forward, pc->input, pc->spectrum, FFTW_FORWARD);
    pc->inverse = fft_plan(pc->n_inverse, pc->product, pc->trace, FFTW_BACKWARD);
    if (!pc->forward || !pc->inverse)
        return -ENOMEM;
    memset(pc->input, 0, n * sizeof(float));
    memset(pc->product, 0, m * sizeof(float));
    return 0;
}

/* The replica's spectrum, left in pc->spectrum. */
static void replica_transform(struct pulse_compress *pc,
                              const struct pulse_compress_config *c, float *replica)
{
    if (c->n_replica)
        memcpy(replica, c->replica, c->n_replica * sizeof(*replica));
    else
        chirp_generate(&c->chirp, c->sample_rate_hz, replica);
    memset(pc->input, 0, 2 * pc->n_forward * sizeof(float));
    for (size_t i = 0; i < pc->n_replica; i++)
        pc->input[2 * i] = replica[i];
    fftwf_execute(pc->forward);
    memset(pc->input, 0, 2 * pc->n_forward * sizeof(float));
}

static double correction(const struct microphone *m, double frequency_hz)
{
    double gain = m ? microphone_gain(m, frequency_hz) : 1.0;

    return fmin(fmax(1.0 / gain, 1.0 / MAX_CORRECTION), MAX_CORRECTION);
}

/* conj(S) / (|S|^2 + eps max|S|^2) W, turned so that the trace starts at t0 and that the
 * emission is where the latency says; scaled so that the sum over the band, which is the
 * peak of an echo of gain 1, is 1.  The half is for what the pair of channels doubles. */
static int filters_create(struct pulse_compress *pc,
                          const struct pulse_compress_config *c, const double band_hz[2])
{
    double fs = c->sample_rate_hz, bin_hz = fs / (double)pc->n_forward;
    double delay_s = (c->latency_samples - (double)pc->first) / fs;
    double max = 0.0, sum = 0.0;
    const float *s = pc->spectrum + 2 * pc->first_bin;

    for (size_t k = 0; k < pc->n_bins; k++)
        max =
            fmax(max, (double)s[2 * k] * s[2 * k] + (double)s[2 * k + 1] * s[2 * k + 1]);
    if (!(max > 0.0) || !isfinite(max))
        return -EINVAL;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t k = 0; k < pc->n_bins; k++) {
            double re = s[2 * k], im = s[2 * k + 1], power = re * re + im * im;
            double f = bin_hz * (double)(pc->first_bin + k);
            double x = (f - band_hz[0]) / (band_hz[1] - band_hz[0]);
            double weight = window_weight(c->window, fmin(fmax(x, 0.0), 1.0));
            double scale = weight / (power + REGULARISER * max);
            double turn = f * delay_s + (f - pc->format.carrier_hz) * pc->format.t0_s;
            double a = 2.0 * M_PI * (turn - floor(turn));

            if (pass == 0) {
                sum += scale * power;
                continue;
            }
            scale *= 0.5 / sum;
            for (size_t i = 0; i < pc->n_filters; i++) {
                float *h = pc->filters + 2 * (i * pc->n_bins + k);
                double g = scale *
                           correction(c->microphones ? c->microphones[i] : NULL, f);
                h[0] = (float)(g * (re * cos(a) + im * sin(a)));
                h[1] = (float)(g * (re * sin(a) - im * cos(a)));
            }
        }
    }
    return 0;
}

int pulse_compress_create(struct pulse_compress **out,
                          const struct pulse_compress_config *c)
{
    struct pulse_compress *pc;
    float *replica = NULL;
    double band_hz[2];
    int err;

    if (!out || !c || !config_is_valid(c))
        return -EINVAL;
    err = band_choose(band_hz, c);
    if (err)
        return err;
    pc = calloc(1, sizeof(*pc));
    if (!pc)
        return -ENOMEM;
    pc->n_replica = c->n_replica ? c->n_replica
                                 : chirp_length(&c->chirp, c->sample_rate_hz);
    pc->n_filters = c->microphones ? c->n_channels : 1;
    err = layout_choose(pc, c, band_hz);
    if (!err)
        err = taper_create(pc, c->window);
    if (!err)
        err = scratch_create(pc);
    if (err)
        goto done;
    replica = malloc(pc->n_replica * sizeof(*replica));
    if (!replica) {
        err = -ENOMEM;
        goto done;
    }
    replica_transform(pc, c, replica);
    err = filters_create(pc, c, band_hz);

done:
    free(replica);
    if (err)
        pulse_compress_destroy(pc);
    else
        *out = pc;
    return err;
}

void pulse_compress_format(const struct pulse_compress *pc, struct trace_format *out)
{
    *out = pc->format;
}

/* Filters one channel of the pair that is in pc->spectrum, and transforms it back.  The
 * bins below the carrier are the negative frequencies of the baseband. */
static void channel_compress(struct pulse_compress *pc, size_t channel, bool odd,
                             float complex *y)
{
    void (*filter)(float *restrict, const float *restrict, const float *restrict,
                   const float *restrict, size_t) = odd ? filter_odd : filter_even;
    const float *h = pc->filters;
    const float *z = pc->spectrum + 2 * pc->first_bin;
    const float *mirrored = pc->spectrum + 2 * (pc->n_forward - pc->first_bin);
    size_t below = pc->n_below;

    if (pc->n_filters > 1)
        h += 2 * channel * pc->n_bins;
    filter(pc->product + 2 * (pc->n_inverse - below), z, mirrored, h, below);
    filter(pc->product, z + 2 * below, mirrored - 2 * below, h + 2 * below,
           pc->n_bins - below);
    fftwf_execute(pc->inverse);
    memcpy(y, pc->trace, pc->format.n_samples * sizeof(*y));
}

void pulse_compress_execute(struct pulse_compress *pc, const float *rx, size_t rx_stride,
                            float complex *restrict y)
{
    size_t n = pc->format.n_samples;

    for (size_t i = 0; i < pc->n_channels; i += 2) {
        const float *a = rx + i * rx_stride + pc->first;
        bool pair = i + 1 < pc->n_channels;

        /* A last one without a partner shares the transform with itself. */
        pair_pack(pc->input, a, pair ? a + rx_stride : a, pc->n_input);
        pair_taper(pc->input + 2 * (pc->n_input - pc->n_taper), pc->taper, pc->n_taper);
        fftwf_execute(pc->forward);
        channel_compress(pc, i, false, y + i * n);
        if (pair)
            channel_compress(pc, i + 1, true, y + (i + 1) * n);
    }
}

void pulse_compress_destroy(struct pulse_compress *pc)
{
    if (!pc)
        return;
    if (pc->forward)
        fftwf_destroy_plan(pc->forward);
    if (pc->inverse)
        fftwf_destroy_plan(pc->inverse);
    fftwf_free(pc->filters);
    fftwf_free(pc->taper);
    fftwf_free(pc->input);
    fftwf_free(pc->spectrum);
    fftwf_free(pc->product);
    fftwf_free(pc->trace);
    free(pc);
}
