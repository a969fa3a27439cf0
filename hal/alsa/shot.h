/* hal/alsa/shot.h -- the shot that a running sound card plays and records: its emissions
 * into the playback, its recording out of the capture, by the slot plan.  The recording
 * is a ring that holds a whole shot, and a second of an endless one.  The one who fires
 * and the one who moves the frames may be two threads: fire, halt, read, copy and release
 * belong to the first, the others to the second, which never waits for the first. */
#ifndef ANLOS_HAL_ALSA_SHOT_H
#define ANLOS_HAL_ALSA_SHOT_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "hal/alsa/slot_plan.h"
#include "hal/alsa/stream.h"
#include "hal/survey/rig_file.h"

/* What is to be emitted.  Each has a number: what is told of another one is void. */
struct alsa_order {
    uint16_t number;
    uint32_t *speakers; /* [n_speakers of the survey] */
    size_t n_speakers;  /* 0: none */
    bool endless, silence_first;
};

struct alsa_shot {
    const struct rig *rig;
    struct slot_plan plan;
    float *emissions[2]; /* up, down: [n_emission], amplitude 1 */
    size_t n_emission;
    float *recording; /* [n_microphones][n_frames]: as the card gave it; frame n of
                        the shot at n % n_frames */
    size_t n_frames;
    _Atomic int64_t *t0_ns; /* [plan.max_slots]: of slot k at k % max_slots */
    pthread_mutex_t mutex;  /* of what is ordered */
    struct alsa_order ordered, under_way;
    bool ordered_anew;
    atomic_uint_fast64_t settled, released; /* slots, with the order's number */
};

/* rig is not copied.  0, -ENOMEM. */
int alsa_shot_create(struct alsa_shot *out, const struct rig *rig);

/* The shot before must be settled whole, or halted. */
void alsa_shot_fire(struct alsa_shot *s, const uint32_t *speakers, size_t n_speakers,
                    bool endless);

/* Nothing more of it is emitted but what is written ahead already, and the next shot
 * begins when that has faded away. */
void alsa_shot_halt(struct alsa_shot *s);

/* Slots of the shot that was fired last whose fate is known. */
size_t alsa_shot_settled(const struct alsa_shot *s);

/* The slot to be read in place of k: of an endless shot the newest one, when half of what
 * the ring holds has not been read; else k. */
size_t alsa_shot_newest(const struct alsa_shot *s, size_t k);

/* Of a settled slot: *t0_ns when it began; false: it is void. */
bool alsa_shot_read(const struct alsa_shot *s, size_t k, int64_t *t0_ns);

/* A settled slot and its tail, to out[n_microphones][slot_samples + tail_samples]. */
void alsa_shot_copy(const struct alsa_shot *s, size_t k, float *out);

/* The slots before k may be recorded over. */
void alsa_shot_release(struct alsa_shot *s, size_t k);

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

/* All before `frame` is recorded; frame 0 was at origin_ns.  true: a slot settled;
 * *n_void: so many that nobody had made room for. */
bool alsa_shot_heard(struct alsa_shot *s, uint64_t frame, int64_t origin_ns,
                     size_t *n_void);

/* The stream broke: nothing from `frame` on counts.  Returns the slots that makes void.
 */
size_t alsa_shot_break(struct alsa_shot *s, uint64_t frame, int64_t origin_ns);
void alsa_shot_clear(struct alsa_shot *s);

#endif
