/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_receiver.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CLEARANCE_M                                                                      \
    0.15 /* of a path, behind the direct sound's: its sidelobes, the stand */
#define THRESHOLD_DB   15.0 /* above the noise of the trace */
#define RANGE_DB       20.0 /* below its strongest echo */
#define BEFORE_S       5e-4 /* of the next emission: its sidelobes */
#define LEAD           6.0  /* over the band: sidelobes of direct sound before it */
#define MARGIN_SAMPLES 4.0  /* of a gate: what is rounded to whole samples of traces */

static double longest_direct_m(const struct survey *s)
{
    double longest = 0.0;
    for (size_t j = 0; j < s->n_speakers; j++)
        for (size_t i = 0; i < s->n_microphones; i++)
            longest =
                fmax(longest, geometry_distance(s->speakers_m[j], s->microphones_m[i]));
    return longest;
}

static double slot_s(const struct survey *s)
{
    return (double)s->slot_samples / s->sample_rate_hz;
}

/* From the emission on, as far as walls are looked for and the ping holds whole chirps.
 */
static int plan_gate(struct wall_receiver *r, double reach_m, struct error *why)
{
    const struct survey *s = r->survey;
    struct processing *p = &r->processing;
    int err = processing_plan(p, s, why);
    if (err)
        return err;
    double whole_s = ((double)p->ping_samples - s->latency_samples) / s->sample_rate_hz -
                     s->chirp_duration_s;
    double path_m = 2.0 * reach_m + longest_direct_m(s);
    if (s->n_speakers > 1) /* then the next one is heard directly */
        whole_s = fmin(whole_s, slot_s(s) - BEFORE_S);
    r->until_s = fmin(path_m / s->sound_speed_m_s, whole_s);
    p->gate_s[0] = 0.0;
    p->gate_s[1] = r->until_s;
    if (!(r->until_s > 0.0))
        return error_say(
            why, -EINVAL,
            "slot_samples: pings of %zu samples hold no echo of a wall whole",
            p->ping_samples);
    return 0;
}

/* The other chirp's direct sound: of this slot, and of the next if filters for an echo
 * reach as far. */
static int plan_crosstalk(struct wall_receiver *r, const struct survey *down,
                          double direct_s, struct error *why)
{
    struct survey flat[2] = {*r->survey, *down};
    struct wall_crosstalk_config cfg = {.sample_rate_hz = down->sample_rate_hz,
                                        .latency_samples = down->latency_samples,
                                        .n_samples = r->processing.ping_samples,
                                        .direct_s = direct_s,
                                        .slot_s = slot_s(down)};
    int err = 0;
    for (int k = 0; !err && k < 2; k++) {
        flat[k].n_microphones = 1;
        flat[k].n_responses = 0;
        cfg.chirps[k] = processing_chirp(&flat[k]);
        err = processing_compressor(&cfg.filters[k], &r->processing, &flat[k],
                                    WINDOW_HANN, why);
    }
    if (!err) {
        err = wall_crosstalk_create(&r->crosstalk, &cfg);
        if (err)
            error_say(why, err, "planning to tell two chirps at a time apart: %s",
                      strerror(-err));
    }
    pulse_compress_destroy(cfg.filters[0]);
    pulse_compress_destroy(cfg.filters[1]);
    return err;
}

/* Does a filter for an echo reach into the next slot? */
static bool hears_next(const struct wall_receiver *r)
{
    return r->until_s + r->survey->chirp_duration_s > slot_s(r->survey);
}

/* All that two chirps at a time bring directly has to be in the ping. */
static bool can_tell_apart(const struct wall_receiver *r, double direct_s)
{
    const struct survey *s = r->survey;
    double ping_s = ((double)r->processing.ping_samples - s->latency_samples) /
                    s->sample_rate_hz;
    double end_s = direct_s + (hears_next(r) ? slot_s(s) : 0.0);
    return s->chirp_alternates && !survey_overlaps(s) && direct_s < slot_s(s) &&
           end_s < ping_s;
}

/* Silence before the ping, and the gate on to the end of the next direct sound. */
static void extend(struct wall_receiver *r, double *direct_s)
{
    const struct survey *s = r->survey;
    struct processing *p = &r->processing;
    double band_hz = fabs(s->chirp_stop_hz - s->chirp_start_hz);
    r->lead = (size_t)ceil(LEAD / band_hz * s->sample_rate_hz);
    p->ping_samples += r->lead;
    *direct_s += (double)r->lead / s->sample_rate_hz;
    p->gate_s[1] = fmax(r->until_s + (double)r->lead / s->sample_rate_hz,
                        *direct_s + MARGIN_SAMPLES / s->sample_rate_hz);
    if (hears_next(r))
        p->gate_s[1] = slot_s(s) + *direct_s + MARGIN_SAMPLES / s->sample_rate_hz;
}

static double direct_s_of(const struct survey *s)
{
    return (longest_direct_m(s) + CLEARANCE_M) / s->sound_speed_m_s;
}

static int plan_reach(struct wall_receiver *r, const struct survey *s, double reach_m,
                      bool *apart, struct error *why)
{
    *r = (struct wall_receiver){
        .survey = s, .survey_id = survey_id(s), .reach_m = reach_m};
    int err = plan_gate(r, reach_m, why);
    if (err)
        return err;
    *apart = can_tell_apart(r, direct_s_of(s));
    if (s->together > 1 && !*apart)
        return error_say(why, -EINVAL,
                         "walls: two speakers at a time do not fit this slot, so that "
                         "none is heard; use longer slots, or name or give the walls");
    return 0;
}

int wall_receiver_reach(const struct survey *s, double reach_m, double *until_s,
                        bool *alone, struct error *why)
{
    struct wall_receiver r;
    bool apart;
    int err = plan_reach(&r, s, reach_m, &apart, why);
    *until_s = r.until_s;
    *alone = !err && !apart;
    return err;
}

static int plan_filters(struct wall_receiver *r, bool apart, struct error *why)
{
    const struct survey *s = r->survey;
    struct processing *p = &r->processing;
    struct survey down = *s; /* borrows: only for the chirp */
    down.chirp_start_hz = s->chirp_stop_hz;
    down.chirp_stop_hz = s->chirp_start_hz;
    double direct_s = direct_s_of(s);
    if (apart)
        extend(r, &direct_s);
    int err = processing_compressor(&r->compress[0], p, s, WINDOW_HANN, why);
    if (!err && s->chirp_alternates)
        err = processing_compressor(&r->compress[1], p, &down, WINDOW_HANN, why);
    if (!err && apart)
        err = plan_crosstalk(r, &down, direct_s, why);
    if (err)
        return err;
    pulse_compress_format(r->compress[0], &r->format);
    r->format.t0_s -= (double)r->lead / s->sample_rate_hz;
    size_t n = s->n_microphones * r->format.n_samples;
    r->padded = calloc(s->n_microphones * r->processing.ping_samples, sizeof *r->padded);
    r->traces = calloc(n, sizeof *r->traces);
    r->other = r->crosstalk ? calloc(n, sizeof *r->other) : NULL;
    if (!r->padded || !r->traces || (r->crosstalk && !r->other))
        return error_say(why, -ENOMEM, "not enough memory to look for walls");
    return 0;
}

int wall_receiver_open(struct wall_receiver *r, const struct survey *s, double reach_m,
                       const struct trace_format *given, struct error *why)
{
    bool apart;
    int err = plan_reach(r, s, reach_m, &apart, why);
    if (err)
        return err;
    r->compresses = !given || apart;
    if (r->compresses)
        err = plan_filters(r, apart, why);
    else
        r->format = *given;
    if (err)
        return err;
    r->arrivals = calloc(s->n_microphones, sizeof *r->arrivals);
    return r->arrivals ? 0
                       : error_say(why, -ENOMEM, "not enough memory to look for walls");
}

void wall_receiver_clear(struct wall_receiver *r)
{
    pulse_compress_destroy(r->compress[0]);
    pulse_compress_destroy(r->compress[1]);
    wall_crosstalk_destroy(r->crosstalk);
    free(r->padded);
    free(r->traces);
    free(r->other);
    free(r->arrivals);
    *r = (struct wall_receiver){.survey = NULL};
}

static bool is_usable(const struct wall_receiver *r, const struct ping *ping)
{
    const struct survey *s = r->survey;
    return (!ping->down || s->chirp_alternates) && ping->valid && ping->samples &&
           ping->survey_id == r->survey_id && ping->n_microphones == s->n_microphones &&
           ping->position < s->n_positions && ping->speaker < s->n_speakers;
}

static const float complex *compress(struct wall_receiver *r, const struct ping *ping)
{
    size_t need = r->processing.ping_samples, n_trace = r->format.n_samples;
    const float *x = ping->samples;
    size_t n = ping->n_samples;
    int own = ping->down ? 1 : 0;
    if (n < need || r->lead) {
        size_t held = n < need - r->lead ? n : need - r->lead;
        for (size_t m = 0; m < ping->n_microphones; m++) {
            float *to = r->padded + m * need + r->lead;
            memcpy(to, x + m * n, held * sizeof *x);
            memset(to + held, 0, (need - r->lead - held) * sizeof *x);
        }
        x = r->padded;
        n = need;
    }
    pulse_compress_execute(r->compress[own], x, n, r->traces);
    if (!r->crosstalk)
        return r->traces;
    pulse_compress_execute(r->compress[1 - own], x, n, r->other);
    for (size_t m = 0; m < ping->n_microphones; m++)
        wall_crosstalk_remove(r->crosstalk, own, r->traces + m * n_trace,
                              r->other + m * n_trace);
    return r->traces;
}

static bool is_silent(const float complex *trace, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (crealf(trace[i]) != 0.0f || cimagf(trace[i]) != 0.0f)
            return false;
    return true;
}

/* Behind the direct sound. */
static void pick(const struct wall_receiver *r, const struct ping *ping,
                 size_t microphone, const float complex *trace, struct wall_arrivals *out)
{
    double speaker_m[3], microphone_m[3];
    struct geometry g;
    processing_geometry(&g, r->survey);
    geometry_speaker(&g, ping->position, ping->speaker, speaker_m);
    geometry_microphone(&g, ping->position, ping->speaker, microphone, microphone_m);
    double direct_m = geometry_distance(speaker_m, microphone_m);
    const double path_m[2] = {
        direct_m + CLEARANCE_M,
        fmin(2.0 * r->reach_m + direct_m, r->until_s * r->survey->sound_speed_m_s)};
    out->n = (uint32_t)wall_echo_peaks(&r->format, trace, g.sound_speed_m_s, path_m,
                                       THRESHOLD_DB, RANGE_DB, out->peaks, WALL_PEAKS);
}

void wall_receiver_take(struct wall_receiver *r, const struct ping *ping,
                        const float complex *traces, struct wall_returns *out)
{
    size_t n = r->format.n_samples;
    *out = (struct wall_returns){.ping = *ping, .usable = is_usable(r, ping)};
    out->ping.samples = NULL;
    out->ping.clipped = out->ping.not_finite = NULL;
    if (r->compresses && out->usable)
        traces = compress(r, ping);
    out->usable = out->usable && traces;
    if (!out->usable)
        return;
    out->n_microphones = ping->n_microphones;
    out->at = r->arrivals;
    for (size_t m = 0; m < ping->n_microphones; m++) {
        struct wall_arrivals *a = &r->arrivals[m];
        *a = (struct wall_arrivals){.heard = !ping->not_finite[m] &&
                                             !is_silent(traces + m * n, n)};
        if (a->heard)
            pick(r, ping, m, traces + m * n, a);
    }
}
