/* SPDX-License-Identifier: MIT */
/* recon/frontend/interference.h -- does another array sound here?  By dsp/async_pulse.h,
 * ping by ping of a static array: an echo of ours may have moved from ping to ping by how
 * far the speakers stand apart, and by INTERFERENCE_SPEED_M_S and the vehicle's own
 * speed, there and back.  Another array is present once INTERFERENCE_SOME of the newest
 * INTERFERENCE_PINGS are hit, until fewer than INTERFERENCE_FEW are.
 *
 * One with slots as long as ours is heard at one delay, and no ping is hit but those that
 * follow a longer slot (hal/survey/firing.h): looks.  By itself one of 163 was, so few
 * are enough: another array is present, too, once three of the newest 8 looks are hit,
 * until fewer than two of the newest 16 are.
 *
 * While it is present its chirps are taken out of the pings; before, nothing is.
 *
 * What it sends comes by way of everything around, too, at all delays and fainter, where
 * echoes of ours may be.  That stays in the traces. */
#ifndef ANLOS_RECON_FRONTEND_INTERFERENCE_H
#define ANLOS_RECON_FRONTEND_INTERFERENCE_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/pulse_compress.h"
#include "recon/ping.h"
#include "recon/survey.h"

#define INTERFERENCE_SPEED_M_S 2.5
#define INTERFERENCE_PINGS     48
#define INTERFERENCE_SOME      12
#define INTERFERENCE_FEW       8

#define INTERFERENCE_LOOKS_SOME 3          /* of 8 */
#define INTERFERENCE_LOOKS_FEW  2          /* of 16 */
#define INTERFERENCE_LONGER     (1.0 / 32) /* of a slot, at least, before a look */

struct interference_levels {
    bool present;
    uint64_t pings; /* that were hit, since the survey */
    double share;   /* of the newest pings, that is hit */
};

struct interference;

/* Copies what it needs.  format: of the traces, of which the first `until` samples are
 * looked at: behind them the next emission is heard, too.  0, -EINVAL, -ENOMEM. */
int interference_create(struct interference **out, const struct survey *s,
                        const struct trace_format *format, size_t until);

struct interference_ping {
    const struct ping *ping;
    bool subtracted;             /* its traces are what a background leaves */
    double speed_m_s;            /* of the vehicle */
    const float complex *traces; /* [n_microphones][format.n_samples] */
    const bool *masked;          /* [n_microphones] */
};

/* [n_microphones][n_samples], borrowed until the next ping: 1 where a sample is to be
 * taken out; NULL: none is. */
const uint8_t *interference_ping(struct interference *i,
                                 const struct interference_ping *in);

/* The pings before cannot be held against those to come. */
void interference_break(struct interference *i);
void interference_levels(const struct interference *i, struct interference_levels *out);
void interference_destroy(struct interference *i);

#endif
