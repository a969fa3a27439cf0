/* SPDX-License-Identifier: MIT */
#include "hal/room/stream.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "hal/room/room_state.h"

struct room_stream {
    struct room *room;
    struct room_stream_config cfg;
    uint64_t pass;      /* word of its noise */
    uint32_t *speakers; /* [n_speakers] */
    size_t n_speakers;
    size_t n_ping, n_line; /* samples */
    uint64_t base;         /* sample of the stream where the line begins */
    uint64_t next;         /* emission to render next */
    uint64_t next_slot;    /* of which to add the noise next */
    uint64_t *interferes;  /* [interferers.n]: emission of each to render next */
    uint64_t asked;        /* pings before this one may not be asked for */
    float *line;           /* [n_microphones][n_line] */
    float *ping;           /* [n_microphones][n_ping] */
};

int room_stream_create(struct room_stream **out, struct room *r,
                       const struct room_stream_config *cfg)
{
    *out = NULL;
    if (!cfg->n_speakers)
        return -EINVAL;
    for (size_t i = 0; i < cfg->n_speakers; i++)
        if (cfg->speakers[i] >= r->survey.n_speakers)
            return -EINVAL;
    struct room_stream *s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    size_t n_microphones = r->survey.n_microphones;
    s->room = r;
    s->cfg = *cfg;
    s->pass = (uint64_t)cfg->pass | (uint64_t)cfg->take << 8;
    s->n_speakers = cfg->n_speakers;
    s->n_ping = room_frames(r, 1);
    s->n_line = s->n_ping + r->n_heard + r->survey.slot_samples;
    s->speakers = malloc(cfg->n_speakers * sizeof *s->speakers);
    s->line = calloc(n_microphones * s->n_line, sizeof *s->line);
    s->ping = calloc(n_microphones * s->n_ping, sizeof *s->ping);
    s->interferes = calloc(r->interferers.n + 1, sizeof *s->interferes);
    if (!s->speakers || !s->line || !s->ping || !s->interferes) {
        room_stream_destroy(s);
        return -ENOMEM;
    }
    memcpy(s->speakers, cfg->speakers, cfg->n_speakers * sizeof *s->speakers);
    *out = s;
    return 0;
}

void room_stream_destroy(struct room_stream *s)
{
    if (!s)
        return;
    free(s->speakers);
    free(s->interferes);
    free(s->line);
    free(s->ping);
    free(s);
}

uint64_t room_stream_start(const struct room_stream *s, uint64_t n)
{
    const struct survey *survey = &s->room->survey;
    uint64_t round = n / s->n_speakers;
    uint64_t slot = round * survey_slots(survey, s->n_speakers) +
                    survey_slot_of(survey, n % s->n_speakers);
    return s->cfg.n_emissions ? slot * survey->slot_samples
                              : firing_start(&s->room->slots, slot);
}

/* Lets the line begin at a later sample. */
static void advance(struct room_stream *s, uint64_t base)
{
    uint64_t by = base - s->base;
    size_t keep = by < s->n_line ? s->n_line - (size_t)by : 0;
    for (size_t m = 0; m < s->room->survey.n_microphones; m++) {
        float *line = s->line + m * s->n_line;
        if (keep)
            memmove(line, line + by, keep * sizeof *line);
        memset(line + keep, 0, (s->n_line - keep) * sizeof *line);
    }
    s->base = base;
}

/* The noise of whole slots, up to a sample.  A slot that had begun before the line was
 * ignored. */
static void add_noise(struct room_stream *s, uint64_t until)
{
    const struct room *r = s->room;
    size_t slot_samples = r->survey.slot_samples;
    if (s->next_slot * slot_samples < s->base)
        s->next_slot = (s->base + slot_samples - 1) / slot_samples;
    for (; s->next_slot * slot_samples < until; s->next_slot++) {
        float *at = s->line + (size_t)(s->next_slot * slot_samples - s->base);
        uint64_t pass = s->pass, seed = r->scene->seed;
        double t_s = s->cfg.start_s +
                     (double)(s->next_slot * slot_samples) / r->survey.sample_rate_hz;
        noise_add(&r->noise, &r->drive, t_s,
                  (uint64_t[]){seed, ROOM_NOISE_STREAM, pass, s->next_slot}, 4, at,
                  s->n_line, slot_samples);
        faults_add_noise(&r->faults,
                         (uint64_t[]){seed, pass, ROOM_NOISE_STREAM, s->next_slot},
                         FAULTS_NO_SPEAKER, at, s->n_line, slot_samples);
    }
}

/* Heard sound [n_microphones][n] onto the line from a sample of the stream on; what comes
 * before the line is over. */
static void add_heard(struct room_stream *s, const float *heard, size_t n, int64_t start)
{
    int64_t base = (int64_t)s->base;
    size_t skip = start < base ? (size_t)(base - start) : 0;
    size_t at = start < base ? 0 : (size_t)(start - base);
    if (skip >= n || at >= s->n_line)
        return;
    size_t left = n - skip, room = s->n_line - at;
    for (size_t m = 0; m < s->room->survey.n_microphones; m++) {
        const float *from = heard + m * n + skip;
        float *line = s->line + m * s->n_line + at;
        for (size_t i = 0; i < left && i < room; i++)
            line[i] += from[i];
    }
}

static int add_emission(struct room_stream *s, uint64_t n)
{
    struct room *r = s->room;
    size_t index = (size_t)(n % s->n_speakers);
    uint64_t start = room_stream_start(s, n);
    double since_s = (double)start / r->survey.sample_rate_hz;
    struct room_emission e = {.pass = s->cfg.pass,
                              .speaker = s->speakers[index],
                              .down = survey_is_down(&r->survey, index),
                              .t_s = s->cfg.start_s + since_s,
                              .position = s->cfg.position + (size_t)(n / s->n_speakers),
                              .stage_m = s->cfg.stage_m + s->cfg.stage_m_s * since_s,
                              .stage_m_s = s->cfg.stage_m_s};
    int err = room_hear(r, &e);
    if (err)
        return err;
    size_t at = start < s->base ? 0 : (size_t)(start - s->base);
    add_heard(s, r->heard, r->n_heard, (int64_t)start);
    uint64_t words[] = {r->scene->seed, s->pass, ROOM_NOISE_STREAM, n};
    if (start >= s->base)
        faults_add_noise(&r->faults, words, e.speaker, s->line + at, s->n_line,
                         r->survey.slot_samples);
    return 0;
}

/* Its sound, by the microphones' cables. */
static void add_interferer(struct room_stream *s, size_t interferer, uint64_t until)
{
    struct room *r = s->room;
    struct interferers *all = &r->interferers;
    const struct interferer *i = &all->list[interferer];
    double rate_hz = r->survey.sample_rate_hz;
    double since_s = s->cfg.start_s + (double)s->base / rate_hz;
    double until_s = s->cfg.start_s + (double)until / rate_hz;
    uint64_t first = interferer_next(i, since_s - (double)all->n_heard / rate_hz);
    uint64_t *next = &s->interferes[interferer];
    struct interferer_emission e;
    *next = *next > first ? *next : first;
    for (;; ++*next) {
        interferer_emission(i, r->scene->drive->period_s, *next, &e);
        if (e.t_s >= until_s)
            break;
        double at = (e.t_s - s->cfg.start_s) * rate_hz;
        if (!e.sounds || at + (double)all->n_heard <= (double)s->base)
            continue;
        room_hear_interferer(r, interferer, e.speaker, e.t_s, at - floor(at));
        add_heard(s, all->heard, all->n_heard, (int64_t)floor(at));
    }
}

int room_stream_ping(struct room_stream *s, uint64_t n, const float **samples)
{
    struct room *r = s->room;
    uint64_t start = room_stream_start(s, n);
    if (n < s->asked)
        return -EINVAL;
    s->asked = n;
    bool longer = r->slots.jitter_samples || r->slots.stagger_samples;
    if (longer && start - s->base <= r->n_heard) /* between two pings, too */
        add_noise(s, start);
    advance(s, start);
    add_noise(s, start + s->n_ping);
    for (; room_stream_start(s, s->next) < start + s->n_ping; s->next++) {
        if (room_stream_start(s, s->next) + r->n_heard <= start ||
            (s->cfg.n_emissions && s->next >= s->cfg.n_emissions))
            continue;
        int err = add_emission(s, s->next);
        if (err)
            return err;
    }
    for (size_t i = 0; i < r->interferers.n && s->cfg.pass == PASS_SCENE; i++)
        add_interferer(s, i, start + s->n_ping);
    for (size_t m = 0; m < r->survey.n_microphones; m++)
        memcpy(s->ping + m * s->n_ping, s->line + m * s->n_line,
               s->n_ping * sizeof *s->ping);
    faults_limit(&r->faults, s->ping, s->n_ping, s->n_ping);
    *samples = s->ping;
    return 0;
}

int room_stream_round(struct room *r, enum pass pass, size_t round, float *samples)
{
    const struct survey *s = &r->survey;
    if (!s->continuous || round >= s->n_positions)
        return -EINVAL;
    uint32_t *speakers = malloc(s->n_speakers * sizeof *speakers);
    if (!speakers)
        return -ENOMEM;
    for (size_t j = 0; j < s->n_speakers; j++)
        speakers[j] = (uint32_t)j;
    const struct room_stream_config cfg = {.pass = pass,
                                           .speakers = speakers,
                                           .n_speakers = s->n_speakers,
                                           .stage_m = s->stage_positions_m[0],
                                           .stage_m_s = survey_speed_m_s(s),
                                           .n_emissions = s->n_positions * s->n_speakers};
    struct room_stream *stream = NULL;
    size_t n_ping = room_frames(r, 1), n = room_frames(r, s->n_speakers);
    uint64_t first = round * s->n_speakers;
    int err = room_stream_create(&stream, r, &cfg);
    for (uint64_t k = first; !err && k < first + s->n_speakers; k++) {
        const float *ping;
        err = room_stream_ping(stream, k, &ping);
        size_t at =
            (size_t)(room_stream_start(stream, k) - room_stream_start(stream, first));
        for (size_t m = 0; !err && m < s->n_microphones; m++)
            memcpy(samples + m * n + at, ping + m * n_ping, n_ping * sizeof *ping);
    }
    room_stream_destroy(stream);
    free(speakers);
    return err;
}
