/* SPDX-License-Identifier: MIT */
/* recon/frontend/compressor.h -- raw pings to traces by the way that was asked for:
 * matched filter (dsp/pulse_compress.h) or the paper's deramp (dsp/deramp.h), one face
 * for both, and for both directions of a survey whose chirps alternate.  Where emissions
 * overlap the ends of the ping are tapered, which cut off those before and behind
 * (dsp/window.h).
 */
#ifndef ANLOS_RECON_FRONTEND_COMPRESSOR_H
#define ANLOS_RECON_FRONTEND_COMPRESSOR_H

#include <complex.h>
#include <stdbool.h>

#include "recon/processing.h"

enum compression { COMPRESSION_MATCHED_FILTER, COMPRESSION_DERAMP };

/* "hann", "hamming", "rectangular"; "matched_filter", "deramp".  0, -EINVAL. */
int window_from_name(const char *name, enum window *out);
int compression_from_name(const char *name, enum compression *out);

/* NULL past the last of them. */
const char *window_name(enum window window);
const char *compression_name(enum compression compression);

struct compressor;

/* Microphone responses come from the survey (matched filter only).  Plans: one thread at
 * a time.  0, -EINVAL, -ERANGE, -ENOMEM. */
int compressor_create(struct compressor **out, const struct processing *p,
                      const struct survey *s, enum compression compression,
                      enum window window, struct error *why);
void compressor_format(const struct compressor *c, struct trace_format *out);

/* The same without one: what whoever takes its traces goes by.  0, -EINVAL, -ERANGE. */
int compressor_format_of(struct trace_format *out, const struct processing *p,
                         const struct survey *s, enum compression compression,
                         struct error *why);

/* What is written with reach_s, and where in it the format above begins. */
void compressor_whole(const struct compressor *c, struct trace_format *out,
                      size_t *first);

/* rx: [n_microphones][rx_stride >= ping_samples], y: [n_microphones][whole.n_samples].
 * down: of a survey whose chirps alternate, which way this one ran.  One instance a
 * thread. */
void compressor_execute(struct compressor *c, bool down, const float *rx,
                        size_t rx_stride, float complex *restrict y);
void compressor_destroy(struct compressor *c);

#endif
