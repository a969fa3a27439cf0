/* SPDX-License-Identifier: MIT */
/* recon/tail.h -- how long a slot's sound rings on into the next one. */
#ifndef ANLOS_RECON_TAIL_H
#define ANLOS_RECON_TAIL_H

#include <stddef.h>

#include "recon/survey.h"

#define TAIL_DEFAULT_FAR_M 4.0 /* the far gate of a survey that names none */

/* Samples after a slot that a ping must keep so that the whole chirp comes back from the
 * far end of what can be imaged: the corners of the volume, or the far gate's plane, half
 * a metre wider than the array.  At most a slot: there the next-but-one begins.  Where
 * the emissions overlap it is as long as the chirp and the gate ask for. */
size_t tail_echo_samples(const struct survey *s);

/* The same, and when the next emission begins within it, the whole of that, heard
 * directly: cut off it leaks into the gate, which stays when the background is subtracted
 * sample by sample, but not when its time axis is stretched (dsp/drift.h).  Where the
 * emissions overlap each ping cuts some of them off, and its ends have to be tapered
 * (dsp/window.h). */
size_t tail_samples(const struct survey *s);

#endif
