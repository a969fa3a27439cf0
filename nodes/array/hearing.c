#include "nodes/array/hearing.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/tail.h"
#include "msgs/tensor.h"
#include "nodes/rt/processing.h"

#define DEAF_S 0.07
/* A peak over the mean power.  Of N independent samples of noise the highest passes it
 * once in e^20 / N traces: of a thousand, every half a million. */
#define STANDS_OUT 20.0
/* Under the loudest quarter of the speakers: what still comes of the one before.  How far
 * each is from its nearest microphone makes less. */
#define MUTE_RATIO 1e-3

struct ear {
    unsigned missed; /* pings in a row */
    bool hears, told;
};

struct mouth {
    double power; /* of the loudest peak, when it sounded last */
    bool sounded, told;
};

struct hearing {
    const struct survey *survey;
    size_t n_samples, n_own;            /* of a ping, and ahead of the next emission */
    float *own;                         /* [n_microphones][n_samples]; then silence */
    struct pulse_compress *compress[2]; /* up, down */
    struct trace_format format;
    float complex *traces; /* [n_microphones][format.n_samples] */
    struct ear *ears;      /* [n_microphones] */
    struct mouth *mouths;  /* [n_speakers] */
    double *powers;        /* [n_speakers], scratch */
    unsigned patience;     /* pings that one may miss */
};

static int plan(struct hearing *h, struct complaint *why)
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
        return complain(why, -EINVAL, "pings of %zu samples hold no chirp whole",
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

int hearing_create(struct hearing **out, const struct survey *s, struct complaint *why)
{
    struct hearing *h = calloc(1, sizeof *h);

    if (!h)
        return complain(why, -ENOMEM, "not enough memory to judge the microphones");
    h->survey = s;
    h->n_samples = s->slot_samples + tail_samples(s);
    int err = plan(h, why);
    if (!err) {
        h->own = calloc(s->n_microphones * h->n_samples, sizeof *h->own);
        h->traces = calloc(s->n_microphones * h->format.n_samples, sizeof *h->traces);
        h->ears = calloc(s->n_microphones, sizeof *h->ears);
        h->mouths = calloc(s->n_speakers, sizeof *h->mouths);
        h->powers = calloc(s->n_speakers, sizeof *h->powers);
        if (!h->own || !h->traces || !h->ears || !h->mouths || !h->powers)
            err = complain(why, -ENOMEM, "not enough memory to judge the microphones");
    }
    if (err)
        hearing_destroy(h);
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

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* What a speaker has to be heard with. */
static double least_power(struct hearing *h)
{
    size_t n = 0;

    for (size_t j = 0; j < h->survey->n_speakers; j++)
        if (h->mouths[j].sounded)
            h->powers[n++] = h->mouths[j].power;
    qsort(h->powers, n, sizeof *h->powers, compare);
    return n ? MUTE_RATIO * h->powers[3 * n / 4] : 0.0;
}

static bool is_mute(const struct hearing *h, size_t speaker, double least)
{
    const struct mouth *m = &h->mouths[speaker];
    return m->sounded && m->power <= least;
}

static bool is_deaf(const struct hearing *h, size_t mic)
{
    return h->ears[mic].missed >= h->patience;
}

/* For people they count from 1. */
static void notice(struct hearing *h, double least, char *note, size_t size)
{
    for (size_t m = 0; m < h->survey->n_microphones; m++) {
        size_t used = strlen(note);
        if (!is_deaf(h, m) || h->ears[m].told)
            continue;
        h->ears[m].told = true;
        snprintf(note + used, size - used, "%smicrophone %zu hears no speaker",
                 used ? "; " : "", m + 1);
    }
    for (size_t j = 0; j < h->survey->n_speakers; j++) {
        size_t used = strlen(note);
        if (!is_mute(h, j, least) || h->mouths[j].told)
            continue;
        h->mouths[j].told = true;
        snprintf(note + used, size - used, "%sno microphone hears speaker %zu",
                 used ? "; " : "", j + 1);
    }
}

static void listen(struct hearing *h, const Anlos__Ping *ping, const float *samples)
{
    size_t n_mics = h->survey->n_microphones, n = h->format.n_samples;
    struct mouth *mouth = &h->mouths[ping->speaker];

    for (size_t m = 0; m < n_mics; m++)
        memcpy(h->own + m * h->n_samples, samples + m * h->n_samples,
               h->n_own * sizeof *h->own);
    pulse_compress_execute(h->compress[ping->down && h->compress[1]], h->own,
                           h->n_samples, h->traces);
    mouth->sounded = true;
    mouth->power = 0.0;
    for (size_t m = 0; m < n_mics; m++) {
        double power = heard_power(h->traces + m * n, n);
        h->ears[m].hears = power > 0.0;
        mouth->power = fmax(mouth->power, power);
    }
    bool sounds = !is_mute(h, ping->speaker, least_power(h));
    for (size_t m = 0; sounds && m < n_mics; m++) {
        bool fit = m >= ping->n_not_finite || !ping->not_finite[m];
        if (h->ears[m].hears || !fit)
            h->ears[m].missed = 0;
        else if (h->ears[m].missed < h->patience)
            h->ears[m].missed++;
    }
}

void hearing_ping(struct hearing *h, const Anlos__Ping *ping, struct hearing_faults *out,
                  char *note, size_t note_size)
{
    size_t extents[2];
    const float *samples = tensor_f32(ping->samples, 2, extents);

    if (samples && extents[0] == h->survey->n_microphones && extents[1] == h->n_samples &&
        ping->speaker < h->survey->n_speakers)
        listen(h, ping, samples);
    *out = (struct hearing_faults){.of_microphones = h->survey->n_microphones};
    for (size_t m = 0; m < h->survey->n_microphones; m++)
        out->deaf += is_deaf(h, m);
    double least = least_power(h);
    for (size_t j = 0; j < h->survey->n_speakers; j++) {
        out->of_speakers += h->mouths[j].sounded;
        out->mute += is_mute(h, j, least);
    }
    notice(h, least, note, note_size);
}

void hearing_destroy(struct hearing *h)
{
    if (!h)
        return;
    pulse_compress_destroy(h->compress[0]);
    pulse_compress_destroy(h->compress[1]);
    free(h->own);
    free(h->traces);
    free(h->ears);
    free(h->mouths);
    free(h->powers);
    free(h);
}
