/* SPDX-License-Identifier: MIT */
/* recon/walls/wall_receiver.h -- a ping to what walls are looked for in: the strongest
 * arrivals of each trace, from the direct sound on and with no background subtracted.
 * It stands beside the front end, whose traces it takes where they reach from the
 * emission far enough; elsewhere it compresses a ping itself.  Where chirps run up and
 * down in turn, what the other chirp leaves of its direct sound is taken away
 * (recon/walls/wall_crosstalk.h). */
#ifndef ANLOS_RECON_WALLS_WALL_RECEIVER_H
#define ANLOS_RECON_WALLS_WALL_RECEIVER_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "recon/ping.h"
#include "recon/processing.h"
#include "recon/survey.h"
#include "recon/walls/wall_crosstalk.h"
#include "recon/walls/wall_echo.h"

#define WALL_PEAKS 6 /* of a trace */

struct wall_arrivals { /* of one microphone */
    bool heard;        /* false: silent, or samples that are no numbers */
    uint32_t n;
    struct wall_echo_peak peaks[WALL_PEAKS]; /* [n], by delay */
};

struct wall_returns { /* of a ping */
    struct ping ping; /* without its samples */
    bool usable;      /* else it has no arrivals */
    size_t n_microphones;
    const struct wall_arrivals *at; /* [n_microphones] */
};

struct wall_receiver {
    const struct survey *survey;
    uint64_t survey_id;
    struct processing processing;
    struct pulse_compress *compress[2]; /* up, down; the latter NULL: there are none */
    struct wall_crosstalk *crosstalk;   /* or NULL */
    size_t lead; /* samples of silence that are put before a ping */
    struct trace_format format;
    bool compresses;                /* else it is given traces of this format */
    double reach_m, until_s;        /* delays up to this can be used */
    float *padded;                  /* [n_microphones][ping_samples] */
    float complex *traces, *other;  /* [n_microphones][format.n_samples] */
    struct wall_arrivals *arrivals; /* [n_microphones] */
};

/* Delays that walls up to reach_m away are looked for at; *alone: the traces of a matched
 * filter say all of it, no chirps are to be told apart.  0, or a negative errno with an
 * error: -EINVAL also when two speakers sound together and cannot be told apart. */
int wall_receiver_reach(const struct survey *s, double reach_m, double *until_s,
                        bool *alone, struct error *why);

/* {0}: may be cleared.  given: traces that each ping comes with, of a matched filter with
 * a Hann window, from the emission to until_s at least; NULL: there are none.  The survey
 * must outlive it.  0, or a negative errno with an error, as above. */
int wall_receiver_open(struct wall_receiver *r, const struct survey *s, double reach_m,
                       const struct trace_format *given, struct error *why);

/* The arrivals of a ping; traces [n_microphones][given.n_samples], or NULL, see above.
 * *out is good until the next one. */
void wall_receiver_take(struct wall_receiver *r, const struct ping *ping,
                        const float complex *traces, struct wall_returns *out);

void wall_receiver_clear(struct wall_receiver *r);

#endif
