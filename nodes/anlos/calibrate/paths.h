/* SPDX-License-Identifier: MIT */
/* nodes/anlos/calibrate/paths.h -- sound on ways whose length is known: when it came by
 * each pair of speaker and microphone. */
#ifndef ANLOS_NODES_ANLOS_CALIBRATE_PATHS_H
#define ANLOS_NODES_ANLOS_CALIBRATE_PATHS_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/arrival.h"
#include "dsp/pulse_compress.h"
#include "dsp/time_zero.h"
#include "hal/array.h"

/* Each speaker alone, some times over, and what all microphones heard of it: the mean
 * over the takes, and the noise by which they differ (reverberation is the same in each,
 * so it does not count as noise). */

struct sounding_pair {
    uint64_t clipped;    /* samples, over all takes */
    uint64_t not_finite; /* the same */
    double noise_rms;    /* of a sample of one take; 0 where takes are equal */
    double rms;          /* of the mean */
};

struct sounding;

/* Fires and records, `takes` times; pings that come invalid are taken again.  only: one
 * speaker, or SIZE_MAX for all.  0, -EINTR (Ctrl-C), -ENODATA (every sample is 0), other
 * negative errno of the array. */
int sounding_take(struct sounding **out, struct array *array, size_t position,
                  size_t only, size_t takes, struct error *why);

const struct survey *sounding_survey(const struct sounding *s);
size_t sounding_retaken(const struct sounding *s);
const struct sounding_pair *sounding_pair(const struct sounding *s, size_t speaker,
                                          size_t microphone);

/* Compressed with the microphones' curves undone, delays from the nominal emission on:
 * [n_microphones][format.n_samples], until the next call. */
void sounding_format(const struct sounding *s, struct trace_format *out);
const float complex *sounding_traces(struct sounding *s, size_t speaker);

/* The same of the chirp's third overtone, with a format of its own, until the next call.
 * NULL: it has none that can be heard (dsp/chirp.h). */
const float complex *sounding_overtones(struct sounding *s, size_t speaker,
                                        struct trace_format *format);
void sounding_destroy(struct sounding *s);

struct path {
    double distance_m;
    bool ignored; /* not to be heard */
    bool heard;
    struct arrival arrival; /* if heard */
};

/* [n_speakers][n_microphones], straight from speaker to microphone.  free() it; NULL: no
 * memory. */
struct path *paths_direct(const struct survey *s);

/* By way of a plane { p : normal . p = distance_m }, at a stage position. */
struct path *paths_reflected(const struct survey *s, size_t position,
                             const double normal[3], double distance_m);

/* The first arrival of each pair that stands out of its trace. */
int paths_hear_first(struct path *paths, struct sounding *s);

/* The strongest arrival within window_s around where it is expected.  0, -ENOMEM. */
int paths_hear_near(struct path *paths, struct sounding *s, double latency_s,
                    double speed_m_s, double window_s);

/* How far around: 6 pulses of the chirp's band, 0.25 ms at least. */
double paths_window_s(const struct survey *s);

/* out[n] of paths[n], for dsp/time_zero.h. */
void paths_pairs(const struct path *paths, size_t n, struct time_zero_pair *out);

/* Direct paths: heard anywhere first, then where the latency that fits most of them
 * says.  0, -ENODATA (none is heard), -ENOMEM. */
int paths_fit_latency(struct path *direct, struct sounding *s, double speed_m_s,
                      struct time_zero *out, struct error *why);

#endif
