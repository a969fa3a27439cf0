/* nodes/anlos/calibrate/sounding.h -- each speaker alone, some times over, and what all
 * microphones heard of it: the mean over the takes, and the noise by which they differ
 * (reverberation is the same in each, so it does not count as noise). */
#ifndef ANLOS_NODES_ANLOS_CALIBRATE_SOUNDING_H
#define ANLOS_NODES_ANLOS_CALIBRATE_SOUNDING_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/pulse_compress.h"
#include "hal/array.h"

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
                  size_t only, size_t takes, struct complaint *why);

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

#endif
