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

#define DIRECT_S    0.25e-3 /* about where the direct sound is expected */
#define RISES_RATIO 2.0     /* noise that is so much louder is believed at once */
#define NOISE_PINGS 8.0     /* noise is a mean of so many */

struct microphone_state {
    unsigned missed; /* pings in a row */
    bool hears, said, covered, covered_said;
    double noise; /* power of a sample, a mean */
};

struct speaker_state {
    double power; /* of the loudest peak, when it sounded last */
    bool sounded, said, covered, covered_said;
};

struct self_test {
    const struct survey *survey;
    size_t n_samples, n_own;            /* of a ping, and ahead of the next emission */
    float *own;                         /* [n_microphones][n_samples]; then silence */
    struct pulse_compress *compress[2]; /* up, down */
    struct trace_format format;
    float complex *traces;                /* [n_microphones][format.n_samples] */
    struct microphone_state *microphones; /* [n_microphones] */
    struct speaker_state *speakers;       /* [n_speakers] */
    double *powers;                       /* [n_speakers], scratch */
    unsigned patience;                    /* pings that one may miss */

    float complex *whole; /* [n_microphones][format.n_samples]: with the next emission */
    struct noise_floor *floor;
    struct cover *cover;
    struct range_monitor *range;
    double *fresh, *direct; /* [n_microphones], scratch */
    bool *unfit, *usable;   /* [n_microphones] */
    bool has_noise;
};

static int plan(struct self_test *h, struct error *why)
{
    const struct survey *s = h->survey;
    struct survey down = *s; /* borrows: only for the chirp */
    double slot_s = (double)s->slot_samples / s->sample_rate_hz;
    double own =
        fmin((double)s->slot_samples + floor(s->latency_samples), (double)h->n_samples);
    struct processing p = {.band_hz = {fmin(s->chirp_start_hz, s->chirp_stop_hz),
                                       fmax(s->chirp_start_hz, s->chirp_stop_hz)},
                           .ping_samples = h->n_samples};
    double whole_s = ((double)h->n_samples - s->latency_samples) / s->sample_rate_hz -
                     s->chirp_duration_s;

    h->n_own = (size_t)own;
    p.gate_s[1] = fmin(slot_s, whole_s);
    if (!(p.gate_s[1] > 0.0))
        return error_say(why, -EINVAL, "pings of %zu samples hold no chirp whole",
                         h->n_samples);
    down.chirp_start_hz = s->chirp_stop_hz;
    down.chirp_stop_hz = s->chirp_start_hz;
    int err = processing_compressor(&h->compress[0], &p, s, WINDOW_HANN, why);
    if (!err && s->chirp_alternates)
        err = processing_compressor(&h->compress[1], &p, &down, WINDOW_HANN, why);
    if (err)
        return err;
    pulse_compress_format(h->compress[0], &h->format);
    h->patience = (unsigned)fmax(
        1.0, floor(DEAF_S / slot_s * (s->together > 1 ? (double)s->together : 1.0)));
    return 0;
}

static int create_cover(struct self_test *h, struct error *why)
{
    const struct survey *s = h->survey;
    double *m = calloc(s->n_speakers * s->n_microphones, sizeof *m);

    if (!m)
        return error_say(why, -ENOMEM, "not enough memory to see what is covered");
    for (size_t j = 0; j < s->n_speakers; j++)
        for (size_t i = 0; i < s->n_microphones; i++)
            m[j * s->n_microphones + i] =
                fmax(geometry_distance(s->speakers_m[j], s->microphones_m[i]), 0.01);
    int err = cover_create(&h->cover, s->n_speakers, s->n_microphones, m,
                           s->together > 1 ? CROSSTALK_DB : LATE_DB);
    free(m);
    return err ? error_say(why, err, "not enough memory to see what is covered") : 0;
}

/* Noise where images are made. */
static int create_floor(struct self_test *h, const double gate_s[2], struct error *why)
{
    const struct trace_format *f = &h->format;
    double from = ceil((gate_s[0] - f->t0_s) * f->rate_hz);
    double until = floor((gate_s[1] - f->t0_s) * f->rate_hz) + 1.0;
    const struct noise_floor_config cfg = {
        .n_speakers = h->survey->n_speakers,
        .n_channels = h->survey->n_microphones,
        .n_samples = f->n_samples,
        .from = (size_t)fmin(fmax(from, 0.0), (double)f->n_samples),
        .until = (size_t)fmin(fmax(until, 0.0), (double)f->n_samples)};
    int err = noise_floor_create(&h->floor, &cfg);

    if (err == -EINVAL)
        return error_say(why, err, "gate_m: of %g to %g ms after an emission %s",
                         1e3 * gate_s[0], 1e3 * gate_s[1], "no ping has any sound");
    return err ? error_say(why, err, "not enough memory for the level of noise") : 0;
}

static int create_levels(struct self_test *h, const struct range_config *cfg,
                         struct error *why)
{
    size_t n = h->survey->n_microphones;
    struct processing p;
    int err = processing_plan(&p, h->survey, why);

    if (err)
        return err;
    h->whole = calloc(n * h->format.n_samples, sizeof *h->whole);
    h->fresh = calloc(n, sizeof *h->fresh);
    h->direct = calloc(n, sizeof *h->direct);
    h->unfit = calloc(n, sizeof *h->unfit);
    h->usable = calloc(n, sizeof *h->usable);
    if (!h->whole || !h->fresh || !h->direct || !h->unfit || !h->usable)
        return error_say(why, -ENOMEM, "not enough memory for the level of noise");
    err = create_floor(h, p.gate_s, why);
    if (!err)
        err = create_cover(h, why);
    if (!err)
        err = range_monitor_create(&h->range, cfg, h->survey, &h->format, p.gate_m, why);
    return err;
}

int self_test_create(struct self_test **out, const struct range_config *cfg,
                     const struct survey *s, struct error *why)
{
    struct self_test *h = calloc(1, sizeof *h);

    *out = NULL;
    if (!h)
        return error_say(why, -ENOMEM, "not enough memory to judge the microphones");
    h->survey = s;
    h->n_samples = s->slot_samples + tail_samples(s);
    int err = plan(h, why);
    if (!err) {
        h->own = calloc(s->n_microphones * h->n_samples, sizeof *h->own);
        h->traces = calloc(s->n_microphones * h->format.n_samples, sizeof *h->traces);
        h->microphones = calloc(s->n_microphones, sizeof *h->microphones);
        h->speakers = calloc(s->n_speakers, sizeof *h->speakers);
        h->powers = calloc(s->n_speakers, sizeof *h->powers);
        if (!h->own || !h->traces || !h->microphones || !h->speakers || !h->powers)
            err = error_say(why, -ENOMEM, "not enough memory to judge the microphones");
    }
    if (!err)
        err = create_levels(h, cfg, why);
    if (err)
        self_test_destroy(h);
    else
        *out = h;
    return err;
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
static double least_power(struct self_test *h)
{
    size_t n = 0;

    for (size_t j = 0; j < h->survey->n_speakers; j++)
        if (h->speakers[j].sounded)
            h->powers[n++] = h->speakers[j].power;
    return n ? MUTE_RATIO * rank_double(h->powers, n, 3 * n / 4 + 1) : 0.0;
}

static bool is_mute(const struct self_test *h, size_t speaker, double least)
{
    const struct speaker_state *m = &h->speakers[speaker];
    return m->sounded && !m->covered && m->power <= least;
}

static bool is_deaf(const struct self_test *h, size_t mic)
{
    return h->microphones[mic].missed >= h->patience && !h->microphones[mic].covered;
}

static void add_note(char *note, size_t size, const char *format, size_t channel)
{
    size_t used = strlen(note);

    used += (size_t)snprintf(note + used, size - used, "%s", used ? "; " : "");
    if (used < size)
        snprintf(note + used, size - used, format, channel);
}

/* Cover comes and goes. */
static void notice_cover(struct self_test *h, char *note, size_t size)
{
    for (size_t m = 0; m < h->survey->n_microphones; m++) {
        struct microphone_state *e = &h->microphones[m];
        if (e->covered != e->covered_said)
            add_note(note, size,
                     e->covered ? "microphone %zu is covered"
                                : "microphone %zu is not covered any more",
                     m + 1);
        e->covered_said = e->covered;
    }
    for (size_t j = 0; j < h->survey->n_speakers; j++) {
        struct speaker_state *m = &h->speakers[j];
        if (m->covered != m->covered_said)
            add_note(note, size,
                     m->covered ? "speaker %zu is covered"
                                : "speaker %zu is not covered any more",
                     j + 1);
        m->covered_said = m->covered;
    }
}

/* For people they count from 1. */
static void notice(struct self_test *h, double least, char *note, size_t size)
{
    for (size_t m = 0; m < h->survey->n_microphones; m++) {
        if (!is_deaf(h, m) || h->microphones[m].said)
            continue;
        h->microphones[m].said = true;
        add_note(note, size, "microphone %zu hears no speaker", m + 1);
    }
    for (size_t j = 0; j < h->survey->n_speakers; j++) {
        if (!is_mute(h, j, least) || h->speakers[j].said)
            continue;
        h->speakers[j].said = true;
        add_note(note, size, "no microphone hears speaker %zu", j + 1);
    }
    notice_cover(h, note, size);
}

/* Would the direct sound of a speaker stand out of the noise of now at a microphone? */
static bool expects(const struct self_test *h, size_t speaker, size_t mic)
{
    return !h->has_noise ||
           cover_expects(h->cover, speaker, mic, h->microphones[mic].noise);
}

static bool expects_any(const struct self_test *h, size_t speaker)
{
    size_t m = 0;

    while (m < h->survey->n_microphones && !expects(h, speaker, m))
        m++;
    return m < h->survey->n_microphones;
}

static void listen(struct self_test *h, const struct ping *ping)
{
    size_t n_mics = h->survey->n_microphones, n = h->format.n_samples;
    struct speaker_state *speaker = &h->speakers[ping->speaker];
    double loudest = 0.0;

    for (size_t m = 0; m < n_mics; m++)
        memcpy(h->own + m * h->n_samples, ping->samples + m * h->n_samples,
               h->n_own * sizeof *h->own);
    pulse_compress_execute(h->compress[ping->down && h->compress[1]], h->own,
                           h->n_samples, h->traces);
    for (size_t m = 0; m < n_mics; m++) {
        double power = heard_power(h->traces + m * n, n);
        h->microphones[m].hears = power > 0.0;
        loudest = fmax(loudest, power);
    }
    if (loudest > 0.0 || expects_any(h, ping->speaker)) {
        speaker->sounded = true;
        speaker->power = loudest;
    }
    bool sounds = !is_mute(h, ping->speaker, least_power(h));
    for (size_t m = 0; sounds && m < n_mics; m++) {
        if (h->microphones[m].hears || ping->not_finite[m])
            h->microphones[m].missed = 0;
        else if (h->microphones[m].missed < h->patience && expects(h, ping->speaker, m))
            h->microphones[m].missed++;
    }
}

/* -- levels -----------------------------------------------------------------------------
 */

static void settle(double *mean, bool known, double value)
{
    *mean = known ? *mean + (value - *mean) / NOISE_PINGS : value;
}

/* Samples that are none tell nothing of the noise. */
static void measure_noise(struct self_test *h, size_t speaker)
{
    if (!noise_floor_execute(h->floor, speaker, h->whole, h->unfit, h->fresh))
        return;
    for (size_t m = 0; m < h->survey->n_microphones; m++)
        if (!isnan(h->fresh[m]))
            settle(&h->microphones[m].noise,
                   h->microphones[m].noise > 0.0 &&
                       h->fresh[m] < RISES_RATIO * h->microphones[m].noise,
                   h->fresh[m]);
    h->has_noise = true;
}

static void measure_direct(struct self_test *h, size_t speaker)
{
    const struct survey *s = h->survey;

    for (size_t m = 0; m < s->n_microphones; m++) {
        double delay_s = geometry_distance(s->speakers_m[speaker], s->microphones_m[m]) /
                         s->sound_speed_m_s;
        h->direct[m] = arrival_power(&h->format, h->whole + m * h->format.n_samples,
                                     delay_s - DIRECT_S, delay_s + DIRECT_S);
        h->fresh[m] = h->microphones[m].noise;
    }
    cover_take(h->cover, speaker, h->direct, h->fresh, h->unfit);
    for (size_t m = 0; m < s->n_microphones; m++)
        h->microphones[m].covered = cover_microphone(h->cover, m);
    for (size_t j = 0; j < s->n_speakers; j++)
        h->speakers[j].covered = cover_speaker(h->cover, j);
}

static void measure(struct self_test *h, const struct ping *ping)
{
    pulse_compress_execute(h->compress[ping->down && h->compress[1]], ping->samples,
                           h->n_samples, h->whole);
    for (size_t m = 0; m < h->survey->n_microphones; m++)
        h->unfit[m] = ping->not_finite[m];
    measure_noise(h, ping->speaker);
    if (!h->has_noise)
        return;
    measure_direct(h, ping->speaker);
    for (size_t m = 0; m < h->survey->n_microphones; m++)
        h->usable[m] = !h->unfit[m] && !h->microphones[m].covered;
    const struct range_ping heard = {
        .speaker = ping->speaker,
        .traces = h->whole,
        .noise = h->fresh,
        .usable = h->usable,
        .speaker_usable = !h->speakers[ping->speaker].covered};
    range_monitor_take(h->range, &heard);
}

void self_test_ping(struct self_test *h, const struct ping *ping,
                    struct self_test_faults *out, char *note, size_t note_size)
{
    if (ping->samples && ping->n_microphones == h->survey->n_microphones &&
        ping->n_samples == h->n_samples && ping->speaker < h->survey->n_speakers) {
        measure(h, ping);
        listen(h, ping);
    }
    *out = (struct self_test_faults){.of_microphones = h->survey->n_microphones};
    for (size_t m = 0; m < h->survey->n_microphones; m++)
        out->deaf += is_deaf(h, m);
    for (size_t m = 0; m < h->survey->n_microphones; m++)
        out->covered_microphones += h->microphones[m].covered;
    double least = least_power(h);
    for (size_t j = 0; j < h->survey->n_speakers; j++) {
        out->of_speakers += h->speakers[j].sounded;
        out->mute += is_mute(h, j, least);
        out->covered_speakers += h->speakers[j].covered;
    }
    notice(h, least, note, note_size);
}

void self_test_walls(struct self_test *h, const struct walls *walls)
{
    range_monitor_walls(h->range, walls);
}

/* Of the microphones of which it is known. */
static double mean_noise(const struct self_test *h)
{
    double sum = 0.0, n = 0.0;

    for (size_t m = 0; m < h->survey->n_microphones; m++) {
        sum += h->microphones[m].noise;
        n += h->microphones[m].noise > 0.0;
    }
    return n > 0.0 ? sum / n : NAN;
}

void self_test_levels(const struct self_test *h, struct self_test_levels *out)
{
    double noise = h->has_noise ? mean_noise(h) : NAN;
    struct range_levels r;

    range_monitor_levels(h->range, &r);
    *out = (struct self_test_levels){.noise_db = 10.0 * log10(noise),
                                     .direct_db = h->has_noise ? cover_snr_db(h->cover)
                                                               : NAN,
                                     .echo_db = 10.0 * log10(r.echo / noise),
                                     .range_m = r.range_m,
                                     .gate_m = r.gate_m,
                                     .limited = r.limited};
}

bool self_test_covers_microphone(const struct self_test *h, size_t microphone)
{
    return h->microphones[microphone].covered;
}

bool self_test_covers_speaker(const struct self_test *h, size_t speaker)
{
    return h->speakers[speaker].covered;
}

void self_test_destroy(struct self_test *h)
{
    if (!h)
        return;
    noise_floor_destroy(h->floor);
    cover_destroy(h->cover);
    range_monitor_destroy(h->range);
    free(h->whole);
    free(h->fresh);
    free(h->direct);
    free(h->unfit);
    free(h->usable);
    pulse_compress_destroy(h->compress[0]);
    pulse_compress_destroy(h->compress[1]);
    free(h->own);
    free(h->traces);
    free(h->microphones);
    free(h->speakers);
    free(h->powers);
    free(h);
}
