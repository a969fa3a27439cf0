/* SPDX-License-Identifier: MIT */
/* recon/frontend/recorded_background.h -- the room without the hidden objects, as it was
 * recorded before, subtracted as it would sound in the air of now (dsp/drift.h). */
#ifndef ANLOS_RECON_FRONTEND_RECORDED_BACKGROUND_H
#define ANLOS_RECON_FRONTEND_RECORDED_BACKGROUND_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "recon/frontend/air.h"
#include "recon/ping.h"
#include "recon/processing.h"

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

#endif
