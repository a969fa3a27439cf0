/* SPDX-License-Identifier: MIT */
/* hal/array.h -- the speaker and microphone array: emit a shot, get its pings, every
 * microphone on one clock.  A backend is a table of operations behind a URI:
 *   sim:scene.yaml            the simulated room (hal/room)
 *   wav:folder                a recording with its survey.yaml (hal/recording)
 *   alsa:hw:2,0?rig=rig.yaml  a sound card (hal/survey/rig_file)
 * URIs may carry options: "sim:scene.yaml?pace=real", "wav:rec?background=rec_bg".
 * Of `sim` and `alsa` hal/survey/firing.h has those that say how the speakers fire.
 * "calibrated=FILE" sets survey and samples right by what `anlos calibrate` has measured
 * (hal/survey/calibration.h); an empty one takes the array as it is. */
#ifndef ANLOS_HAL_ARRAY_H
#define ANLOS_HAL_ARRAY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "hal/clock.h"
#include "hal/device.h"
#include "recon/ping.h"
#include "recon/survey.h"

/* One emission of each speaker named, in turn, without a break: emission k of it in slot
 * survey_slot_of(k), downward where survey_is_down(k) (recon/survey.h).  An endless shot
 * goes round its speakers until array_halt, each round in as many slots as one that is
 * not endless, the next right behind it.  A recording is played as it is instead: in its
 * own order, those of the speakers named, and to its end (-ENODATA) unless the URI says
 * "loop=yes".
 * Its pings come at the true pace, whatever else the array does: nobody holds them back.
 * So do those of a continuous shot, n_rounds of all speakers without a break while the
 * stage goes on, for the positions from `position` on. */
struct array_shot {
    enum pass pass;
    size_t position;          /* index into the survey's stage positions */
    double stage_m;           /* where the stage really stands */
    const uint32_t *speakers; /* [n_speakers] */
    size_t n_speakers;
    bool endless; /* of an array that stands still */
    /* Continuous: 0, or how many rounds; when the first slot begins, or as soon after as
     * can be (the ping's t0_ns says when); stage_m is where the stage is then, and this
     * how fast it goes on. */
    size_t n_rounds;
    int64_t start_ns;
    double stage_m_s;
};

/* One ping.  samples is [n_microphones][n_samples], full scale +-1, valid until the next
 * call on the array; sample 0 is the nominal start of the emission. */
struct array_ping {
    size_t shot_index; /* 0..n_speakers-1 */
    uint32_t frame;    /* of an endless or continuous shot: the round, from 1; else 0.  A
                          ping that the array had to leave out, because nobody took it in
                          time, is a gap in frame and shot_index */
    bool down;         /* the chirp ran from its stop to its start */
    const float *samples;
    size_t n_samples;           /* slot and tail; the same for every ping of an array */
    const uint32_t *clipped;    /* [n_microphones] */
    const uint32_t *not_finite; /* [n_microphones]; those samples were set to 0 */
    bool valid;                 /* false: retake */
    double temperature_c;       /* NaN: not measured */
    int64_t t0_ns;              /* time of sample 0 */
};

struct array_ops {
    const char *scheme; /* "sim" */
    /* arg: the URI after the scheme.  The error names file and line. */
    int (*open)(void **state, const char *arg, const struct clock_source *clock,
                struct error *why);
    const struct survey *(*survey)(void *state);
    int (*fire)(void *state, const struct array_shot *shot);
    /* Fills shot_index, and frame of an endless shot; `down` is set by array_next. */
    int (*next)(void *state, struct array_ping *out, struct error *why);
    /* The direction of emission k of the shot.  May be NULL: as survey_is_down says. */
    bool (*is_down)(void *state, size_t k);
    /* Of an endless or continuous shot: emits no more, `next` is not asked for it again.
     * May be NULL: there is nothing to be done. */
    void (*halt)(void *state);
    /* May be NULL: nothing is counted. */
    size_t (*counts)(void *state, struct device_count out[DEVICE_MAX_COUNTS]);
    /* May be NULL: it is always there, and nothing befalls it. */
    int (*condition)(void *state, struct error *why);
    bool (*notice)(void *state, struct error *out);
    void (*close)(void *state);
};

/* The tables that array_open chooses from. */
extern const struct array_ops array_alsa_ops;
extern const struct array_ops array_sim_ops;
extern const struct array_ops array_wav_ops;

struct array;

/* 0, -EINVAL (URI or contents), -ENOENT (no such file or device), -ENODEV (no such
 * scheme), -ENOMEM. */
int array_open(struct array **out, const char *uri, const struct clock_source *clock,
               struct error *why);

/* Owned by the array; complete before the first shot. */
const struct survey *array_survey(const struct array *a);

/* Starts a shot; the previous one must have been read to its end, or halted.  0, -EINVAL
 * (also of an endless one whose round is shorter than the chirp: survey_round_fits; of a
 * continuous one of not all speakers, of more rounds than there are positions, or of a
 * survey that is not), -ENOTSUP (this array has no endless shots). */
int array_fire(struct array *a, const struct array_shot *shot);

/* Blocks until the next ping of the shot is recorded.  0, -ENODATA (the shot has ended),
 * -EINTR (a signal; call again or give up), -EAGAIN (the device is away, array_condition
 * says why; the shot goes on when it is back: call again or give up), other negative
 * errno, which end the shot. */
int array_next(struct array *a, struct array_ping *out, struct error *why);

/* Ends an endless or continuous shot at once: what is under way of it is dropped, the
 * next shot may be fired.  Nothing where there is none. */
void array_halt(struct array *a);

/* How many counts there are. */
size_t array_counts(struct array *a, struct device_count out[DEVICE_MAX_COUNTS]);

/* 0, or a negative errno while the device is away and is tried again: why says so. */
int array_condition(struct array *a, struct error *why);

/* What has befallen the device and a person should know, once each.  false: no more. */
bool array_notice(struct array *a, struct error *out);
void array_close(struct array *a);

#endif
