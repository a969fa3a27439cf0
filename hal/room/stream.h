/* SPDX-License-Identifier: MIT */
/* hal/room/stream.h -- an endless shot in a simulated room, or a continuous scan: a
 * speaker a slot (two that share one) round after round, each emission from where
 * everything is at its own time, and what rings on of those before it.  Slots and
 * directions as recon/survey.h says. */
#ifndef ANLOS_HAL_ROOM_STREAM_H
#define ANLOS_HAL_ROOM_STREAM_H

#include <stddef.h>
#include <stdint.h>

#include "hal/room/room.h"

struct room_stream;

struct room_stream_config {
    enum pass pass;
    const uint32_t *speakers; /* [n_speakers] of a round; copied */
    size_t n_speakers;
    double start_s; /* world time of the first sample */
    /* Of a continuous scan: the position that the first round belongs to, where the stage
     * is at the first sample and how fast it goes; and its number, for another noise. */
    size_t position;
    double stage_m, stage_m_s;
    uint32_t take;
    uint64_t n_emissions; /* no more; 0: without end */
};

/* The room must outlive it and do nothing else meanwhile.  0, -EINVAL (no such speaker,
 * none), -ENOMEM. */
int room_stream_create(struct room_stream **out, struct room *r,
                       const struct room_stream_config *cfg);

/* Samples from the first sample of the stream to the start of emission n, which is number
 * n % n_speakers of round n / n_speakers. */
uint64_t room_stream_start(const struct room_stream *s, uint64_t n);

/* The ping of emission n: *samples [n_microphones][room_frames(1)], valid until the next
 * call.  n must not fall; what is left out is not rendered unless it rings on into n.
 * Costs one emission.  0, -EINVAL (n fell), -ENOMEM. */
int room_stream_ping(struct room_stream *s, uint64_t n, const float **samples);
void room_stream_destroy(struct room_stream *s);

/* Of a continuous scan that goes as its survey says a round of all speakers, with what
 * rings on of the one before: samples [n_microphones][room_frames(n_speakers)], in which
 * behind its slots those of the next begin.  0, -EINVAL (there is no such round, or the
 * stage stops), -ENOMEM. */
int room_stream_round(struct room *r, enum pass pass, size_t round, float *samples);

#endif
