/* SPDX-License-Identifier: MIT */
#include "recon/coherent/stretch.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/lane_fft.h"
#include "dsp/vector.h"
#include "recon/coherent/sinc.h"

#define TAPS         8
#define FRACTIONS    1024 /* steps of the interpolation table between two samples */
#define FADE         8    /* samples over which the ends of a trace fade */
#define OVERSAMPLING 1.4  /* of complex traces in log time */
#define STRETCH_MAX  2.0  /* dt0 / dt, where moveout mutes */
#define STRETCH_FADE 1.7  /* where it begins to */
/* Power has twice the band, but little in its outer parts (the spectrum of a Hann
 * window's square).  Measured: these lose least. */
#define POWER_SAMPLES 1.5  /* of log time, for each period of the band's width */
#define POWER_IN      0.55 /* of the band that the interpolations are to keep */
#define POWER_OUT     0.58
/* A transform that is 2% short serves, with coarser steps. */
#define FIT 0.98

struct step {
    uint32_t first;    /* row of the first tap */
    uint32_t fraction; /* of the interpolation table */
    float gain;
    float phase[2];
};

struct stretch {
    bool power;
    size_t n_out, n_rows;
    double first_ln, step_ln;  /* log time of row 0, from row to row */
    double centre;             /* angular log-frequency that is bin 0 */
    float *taps_in, *taps_out; /* [FRACTIONS + 1][TAPS] */
    struct step *in;           /* [n_offsets][n_rows] */
    struct step *out;          /* [n_out] */
};

/* -- create -----------------------------------------------------------------------------
 */

static double smooth(double x) /* 0 to 1 */
{
    return x <= 0.0 ? 0.0 : x >= 1.0 ? 1.0 : 0.5 - 0.5 * cos(M_PI * x);
}

static void set_phase(struct step *s, double turns)
{
    double phase = 2.0 * M_PI * (turns - rint(turns));
    s->phase[0] = (float)cos(phase);
    s->phase[1] = (float)sin(phase);
}

/* Taps around row `at` of n; false where they are not all there. */
static bool set_taps(struct step *s, double at, size_t n)
{
    double below = floor(at), first = below - (TAPS / 2 - 1);
    *s = (struct step){0};
    if (!(first >= 0.0 && first + TAPS <= (double)n))
        return false;
    s->first = (uint32_t)first;
    s->fraction = (uint32_t)lrint((at - below) * FRACTIONS);
    return true;
}

static void plan_in(const struct stretch *s, const struct stretch_config *cfg,
                    double half_offset_m, size_t row, struct step *step)
{
    double ln = s->first_ln + s->step_ln * (double)row, c = cfg->sound_speed_m_s;
    double t0 = exp(ln), t = hypot(t0, 2.0 * half_offset_m / c);
    double at = (t - cfg->in.t0_s) * cfg->in.rate_hz;
    if (!set_taps(step, at, cfg->in.n_samples))
        return;
    double edge = fmin(at, (double)(cfg->in.n_samples - 1) - at);
    double gain = smooth((edge - (TAPS / 2 - 1)) / FADE) *
                  smooth((t0 - cfg->mute_s) * cfg->in.rate_hz / FADE) *
                  smooth((STRETCH_MAX - t / t0) / (STRETCH_MAX - STRETCH_FADE));
    gain *= cfg->power ? c * t * c * t : 0.5 * c * t0;
    step->gain = (float)gain;
    set_phase(step, cfg->in.carrier_hz * t - s->centre / (2.0 * M_PI) * ln);
}

static void plan_out(const struct stretch *s, const struct stretch_config *cfg, size_t n,
                     struct step *step)
{
    double t0 = cfg->out.t0_s + (double)n / cfg->out.rate_hz;
    *step = (struct step){0};
    if (!(t0 > 0.0) || !set_taps(step, (log(t0) - s->first_ln) / s->step_ln, s->n_rows))
        return;
    step->gain = 1.0f;
    set_phase(step, s->centre / (2.0 * M_PI) * log(t0) - cfg->out.carrier_hz * t0);
}

static void make_taps(double occupancy, float *taps)
{
    double weights[TAPS];
    for (size_t f = 0; f <= FRACTIONS; f++) {
        sinc_weights(TAPS, fmin(occupancy, 0.95), (double)f / FRACTIONS, weights);
        for (size_t q = 0; q < TAPS; q++)
            taps[f * TAPS + q] = (float)weights[q];
    }
}

/* How far, in log time, dip moveout brings events forward: those of 60 degrees (the
 * stationary point of its convolution is at x^2 = h^2 (1 - 2 / (A + 1))). */
static double longest_lead(const struct stretch_config *cfg, double first_s)
{
    double lead = 0.0;
    for (size_t o = 0; o < cfg->n_offsets; o++) {
        double t0 = fmax(first_s, 1.2 * cfg->half_offset_m[o] / cfg->sound_speed_m_s);
        double x = 4.0 * sin(M_PI / 3.0) * cfg->half_offset_m[o] /
                   (cfg->sound_speed_m_s * t0);
        lead = fmax(lead, 0.5 * log(0.5 + 0.5 * sqrt(1.0 + x * x)));
    }
    return lead;
}

/* The axis of log time, from before the first sample wanted to behind the last. */
static void plan_axis(struct stretch *s, const struct stretch_config *cfg)
{
    double sample_s = 1.0 / cfg->in.rate_hz;
    double in_end_s = cfg->in.t0_s + (double)cfg->in.n_samples * sample_s;
    double out_end_s = cfg->out.t0_s + (double)cfg->out.n_samples / cfg->out.rate_hz;
    double last_s = fmax(fmin(in_end_s, out_end_s), 2.0 * sample_s);
    double first_s = fmax(fmax(cfg->out.t0_s, cfg->mute_s - sample_s), sample_s);
    first_s = fmin(first_s, 0.999 * last_s);
    double width_hz = cfg->band_hz[1] - cfg->band_hz[0], high = cfg->band_hz[1] * last_s;
    double low = cfg->band_hz[0] * first_s;
    double per_ln = cfg->power ? POWER_SAMPLES * width_hz * last_s
                               : OVERSAMPLING * (high - low);
    double span_ln = log(last_s / first_s) + longest_lead(cfg, first_s);
    double rows = per_ln * span_ln + 3 * TAPS;
    s->n_rows = lane_fft_size((size_t)ceil(FIT * rows));
    if ((double)s->n_rows < rows)
        per_ln = ((double)s->n_rows - 3 * TAPS) / span_ln;
    s->step_ln = 1.0 / per_ln;
    s->centre = cfg->power ? 0.0 : M_PI * (high + low);
    s->first_ln = log(first_s) - TAPS * s->step_ln;
}

static bool sensible(const struct stretch_config *cfg)
{
    bool ok = cfg->in.n_samples >= TAPS && cfg->out.n_samples && cfg->n_offsets;
    ok = ok && cfg->in.rate_hz > 0.0 && cfg->out.rate_hz > 0.0;
    ok = ok && cfg->sound_speed_m_s > 0.0 && cfg->band_hz[1] > cfg->band_hz[0];
    return ok && cfg->in.t0_s + (double)cfg->in.n_samples / cfg->in.rate_hz > 0.0;
}

int stretch_create(struct stretch **out, const struct stretch_config *cfg)
{
    if (!sensible(cfg))
        return -EINVAL;
    struct stretch *s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    s->power = cfg->power;
    s->n_out = cfg->out.n_samples;
    plan_axis(s, cfg);
    s->taps_in = malloc((FRACTIONS + 1) * TAPS * sizeof *s->taps_in);
    s->taps_out = malloc((FRACTIONS + 1) * TAPS * sizeof *s->taps_out);
    s->in = malloc(cfg->n_offsets * s->n_rows * sizeof *s->in);
    s->out = malloc(s->n_out * sizeof *s->out);
    if (!s->taps_in || !s->taps_out || !s->in || !s->out) {
        stretch_destroy(s);
        return -ENOMEM;
    }
    double width_hz = cfg->band_hz[1] - cfg->band_hz[0];
    make_taps(s->power ? POWER_IN * 2.0 * width_hz / cfg->in.rate_hz
                       : width_hz / cfg->in.rate_hz,
              s->taps_in);
    make_taps(s->power ? POWER_OUT : 1.0 / OVERSAMPLING, s->taps_out);
    for (size_t q = 0; q < cfg->n_offsets * s->n_rows; q++)
        plan_in(s, cfg, cfg->half_offset_m[q / s->n_rows], q % s->n_rows, &s->in[q]);
    for (size_t n = 0; n < s->n_out; n++)
        plan_out(s, cfg, n, &s->out[n]);
    *out = s;
    return 0;
}

void stretch_destroy(struct stretch *s)
{
    if (!s)
        return;
    free(s->taps_in);
    free(s->taps_out);
    free(s->in);
    free(s->out);
    free(s);
}

size_t stretch_rows(const struct stretch *s)
{
    return s->n_rows;
}

double stretch_frequency(const struct stretch *s, size_t q)
{
    double bin = q <= s->n_rows / 2 ? (double)q : (double)q - (double)s->n_rows;
    if (s->power && 2 * q == s->n_rows)
        return INFINITY;
    return s->centre + 2.0 * M_PI * bin / ((double)s->n_rows * s->step_ln);
}

/* -- execute ----------------------------------------------------------------------------
 */

VECTOR_INLINE void interpolate(const struct stretch *s, const struct step *steps,
                               size_t n, const float *table, const float *restrict in,
                               float *restrict out)
{
    for (size_t q = 0; q < n; q++, out += LANE_FFT_POINT) {
        const struct step *step = &steps[q];
        const float *w = table + step->fraction * TAPS;
        const float *x = in + (size_t)step->first * LANE_FFT_POINT;
        float a = step->gain, c = step->phase[0], d = step->phase[1];
        if (a == 0.0f) { /* also where there is nothing to read */
            memset(out, 0, LANE_FFT_POINT * sizeof *out);
            continue;
        }
        float re[VECTOR_LANES] = {0}, im[VECTOR_LANES] = {0};
        for (size_t l = 0; l < TAPS; l++, x += LANE_FFT_POINT) {
#pragma GCC unroll 1 /* else GCC 12 unrolls it before it could become vectors */
            for (size_t v = 0; v < VECTOR_LANES; v++) {
                re[v] += a * w[l] * x[v];
                im[v] += a * w[l] * x[VECTOR_LANES + v];
            }
        }
        for (size_t v = 0; !s->power && v < VECTOR_LANES; v++) {
            float turned = re[v] * c - im[v] * d;
            im[v] = re[v] * d + im[v] * c;
            re[v] = turned;
        }
        memcpy(out, re, sizeof re);
        memcpy(out + VECTOR_LANES, im, sizeof im);
    }
}

VECTOR_CLONES
void stretch_in(const struct stretch *s, size_t offset, const float *restrict in,
                float *restrict out)
{
    interpolate(s, s->in + offset * s->n_rows, s->n_rows, s->taps_in, in, out);
}

VECTOR_CLONES
void stretch_out(const struct stretch *s, const float *restrict in, float *restrict out)
{
    interpolate(s, s->out, s->n_out, s->taps_out, in, out);
}
