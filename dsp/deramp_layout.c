#include "dsp/deramp_layout.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "dsp/fft_size.h"

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

double deramp_slope_hz_s(const struct deramp_config *c)
{
    return (c->chirp.stop_hz - c->chirp.start_hz) / c->chirp.duration_s;
}

static double ramp(double x) /* 0 to 1 */
{
    return x <= 0.0 ? 0.0 : x >= 1.0 ? 1.0 : 0.5 - 0.5 * cos(M_PI * x);
}

/* Sound that the ping's ends cut, a neighbouring emission's, rings into the gate's beats;
 * faded it does not. */
double deramp_fade(const struct deramp_layout *l, const struct deramp_config *c,
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

double deramp_band_weight(const struct deramp_layout *l, const struct deramp_config *c,
                          size_t n)
{
    return window_weight(c->window, (double)n * l->step_s / c->chirp.duration_s);
}

double deramp_echo_sum(const struct deramp_layout *l, const struct deramp_config *c,
                       double delay_s)
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
static int choose_transform(struct deramp_layout *l, struct band_transform **transform,
                            const struct deramp_config *c)
{
    double fs = c->sample_rate_hz, slope = fabs(deramp_slope_hz_s(c));
    double width_hz = slope * c->chirp.duration_s;
    double low_hz = fmin(c->chirp.start_hz, c->chirp.stop_hz);
    double high_hz = fmax(c->chirp.start_hz, c->chirp.stop_hz);
    size_t n_chirp = chirp_length(&c->chirp, fs);
    size_t n = l->n_used > n_chirp ? l->n_used : n_chirp;
    struct band_transform_config cfg = {
        .n_min = (size_t)ceil((1.0 + ROOM) * (double)n) + 1,
        .band = {low_hz / fs, high_hz / fs},
        .oversampling = (width_hz + slope * c->gate_s[1] + 2.0 * skirt_hz(c)) / width_hz,
        .span = (double)l->n_used,
    };
    struct band_transform_layout layout;

    if (cfg.oversampling > MAX_OVERSAMPLING)
        return -ERANGE;
    int err = band_transform_create(transform, &cfg);
    if (err)
        return err;
    band_transform_layout(*transform, &layout);
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

int deramp_layout_choose(struct deramp_layout *l, struct band_transform **transform,
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
