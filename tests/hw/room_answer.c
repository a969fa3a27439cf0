/* SPDX-License-Identifier: MIT */
#include "tests/hw/room_answer.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static float *answer_of(const struct room_answer *r, int pass, size_t position,
                        size_t speaker)
{
    const struct survey *s = room_survey(r->room);
    size_t i = ((size_t)pass * s->n_positions + position) * s->n_speakers + speaker;
    return r->answers + i * s->n_microphones * r->n_frames;
}

static void record_all(struct room_answer *r)
{
    const struct survey *s = room_survey(r->room);
    for (int pass = 0; pass < 2; pass++)
        for (size_t k = 0; k < s->n_positions; k++)
            for (uint32_t j = 0; j < s->n_speakers; j++)
                if (room_record(r->room, (enum pass)pass, k, &j, 1, 0,
                                answer_of(r, pass, k, j)))
                    abort();
}

/* Lindell 2019, Eq. 5. */
static void make_chirp(struct room_answer *r)
{
    const struct survey *s = room_survey(r->room);
    double rate = (s->chirp_stop_hz - s->chirp_start_hz) / s->chirp_duration_s;
    r->n_chirp = (size_t)llround(s->chirp_duration_s * s->sample_rate_hz);
    r->chirp = calloc(r->n_chirp, sizeof *r->chirp);
    for (size_t i = 0; r->chirp && i < r->n_chirp; i++) {
        double t = (double)i / s->sample_rate_hz;
        double x = cos(2 * M_PI * (s->chirp_start_hz + 0.5 * rate * t) * t);
        r->chirp[i] = (int32_t)rint(x * r->amplitude * 2147483647.0);
    }
}

void room_answer_create(struct room_answer *out, const char *scene, size_t n_channels,
                        const size_t *inputs, double amplitude)
{
    struct error why = {""};
    struct room_answer *r = out;
    memset(r, 0, sizeof *r);
    r->n_channels = n_channels;
    r->inputs = inputs;
    r->amplitude = amplitude;
    r->start = UINT64_MAX;
    if (room_load(&r->room, scene, &why)) {
        fprintf(stderr, "%s\n", why.text);
        abort();
    }
    const struct survey *s = room_survey(r->room);
    r->n_frames = room_frames(r->room, 1);
    r->answers = calloc(2 * s->n_positions * s->n_speakers * s->n_microphones,
                        r->n_frames * sizeof *r->answers);
    r->pending = calloc(r->n_frames, s->n_microphones * sizeof *r->pending);
    make_chirp(r);
    if (!r->answers || !r->pending || !r->chirp)
        abort();
    record_all(r);
}

static void begin(struct room_answer *r, uint64_t frame, size_t speaker)
{
    const struct survey *s = room_survey(r->room);
    const float *answer =
        answer_of(r, atomic_load(&r->pass), (size_t)atomic_load(&r->position), speaker);
    r->start = frame;
    r->speaker = speaker;
    for (size_t i = 0; i < r->n_frames; i++)
        for (size_t m = 0; m < s->n_microphones; m++)
            r->pending[(frame + i) % r->n_frames * s->n_microphones + m] +=
                answer[m * r->n_frames + i];
    atomic_fetch_add(&r->n_emissions, 1);
}

/* The first sample of a cosine is its greatest, so an emission begins loud. */
static void hear(struct room_answer *r, uint64_t frame, const int32_t *heard)
{
    size_t n_speakers = room_survey(r->room)->n_speakers, n_strange = 0;
    bool over = r->start == UINT64_MAX || frame - r->start >= r->n_chirp;
    for (size_t c = 0; over && c < n_speakers; c++)
        if (heard[c]) {
            begin(r, frame, c);
            over = false;
        }
    for (size_t c = 0; c < r->n_channels; c++) {
        double expected = !over && c == r->speaker ? r->chirp[frame - r->start] : 0;
        /* What the rig says in dB, and 24 bits of a float. */
        n_strange += fabs(heard[c] - expected) > 0x1p-20 * 2147483648.0;
    }
    atomic_fetch_add(&r->n_strange, n_strange);
}

void room_answer_give(void *ctx, uint64_t frame, const void *heard, void *answer,
                      size_t n)
{
    struct room_answer *r = ctx;
    size_t n_microphones = room_survey(r->room)->n_microphones;
    for (size_t i = 0; i < n; i++) {
        int32_t *out = (int32_t *)answer + i * r->n_channels;
        hear(r, frame + i, (const int32_t *)heard + i * r->n_channels);
        float *now = r->pending + (frame + i) % r->n_frames * n_microphones;
        for (size_t m = 0; m < n_microphones; m++)
            out[r->inputs[m]] = (int32_t)lrintf(now[m] * 0x1p31f);
        memset(now, 0, n_microphones * sizeof *now);
    }
}

struct far_end *room_answer_start(struct room_answer *r, size_t ahead_frames)
{
    const struct far_end_config cfg = {
        .format = SND_PCM_FORMAT_S32,
        .n_channels = (unsigned)r->n_channels,
        .rate_hz = (unsigned)room_survey(r->room)->sample_rate_hz,
        .buffer_frames = 2 * ahead_frames,
        .ahead_frames = ahead_frames,
        .answer = room_answer_give,
        .ctx = r};
    return far_end_start(&cfg);
}

void room_answer_forget(struct room_answer *r)
{
    r->start = UINT64_MAX;
    memset(r->pending, 0,
           r->n_frames * room_survey(r->room)->n_microphones * sizeof *r->pending);
}

void room_answer_clear(struct room_answer *r)
{
    room_destroy(r->room);
    free(r->answers);
    free(r->pending);
    free(r->chirp);
}
