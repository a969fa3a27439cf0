/* SPDX-License-Identifier: MIT */
/* hal/alsa/slot_plan.h -- which frames of a running stream belong to which emission of a
 * shot. Slot k of a shot begins slot_samples after slot k-1, or somewhat later in an
 * endless one (hal/survey/firing.h); what is recorded of it is slot_samples and the tail
 * behind them, into which the next slots' emissions fall; a slot's
 * emission may last longer than the slot, and sounds together with the next ones' then.
 * Frames count from the start of the stream, and playback frame n is heard in capture
 * frame n.
 *
 * When the stream breaks, slots that were recorded whole stay good, those that had begun
 * are void, and those that had not are placed anew after the restart. */
#ifndef ANLOS_HAL_ALSA_SLOT_PLAN_H
#define ANLOS_HAL_ALSA_SLOT_PLAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/survey/firing.h"

#define SLOT_PLAN_ENDLESS ((size_t)1 << 40) /* slots: 1000 years of 30 ms */

struct slot_plan {
    size_t slot_samples, tail_samples;
    struct firing_slots endless; /* of endless shots; may be set before one is loaded */
    struct firing_slots slots;   /* of the shot */
    size_t n_slots;              /* of the shot; 0: none is loaded */
    size_t first;                /* slots from here on lie at the origin */
    uint64_t origin;             /* frame at which slot `first` begins */
    size_t n_settled; /* slots whose fate is known; all of them: the shot is over */
    bool placed;      /* there is an origin */
    size_t gap[2];    /* of the recording, from and to: it was not kept */
    size_t max_slots;
    bool *valid; /* [max_slots], of the newest slots settled: slot k at k % max_slots */
};

/* A stretch of frames that both a transfer and the plan have. */
struct slot_piece {
    size_t at;     /* frames after the first of the transfer */
    size_t n;      /* frames; 0: none */
    size_t slot;   /* that it begins in */
    size_t offset; /* of its first frame: in the emission, or in the recording */
};

/* 0, -ENOMEM. */
int slot_plan_create(struct slot_plan *out, size_t slot_samples, size_t tail_samples,
                     size_t max_slots);

/* Frames from slot 0 to slot k, if no break comes between. */
uint64_t slot_plan_offset(const struct slot_plan *p, size_t k);

/* The frame at which a slot from `first` on begins. */
uint64_t slot_plan_start(const struct slot_plan *p, size_t k);

/* A new shot of n_slots, or SLOT_PLAN_ENDLESS, not yet placed. */
void slot_plan_load(struct slot_plan *p, size_t n_slots);

/* Puts what is left of the shot at a frame that has not been played yet. */
void slot_plan_place(struct slot_plan *p, uint64_t frame);

/* The slots, from *first to before *end, whose emission of n_emission sounds within the n
 * frames from `frame` on. */
void slot_plan_sounding(const struct slot_plan *p, uint64_t frame, size_t n,
                        size_t n_emission, size_t *first, size_t *end);

/* The stretch of such a slot's emission within these frames. */
struct slot_piece slot_plan_emission(const struct slot_plan *p, size_t slot,
                                     uint64_t frame, size_t n, size_t n_emission);

/* The stretch that is recorded: offset counts in the recording of the whole shot, where
 * slot k begins at slot_plan_offset(k). */
struct slot_piece slot_plan_recording(const struct slot_plan *p, uint64_t frame,
                                      size_t n);

/* The n frames at this offset of the recording had no room: the slots that need them will
 * be void. */
void slot_plan_lose(struct slot_plan *p, size_t offset, size_t n);

/* All frames before `frame` have been recorded.  Returns how many of the slots that
 * settles are void, of frames lost; n_settled tells how many there are. */
size_t slot_plan_heard(struct slot_plan *p, uint64_t frame);

/* Nothing is recorded from `frame` on.  Returns how many slots are void by that, and of
 * frames lost. */
size_t slot_plan_break(struct slot_plan *p, uint64_t frame);
void slot_plan_clear(struct slot_plan *p);

#endif
