#include "nodes/array/hearing.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/cover.h"
#include "dsp/noise_floor.h"
#include "hal/tail.h"
#include "msgs/tensor.h"
#include "nodes/rt/processing.h"
#include "nodes/rt/walls.h"
#include "recon/detection_range.h"

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
#define ECHO_M      0.5     /* of a path, about the wall's: what a vehicle moves */
#define UNSEEN_S    1.0
#define RISES_RATIO 2.0 /* noise that is so much louder is believed at once */
#define ECHO_LEAST  1.0 /* over noise: less is none */
#define CLEAR_M     0.1 /* of a path, behind the direct sound's */
#define WALK_M_S    1.2
#define NOISE_PINGS 8.0  /* noise is a mean of so many */
#define ECHO_PINGS  32.0 /* the reference, which walls change, not weather */

struct ear {
    unsigned missed; /* pings in a row */
    bool hears, told, covered, covered_told;
    double noise; /* power of a sample, a mean */
};

struct mouth {
    double power; /* of the loudest peak, when it sounded last */
    bool sounded, told, covered, covered_told;
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

    struct hearing_config cfg;
    float complex *whole; /* [n_microphones][format.n_samples]: with the next emission */
    struct noise_floor *floor;
    struct cover *cover;
    double *fresh, *direct; /* [n_microphones], scratch */
    bool *unfit;            /* [n_microphones] */
    struct walls walls;
    double gate_m;
    double echo_trace, echo, echo_noise; /* the wall's power in a trace; at 1 m, over
                                            what noise would be there */
    bool has_noise, has_echo, limited;
    unsigned n_less; /* pings in a row with less range than the gate has */
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

/* Samples of a trace from one delay to another. */
static void samples_between(const struct hearing *h, const double delays_s[2],
                            size_t *from, size_t *until)
{
    const struct trace_format *f = &h->format;
    double a = ceil((delays_s[0] - f->t0_s) * f->rate_hz);
    double b = floor((delays_s[1] - f->t0_s) * f->rate_hz) + 1.0;

    *from = (size_t)fmin(fmax(a, 0.0), (double)f->n_samples);
    *until = (size_t)fmin(fmax(b, 0.0), (double)f->n_samples);
}

static int create_cover(struct hearing *h)
{
    const struct survey *s = h->survey;
    double *m = calloc(s->n_speakers * s->n_microphones, sizeof *m);

    if (!m)
        return -ENOMEM;
    for (size_t j = 0; j < s->n_speakers; j++)
        for (size_t i = 0; i < s->n_microphones; i++)
            m[j * s->n_microphones + i] =
                fmax(geometry_distance(s->speakers_m[j], s->microphones_m[i]), 0.01);
    int err = cover_create(&h->cover, s->n_speakers, s->n_microphones, m,
                           s->together > 1 ? CROSSTALK_DB : LATE_DB);
    free(m);
    return err;
}

/* Noise where images are made. */
static int create_levels(struct hearing *h)
{
    const struct survey *s = h->survey;
    struct noise_floor_config cfg = {.n_speakers = s->n_speakers,
                                     .n_channels = s->n_microphones,
                                     .n_samples = h->format.n_samples};
    struct processing p;
    struct complaint ignored;

    if (processing_plan(&p, s, &ignored))
        return 0;
    h->gate_m = p.gate_m[1];
    samples_between(h, p.gate_s, &cfg.from, &cfg.until);
    if (cfg.from >= cfg.until)
        return 0;
    h->whole = calloc(s->n_microphones * h->format.n_samples, sizeof *h->whole);
    h->fresh = calloc(s->n_microphones, sizeof *h->fresh);
    h->direct = calloc(s->n_microphones, sizeof *h->direct);
    h->unfit = calloc(s->n_microphones, sizeof *h->unfit);
    if (!h->whole || !h->fresh || !h->direct || !h->unfit)
        return -ENOMEM;
    int err = noise_floor_create(&h->floor, &cfg);
    return err ? err : create_cover(h);
}

void hearing_config_launch(struct hearing_config *cfg, const struct launchfile *l,
                           const struct survey *s)
{
    size_t of_a_round = l->scan.n_speakers ? l->scan.n_speakers : s->n_speakers;

    *cfg = (struct hearing_config){
        .ranges = l->scan.fixed,
        .n_pings = l->recon.frames.pings ? l->recon.frames.pings : of_a_round,
        .sum = l->recon.frames.sum,
        .false_alarm_rate = l->track.false_alarm_rate,
        .person_m = l->array.person_m};
}

int hearing_create(struct hearing **out, const struct hearing_config *cfg,
                   const struct survey *s, struct complaint *why)
{
    struct hearing *h = calloc(1, sizeof *h);

    if (!h)
        return complain(why, -ENOMEM, "not enough memory to judge the microphones");
    h->survey = s;
    h->cfg = *cfg;
    walls_from_survey(&h->walls, s);
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
    if (!err && create_levels(h))
        err = complain(why, -ENOMEM, "not enough memory for the level of noise");
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
    return m->sounded && !m->covered && m->power <= least;
}

static bool is_deaf(const struct hearing *h, size_t mic)
{
    return h->ears[mic].missed >= h->patience && !h->ears[mic].covered;
}

static void add_note(char *note, size_t size, const char *format, size_t channel)
{
    size_t used = strlen(note);

    used += (size_t)snprintf(note + used, size - used, "%s", used ? "; " : "");
    if (used < size)
        snprintf(note + used, size - used, format, channel);
}

/* Cover comes and goes. */
static void notice_cover(struct hearing *h, char *note, size_t size)
{
    for (size_t m = 0; m < h->survey->n_microphones; m++) {
        struct ear *e = &h->ears[m];
        if (e->covered != e->covered_told)
            add_note(note, size,
                     e->covered ? "microphone %zu is covered"
                                : "microphone %zu is not covered any more",
                     m + 1);
        e->covered_told = e->covered;
    }
    for (size_t j = 0; j < h->survey->n_speakers; j++) {
        struct mouth *m = &h->mouths[j];
        if (m->covered != m->covered_told)
            add_note(note, size,
                     m->covered ? "speaker %zu is covered"
                                : "speaker %zu is not covered any more",
                     j + 1);
        m->covered_told = m->covered;
    }
}

/* For people they count from 1. */
static void notice(struct hearing *h, double least, char *note, size_t size)
{
    for (size_t m = 0; m < h->survey->n_microphones; m++) {
        if (!is_deaf(h, m) || h->ears[m].told)
            continue;
        h->ears[m].told = true;
        add_note(note, size, "microphone %zu hears no speaker", m + 1);
    }
    for (size_t j = 0; j < h->survey->n_speakers; j++) {
        if (!is_mute(h, j, least) || h->mouths[j].told)
            continue;
        h->mouths[j].told = true;
        add_note(note, size, "no microphone hears speaker %zu", j + 1);
    }
    notice_cover(h, note, size);
}

/* Would the direct sound of a speaker stand out of the noise of now at a microphone? */
static bool expects(const struct hearing *h, size_t speaker, size_t mic)
{
    return !h->has_noise || cover_expects(h->cover, speaker, mic, h->ears[mic].noise);
}

static bool expects_any(const struct hearing *h, size_t speaker)
{
    size_t m = 0;

    while (m < h->survey->n_microphones && !expects(h, speaker, m))
        m++;
    return m < h->survey->n_microphones;
}

static void listen(struct hearing *h, const Anlos__Ping *ping, const float *samples)
{
    size_t n_mics = h->survey->n_microphones, n = h->format.n_samples;
    struct mouth *mouth = &h->mouths[ping->speaker];
    double loudest = 0.0;

    for (size_t m = 0; m < n_mics; m++)
        memcpy(h->own + m * h->n_samples, samples + m * h->n_samples,
               h->n_own * sizeof *h->own);
    pulse_compress_execute(h->compress[ping->down && h->compress[1]], h->own,
                           h->n_samples, h->traces);
    for (size_t m = 0; m < n_mics; m++) {
        double power = heard_power(h->traces + m * n, n);
        h->ears[m].hears = power > 0.0;
        loudest = fmax(loudest, power);
    }
    if (loudest > 0.0 || expects_any(h, ping->speaker)) {
        mouth->sounded = true;
        mouth->power = loudest;
    }
    bool sounds = !is_mute(h, ping->speaker, least_power(h));
    for (size_t m = 0; sounds && m < n_mics; m++) {
        bool fit = m >= ping->n_not_finite || !ping->not_finite[m];
        if (h->ears[m].hears || !fit)
            h->ears[m].missed = 0;
        else if (h->ears[m].missed < h->patience && expects(h, ping->speaker, m))
            h->ears[m].missed++;
    }
}

/* -- levels -----------------------------------------------------------------------------
 */

/* The highest power within a time about a delay. */
static double peak(const struct hearing *h, const float complex *trace, double delay_s,
                   double within_s)
{
    const double delays_s[2] = {delay_s - within_s, delay_s + within_s};
    size_t from, until;
    double most = 0.0;

    samples_between(h, delays_s, &from, &until);
    for (size_t i = from; i < until; i++) {
        double re = crealf(trace[i]), im = cimagf(trace[i]);
        most = fmax(most, re * re + im * im);
    }
    return most;
}

static double way_s(const struct hearing *h, const double from[3], const double to[3])
{
    return geometry_distance(from, to) / h->survey->sound_speed_m_s;
}

static void settle(double *mean, bool known, double value, double pings)
{
    *mean = known ? *mean + (value - *mean) / pings : value;
}

/* What the highest of the samples about an echo is over the mean power, of noise alone:
 * the mean of the highest of n exponential ones.  Every second sample is a new one. */
static double highest_of(const struct hearing *h, double within_m)
{
    double n = h->format.rate_hz * within_m / h->survey->sound_speed_m_s;

    return log(fmax(n, 1.0)) + 0.57722;
}

/* The first wall's echo, which would have the same power over all paths of 1 m. */
static void measure_echo(struct hearing *h, size_t speaker)
{
    const struct survey *s = h->survey;
    double trace = 0.0, sum = 0.0, noise = 0.0, image[3];
    size_t n = 0;

    if (!h->walls.n) /* none is known: the reference is what it was */
        return;
    wall_mirror(&h->walls.list[0].plane, s->speakers_m[speaker], image);
    for (size_t m = 0; m < s->n_microphones; m++) {
        double path_m = geometry_distance(image, s->microphones_m[m]);
        double direct_m = geometry_distance(s->speakers_m[speaker], s->microphones_m[m]);
        double delay_s = path_m / s->sound_speed_m_s;
        if (h->unfit[m] || h->ears[m].covered || path_m < direct_m + 2.0 * CLEAR_M ||
            delay_s * h->format.rate_hz > (double)h->format.n_samples)
            continue;
        double within_m = fmin(ECHO_M, path_m - direct_m - CLEAR_M);
        double power = peak(h, h->whole + m * h->format.n_samples, delay_s,
                            within_m / s->sound_speed_m_s);
        double of_noise = h->ears[m].noise * highest_of(h, within_m);
        trace += power;
        sum += (power - of_noise) * path_m * path_m;
        noise += h->ears[m].noise * path_m * path_m;
        n++;
    }
    if (!n || h->mouths[speaker].covered)
        return;
    settle(&h->echo_trace, h->has_echo, trace / (double)n, ECHO_PINGS);
    settle(&h->echo, h->has_echo, sum / (double)n, ECHO_PINGS);
    h->echo_noise = noise / (double)n;
    h->has_echo = true;
}

static void measure_noise(struct hearing *h, size_t speaker)
{
    if (!noise_floor_execute(h->floor, speaker, h->whole, h->fresh))
        return;
    for (size_t m = 0; m < h->survey->n_microphones; m++)
        settle(&h->ears[m].noise,
               h->has_noise && h->fresh[m] < RISES_RATIO * h->ears[m].noise, h->fresh[m],
               NOISE_PINGS);
    h->has_noise = true;
}

static void measure_direct(struct hearing *h, size_t speaker)
{
    const struct survey *s = h->survey;

    for (size_t m = 0; m < s->n_microphones; m++) {
        h->direct[m] = peak(h, h->whole + m * h->format.n_samples,
                            way_s(h, s->speakers_m[speaker], s->microphones_m[m]),
                            DIRECT_S);
        h->fresh[m] = h->ears[m].noise;
    }
    cover_take(h->cover, speaker, h->direct, h->fresh, h->unfit);
    for (size_t m = 0; m < s->n_microphones; m++)
        h->ears[m].covered = cover_microphone(h->cover, m);
    for (size_t j = 0; j < s->n_speakers; j++)
        h->mouths[j].covered = cover_speaker(h->cover, j);
}

/* Of the microphones that can be used: their mean over how many they are. */
static double noise_of_sum(const struct hearing *h)
{
    double sum = 0.0, n = 0.0;

    for (size_t m = 0; m < h->survey->n_microphones; m++)
        if (!h->unfit[m] && !h->ears[m].covered && h->ears[m].noise > 0.0) {
            sum += h->ears[m].noise;
            n += 1.0;
        }
    return n > 0.0 ? sum / (n * n) : NAN;
}

static double ping_s(const struct hearing *h)
{
    const struct survey *s = h->survey;

    return (double)s->slot_samples / s->sample_rate_hz /
           (s->together > 1 ? (double)s->together : 1.0);
}

/* Of a person who walks, in an image of powers. */
static double stay(const struct hearing *h)
{
    const struct survey *s = h->survey;
    double voxel_m = s->sound_speed_m_s / fabs(s->chirp_stop_hz - s->chirp_start_hz);

    return detection_range_stay(WALK_M_S, ping_s(h), voxel_m, h->cfg.n_pings);
}

static double range_m(const struct hearing *h)
{
    bool coherent = h->cfg.sum == FRAMES_COHERENT;
    size_t n = h->cfg.n_pings;
    const struct detection_range d = {.n_pings = coherent ? 1 : n,
                                      .false_alarm_rate = h->cfg.false_alarm_rate,
                                      .probability = HEARING_RANGE_PROBABILITY,
                                      .scattering_m = h->cfg.person_m,
                                      .stay = coherent ? 1.0 : stay(h)};

    if (!h->cfg.ranges || !h->has_noise || !h->has_echo)
        return NAN;
    double echo = h->echo > ECHO_LEAST * h->echo_noise ? h->echo : 0.0;
    return detection_range_m(&d, echo, noise_of_sum(h) / (coherent ? (double)n : 1.0));
}

static void measure(struct hearing *h, const Anlos__Ping *ping, const float *samples)
{
    if (!h->floor)
        return;
    pulse_compress_execute(h->compress[ping->down && h->compress[1]], samples,
                           h->n_samples, h->whole);
    for (size_t m = 0; m < h->survey->n_microphones; m++)
        h->unfit[m] = m < ping->n_not_finite && ping->not_finite[m];
    measure_noise(h, ping->speaker);
    if (!h->has_noise)
        return;
    measure_direct(h, ping->speaker);
    measure_echo(h, ping->speaker);
    double ratio = h->limited ? HEARING_CLEAR_RATIO : 1.0;
    bool less = range_m(h) < ratio * h->gate_m;
    h->n_less = less ? h->n_less + 1 : 0;
    h->limited = less && (h->limited || (double)h->n_less * ping_s(h) > HEARING_LESS_S);
}

void hearing_ping(struct hearing *h, const Anlos__Ping *ping, struct hearing_faults *out,
                  char *note, size_t note_size)
{
    size_t extents[2];
    const float *samples = tensor_f32(ping->samples, 2, extents);

    if (samples && extents[0] == h->survey->n_microphones && extents[1] == h->n_samples &&
        ping->speaker < h->survey->n_speakers) {
        measure(h, ping, samples);
        listen(h, ping, samples);
    }
    *out = (struct hearing_faults){.of_microphones = h->survey->n_microphones};
    for (size_t m = 0; m < h->survey->n_microphones; m++)
        out->deaf += is_deaf(h, m);
    for (size_t m = 0; m < h->survey->n_microphones; m++)
        out->covered_microphones += h->ears[m].covered;
    double least = least_power(h);
    for (size_t j = 0; j < h->survey->n_speakers; j++) {
        out->of_speakers += h->mouths[j].sounded;
        out->mute += is_mute(h, j, least);
        out->covered_speakers += h->mouths[j].covered;
    }
    notice(h, least, note, note_size);
}

void hearing_walls(struct hearing *h, const Anlos__WallList *list)
{
    struct complaint ignored;
    struct walls walls;

    if (walls_from_message(&walls, list, &ignored))
        return;
    if (walls.n &&
        (list->walls[0]->unseen_s > UNSEEN_S || list->walls[0]->existence < 0.5))
        walls.n = 0;
    h->walls = walls;
}

void hearing_levels(const struct hearing *h, struct hearing_levels *out)
{
    double sum = 0.0;

    *out = (struct hearing_levels){NAN, NAN, NAN, NAN, NAN, h->limited};
    if (h->cfg.ranges && h->gate_m > 0.0)
        out->gate_m = h->gate_m;
    if (!h->has_noise)
        return;
    for (size_t m = 0; m < h->survey->n_microphones; m++)
        sum += h->ears[m].noise;
    sum /= (double)h->survey->n_microphones;
    out->noise_db = 10.0 * log10(sum);
    out->direct_db = cover_snr_db(h->cover);
    out->echo_db = h->has_echo ? 10.0 * log10(h->echo_trace / sum) : NAN;
    out->range_m = fmin(range_m(h), out->gate_m);
    if (isnan(range_m(h)))
        out->range_m = NAN;
}

bool hearing_covers_microphone(const struct hearing *h, size_t microphone)
{
    return h->ears[microphone].covered;
}

bool hearing_covers_speaker(const struct hearing *h, size_t speaker)
{
    return h->mouths[speaker].covered;
}

void hearing_destroy(struct hearing *h)
{
    if (!h)
        return;
    noise_floor_destroy(h->floor);
    cover_destroy(h->cover);
    free(h->whole);
    free(h->fresh);
    free(h->direct);
    free(h->unfit);
    pulse_compress_destroy(h->compress[0]);
    pulse_compress_destroy(h->compress[1]);
    free(h->own);
    free(h->traces);
    free(h->ears);
    free(h->mouths);
    free(h->powers);
    free(h);
}
