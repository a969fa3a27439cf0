/* SPDX-License-Identifier: MIT */
#include "recon/processing.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/tail.h"

#define GATE_NEAR_LEAST_M  0.3
#define DIRECT_CLEARANCE_M 0.1  /* behind the direct path: its sidelobes and the stand */
#define NEXT_CLEARANCE     10.0 /* over the band: hann's sidelobes are at -70 dB there */
#define VOLUME_CLEARANCE_M 0.05 /* before the nearest voxel: the interpolators' taps */
#define TRACE_OVERSAMPLING 2.0
#define LEAST_SPAN         16.0 /* over the band: interpolators' taps on both sides */

/* Which part of a chirp is over when it has got to f1 of recon/geometry.h: <f^3> / <f^2>
 * under Hann's window, whose square has the mean 1/3 - 2/pi^2 over -1..1. */
static double chirp_part(const struct survey *s, size_t emission)
{
    double middle = 0.5 * (s->chirp_start_hz + s->chirp_stop_hz);
    double half = 0.5 * (s->chirp_stop_hz - s->chirp_start_hz);
    double square = half * half * (1.0 / 3.0 - 2.0 / (M_PI * M_PI));
    double f1 = middle * (middle * middle + 3.0 * square) / (middle * middle + square);
    double part = 0.5 + 0.5 * (f1 - middle) / half;
    if (s->n_replica)
        return 0.5;
    return survey_is_down(s, emission) ? 1.0 - part : part;
}

static void plan_motion(struct geometry *g, const struct survey *s)
{
    double speed_m_s = survey_speed_m_s(s), rate_hz = s->sample_rate_hz;
    double far_m = s->has_gate ? s->gate_m[1] : TAIL_DEFAULT_FAR_M;
    double near_m = s->has_gate ? s->gate_m[0] : GATE_NEAR_LEAST_M;
    g->together = s->together;
    g->slot_m = speed_m_s * (double)s->slot_samples / rate_hz;
    for (size_t odd = 0; odd < 2; odd++)
        g->chirp_m[odd] = speed_m_s * (chirp_part(s, odd) * s->chirp_duration_s +
                                       s->latency_samples / rate_hz);
    g->echo_m = speed_m_s * (near_m + far_m) / s->sound_speed_m_s;
}

void processing_geometry(struct geometry *g, const struct survey *s)
{
    memset(g, 0, sizeof *g);
    g->sound_speed_m_s = s->sound_speed_m_s;
    g->n_speakers = s->n_speakers;
    g->n_microphones = s->n_microphones;
    g->n_positions = s->n_positions;
    g->speakers_m = (const double(*)[3])s->speakers_m;
    g->microphones_m = (const double(*)[3])s->microphones_m;
    memcpy(g->stage_axis, s->stage_axis, sizeof g->stage_axis);
    g->stage_positions_m = s->stage_positions_m;
    g->pings_m = (const double(*)[2][3])s->pings_m;
    if (s->continuous)
        plan_motion(g, s);
}

struct chirp processing_chirp(const struct survey *s)
{
    return (struct chirp){.start_hz = s->chirp_start_hz,
                          .stop_hz = s->chirp_stop_hz,
                          .duration_s = s->chirp_duration_s,
                          .sine = s->chirp_sine};
}

struct span {
    double shortest_m, longest_m;
};

static void widen(struct span *s, const double a[3], const double b[3])
{
    double m = geometry_distance(a, b);
    s->shortest_m = fmin(s->shortest_m, m);
    s->longest_m = fmax(s->longest_m, m);
}

static struct span direct_paths(const struct survey *s)
{
    struct span out = {INFINITY, 0.0};
    for (size_t k = 0; s->pings_m && k < s->n_positions; k++)
        widen(&out, s->pings_m[k][0], s->pings_m[k][1]);
    for (size_t j = 0; !s->pings_m && j < s->n_speakers; j++)
        for (size_t i = 0; i < s->n_microphones; i++)
            widen(&out, s->speakers_m[j], s->microphones_m[i]);
    return out;
}

/* The longest delay that can be told from the next emission's, and that ends within the
 * two slots that a ping may have; where emissions overlap it is longer (recon/tail.h). */
static double slot_reach_s(const struct survey *s)
{
    double slot_s = (double)s->slot_samples / s->sample_rate_hz;
    if (survey_overlaps(s))
        return slot_s;
    double latency_s = s->latency_samples / s->sample_rate_hz;
    return fmin(slot_s, 2.0 * slot_s - latency_s - s->chirp_duration_s);
}

/* The longest delay that is still quiet: soon after the slot the next emission is heard
 * directly, and its sidelobes reach before it.  Pings with places of their own may have
 * been recorded one by one. */
static double quiet_until_s(const struct survey *s, const double band_hz[2])
{
    double slot_s = (double)s->slot_samples / s->sample_rate_hz;
    if (s->pings_m)
        return slot_s;
    return slot_s + direct_paths(s).shortest_m / s->sound_speed_m_s -
           NEXT_CLEARANCE / (band_hz[1] - band_hz[0]);
}

static int plan_gate(struct processing *p, const struct survey *s, double reach_s,
                     struct error *why)
{
    double reach_m = 0.5 * s->sound_speed_m_s * reach_s;
    double nearest_m =
        fmax(0.5 * direct_paths(s).longest_m + DIRECT_CLEARANCE_M, GATE_NEAR_LEAST_M);

    if (s->has_gate) {
        p->gate_m[0] = s->gate_m[0];
        p->gate_m[1] = s->gate_m[1];
        if (!(p->gate_m[0] >= 0.0 && p->gate_m[0] < p->gate_m[1]))
            return error_say(why, -EINVAL,
                             "gate_m: expected 0 <= near < far, not [%g, %g]",
                             p->gate_m[0], p->gate_m[1]);
        if (p->gate_m[1] > reach_m)
            return error_say(
                why, -EINVAL,
                "gate_m: far end %g m lies beyond the slot; at most %.2f m fits "
                "slot_samples %zu at %g Hz",
                p->gate_m[1], reach_m, s->slot_samples, s->sample_rate_hz);
        return 0;
    }
    p->gate_m[0] = nearest_m;
    p->gate_m[1] = fmin(TAIL_DEFAULT_FAR_M, reach_m);
    if (p->gate_m[1] <= p->gate_m[0])
        return error_say(
            why, -EINVAL,
            "slot_samples: %zu samples reach %.2f m, but the gate can only begin "
            "at %.2f m, behind the direct path; give gate_m or a longer slot",
            s->slot_samples, reach_m, nearest_m);
    return 0;
}

/* A volume that was asked for narrows a gate that was not. */
static int fit_gate_to_volume(struct processing *p, const struct survey *s,
                              double reach_s, const double delays_s[2], struct error *why)
{
    double half_c = 0.5 * s->sound_speed_m_s;
    if (delays_s[0] >= reach_s)
        return error_say(
            why, -EINVAL,
            "volume: z_m begins %.2f m away, beyond the slot; at most %.2f m "
            "fits slot_samples %zu at %g Hz",
            half_c * delays_s[0], half_c * reach_s, s->slot_samples, s->sample_rate_hz);
    if (!s->has_gate) {
        p->gate_m[0] = fmax(p->gate_m[0], half_c * delays_s[0] - VOLUME_CLEARANCE_M);
        p->gate_m[1] = half_c * fmin(delays_s[1], reach_s);
    }
    if (half_c * delays_s[1] <= p->gate_m[0] || half_c * delays_s[0] >= p->gate_m[1])
        return error_say(
            why, -EINVAL,
            "volume: z_m lies %.2f to %.2f m away, outside the gate of %.2f to "
            "%.2f m; change gate_m or volume",
            half_c * delays_s[0], half_c * delays_s[1], p->gate_m[0], p->gate_m[1]);
    return 0;
}

/* The echoes of a few voxels are over before an interpolator has its samples. */
static void widen_gate(double gate_s[2], double least_s, double until_s)
{
    double missing_s = least_s - (gate_s[1] - gate_s[0]);
    if (!(missing_s > 0.0))
        return;
    gate_s[1] = fmin(gate_s[1] + 0.5 * missing_s, fmax(gate_s[1], until_s));
    gate_s[0] = fmax(gate_s[1] - least_s, 0.0);
}

int processing_plan(struct processing *out, const struct survey *s, struct error *why)
{
    struct processing p = {0};
    double reach_s = slot_reach_s(s), delays_s[2];
    int err;

    if (s->pings_m && !s->has_volume)
        return error_say(why, -EINVAL,
                         "volume: expected x_m, y_m and z_m, each [min, max, step], for "
                         "pings with places of their own have no front");
    processing_geometry(&p.geometry, s);
    p.band_hz[0] = fmin(s->chirp_start_hz, s->chirp_stop_hz);
    p.band_hz[1] = fmax(s->chirp_start_hz, s->chirp_stop_hz);
    err = plan_gate(&p, s, reach_s, why);
    if (err)
        return err;

    if (s->has_volume) {
        err = grid_from_limits(&p.grid, (const double(*)[3])s->volume_m);
        if (err)
            return error_say(why, err,
                             err == -EFBIG ? "volume: too many voxels; expected at "
                                             "most 2^28, use larger steps"
                                           : "volume: expected [min, max, step] "
                                             "with max >= min and step > 0");
    } else {
        grid_default(&p.grid, &p.geometry, p.gate_m, p.band_hz);
    }
    grid_delays(&p.grid, &p.geometry, delays_s);
    if (s->has_volume) {
        err = fit_gate_to_volume(&p, s, reach_s, delays_s, why);
        if (err)
            return err;
    }

    p.gate_s[0] = fmax(2.0 * p.gate_m[0] / s->sound_speed_m_s, delays_s[0]);
    p.quiet_s = quiet_until_s(s, p.band_hz);
    p.gate_s[1] = fmin(fmin(delays_s[1], reach_s), p.quiet_s);
    if (s->has_gate)
        p.gate_s[1] = fmin(p.gate_s[1], 2.0 * p.gate_m[1] / s->sound_speed_m_s);
    widen_gate(p.gate_s, LEAST_SPAN / (p.band_hz[1] - p.band_hz[0]),
               fmin(reach_s, p.quiet_s));
    p.ping_samples = s->slot_samples + tail_samples(s);
    p.echo_samples = s->slot_samples + tail_echo_samples(s);
    *out = p;
    return 0;
}

void processing_listen_beyond(struct processing *p, const struct survey *s)
{
    double delays_s[2], until_s;

    if (s->n_positions > 1 || s->pings_m || survey_overlaps(s))
        return;
    grid_delays(&p->grid, &p->geometry, delays_s);
    until_s = ((double)p->ping_samples - s->latency_samples) / s->sample_rate_hz -
              s->chirp_duration_s;
    until_s = fmin(fmin(until_s, delays_s[1]),
                   2.0 * (p->gate_m[1] + PROCESSING_BEYOND_M) / s->sound_speed_m_s);
    p->gate_s[1] = fmax(p->gate_s[1], until_s);
}

static void configure(struct pulse_compress_config *cfg, const struct processing *p,
                      const struct survey *s, enum window window)
{
    memset(cfg, 0, sizeof *cfg);
    cfg->sample_rate_hz = s->sample_rate_hz;
    cfg->n_samples = p->ping_samples;
    cfg->chirp = processing_chirp(s);
    cfg->latency_samples = s->latency_samples;
    memcpy(cfg->band_hz, p->band_hz, sizeof cfg->band_hz);
    cfg->window = window;
    memcpy(cfg->gate_s, p->gate_s, sizeof cfg->gate_s);
    cfg->reach_s = p->reach_s;
    cfg->oversampling = TRACE_OVERSAMPLING;
    cfg->n_replica = s->n_replica;
    cfg->replica = s->replica;
    cfg->n_channels = s->n_microphones;
}

struct curves {
    struct microphone *curve;
    const struct microphone **each; /* [n_microphones]; NULL: all are flat */
};

static int curves_take(struct curves *out, const struct survey *s)
{
    *out = (struct curves){NULL, NULL};
    if (!s->n_responses)
        return 0;
    out->curve = calloc(s->n_microphones, sizeof *out->curve);
    out->each = calloc(s->n_microphones, sizeof *out->each);
    if (!out->curve || !out->each)
        return -ENOMEM;
    for (size_t i = 0; i < s->n_microphones; i++) {
        const struct survey_response *r = &s->responses[i];
        out->curve[i] = (struct microphone){r->n_points, r->frequency_hz, r->gain_db};
        out->each[i] = &out->curve[i];
    }
    return 0;
}

static void curves_clear(struct curves *c)
{
    free(c->each);
    free(c->curve);
}

static int say_compressor(const struct processing *p, int err, struct error *why)
{
    return error_say(why, err, "pulse compression of %zu samples, %.4f to %.4f s: %s",
                     p->ping_samples, p->gate_s[0], p->gate_s[1], strerror(-err));
}

int processing_compressor(struct pulse_compress **out, const struct processing *p,
                          const struct survey *s, enum window window, struct error *why)
{
    struct pulse_compress_config cfg;
    struct curves curves;
    int err = curves_take(&curves, s);

    configure(&cfg, p, s, window);
    cfg.microphones = curves.each;
    if (!err)
        err = pulse_compress_create(out, &cfg);
    if (err)
        say_compressor(p, err, why);
    curves_clear(&curves);
    return err;
}

int processing_compressor_format(struct trace_format *out, const struct processing *p,
                                 const struct survey *s, struct error *why)
{
    struct pulse_compress_config cfg;

    configure(&cfg, p, s, WINDOW_RECTANGULAR);
    int err = pulse_compress_format_of(&cfg, out);
    return err ? say_compressor(p, err, why) : 0;
}

static struct deramp_config configure_deramp(const struct processing *p,
                                             const struct survey *s, enum window window)
{
    return (struct deramp_config){
        .sample_rate_hz = s->sample_rate_hz,
        .n_samples = p->ping_samples,
        .chirp = processing_chirp(s),
        .latency_samples = s->latency_samples,
        .window = window,
        .gate_s = {p->gate_s[0], p->gate_s[1]},
        .n_channels = s->n_microphones,
        .rate_hz = TRACE_OVERSAMPLING * (p->band_hz[1] - p->band_hz[0]),
    };
}

static int say_deramp(const struct processing *p, int err, struct error *why)
{
    return error_say(why, err, "deramp of %zu samples, %.4f to %.4f s: %s",
                     p->ping_samples, p->gate_s[0], p->gate_s[1], strerror(-err));
}

static int check_deramp(const struct survey *s, struct error *why)
{
    return s->n_replica ? error_say(why, -EINVAL,
                                    "compression: deramp mixes with a chirp, and the "
                                    "survey names a replica; use matched_filter")
                        : 0;
}

int processing_deramp(struct deramp **out, const struct processing *p,
                      const struct survey *s, enum window window, struct error *why)
{
    struct deramp_config cfg = configure_deramp(p, s, window);
    struct curves curves;
    int err = check_deramp(s, why);

    if (err)
        return err;
    err = curves_take(&curves, s);
    cfg.microphones = curves.each;
    if (!err)
        err = deramp_create(out, &cfg);
    if (err)
        say_deramp(p, err, why);
    curves_clear(&curves);
    return err;
}

int processing_deramp_format(struct trace_format *out, const struct processing *p,
                             const struct survey *s, struct error *why)
{
    struct deramp_config cfg = configure_deramp(p, s, WINDOW_RECTANGULAR);
    int err = check_deramp(s, why);

    if (err)
        return err;
    err = deramp_format_of(&cfg, out);
    return err ? say_deramp(p, err, why) : 0;
}

static struct imager_config imager_of(const struct processing *p, const char *method,
                                      const struct trace_format *format,
                                      struct pool *pool)
{
    return (struct imager_config){.method = method,
                                  .geometry = &p->geometry,
                                  .format = *format,
                                  .band_hz = {p->band_hz[0], p->band_hz[1]},
                                  .gate_m = {p->gate_m[0], p->gate_m[1]},
                                  .grid = p->grid,
                                  .pool = pool,
                                  .options = p->imaging};
}

int processing_imager(struct imager **out, const struct processing *p, const char *method,
                      const struct trace_format *format, struct pool *pool,
                      struct error *why)
{
    const struct imager_config cfg = imager_of(p, method, format, pool);
    const char *reason = NULL;
    int err = imager_create(out, &cfg, &reason);
    if (err == -ENOENT) {
        char known[256] = "", hint[NEAREST_HINT_SIZE];
        for (const char *m = imager_methods(); *m; m += strlen(m) + 1)
            text_add(known, sizeof known, ", ", "%s", m);
        return error_say(why, err, "method '%s': no such method; expected one of %s%s",
                         method, known, nearest_hint(hint, method, imager_methods()));
    }
    if (err == -ENOTSUP)
        return error_say(why, err, "method '%s' cannot image this survey: it needs %s",
                         method, reason && *reason ? reason : "another geometry");
    if (err == -ECANCELED)
        return error_say(why, err, "stopped while planning");
    if (err)
        return error_say(why, err, "method '%s': %s", method,
                         reason && *reason ? reason : strerror(-err));
    return 0;
}

int processing_surroundings(struct surroundings **out, const struct processing *p,
                            const struct trace_format *format, struct pool *pool)
{
    const struct imager_config wanted = imager_of(p, NULL, format, pool);

    return surroundings_create(out, &wanted);
}
