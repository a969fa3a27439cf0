/* SPDX-License-Identifier: MIT */
#include "recon/frontend/self_test.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/arrival.h"
#include "dsp/cover.h"
#include "dsp/noise_floor.h"
#include "dsp/rank.h"
#include "recon/processing.h"
#include "recon/tail.h"

#define DEAF_S 0.07
/* A peak over the mean power.  Of N independent samples of noise the highest passes it
 * once in e^20 / N traces: of a thousand, every half a million. */
#define STANDS_OUT 20.0
/* Under the loudest quarter of the speakers: what still comes of the one before.  How far
 * each is from its nearest microphone makes less. */
#define MUTE_RATIO 1e-3

/* What is quieter than usual by so much may be another emission: the late echoes of the
 * one before, or the other chirp of the same slot. */
#define LATE_DB      35.0
#define CROSSTALK_DB 20.0

/* The next emission's direct sound: Hann's sidelobes are at -70 dB there, over the band.
 */
#define BEFORE 10.0

#define DIRECT_S    0.25e-3 /* about where the direct sound is expected */
#define TIMED_DB    25.0    /* over noise: so loud it has to be to say when it came */
#define RISES_RATIO 2.0     /* noise that is so much louder is believed at once */
#define NOISE_PINGS 8.0     /* noise is a mean of so many */

struct microphone_state {
    unsigned missed; /* pings in a row */
    bool hears, said, covered, covered_said, moved_said;
    double noise; /* power of a sample, a mean */
};

struct speaker_state {
    double power; /* of the loudest peak, when it sounded last */
    bool sounded, said, covered, covered_said, moved_said;
};

struct self_test {
    const struct survey *survey;
    size_t n_samples, n_own; /* of a ping, and ahead of the next emission */
    struct trace_format format;
    bool compresses;                    /* else it is given traces of this format */
    struct pulse_compress *compress[2]; /* up, down */
    float *own;                         /* [n_microphones][n_samples]; then silence */
    float complex *traces, *whole; /* [n_microphones][format.n_samples]: of what is its
                                    * own, and with the next emission */
    struct microphone_state *microphones; /* [n_microphones] */
    struct speaker_state *speakers;       /* [n_speakers] */
    double *powers;                       /* [n_speakers], scratch */
    unsigned patience;                    /* pings that one may miss */

    struct noise_floor *floor;
    struct cover *cover;
    struct displacement *displacement;
    struct range_monitor *range;
    double *fresh, *direct, *delay_s, *echo_s; /* [n_microphones], scratch */
    bool *unfit, *usable;                      /* [n_microphones] */
    bool has_noise;
    bool tone; /* one sounds */
};

static double slot_s(const struct survey *s)
{
    return (double)s->slot_samples / s->sample_rate_hz;
}

void self_test_reach(const struct survey *s, double *least_s, double *most_s)
{
    double longest_m = 0.0, shortest_m = INFINITY;

    for (size_t j = 0; j < s->n_speakers; j++)
        for (size_t i = 0; i < s->n_microphones; i++) {
            double m = geometry_distance(s->speakers_m[j], s->microphones_m[i]);
            longest_m = fmax(longest_m, m);
            shortest_m = fmin(shortest_m, m);
        }
    double next_s = slot_s(s) + shortest_m / s->sound_speed_m_s -
                    BEFORE / fabs(s->chirp_stop_hz - s->chirp_start_hz);
    double whole_s = ((double)(s->slot_samples + tail_samples(s)) - s->latency_samples) /
                         s->sample_rate_hz -
                     s->chirp_duration_s;
    *least_s = longest_m / s->sound_speed_m_s + DIRECT_S;
    *most_s = fmin(next_s, whole_s);
}

static int plan(struct self_test *t, struct error *why)
{
    const struct survey *s = t->survey;
    struct survey down = *s; /* borrows: only for the chirp */
    size_t n_mics = s->n_microphones;
    struct processing p = {.band_hz = {fmin(s->chirp_start_hz, s->chirp_stop_hz),
                                       fmax(s->chirp_start_hz, s->chirp_stop_hz)},
                           .ping_samples = t->n_samples};
    double whole_s = ((double)t->n_samples - s->latency_samples) / s->sample_rate_hz -
                     s->chirp_duration_s;

    t->n_own = (size_t)fmin((double)s->slot_samples + floor(s->latency_samples),
                            (double)t->n_samples);
    p.gate_s[1] = fmin(slot_s(s), whole_s);
    if (!(p.gate_s[1] > 0.0))
        return error_say(why, -EINVAL, "pings of %zu samples hold no chirp whole",
                         t->n_samples);
    down.chirp_start_hz = s->chirp_stop_hz;
    down.chirp_stop_hz = s->chirp_start_hz;
    int err = processing_compressor(&t->compress[0], &p, s, WINDOW_HANN, why);
    if (!err && s->chirp_alternates)
        err = processing_compressor(&t->compress[1], &p, &down, WINDOW_HANN, why);
    if (err)
        return err;
    pulse_compress_format(t->compress[0], &t->format);
    t->own = calloc(n_mics * t->n_samples, sizeof *t->own);
    t->traces = calloc(n_mics * t->format.n_samples, sizeof *t->traces);
    t->whole = calloc(n_mics * t->format.n_samples, sizeof *t->whole);
    return t->own && t->traces && t->whole
               ? 0
               : error_say(why, -ENOMEM, "not enough memory to judge the microphones");
}

static int create_cover(struct self_test *t, struct error *why)
{
    const struct survey *s = t->survey;
    double *m = calloc(s->n_speakers * s->n_microphones, sizeof *m);

    if (!m)
        return error_say(why, -ENOMEM, "not enough memory to see what is covered");
    for (size_t j = 0; j < s->n_speakers; j++)
        for (size_t i = 0; i < s->n_microphones; i++)
            m[j * s->n_microphones + i] =
                fmax(geometry_distance(s->speakers_m[j], s->microphones_m[i]), 0.01);
    int err = cover_create(&t->cover, s->n_speakers, s->n_microphones, m,
                           s->together > 1 ? CROSSTALK_DB : LATE_DB);
    free(m);
    return err ? error_say(why, err, "not enough memory to see what is covered") : 0;
}

/* Noise where images are made. */
static int create_floor(struct self_test *t, const double gate_s[2], struct error *why)
{
    const struct trace_format *f = &t->format;
    double from = ceil((gate_s[0] - f->t0_s) * f->rate_hz);
    double until = floor((gate_s[1] - f->t0_s) * f->rate_hz) + 1.0;
    const struct noise_floor_config cfg = {
        .n_speakers = t->survey->n_speakers,
        .n_channels = t->survey->n_microphones,
        .n_samples = f->n_samples,
        .from = (size_t)fmin(fmax(from, 0.0), (double)f->n_samples),
        .until = (size_t)fmin(fmax(until, 0.0), (double)f->n_samples)};
    int err = noise_floor_create(&t->floor, &cfg);

    if (err == -EINVAL)
        return error_say(why, err, "gate_m: of %g to %g ms after an emission %s",
                         1e3 * gate_s[0], 1e3 * gate_s[1], "no ping has any sound");
    return err ? error_say(why, err, "not enough memory for the level of noise") : 0;
}

static int create_levels(struct self_test *t, const struct range_config *cfg,
                         struct error *why)
{
    size_t n = t->survey->n_microphones;
    struct processing p;
    int err = processing_plan(&p, t->survey, why);

    if (err)
        return err;
    t->fresh = calloc(n, sizeof *t->fresh);
    t->direct = calloc(n, sizeof *t->direct);
    t->delay_s = calloc(n, sizeof *t->delay_s);
    t->echo_s = calloc(n, sizeof *t->echo_s);
    t->unfit = calloc(n, sizeof *t->unfit);
    t->usable = calloc(n, sizeof *t->usable);
    if (!t->fresh || !t->direct || !t->delay_s || !t->echo_s || !t->unfit || !t->usable)
        return error_say(why, -ENOMEM, "not enough memory for the level of noise");
    err = create_floor(t, p.gate_s, why);
    if (!err)
        err = create_cover(t, why);
    if (!err && displacement_create(&t->displacement, t->survey))
        err = error_say(why, -ENOMEM, "not enough memory to see what has moved");
    if (!err)
        err = range_monitor_create(&t->range, cfg, t->survey, &t->format, p.gate_m, why);
    return err;
}

int self_test_create(struct self_test **out, const struct range_config *cfg,
                     const struct survey *s, const struct trace_format *given,
                     struct error *why)
{
    struct self_test *t = calloc(1, sizeof *t);
    double together = s->together > 1 ? (double)s->together : 1.0;
    int err = 0;

    *out = NULL;
    if (!t)
        return error_say(why, -ENOMEM, "not enough memory to judge the microphones");
    t->survey = s;
    t->n_samples = s->slot_samples + tail_samples(s);
    t->patience = (unsigned)fmax(1.0, floor(DEAF_S / slot_s(s) * together));
    t->compresses = !given;
    if (given)
        t->format = *given;
    else
        err = plan(t, why);
    if (!err) {
        t->microphones = calloc(s->n_microphones, sizeof *t->microphones);
        t->speakers = calloc(s->n_speakers, sizeof *t->speakers);
        t->powers = calloc(s->n_speakers, sizeof *t->powers);
        if (!t->microphones || !t->speakers || !t->powers)
            err = error_say(why, -ENOMEM, "not enough memory to judge the microphones");
    }
    if (!err)
        err = create_levels(t, cfg, why);
    if (err)
        self_test_destroy(t);
    else
        *out = t;
    return err;
}

void self_test_inherit(struct self_test *t, struct self_test *before)
{
    struct microphone_state *microphones = t->microphones;
    struct speaker_state *speakers = t->speakers;
    struct cover *cover = t->cover;
    struct displacement *displacement = t->displacement;

    t->microphones = before->microphones;
    t->speakers = before->speakers;
    t->cover = before->cover;
    t->displacement = before->displacement;
    t->has_noise = before->has_noise;
    before->microphones = microphones;
    before->speakers = speakers;
    before->cover = cover;
    before->displacement = displacement;
    displacement_stand(t->displacement, t->survey);
    for (size_t m = 0; m < t->survey->n_microphones; m++)
        t->microphones[m].moved_said = displacement_microphone(t->displacement, m)->moved;
    for (size_t j = 0; j < t->survey->n_speakers; j++)
        t->speakers[j].moved_said = displacement_speaker(t->displacement, j)->moved;
    range_monitor_inherit(t->range, before->range);
}

/* The highest peak's power; 0: none stands out. */
static double heard_power(const float complex *y, size_t n)
{
    double sum = 0.0, most = 0.0;

    for (size_t i = 0; i < n; i++) {
        double re = crealf(y[i]), im = cimagf(y[i]), power = re * re + im * im;
        sum += power;
        most = power > most ? power : most;
    }
    return most * (double)n > STANDS_OUT * sum ? most : 0.0;
}

/* What a speaker has to be heard with. */
static double least_power(struct self_test *t)
{
    size_t n = 0;

    for (size_t j = 0; j < t->survey->n_speakers; j++)
        if (t->speakers[j].sounded)
            t->powers[n++] = t->speakers[j].power;
    return n ? MUTE_RATIO * rank_double(t->powers, n, 3 * n / 4 + 1) : 0.0;
}

static bool is_mute(const struct self_test *t, size_t speaker, double least)
{
    const struct speaker_state *s = &t->speakers[speaker];
    return s->sounded && !s->covered && s->power <= least;
}

static bool is_deaf(const struct self_test *t, size_t mic)
{
    return t->microphones[mic].missed >= t->patience && !t->microphones[mic].covered;
}

/* Cover comes and goes. */
static void notice_cover(struct self_test *t, char *note, size_t size)
{
    for (size_t m = 0; m < t->survey->n_microphones; m++) {
        struct microphone_state *state = &t->microphones[m];
        if (state->covered != state->covered_said)
            text_add(note, size, "; ",
                     state->covered ? "microphone %zu is covered"
                                    : "microphone %zu is not covered any more",
                     m + 1);
        state->covered_said = state->covered;
    }
    for (size_t j = 0; j < t->survey->n_speakers; j++) {
        struct speaker_state *state = &t->speakers[j];
        if (state->covered != state->covered_said)
            text_add(note, size, "; ",
                     state->covered ? "speaker %zu is covered"
                                    : "speaker %zu is not covered any more",
                     j + 1);
        state->covered_said = state->covered;
    }
}

/* Along which axes, and how far where that is not told. */
static void describe(const struct displacement_of *d, char *out, size_t size)
{
    int used = snprintf(out, size, "%.1f cm +- %.1f mm (x %+.0f, y %+.0f, z %+.0f mm",
                        1e2 * d->size_m, 1e3 * d->sigma_m, 1e3 * d->by_m[0],
                        1e3 * d->by_m[1], 1e3 * d->by_m[2]);

    snprintf(out + used, size - (size_t)used, d->across_m > 0.0 ? "; %.0f across%s" : ")",
             1e3 * d->across_m, ", the side is not heard)");
}

static void notice_one(const char *kind, size_t i, const struct displacement_of *d,
                       bool *said, char *note, size_t size)
{
    char text[160];

    if (d->moved == *said)
        return;
    *said = d->moved;
    describe(d, text, sizeof text);
    if (d->moved)
        text_add(note, size, "; ",
                 d->at_start ? "%s %zu stands beside where the survey has it by %s"
                             : "%s %zu has moved by %s",
                 kind, i + 1, text);
    else
        text_add(note, size, "; ", "%s %zu stands where it stood again", kind, i + 1);
}

static void notice_moves(struct self_test *t, char *note, size_t size)
{
    for (size_t m = 0; m < t->survey->n_microphones; m++)
        notice_one("microphone", m, displacement_microphone(t->displacement, m),
                   &t->microphones[m].moved_said, note, size);
    for (size_t j = 0; j < t->survey->n_speakers; j++)
        notice_one("speaker", j, displacement_speaker(t->displacement, j),
                   &t->speakers[j].moved_said, note, size);
}

/* For people they count from 1. */
static void notice(struct self_test *t, double least, char *note, size_t size)
{
    for (size_t m = 0; m < t->survey->n_microphones; m++) {
        if (!is_deaf(t, m) || t->microphones[m].said)
            continue;
        t->microphones[m].said = true;
        text_add(note, size, "; ", "microphone %zu hears no speaker", m + 1);
    }
    for (size_t j = 0; j < t->survey->n_speakers; j++) {
        if (!is_mute(t, j, least) || t->speakers[j].said)
            continue;
        t->speakers[j].said = true;
        text_add(note, size, "; ", "no microphone hears speaker %zu", j + 1);
    }
    notice_cover(t, note, size);
    notice_moves(t, note, size);
}

/* Would the direct sound of a speaker stand out of the noise of now at a microphone? */
static bool expects(const struct self_test *t, size_t speaker, size_t mic)
{
    return !t->has_noise ||
           cover_expects(t->cover, speaker, mic, t->microphones[mic].noise);
}

static bool expects_any(const struct self_test *t, size_t speaker)
{
    size_t m = 0;

    while (m < t->survey->n_microphones && !expects(t, speaker, m))
        m++;
    return m < t->survey->n_microphones;
}

/* Without what the next emission brought. */
static const float complex *compress_own(struct self_test *t, const struct ping *ping)
{
    for (size_t m = 0; m < t->survey->n_microphones; m++)
        memcpy(t->own + m * t->n_samples, ping->samples + m * t->n_samples,
               t->n_own * sizeof *t->own);
    pulse_compress_execute(t->compress[ping->down && t->compress[1]], t->own,
                           t->n_samples, t->traces);
    return t->traces;
}

/* As if nobody had been listened to yet. */
static void judge_nobody(struct self_test *t)
{
    for (size_t m = 0; m < t->survey->n_microphones; m++)
        t->microphones[m].missed = 0;
    for (size_t j = 0; j < t->survey->n_speakers; j++)
        t->speakers[j].sounded = false;
}

static void listen(struct self_test *t, const struct ping *ping,
                   const float complex *traces)
{
    size_t n_mics = t->survey->n_microphones, n = t->format.n_samples;
    struct speaker_state *speaker = &t->speakers[ping->speaker];
    double loudest = 0.0;
    size_t n_hear = 0;

    for (size_t m = 0; m < n_mics; m++) {
        double power = heard_power(traces + m * n, n);
        t->microphones[m].hears = power > 0.0;
        n_hear += power > 0.0;
        loudest = fmax(loudest, power);
    }
    if (t->tone && 2 * n_hear < n_mics) {
        judge_nobody(t);
        return;
    }
    if (loudest > 0.0 || expects_any(t, ping->speaker)) {
        speaker->sounded = true;
        speaker->power = loudest;
    }
    bool sounds = !is_mute(t, ping->speaker, least_power(t));
    for (size_t m = 0; sounds && m < n_mics; m++) {
        if (t->microphones[m].hears || ping->not_finite[m])
            t->microphones[m].missed = 0;
        else if (t->microphones[m].missed < t->patience && expects(t, ping->speaker, m))
            t->microphones[m].missed++;
    }
}

/* -- levels -----------------------------------------------------------------------------
 */

static void settle(double *mean, bool known, double value)
{
    *mean = known ? *mean + (value - *mean) / NOISE_PINGS : value;
}

/* Samples that are none tell nothing of the noise. */
static void measure_noise(struct self_test *t, size_t speaker,
                          const float complex *traces)
{
    if (!noise_floor_execute(t->floor, speaker, traces, t->unfit, t->fresh))
        return;
    for (size_t m = 0; m < t->survey->n_microphones; m++)
        if (!isnan(t->fresh[m]))
            settle(&t->microphones[m].noise,
                   t->microphones[m].noise > 0.0 &&
                       t->fresh[m] < RISES_RATIO * t->microphones[m].noise,
                   t->fresh[m]);
    t->has_noise = true;
}

static void measure_direct(struct self_test *t, size_t speaker,
                           const float complex *traces)
{
    const struct survey *s = t->survey;

    for (size_t m = 0; m < s->n_microphones; m++) {
        double delay_s = geometry_distance(s->speakers_m[speaker], s->microphones_m[m]) /
                         s->sound_speed_m_s;
        t->direct[m] = arrival_power(&t->format, traces + m * t->format.n_samples,
                                     delay_s - DIRECT_S, delay_s + DIRECT_S);
        t->fresh[m] = t->microphones[m].noise;
    }
    cover_take(t->cover, speaker, t->direct, t->fresh, t->unfit);
    for (size_t m = 0; m < s->n_microphones; m++)
        t->microphones[m].covered = cover_microphone(t->cover, m);
    for (size_t j = 0; j < s->n_speakers; j++)
        t->speakers[j].covered = cover_speaker(t->cover, j);
}

/* When what comes about then comes; NaN: it does not stand out of noise.  Of a covered
 * element the sound comes around what covers it. */
static double measure_delay(const struct self_test *t, size_t speaker, size_t m,
                            const float complex *traces, double way_m)
{
    const float complex *trace = traces + m * t->format.n_samples;
    double about_s = way_m / t->survey->sound_speed_m_s;
    double from_s = about_s - DIRECT_S, to_s = about_s + DIRECT_S;
    double least = pow(10.0, TIMED_DB / 10.0) * t->microphones[m].noise;
    struct arrival a;

    if (t->unfit[m] || t->microphones[m].covered || t->speakers[speaker].covered)
        return NAN;
    return arrival_power(&t->format, trace, from_s, to_s) > least &&
                   arrival_strongest(&t->format, trace, from_s, to_s, &a)
               ? a.time_s
               : NAN;
}

static void measure_delays(struct self_test *t, size_t speaker,
                           const float complex *traces)
{
    const struct survey *s = t->survey;
    const struct wall_gate *wall = range_monitor_wall(t->range);
    double image_m[3];

    if (wall)
        wall_mirror(&wall->plane, s->speakers_m[speaker], image_m);
    for (size_t m = 0; m < s->n_microphones; m++) {
        const double *at_m = s->microphones_m[m];
        t->delay_s[m] = measure_delay(t, speaker, m, traces,
                                      geometry_distance(s->speakers_m[speaker], at_m));
        t->echo_s[m] =
            wall ? measure_delay(t, speaker, m, traces, geometry_distance(image_m, at_m))
                 : NAN;
    }
    displacement_wall(t->displacement, wall);
    displacement_take(t->displacement, speaker, t->delay_s, t->echo_s);
}

static void measure(struct self_test *t, const struct ping *ping,
                    const float complex *traces, const float complex *imaged)
{
    for (size_t m = 0; m < t->survey->n_microphones; m++)
        t->unfit[m] = ping->not_finite[m];
    measure_noise(t, ping->speaker, imaged);
    if (!t->has_noise)
        return;
    measure_direct(t, ping->speaker, traces);
    measure_delays(t, ping->speaker, traces);
    for (size_t m = 0; m < t->survey->n_microphones; m++)
        t->usable[m] = !t->unfit[m] && !t->microphones[m].covered;
    const struct range_ping heard = {
        .speaker = ping->speaker,
        .traces = imaged,
        .noise = t->fresh,
        .usable = t->usable,
        .speaker_usable = !t->speakers[ping->speaker].covered};
    range_monitor_take(t->range, &heard);
}

static bool fits(const struct self_test *t, const struct ping *ping,
                 const float complex *traces)
{
    return (t->compresses ? ping->samples != NULL : traces != NULL) &&
           ping->n_microphones == t->survey->n_microphones &&
           ping->n_samples == t->n_samples && ping->speaker < t->survey->n_speakers;
}

void self_test_ping(struct self_test *t, const struct ping *ping,
                    const float complex *traces, const float complex *imaged,
                    struct self_test_faults *out, char *note, size_t note_size)
{
    if (fits(t, ping, traces) && t->compresses) {
        pulse_compress_execute(t->compress[ping->down && t->compress[1]], ping->samples,
                               t->n_samples, t->whole);
        measure(t, ping, t->whole, t->whole);
        listen(t, ping, compress_own(t, ping));
    } else if (fits(t, ping, traces)) {
        measure(t, ping, traces, imaged);
        listen(t, ping, traces);
    }
    *out = (struct self_test_faults){.of_microphones = t->survey->n_microphones,
                                     .speakers = t->survey->n_speakers};
    for (size_t m = 0; m < t->survey->n_microphones; m++) {
        out->deaf += is_deaf(t, m);
        out->covered_microphones += t->microphones[m].covered;
        out->moved_microphones += displacement_microphone(t->displacement, m)->moved;
    }
    double least = least_power(t);
    for (size_t j = 0; j < t->survey->n_speakers; j++) {
        out->of_speakers += t->speakers[j].sounded;
        out->mute += is_mute(t, j, least);
        out->covered_speakers += t->speakers[j].covered;
        out->moved_speakers += displacement_speaker(t->displacement, j)->moved;
    }
    notice(t, least, note, note_size);
}

void self_test_tone(struct self_test *t, bool sounds)
{
    t->tone = sounds;
}

void self_test_walls(struct self_test *t, const struct walls *walls)
{
    range_monitor_walls(t->range, walls);
}

/* Of the microphones of which it is known. */
static double mean_noise(const struct self_test *t)
{
    double sum = 0.0, n = 0.0;

    for (size_t m = 0; m < t->survey->n_microphones; m++) {
        sum += t->microphones[m].noise;
        n += t->microphones[m].noise > 0.0;
    }
    return n > 0.0 ? sum / n : NAN;
}

void self_test_levels(const struct self_test *t, struct self_test_levels *out)
{
    double noise = t->has_noise ? mean_noise(t) : NAN;
    struct range_levels r;

    range_monitor_levels(t->range, &r);
    *out = (struct self_test_levels){.noise_db = 10.0 * log10(noise),
                                     .direct_db = t->has_noise ? cover_snr_db(t->cover)
                                                               : NAN,
                                     .echo_db = 10.0 * log10(r.echo / noise),
                                     .range_m = r.range_m,
                                     .gate_m = r.gate_m,
                                     .limited = r.limited};
}

bool self_test_covers_microphone(const struct self_test *t, size_t microphone)
{
    return t->microphones[microphone].covered;
}

bool self_test_covers_speaker(const struct self_test *t, size_t speaker)
{
    return t->speakers[speaker].covered;
}

const struct displacement_of *self_test_moved_speaker(const struct self_test *t,
                                                      size_t speaker)
{
    return displacement_speaker(t->displacement, speaker);
}

const struct displacement_of *self_test_moved_microphone(const struct self_test *t,
                                                         size_t microphone)
{
    return displacement_microphone(t->displacement, microphone);
}

void self_test_destroy(struct self_test *t)
{
    if (!t)
        return;
    noise_floor_destroy(t->floor);
    cover_destroy(t->cover);
    displacement_destroy(t->displacement);
    range_monitor_destroy(t->range);
    free(t->whole);
    free(t->fresh);
    free(t->direct);
    free(t->delay_s);
    free(t->echo_s);
    free(t->unfit);
    free(t->usable);
    pulse_compress_destroy(t->compress[0]);
    pulse_compress_destroy(t->compress[1]);
    free(t->own);
    free(t->traces);
    free(t->microphones);
    free(t->speakers);
    free(t->powers);
    free(t);
}
