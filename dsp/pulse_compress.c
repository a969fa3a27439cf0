/* SPDX-License-Identifier: MIT */
#include "dsp/pulse_compress.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "dsp/band_transform.h"

/* Whitening: bins this far (in power) below the strongest are not amplified further. */
#define REGULARISER 1e-3
/* From so many channels on they take less time side by side than one by one. */
#define MIN_LANES 9
/* Transforms up to this length are made side by side: longer ones leave the caches. */
#define MAX_LANES_LENGTH 32768

struct pulse_compress {
    struct trace_format format, whole;
    size_t gate; /* first sample of the whole that is one of the gate */
    size_t n_channels;
    size_t n_replica;
    size_t first, n_input;  /* samples of a ping that are used */
    size_t n_filters;       /* 1: all microphones are flat */
    size_t n_filter;        /* values in each */
    float complex *filters; /* [n_filters][n_filter] */
    struct band_transform *transform;
    struct band_lanes *lanes; /* NULL: channels go one by one */
    float *lane_filters; /* [groups of 16][n_filter][BAND_LANES_POINT]; NULL: all flat */
};

static bool config_is_valid(const struct pulse_compress_config *c)
{
    double nyquist_hz = c->sample_rate_hz / 2.0;

    if (!(isfinite(c->sample_rate_hz) && c->sample_rate_hz > 0.0) || !c->n_channels ||
        !c->n_samples || c->n_samples > INT32_MAX / 4)
        return false;
    if (!(c->latency_samples >= 0.0 && c->latency_samples < 1e9) ||
        !(c->oversampling >= 1.0 && c->oversampling <= 64.0))
        return false;
    if (!(c->gate_s[0] >= 0.0 && c->gate_s[1] > c->gate_s[0] && isfinite(c->gate_s[1])) ||
        !(c->reach_s >= 0.0 && isfinite(c->reach_s)))
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

/* Samples beyond the gate's last replica that are used: a next emission that begins with
 * a click in the ping must be in it whole, for only with the rest of its band does
 * whitening leave nothing of it in the gate. */
static size_t next_emission(const struct pulse_compress *pc,
                            const struct pulse_compress_config *c, size_t n_min)
{
    size_t rest = c->n_samples - (size_t)floor(c->latency_samples) - n_min;

    return rest < pc->n_replica ? rest : pc->n_replica;
}

/* The transform starts at the emission, not at the gate: an echo before the gate must be
 * in it whole, for the cut edge of a strong direct path would spread into the gate.  It
 * is long enough that correlation inside the gate is linear. */
static int layout_choose(struct pulse_compress *pc, const struct pulse_compress_config *c,
                         const double band_hz[2], struct band_transform_config *cfg)
{
    double fs = c->sample_rate_hz, first = floor(c->latency_samples);
    double far = c->latency_samples - first + c->gate_s[1] * fs;
    double whole_far = c->latency_samples - first + c->reach_s * fs;
    struct band_transform_layout layout;

    *cfg = (struct band_transform_config){
        .band = {band_hz[0] / fs, band_hz[1] / fs},
        .oversampling = c->oversampling,
        .span = (c->gate_s[1] - c->gate_s[0]) * fs,
    };
    if (pc->n_replica < 2 || pc->n_replica > c->n_samples)
        return -EINVAL;
    if (first + far > (double)c->n_samples)
        return -ERANGE;
    cfg->n_min = pc->n_replica + (size_t)ceil(far) + 1;
    if (cfg->n_min < c->n_samples - (size_t)first)
        cfg->n_min += next_emission(pc, c, cfg->n_min);
    if (c->reach_s > 0.0)
        cfg->beyond = (c->gate_s[0] + fmax(c->reach_s - c->gate_s[1], 0.0)) * fs;
    int err = band_layout_choose(&layout, cfg);
    if (err)
        return err;
    if ((double)pc->n_replica + ceil(whole_far) + 1.0 > (double)layout.length ||
        first + whole_far > (double)c->n_samples)
        return -ERANGE;
    pc->first = (size_t)first;
    pc->n_input = c->n_samples - pc->first;
    if (pc->n_input > layout.length)
        pc->n_input = layout.length;
    pc->n_filter = layout.n_streams * layout.n_bins;
    pc->format = (struct trace_format){
        .t0_s = c->gate_s[0],
        .rate_hz = fs * layout.rate,
        .carrier_hz = fs * layout.carrier,
        .n_samples = (size_t)floor(cfg->span * layout.rate + 1e-6) + 1,
    };
    pc->gate = c->reach_s > 0.0 ? (size_t)floor(c->gate_s[0] * pc->format.rate_hz) : 0;
    pc->whole = pc->format;
    pc->whole.n_samples = layout.n_output;
    pc->whole.t0_s -= (double)pc->gate / pc->format.rate_hz;
    return 0;
}

static int replica_transform(struct pulse_compress *pc,
                             const struct pulse_compress_config *c)
{
    float *chirp;

    if (c->n_replica) {
        band_transform_forward(pc->transform, c->replica, pc->n_replica);
        return 0;
    }
    chirp = malloc(pc->n_replica * sizeof(*chirp));
    if (!chirp)
        return -ENOMEM;
    chirp_generate(&c->chirp, c->sample_rate_hz, chirp);
    band_transform_forward(pc->transform, chirp, pc->n_replica);
    free(chirp);
    return 0;
}

/* Whitening, W / (|S|^2 + eps max|S|^2) without its scale, at each bin; 0 outside of the
 * band.  The sum over the band is the peak of an echo of gain 1: it is made 1.
 * -EINVAL: the replica has nothing in the band. */
static int weights_fill(const struct pulse_compress *pc, double *weight,
                        const double band_hz[2], enum window window, double fs)
{
    struct band_transform_layout l;
    double max = 0.0, sum = 0.0;

    band_transform_layout(pc->transform, &l);
    for (size_t i = 0; i < pc->n_filter; i++) {
        size_t stream = i / l.n_bins, bin = i % l.n_bins;
        double f = fs * band_transform_frequency(pc->transform, stream, bin);
        double s = cabsf(band_transform_bin(pc->transform, stream, bin));
        weight[i] = window_weight(window, (f - band_hz[0]) / (band_hz[1] - band_hz[0]));
        if (weight[i] > 0.0)
            max = fmax(max, s * s);
    }
    if (!(max > 0.0) || !isfinite(max))
        return -EINVAL;
    for (size_t i = 0; i < pc->n_filter; i++) {
        double s = cabsf(band_transform_bin(pc->transform, i / l.n_bins, i % l.n_bins));
        weight[i] /= s * s + REGULARISER * max;
        sum += weight[i] * s * s;
    }
    for (size_t i = 0; i < pc->n_filter; i++)
        weight[i] /= sum;
    return 0;
}

/* conj(S) times the weight, turned so that the trace starts at t0 and that the emission
 * is where the latency says. */
static int filters_create(struct pulse_compress *pc,
                          const struct pulse_compress_config *c, const double band_hz[2])
{
    double fs = c->sample_rate_hz;
    double delay_s = (c->latency_samples - (double)pc->first) / fs;
    double *weight = malloc(pc->n_filter * sizeof(*weight));
    struct band_transform_layout l;
    int err = weight ? 0 : -ENOMEM;

    pc->filters = fftwf_malloc(pc->n_filters * pc->n_filter * sizeof(*pc->filters));
    if (!pc->filters)
        err = -ENOMEM;
    if (!err)
        err = weights_fill(pc, weight, band_hz, c->window, fs);
    band_transform_layout(pc->transform, &l);
    for (size_t i = 0; i < pc->n_filter && !err; i++) {
        size_t stream = i / l.n_bins, bin = i % l.n_bins;
        double f = fs * band_transform_frequency(pc->transform, stream, bin);
        double turn = f * delay_s + (f - pc->whole.carrier_hz) * pc->whole.t0_s;
        double a = 2.0 * M_PI * (turn - floor(turn));
        double complex h = weight[i] *
                           conj(band_transform_bin(pc->transform, stream, bin));

        h *= cos(a) + I * sin(a);
        for (size_t j = 0; j < pc->n_filters; j++)
            pc->filters[j * pc->n_filter + i] = (float complex)(
                h * microphone_correction(c->microphones ? c->microphones[j] : NULL, f));
    }
    free(weight);
    return err;
}

/* Filters as the lanes read them. */
static int lanes_create(struct pulse_compress *pc)
{
    const struct band_plan *plan = band_transform_plan(pc->transform);
    size_t n_floats = pc->n_filter * BAND_LANES_POINT;
    size_t n_lanes = (pc->n_filters + VECTOR_LANES - 1) / VECTOR_LANES * VECTOR_LANES;

    if (pc->n_channels < MIN_LANES || plan->layout.length > MAX_LANES_LENGTH)
        return 0;
    if (pc->n_filters > 1) {
        pc->lane_filters =
            aligned_alloc(BAND_LANES_POINT * sizeof(float),
                          n_lanes / VECTOR_LANES * n_floats * sizeof(float));
        if (!pc->lane_filters)
            return -ENOMEM;
        for (size_t i = 0; i < n_lanes; i++) {
            size_t filter = i < pc->n_filters ? i : pc->n_filters - 1;
            band_lanes_filter(plan, pc->lane_filters + i / VECTOR_LANES * n_floats,
                              i % VECTOR_LANES, pc->filters + filter * pc->n_filter);
        }
    }
    return band_lanes_create(&pc->lanes, plan);
}

/* All but the tables. */
static int choose(struct pulse_compress *pc, const struct pulse_compress_config *c,
                  double band_hz[2], struct band_transform_config *cfg)
{
    int err = band_choose(band_hz, c);

    if (err)
        return err;
    pc->n_channels = c->n_channels;
    pc->n_replica = c->n_replica ? c->n_replica
                                 : chirp_length(&c->chirp, c->sample_rate_hz);
    pc->n_filters = c->microphones ? c->n_channels : 1;
    return layout_choose(pc, c, band_hz, cfg);
}

int pulse_compress_format_of(const struct pulse_compress_config *c,
                             struct trace_format *out)
{
    struct pulse_compress pc = {.n_channels = 0};
    struct band_transform_config cfg;
    double band_hz[2];

    if (!out || !c || !config_is_valid(c))
        return -EINVAL;
    int err = choose(&pc, c, band_hz, &cfg);
    *out = pc.format;
    return err;
}

int pulse_compress_create(struct pulse_compress **out,
                          const struct pulse_compress_config *c)
{
    struct band_transform_config cfg;
    struct pulse_compress *pc;
    double band_hz[2];

    if (!out || !c || !config_is_valid(c))
        return -EINVAL;
    pc = calloc(1, sizeof(*pc));
    if (!pc)
        return -ENOMEM;
    int err = choose(pc, c, band_hz, &cfg);
    if (!err)
        err = band_transform_create(&pc->transform, &cfg);
    if (!err)
        err = replica_transform(pc, c);
    if (!err)
        err = filters_create(pc, c, band_hz);
    if (!err)
        err = lanes_create(pc);
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

void pulse_compress_whole(const struct pulse_compress *pc, struct trace_format *out,
                          size_t *first)
{
    *out = pc->whole;
    *first = pc->gate;
}

static void channel_compress(struct pulse_compress *pc, size_t channel, const float *rx,
                             float complex *restrict y)
{
    size_t filter = pc->n_filters > 1 ? channel : 0;

    band_transform_forward(pc->transform, rx, pc->n_input);
    band_transform_inverse(pc->transform, pc->filters + filter * pc->n_filter, y);
}

/* `channel`: the first of a group of 16. */
static void group_compress(struct pulse_compress *pc, size_t channel, size_t n_channels,
                           const float *rx, size_t rx_stride, float complex *restrict y)
{
    bool shared = !pc->lane_filters;
    const float *filter = shared ? (const float *)pc->filters
                                 : pc->lane_filters + channel / VECTOR_LANES *
                                                          pc->n_filter * BAND_LANES_POINT;

    band_lanes_execute(pc->lanes, rx, rx_stride, pc->n_input, filter, shared, y,
                       n_channels);
}

void pulse_compress_execute(struct pulse_compress *pc, const float *rx, size_t rx_stride,
                            float complex *restrict y)
{
    size_t i = 0, n = pc->whole.n_samples;

    rx += pc->first;
    while (pc->lanes && pc->n_channels - i >= MIN_LANES) {
        size_t left = pc->n_channels - i,
               n_group = left < VECTOR_LANES ? left : VECTOR_LANES;
        group_compress(pc, i, n_group, rx + i * rx_stride, rx_stride, y + i * n);
        i += n_group;
    }
    for (; i < pc->n_channels; i++)
        channel_compress(pc, i, rx + i * rx_stride, y + i * n);
}

void pulse_compress_destroy(struct pulse_compress *pc)
{
    if (!pc)
        return;
    band_lanes_destroy(pc->lanes);
    free(pc->lane_filters);
    band_transform_destroy(pc->transform);
    fftwf_free(pc->filters);
    free(pc);
}
