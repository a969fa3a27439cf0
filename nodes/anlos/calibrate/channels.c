/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/channels.h"
#include "dsp/rank.h"
#include "nodes/anlos/calibrate/calibrate.h"
#include "nodes/anlos/calibrate/paths.h"

/* -- what is the matter with each channel, by each speaker in turn ----------------------
 */

struct diagnosis_channel {
    unsigned faults;      /* enum calibration_fault */
    size_t answers_as;    /* its own number, when it is in its place */
    double level_db;      /* against the median of its kind; -INFINITY: not heard */
    double noise;         /* over the median of its kind; NaN: there is none */
    double noise_rms;     /* of a microphone; 0: takes are equal */
    double overtone;      /* of a speaker, third over first; NaN: not looked at */
    size_t clipped_pings; /* of a microphone: speakers that make it clip */
    uint64_t not_finite;  /* of a microphone: samples that were no number */
};

struct diagnosis {
    size_t n_speakers, n_microphones;
    struct diagnosis_channel *speakers, *microphones;
    struct time_zero time_zero;
    size_t retaken;
    bool has_noise;      /* takes differ */
    bool has_overtones;  /* the chirp has some that can be heard */
    bool either_swapped; /* speakers as named or microphones in like manner: the arrivals
                            are the same */
};

/* Does each channel lead to its own element? */

#define TOLERANCE_M                                                                      \
    0.015 /* elements are not farther from where the survey has them; the                \
             arrivals' spread says nothing, for swaps make it wide */

struct wiring {
    const struct diagnosis *d;
    const struct path *paths;
    double speed_m_s, tolerance_s;
    double *heard, *expected; /* [n][n_others] */
};

/* out [n] of one kind, when the channels of the other lead to others_as[n_others]
 * (NULL: to their own elements). */
static int order(const struct wiring *w, bool microphones, const size_t *others_as,
                 struct channel_place *out)
{
    const struct diagnosis *d = w->d;
    size_t n = microphones ? d->n_microphones : d->n_speakers;
    size_t n_others = microphones ? d->n_speakers : d->n_microphones;
    for (size_t i = 0; i < n; i++)
        for (size_t o = 0; o < n_others; o++) {
            size_t at = others_as ? others_as[o] : o;
            size_t pair = microphones ? o * d->n_microphones + i
                                      : i * d->n_microphones + o;
            size_t place = microphones ? at * d->n_microphones + i
                                       : i * d->n_microphones + at;
            const struct diagnosis_channel *other = microphones ? &d->speakers[o]
                                                                : &d->microphones[o];
            const struct path *p = &w->paths[pair];
            bool counts = p->heard && !(other->faults & CALIBRATION_DEAD);
            w->heard[i * n_others + o] =
                counts ? p->arrival.time_s - d->time_zero.latency_s : NAN;
            w->expected[i * n_others + o] = w->paths[place].distance_m / w->speed_m_s;
        }
    return channel_order_find(n, n_others, w->heard, w->expected, w->tolerance_s, out);
}

/* Do all channels lead to their own elements? */
static bool take_map(const struct channel_place *places, size_t n, size_t *map)
{
    bool own = true;
    for (size_t i = 0; i < n; i++) {
        map[i] = places[i].answers_as;
        own &= map[i] == i;
    }
    return own;
}

struct maps {                                   /* where channels lead, [n] each */
    size_t *speakers, *microphones;             /* the others taken as they are */
    size_t *speakers_given, *microphones_given; /* the others' map taken */
    bool own_speakers, own_microphones;         /* nothing is swapped, then */
    bool own_speakers_given, own_microphones_given;
};

static int find_maps(const struct wiring *w, struct maps *m, struct channel_place *places)
{
    size_t n_speakers = w->d->n_speakers, n_microphones = w->d->n_microphones;
    if (order(w, false, NULL, places) < 0)
        return -ENOMEM;
    m->own_speakers = take_map(places, n_speakers, m->speakers);
    if (order(w, true, NULL, places) < 0)
        return -ENOMEM;
    m->own_microphones = take_map(places, n_microphones, m->microphones);
    if (order(w, false, m->microphones, places) < 0)
        return -ENOMEM;
    m->own_speakers_given = take_map(places, n_speakers, m->speakers_given);
    if (order(w, true, m->speakers, places) < 0)
        return -ENOMEM;
    m->own_microphones_given = take_map(places, n_microphones, m->microphones_given);
    return 0;
}

/* The explanation with fewest swaps: those of one kind, if they leave the other kind in
 * its places. */
static void choose(struct diagnosis *d, const struct maps *m)
{
    bool by_speakers = m->own_microphones_given, by_microphones = m->own_speakers_given;
    bool swapped = !m->own_speakers && !m->own_microphones;
    bool speakers = by_speakers || !by_microphones;
    d->either_swapped = swapped && by_speakers && by_microphones;
    for (size_t j = 0; j < d->n_speakers; j++)
        d->speakers[j].answers_as = speakers ? m->speakers[j] : j;
    for (size_t i = 0; i < d->n_microphones; i++)
        d->microphones[i].answers_as = speakers ? m->microphones_given[i]
                                                : m->microphones[i];
}

/* Fills in answers_as and either_swapped from the first arrivals (paths
 * [n_speakers][n_microphones]), the latency, and which channels are dead.  0, -ENOMEM. */
static int wiring_find(struct diagnosis *d, const struct path *paths, double speed_m_s)
{
    size_t n = d->n_speakers + d->n_microphones;
    size_t *indices = malloc(2 * n * sizeof *indices);
    struct channel_place *places = malloc(n * sizeof *places);
    struct wiring w = {.d = d,
                       .paths = paths,
                       .speed_m_s = speed_m_s,
                       .tolerance_s = TOLERANCE_M / speed_m_s};
    w.heard = malloc(d->n_speakers * d->n_microphones * sizeof *w.heard);
    w.expected = malloc(d->n_speakers * d->n_microphones * sizeof *w.expected);
    int err = indices && places && w.heard && w.expected ? 0 : -ENOMEM;
    if (!err) {
        struct maps m = {.speakers = indices,
                         .speakers_given = indices + d->n_speakers,
                         .microphones = indices + 2 * d->n_speakers,
                         .microphones_given = indices + 2 * d->n_speakers +
                                              d->n_microphones};
        err = find_maps(&w, &m, places);
        if (!err)
            choose(d, &m);
    }
    free(w.expected);
    free(w.heard);
    free(places);
    free(indices);
    return err;
}

#define DEAD_DB        -20.0 /* against the median: more is no matter of gain */
#define LEAST_HEARD    0.25  /* of the channels of the other kind that are alive */
#define NOISY          4.0   /* times the median: 12 dB */
#define NOISE_MATTERS  1e-3  /* of the sound's rms: less harms nothing */
#define DISTORTED      0.1   /* third overtone over the first */
#define OVERTONE_FLOOR 8.0   /* times the median amplitude of its trace */

struct maker {
    struct diagnosis *d;
    struct sounding *s;
    const struct survey *survey;
    struct path *first; /* [n_speakers][n_microphones]: first arrivals, wherever */
    double *scratch;    /* [n_speakers + n_microphones] */
};

static const struct path *first(const struct maker *k, size_t j, size_t m)
{
    return &k->first[j * k->survey->n_microphones + m];
}

static bool is_dead(const struct diagnosis_channel *c)
{
    return c->faults & CALIBRATION_DEAD;
}

/* -- level ------------------------------------------------------------------------------
 */

/* Of channel i over those others that are alive; spherical spreading taken out. */
static double level_db(const struct maker *k, bool microphone, size_t i)
{
    const struct diagnosis *d = k->d;
    size_t n = microphone ? d->n_speakers : d->n_microphones, heard = 0, alive = 0;
    for (size_t o = 0; o < n; o++) {
        const struct path *p = microphone ? first(k, o, i) : first(k, i, o);
        if (is_dead(microphone ? &d->speakers[o] : &d->microphones[o]))
            continue;
        alive++;
        if (p->heard)
            k->scratch[heard++] = 20.0 * log10(cabs(p->arrival.peak) * p->distance_m);
    }
    if (!heard || (double)heard < LEAST_HEARD * (double)alive)
        return -INFINITY;
    return rank_median(k->scratch, heard);
}

static void measure_levels(const struct maker *k, bool microphones)
{
    struct diagnosis_channel *c = microphones ? k->d->microphones : k->d->speakers;
    size_t n = microphones ? k->d->n_microphones : k->d->n_speakers, heard = 0;
    for (size_t i = 0; i < n; i++)
        c[i].level_db = level_db(k, microphones, i);
    for (size_t i = 0; i < n; i++)
        if (isfinite(c[i].level_db))
            k->scratch[heard++] = c[i].level_db;
    double usual_db = rank_median(k->scratch, heard);
    for (size_t i = 0; i < n; i++)
        c[i].level_db -= usual_db;
}

static void find_dead_of(const struct maker *k, bool microphones)
{
    struct diagnosis_channel *c = microphones ? k->d->microphones : k->d->speakers;
    size_t n = microphones ? k->d->n_microphones : k->d->n_speakers;
    measure_levels(k, microphones);
    for (size_t i = 0; i < n; i++)
        if (!(c[i].level_db >= DEAD_DB))
            c[i].faults |= CALIBRATION_DEAD;
}

static bool any_heard(const struct maker *k, bool microphone, size_t i)
{
    size_t n = microphone ? k->d->n_speakers : k->d->n_microphones;
    for (size_t o = 0; o < n; o++)
        if ((microphone ? first(k, o, i) : first(k, i, o))->heard)
            return true;
    return false;
}

/* Channels without any arrival are left out first: one that takes part in none with the
 * dead of the other kind is not dead itself. */
static void find_dead(const struct maker *k)
{
    struct diagnosis *d = k->d;
    for (size_t j = 0; j < d->n_speakers; j++)
        d->speakers[j].faults = any_heard(k, false, j) ? 0 : CALIBRATION_DEAD;
    for (size_t m = 0; m < d->n_microphones; m++)
        d->microphones[m].faults = any_heard(k, true, m) ? 0 : CALIBRATION_DEAD;
    find_dead_of(k, false);
    find_dead_of(k, true);
}

/* -- noise ------------------------------------------------------------------------------
 */
static double usual_rms(const struct maker *k, size_t j)
{
    size_t n = 0;
    for (size_t m = 0; m < k->d->n_microphones; m++)
        if (!is_dead(&k->d->microphones[m]))
            k->scratch[n++] = sounding_pair(k->s, j, m)->rms;
    return n ? rank_median(k->scratch, n) : 0.0;
}

/* A microphone's noise is the same whoever speaks. */
static void find_noisy_microphones(const struct maker *k)
{
    struct diagnosis *d = k->d;
    double loudness = 0.0;
    for (size_t j = 0; j < d->n_speakers; j++)
        loudness = fmax(loudness, usual_rms(k, j));
    for (size_t m = 0; m < d->n_microphones; m++) {
        for (size_t j = 0; j < d->n_speakers; j++)
            k->scratch[j] = sounding_pair(k->s, j, m)->noise_rms;
        d->microphones[m].noise_rms = rank_median(k->scratch, d->n_speakers);
        d->microphones[m].overtone = NAN;
        d->has_noise |= d->microphones[m].noise_rms > 0.0;
    }
    for (size_t m = 0; m < d->n_microphones; m++)
        k->scratch[m] = d->microphones[m].noise_rms;
    double usual = rank_median(k->scratch, d->n_microphones);
    for (size_t m = 0; m < d->n_microphones; m++) {
        struct diagnosis_channel *c = &d->microphones[m];
        c->noise = usual > 0.0 ? c->noise_rms / usual : NAN;
        if (c->noise_rms > NOISY * usual && c->noise_rms > NOISE_MATTERS * loudness)
            c->faults |= CALIBRATION_NOISY;
    }
}

/* A speaker's noise is heard by all, on top of their own, while it emits. */
static void find_noisy_speakers(const struct maker *k)
{
    struct diagnosis *d = k->d;
    for (size_t j = 0; j < d->n_speakers; j++) {
        struct diagnosis_channel *c = &d->speakers[j];
        double loudness = usual_rms(k, j);
        size_t n = 0, matters = 0;
        for (size_t m = 0; m < d->n_microphones; m++) {
            double noise = sounding_pair(k->s, j, m)->noise_rms;
            if (is_dead(&d->microphones[m]))
                continue;
            matters += noise > NOISE_MATTERS * loudness;
            k->scratch[n++] = noise / fmax(d->microphones[m].noise_rms, 1e-12);
        }
        d->has_noise |= matters > 0;
        c->noise = rank_median(k->scratch, n);
        if (c->noise > NOISY && 2 * matters > n)
            c->faults |= CALIBRATION_NOISY;
    }
}

/* -- clipping ---------------------------------------------------------------------------
 */
static void find_clipped_microphones(const struct maker *k)
{
    struct diagnosis *d = k->d;
    for (size_t m = 0; m < d->n_microphones; m++) {
        for (size_t j = 0; j < d->n_speakers; j++) {
            d->microphones[m].clipped_pings += sounding_pair(k->s, j, m)->clipped > 0;
            d->microphones[m].not_finite += sounding_pair(k->s, j, m)->not_finite;
        }
        if (d->microphones[m].clipped_pings)
            d->microphones[m].faults |= CALIBRATION_CLIPPED;
    }
}

/* An overtone that most microphones hear is the speaker's, or its amplifier's. */
static int find_clipped_speakers(const struct maker *k)
{
    const unsigned unfit = CALIBRATION_DEAD | CALIBRATION_CLIPPED | CALIBRATION_NOISY;
    struct diagnosis *d = k->d;
    double window_s = paths_window_s(k->survey);
    for (size_t j = 0; j < d->n_speakers; j++) {
        struct trace_format f;
        const float complex *y = sounding_overtones(k->s, j, &f);
        size_t n = 0;
        d->speakers[j].overtone = NAN;
        if (!y)
            continue;
        d->has_overtones = true;
        float *scratch = malloc(f.n_samples * sizeof *scratch);
        if (!scratch)
            return -ENOMEM;
        for (size_t m = 0; m < d->n_microphones; m++, y += f.n_samples) {
            const struct path *p = first(k, j, m);
            struct arrival a;
            if (!p->heard || d->microphones[m].faults & unfit)
                continue;
            double least = OVERTONE_FLOOR * arrival_floor(&f, y, scratch);
            bool heard = arrival_strongest(&f, y, p->arrival.time_s - window_s,
                                           p->arrival.time_s + window_s, &a) &&
                         cabs(a.peak) >= least;
            k->scratch[n++] = heard ? cabs(a.peak) / cabs(p->arrival.peak) : 0.0;
        }
        free(scratch);
        d->speakers[j].overtone = rank_median(k->scratch, n);
        if (d->speakers[j].overtone > DISTORTED)
            d->speakers[j].faults |= CALIBRATION_CLIPPED;
    }
    return 0;
}

/* -- polarity ---------------------------------------------------------------------------
 */
static int find_inverted(const struct maker *k)
{
    struct diagnosis *d = k->d;
    size_t n = d->n_speakers * d->n_microphones;
    double complex *peaks = calloc(n, sizeof *peaks);
    bool *inverted = calloc(d->n_speakers + d->n_microphones, sizeof *inverted);
    int err = peaks && inverted ? 0 : -ENOMEM;
    for (size_t p = 0; !err && p < n; p++)
        if (k->first[p].heard && !is_dead(&d->speakers[p / d->n_microphones]) &&
            !is_dead(&d->microphones[p % d->n_microphones]))
            peaks[p] = k->first[p].arrival.peak;
    if (!err)
        err = polarity_find(d->n_speakers, d->n_microphones, peaks, inverted,
                            inverted + d->n_speakers);
    for (size_t i = 0; !err && i < d->n_speakers; i++)
        d->speakers[i].faults |= inverted[i] ? CALIBRATION_INVERTED : 0;
    for (size_t i = 0; !err && i < d->n_microphones; i++)
        d->microphones[i].faults |= inverted[d->n_speakers + i] ? CALIBRATION_INVERTED
                                                                : 0;
    free(inverted);
    free(peaks);
    return err;
}

/* Levels once more, with the distances of the elements that the channels lead to. */
static void set_levels(const struct maker *k, const struct path *direct)
{
    struct diagnosis *d = k->d;
    for (size_t j = 0; j < d->n_speakers; j++)
        for (size_t m = 0; m < d->n_microphones; m++)
            k->first[j * d->n_microphones + m].distance_m =
                direct[d->speakers[j].answers_as * d->n_microphones +
                       d->microphones[m].answers_as]
                    .distance_m;
    measure_levels(k, false);
    measure_levels(k, true);
}

static int find_wiring(struct maker *k, double speed_m_s)
{
    struct path *direct = paths_direct(k->survey);
    int err = direct ? wiring_find(k->d, k->first, speed_m_s) : -ENOMEM;
    if (!err)
        set_levels(k, direct);
    free(direct);
    return err;
}

static int diagnose(struct maker *k, double speed_m_s)
{
    int err = paths_hear_first(k->first, k->s);
    if (err)
        return err;
    find_dead(k);
    find_noisy_microphones(k);
    find_noisy_speakers(k);
    find_clipped_microphones(k);
    err = find_clipped_speakers(k);
    if (!err)
        err = find_inverted(k);
    return err ? err : find_wiring(k, speed_m_s);
}

static int diagnosis_make(struct diagnosis *out, struct sounding *s, double speed_m_s,
                          struct error *why)
{
    const struct survey *survey = sounding_survey(s);
    struct maker k = {.d = out, .s = s, .survey = survey};
    *out = (struct diagnosis){.n_speakers = survey->n_speakers,
                              .n_microphones = survey->n_microphones,
                              .retaken = sounding_retaken(s)};
    out->speakers = calloc(out->n_speakers, sizeof *out->speakers);
    out->microphones = calloc(out->n_microphones, sizeof *out->microphones);
    k.first = paths_direct(survey);
    k.scratch = malloc((out->n_speakers + out->n_microphones) * sizeof *k.scratch);
    int err = out->speakers && out->microphones && k.first && k.scratch
                  ? 0
                  : error_say(why, -ENOMEM, "out of memory");
    if (!err)
        err = paths_fit_latency(k.first, s, speed_m_s, &out->time_zero, why);
    if (!err && diagnose(&k, speed_m_s) < 0)
        err = error_say(why, -ENOMEM, "out of memory");
    free(k.scratch);
    free(k.first);
    return err;
}

static void diagnosis_clear(struct diagnosis *d)
{
    free(d->speakers);
    free(d->microphones);
    *d = (struct diagnosis){.n_speakers = 0};
}

/* -- the subcommand ---------------------------------------------------------------------
 */

#define MOST_LINES 64 /* of more channels only those with a fault are shown */

/* "dead, answers as 3" */
static void print_state(size_t i, const struct diagnosis_channel *c)
{
    char state[STATE_SIZE];
    bool elsewhere = c->answers_as != i;
    if (c->faults || !elsewhere)
        printf("%s", state_print(c->faults, state));
    if (elsewhere)
        printf("%sanswers as %zu", c->faults ? ", " : "", c->answers_as);
    if (c->not_finite)
        printf(", %" PRIu64 " samples are no number", c->not_finite);
}

static void print_channel(const char *kind, size_t i, const struct diagnosis_channel *c,
                          bool has_noise)
{
    printf("  %-10s %3zu  ", kind, i);
    if (isfinite(c->level_db))
        printf("%+7.1f dB  ", c->level_db);
    else
        printf("%7s     ", "-");
    if (has_noise && isfinite(c->noise) && c->noise > 0.0)
        printf("%+7.1f dB  ", 20.0 * log10(c->noise));
    else
        printf("%7s     ", "-");
    if (isfinite(c->overtone))
        printf("%6.1f %%  ", 100.0 * c->overtone);
    else
        printf("%6s    ", "-");
    print_state(i, c);
    if (c->clipped_pings)
        printf(" (while %zu speakers emit)", c->clipped_pings);
    printf("\n");
}

static void print_kind(const char *kind, const struct diagnosis_channel *c, size_t n,
                       const struct diagnosis *d)
{
    bool all = d->n_speakers + d->n_microphones <= MOST_LINES;
    for (size_t i = 0; i < n; i++)
        if (all || c[i].faults || c[i].answers_as != i)
            print_channel(kind, i, &c[i], d->has_noise);
}

static void print(const struct session *s, struct diagnosis *d)
{
    printf("channels of %s, %zu takes\n", s->options->array, s->options->takes);
    printf("  %-10s %3s  %10s  %10s  %8s  state\n", "", "", "level", "noise", "overtone");
    print_kind("speaker", d->speakers, d->n_speakers, d);
    print_kind("microphone", d->microphones, d->n_microphones, d);
    if (!d->has_noise)
        printf("  noise cannot be told: %s\n",
               s->options->takes > 1 ? "all takes are the same" : "that takes --takes 2");
    if (!d->has_overtones)
        printf("  overtones cannot be told of this chirp\n");
    if (d->either_swapped)
        printf(
            "  or the speakers are right and the microphones swapped in like manner\n");
    session_print_retaken(d->retaken);
}

static bool is_bad(size_t i, const struct diagnosis_channel *c)
{
    return c->faults & ~(unsigned)CALIBRATION_INVERTED || c->answers_as != i ||
           c->not_finite;
}

struct count {
    size_t all, corrected, bad;
};

static void count(const struct diagnosis_channel *c, size_t n, struct count *out)
{
    for (size_t i = 0; i < n; i++) {
        bool bad = is_bad(i, &c[i]);
        out->all++;
        out->bad += bad;
        out->corrected += !bad && c[i].faults;
    }
}

static void name_bad(const char *kind, const struct diagnosis_channel *c, size_t n,
                     const char **joint)
{
    for (size_t i = 0; i < n; i++) {
        if (!is_bad(i, &c[i]))
            continue;
        printf("%s%s %zu (", *joint, kind, i);
        print_state(i, &c[i]);
        printf(")");
        *joint = ", ";
    }
}

static bool judge(const struct diagnosis *d, const char *file)
{
    struct count n = {0, 0, 0};
    const char *joint = "";
    count(d->speakers, d->n_speakers, &n);
    count(d->microphones, d->n_microphones, &n);
    if (!n.bad) {
        printf("good: all %zu channels are alive and in their places%s; it is in %s\n",
               n.all, n.corrected ? ", the inverted ones will be set right" : "", file);
        return true;
    }
    printf("bad: %zu of %zu channels have a fault: ", n.bad, n.all);
    name_bad("speaker", d->speakers, d->n_speakers, &joint);
    name_bad("microphone", d->microphones, d->n_microphones, &joint);
    printf("\nwith %s dead and noisy ones are left out and inverted ones set right; what "
           "answers from another place has to be rewired\n",
           file);
    return false;
}

static void keep(struct calibration *c, const struct diagnosis *d)
{
    for (size_t j = 0; j < d->n_speakers; j++)
        c->speakers[j].faults = d->speakers[j].faults;
    for (size_t m = 0; m < d->n_microphones; m++)
        c->microphones[m].faults = d->microphones[m].faults;
    c->has_channels = true;
}

int calibrate_channels(struct session *s, bool *good)
{
    struct sounding *sounding;
    struct diagnosis d = {0};
    int err = session_check(s);
    if (!err)
        err = sounding_take(&sounding, s->array, s->options->position, SIZE_MAX,
                            s->options->takes, &s->why);
    if (err)
        return err;
    err = diagnosis_make(&d, sounding, session_speed_m_s(s), &s->why);
    sounding_destroy(sounding);
    if (!err) {
        print(s, &d);
        keep(s->calibration, &d);
        err = session_save(s);
    }
    if (!err)
        *good = judge(&d, s->options->out);
    diagnosis_clear(&d);
    return err;
}
