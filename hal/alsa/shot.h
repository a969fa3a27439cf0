/* hal/alsa/shot.h -- the shot that a running sound card plays and records: its emissions
 * into the playback, its recording out of the capture, by the slot plan.  The one who
 * fires and the one who moves the frames may be two threads: fire and read belong to the
 * first, the others to the second. */
#ifndef ANLOS_HAL_ALSA_SHOT_H
#define ANLOS_HAL_ALSA_SHOT_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "hal/alsa/stream.h"
#include "hal/survey/rig_file.h"
#include "hal/alsa/slot_plan.h"

struct alsa_shot {
    const struct rig *rig;
    struct slot_plan plan;
    float *emission; /* [n_emission], amplitude 1 */
    size_t n_emission, n_frames;
    uint32_t *speakers;    /* [n_speakers of the survey] */
    float *recording;      /* [n_microphones][n_frames]: as the card gave it, slot after
                              slot, and the last one's tail */
    int64_t *t0_ns;        /* [n_speakers]: of each slot */
    atomic_bool fired;     /* and not yet begun */
    atomic_size_t n_fired; /* slots of it */
    atomic_size_t n_settled;
};

/* rig is not copied.  0, -ENOMEM. */
int alsa_shot_create(struct alsa_shot *out, const struct rig *rig);

/* The shot before must be settled whole. */
void alsa_shot_fire(struct alsa_shot *s, const uint32_t *speakers, size_t n_speakers);

/* Is slot k settled?  Then *valid says how, *t0_ns when it began, and its samples are at
 * recording + microphone * n_frames + k * slot_samples. */
bool alsa_shot_read(const struct alsa_shot *s, size_t k, bool *valid, int64_t *t0_ns);

/* A shot that was fired, or the rest of one that broke, begins at this frame. */
void alsa_shot_place(struct alsa_shot *s, uint64_t frame);

/* Silence, and what is emitted of the shot, into n frames of playback from number `frame`
 * on. */
void alsa_shot_fill(const struct alsa_shot *s, const struct alsa_stream *stream,
                    const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                    size_t n);
void alsa_shot_take(struct alsa_shot *s, const struct alsa_stream *stream,
                    const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                    size_t n);

/* All before `frame` is recorded; frame 0 was at origin_ns.  true: a slot settled. */
bool alsa_shot_heard(struct alsa_shot *s, uint64_t frame, int64_t origin_ns);

/* The stream broke: nothing from `frame` on counts.  Returns the slots that makes void.
 */
size_t alsa_shot_break(struct alsa_shot *s, uint64_t frame, int64_t origin_ns);
void alsa_shot_clear(struct alsa_shot *s);

#endif
