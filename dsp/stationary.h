/* SPDX-License-Identifier: MIT */
/* dsp/stationary.h -- what in a spectrum are echoes, and what is noise?  Noise is as loud
 * at all times after the emission, echoes are not.  Traces are cut into segments of time,
 * and of each part of the spectrum the segments' shares of a trace's power, whose mean
 * over the traces no loud one decides, are compared:
 *
 *   echoes   of eight traces or more, the largest is over the middle of them by a quarter
 *            and by six standard errors
 *   noise    of two or more, not so, and the largest is at most twice the middle
 *   unclear  neither, as of few traces: there chance is as uneven as echoes are */
#ifndef ANLOS_DSP_STATIONARY_H
#define ANLOS_DSP_STATIONARY_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#define STATIONARY_PARTS 128 /* of the spectrum, at most */

enum stationary_kind { STATIONARY_UNCLEAR, STATIONARY_NOISE, STATIONARY_ECHOES };

struct stationary;

/* For traces of n_samples, with what is imaginary 0 where they are real: then only half
 * of the spectrum is looked at.  Plans; 0, -EINVAL (too short: real ones under 256, or
 * 128 samples), -ENOMEM. */
int stationary_create(struct stationary **out, size_t n_samples, bool real);

/* How many parts there are: part q is of frequencies q / parts to (q + 1) / parts of the
 * rate, or of half of it. */
size_t stationary_parts(const struct stationary *s);

/* Another trace, finite: x[0], x[step], ... */
void stationary_take(struct stationary *s, const float complex *x, size_t step);

/* kind [parts], of all traces so far.  A gap of up to 3 parts between echoes counts as
 * echoes: there they are faint. */
void stationary_judge(const struct stationary *s, enum stationary_kind *kind);
void stationary_destroy(struct stationary *s);

#endif
