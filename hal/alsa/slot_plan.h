/* hal/alsa/slot_plan.h -- which frames of a running stream belong to which emission of a
 * shot. Slot k of a shot begins slot_samples after slot k-1; what is recorded of it is
 * the slot and the tail behind it, into which the next slot's emission falls.  Frames
 * count from the start of the stream, and playback frame n is heard in capture frame n.
 *
 * When the stream breaks, slots that were recorded whole stay good, those that had begun
 * are void, and those that had not are placed anew after the restart. */
#ifndef ANLOS_HAL_ALSA_SLOT_PLAN_H
#define ANLOS_HAL_ALSA_SLOT_PLAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct slot_plan {
    size_t slot_samples, tail_samples;
    size_t n_slots;   /* of the shot; 0: none is loaded */
    size_t first;     /* slots from here on lie at the origin */
    uint64_t origin;  /* frame at which slot `first` begins */
    size_t n_settled; /* slots whose fate is known; all of them: the shot is over */
    bool placed;      /* there is an origin */
    bool *valid;      /* [max_slots], of the slots settled */
};

/* A stretch of frames that both a transfer and the plan have. */
struct slot_piece {
    size_t at;     /* frames after the first of the transfer */
    size_t n;      /* frames; 0: none */
    size_t slot;   /* that it begins in */
    size_t offset; /* of its first frame: in the emission, or in the recording */
};

/* tail_samples at most slot_samples.  0, -ENOMEM. */
int slot_plan_create(struct slot_plan *out, size_t slot_samples, size_t tail_samples,
                     size_t max_slots);

/* A new shot, not yet placed. */
void slot_plan_load(struct slot_plan *p, size_t n_slots);

/* Puts what is left of the shot at a frame that has not been played yet. */
void slot_plan_place(struct slot_plan *p, uint64_t frame);

/* The first stretch of an emission of n_emission (at most slot_samples) within the n
 * frames from `frame` on. */
struct slot_piece slot_plan_emission(const struct slot_plan *p, uint64_t frame, size_t n,
                                     size_t n_emission);

/* The stretch that is recorded: offset counts in the recording of the whole shot, where
 * slot k begins at k * slot_samples. */
struct slot_piece slot_plan_recording(const struct slot_plan *p, uint64_t frame,
                                      size_t n);

/* All frames before `frame` have been recorded.  true: that settled a slot. */
bool slot_plan_heard(struct slot_plan *p, uint64_t frame);

/* Nothing is recorded from `frame` on.  Returns how many slots that makes void. */
size_t slot_plan_break(struct slot_plan *p, uint64_t frame);
void slot_plan_clear(struct slot_plan *p);

#endif
