/* SPDX-License-Identifier: MIT */
/* hal/alsa/engine.h -- the thread that keeps a sound card going: silence between the
 * shots, a shot at the next free frame, a new start after a break, and new tries while
 * the card is gone.  The calls below are for one other thread. */
#ifndef ANLOS_HAL_ALSA_ENGINE_H
#define ANLOS_HAL_ALSA_ENGINE_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "hal/alsa/slot_plan.h"
#include "hal/array.h"
#include "hal/clock.h"
#include "hal/device.h"
#include "hal/survey/rig_file.h"

/* What the thread of a sound card has to tell: counts, whether the card is there, and
 * notices for a person.  Any thread may call any of it. */

enum alsa_count {
    ALSA_OVERRUNS,
    ALSA_UNDERRUNS,
    ALSA_STALLS,
    ALSA_SLOTS_INVALID,
    ALSA_RESTARTS,
    ALSA_REOPENED,
    ALSA_SLOTS_SKIPPED, /* recorded, but nobody took them in time */
    ALSA_COUNTS
};

enum { ALSA_NOTICES = 4 };

struct alsa_report {
    pthread_mutex_t mutex;
    atomic_uint_fast64_t counts[ALSA_COUNTS];
    int away; /* 0, or the errno of what is wrong */
    struct error condition;
    struct error notices[ALSA_NOTICES]; /* a ring; the oldest makes room */
    size_t first, n;
};

/* Adds n, and returns the sum. */
uint64_t alsa_report_count(struct alsa_report *r, enum alsa_count what, uint64_t n);
size_t alsa_report_counts(struct alsa_report *r,
                          struct device_count out[DEVICE_MAX_COUNTS]);

/* The oldest notice that was not taken yet.  false: none. */
bool alsa_report_take(struct alsa_report *r, struct error *out);

/* What was set last. */
int alsa_report_condition(struct alsa_report *r, struct error *why);

/* The shot that a running sound card plays and records: its emissions into the playback,
 * its recording out of the capture, by the slot plan.  The recording is a ring that
 * holds a whole shot, and a second of an endless one.  The one who fires and the one who
 * moves the frames may be two threads: fire, halt, read, copy and release belong to the
 * first, the others to the second, which never waits for the first. */

/* What is to be emitted.  Each has a number: what is told of another one is void. */
struct alsa_order {
    uint16_t number;
    uint32_t *speakers; /* [n_speakers of the survey] */
    size_t n_speakers;  /* 0: none */
    bool endless, silence_first;
    size_t n_rounds;  /* of a continuous one; 0: one */
    int64_t start_ns; /* its first slot, or as soon after; 0: as soon as can be */
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

/* The shot before must be settled whole, or halted. */
void alsa_shot_fire(struct alsa_shot *s, const struct array_shot *shot);

/* Nothing more of it is emitted but what is written ahead already, and the next shot
 * begins when that has faded away. */
void alsa_shot_halt(struct alsa_shot *s);

/* The slot to be read in place of k: of an endless shot the newest one, when half of what
 * the ring holds has not been read; else k. */
size_t alsa_shot_newest(const struct alsa_shot *s, size_t k);

/* Of a settled slot: *t0_ns when it began; false: it is void. */
bool alsa_shot_read(const struct alsa_shot *s, size_t k, int64_t *t0_ns);

/* A settled slot and its tail, to out[n_microphones][slot_samples + tail_samples]. */
void alsa_shot_copy(const struct alsa_shot *s, size_t k, float *out);

/* The slots before k may be recorded over. */
void alsa_shot_release(struct alsa_shot *s, size_t k);

struct alsa_engine;

/* Opens the device and starts the thread.  rig and clock must live on; the clock is asked
 * by the thread.  slots: of endless shots.  Errors are those of alsa_stream_open, and
 * -ENOMEM. */
int alsa_engine_create(struct alsa_engine **out, const char *device,
                       const struct rig *rig, const struct firing_slots *slots,
                       const struct clock_source *clock, struct error *why);

/* What it plays and records, to be fired and read. */
struct alsa_shot *alsa_engine_shot(struct alsa_engine *e);
struct alsa_report *alsa_engine_report(struct alsa_engine *e);

/* Waits until slot k of the shot is settled.  0, -EINTR (a signal), -EAGAIN (the card is
 * away; the error says what is done about it, and what is left of the shot follows
 * when it is back). */
int alsa_engine_wait(struct alsa_engine *e, size_t k, struct error *why);

/* Ends the thread within the time of a period, dropping what was not played. */
void alsa_engine_destroy(struct alsa_engine *e);

#endif
