/* SPDX-License-Identifier: MIT */
/* recon/frontend/backgrounds.h -- what is heard without the hidden objects, and is taken
 * away: the room as it was recorded before, as it would sound in the air of now, or, of a
 * static array, a mean of what was heard. */
#ifndef ANLOS_RECON_FRONTEND_BACKGROUNDS_H
#define ANLOS_RECON_FRONTEND_BACKGROUNDS_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "recon/ping.h"
#include "recon/processing.h"

/* What the air has done between the two passes of a scan, as dsp/drift.h has found it
 * ping by ping, in words. */

struct air {
    double sound_speed_m_s;  /* the survey's */
    size_t expected;         /* pings of a scan */
    size_t pings, corrected; /* with a background; whose background was stretched */
    double sum, largest;     /* of the stretches; the largest with its sign */
};

/* At 0.4%, 2.3 K, some -40 dB of the background are left, because its pulses are
 * stretched too (dsp/timescale.h), and DRIFT_MAX_STRETCH is near. */
#define AIR_DISTRUST 0.004

void air_start(struct air *a, double sound_speed_m_s, size_t expected);
void air_add(struct air *a, double stretch, bool corrected);

/* What another thread has added. */
void air_join(struct air *a, const struct air *other);

/* The change of temperature in K that a stretch would be: the speed of sound goes with
 * the root of the absolute temperature, so dT = -2 T stretch. */
double air_kelvin(const struct air *a, double stretch);

/* The background does not fit any more. */
bool air_is_distrusted(const struct air *a);

/* "air -0.6 K (0.10%) since the background, at most -0.7 K (0.11%)"; empty: no ping was
 * corrected by 0.05 K. */
void air_text(const struct air *a, char *out, size_t size);

/* The room without the hidden objects, as it was recorded before, subtracted as it would
 * sound in the air of now (dsp/drift.h). */

struct recorded_background;

/* For the pings of a survey and their traces, [n_microphones][format.n_samples].  0,
 * -EINVAL, -ENOMEM. */
int recorded_background_create(struct recorded_background **out, const struct survey *s,
                               const struct processing *p,
                               const struct trace_format *format);

/* Keeps a copy of the traces of a ping of that pass; of an static array (frame) a
 * microphone that was masked in one of its frames stays so. */
void recorded_background_keep(struct recorded_background *b, const struct ping *ping,
                              const bool *masked, const float complex *traces);

/* Is there one for this ping? */
bool recorded_background_is_kept(const struct recorded_background *b,
                                 const struct ping *ping);

/* Subtracts it from a ping of the scene, and masks what was masked in it.  Each scan
 * restarts: the air of the last one may be long gone.  false: there is none. */
bool recorded_background_subtract(struct recorded_background *b, const struct ping *ping,
                                  bool *masked, float complex *traces);

/* Is it no room without what is hidden: what the scan is recorded in, or the two are
 * swapped?  A sentence for the log, once, when half of a scan's pings have come; else
 * empty. */
void recorded_background_judge(struct recorded_background *b, char *note, size_t size);

/* Of the scan that the newest ping belongs to. */
const struct air *recorded_background_air(const struct recorded_background *b);
void recorded_background_destroy(struct recorded_background *b);

/* Backgrounds of a static array: the mean of what was recorded without the hidden
 * objects, or the running mean of all that is heard. */

struct mean_background;

/* time_constant_s: of the running mean.  0, -EINVAL, -ENOMEM. */
int mean_background_create(struct mean_background **out, size_t n_speakers,
                           size_t n_microphones, size_t n_samples,
                           double time_constant_s);

/* A ping of the background and its traces[n_microphones][n_samples], which are used up.
 * The mean of its speaker's so far in this pass, to be kept elsewhere. */
const float complex *mean_background_record(struct mean_background *b,
                                            const struct ping *ping,
                                            float complex *traces);

/* What a speaker has sounded like, [n_microphones][n_samples]; NULL: not known. */
const float complex *mean_background_of(const struct mean_background *b, size_t speaker);

/* Subtracts the running mean from a speaker's traces, from the second ping on, where that
 * leaves less than there was (dsp/trace_mean.h): a loud thing that passes by is in it for
 * as long as the mean remembers.  They count into it when the next ones come.  A
 * microphone that is masked stays out of it, and one that was until now keeps its trace
 * as it is.  false: all do. */
bool mean_background_subtract(struct mean_background *b, size_t speaker,
                              int64_t capture_ns, const bool *masked,
                              float complex *traces);

/* The newest traces that were given do not count, for they may be spoiled. */
void mean_background_drop(struct mean_background *b);

/* Of the newest traces that were given, samples that are foreign (1 of [n_microphones]
 * [n_samples]) do not count: as much is heard there as before. */
void mean_background_excise(struct mean_background *b, const uint8_t *foreign);

/* What was heard does not count any more. */
void mean_background_reset(struct mean_background *b);
void mean_background_destroy(struct mean_background *b);

#endif
