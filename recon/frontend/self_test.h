/* SPDX-License-Identifier: MIT */
/* recon/frontend/self_test.h -- what the array hears of itself, and so of others: does
 * each microphone hear the speakers, and each speaker reach a microphone; is one covered;
 * how loud is noise; and how far away would a person still be found?
 *
 * Deaf and mute.  A cable that is out still gives noise and hum, which no level tells
 * from a quiet room; but nothing in it is as long ago as any other thing.  So a ping
 * counts as heard where, compressed, something stands out of the trace.  A microphone is
 * deaf when it heard none of the pings of 70 ms that others heard; a speaker is mute when
 * nobody heard it when it sounded last, or 30 dB less than most: late echoes of the one
 * before are that loud.  Where noise would drown even the direct sound, neither is
 * judged, nor by pings in which a steady tone hides it from half of the microphones.
 *
 * Covered: the direct sound of whole rows or columns of pairs drops (dsp/cover.h).
 *
 * Moved: recon/frontend/displacement.h, by the direct sound that stands well out of
 * noise.
 *
 * Noise is that of dsp/noise_floor.h, where images are made; how far a person is found in
 * it recon/frontend/range_monitor.h says.
 *
 * It stands beside the front end, whose traces it takes where they reach from the
 * emission far enough; elsewhere it compresses a ping itself: with what the next emission
 * brought, and without. */
#ifndef ANLOS_RECON_FRONTEND_SELF_TEST_H
#define ANLOS_RECON_FRONTEND_SELF_TEST_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "dsp/pulse_compress.h"
#include "recon/frontend/displacement.h"
#include "recon/frontend/range_monitor.h"
#include "recon/ping.h"
#include "recon/survey.h"

struct self_test_faults {
    size_t deaf, of_microphones;
    size_t mute, of_speakers; /* that have sounded, of... */
    size_t speakers;
    size_t covered_microphones, covered_speakers;
    size_t moved_microphones, moved_speakers;
};

struct self_test_levels { /* NaN: not known */
    double noise_db;      /* of a sample of compressed noise, re an echo of gain 1 */
    double direct_db;     /* the loudest direct sound of each speaker over noise */
    double echo_db;       /* the wall's echo over noise */
    double range_m; /* up to which a person is found; 0: nowhere in the gate, which */
    double gate_m;  /* ends here */
    bool limited;   /* range_m is less */
};

struct self_test;

/* From the emission on traces have to reach so far that the direct sound of each pair is
 * in them, the later the better: delays up to most_s are this ping's. */
void self_test_reach(const struct survey *s, double *least_s, double *most_s);

/* given: traces that each ping comes with, of a matched filter with a Hann window, from
 * the emission to self_test_reach; NULL: there are none.  The survey outlives it.  0,
 * -EINVAL (pings are too short to tell, or a gate or a range that is none), -ENOMEM. */
int self_test_create(struct self_test **out, const struct range_config *cfg,
                     const struct survey *s, const struct trace_format *given,
                     struct error *why);

/* What the one before has learnt of the same array, in other air, or of which elements
 * are known to stand elsewhere by now. */
void self_test_inherit(struct self_test *t, struct self_test *before);

/* See range_monitor_walls. */
void self_test_walls(struct self_test *t, const struct walls *walls);

/* Does a steady tone sound (dsp/tone_finder.h), in the pings to come? */
void self_test_tone(struct self_test *t, bool sounds);

/* Of all pings up to this one.  traces: [n_microphones][given.n_samples], or NULL, see
 * above; imaged: the same, as they are imaged, without what the front end takes out of
 * them: by it noise is told.  note: gets what was not said before, or stays as it is. A
 * microphone whose samples are no numbers, or a ping of another shape, is not judged.
 * Costs the passes of dsp/noise_floor.h, and without traces the compression of two pings.
 */
void self_test_ping(struct self_test *t, const struct ping *ping,
                    const float complex *traces, const float complex *imaged,
                    struct self_test_faults *out, char *note, size_t note_size);

void self_test_levels(const struct self_test *t, struct self_test_levels *out);
bool self_test_covers_microphone(const struct self_test *t, size_t microphone);
bool self_test_covers_speaker(const struct self_test *t, size_t speaker);
/* See displacement_speaker. */
const struct displacement_of *self_test_moved_speaker(const struct self_test *t,
                                                      size_t speaker);
const struct displacement_of *self_test_moved_microphone(const struct self_test *t,
                                                         size_t microphone);
void self_test_destroy(struct self_test *t);

#endif
