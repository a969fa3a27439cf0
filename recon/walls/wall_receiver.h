/* recon/walls/wall_receiver.h -- a ping to what walls are looked for in: complex traces
 * from the emission on.  Where chirps run up and down in turn, what the other chirp
 * leaves of its direct sound is taken away (recon/walls/wall_crosstalk.h). */
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

struct wall_receiver {
    const struct survey *survey;
    uint64_t survey_id;
    struct processing processing;
    struct pulse_compress *compress[2]; /* up, down; the latter NULL: there are none */
    struct wall_crosstalk *crosstalk;   /* or NULL */
    size_t lead; /* samples of silence that are put before a ping */
    struct trace_format format;
    double until_s;                /* delays up to this can be used */
    double lag_s[2];               /* wall_echo_lag_s */
    float *padded;                 /* [n_microphones][ping_samples] */
    float complex *traces, *other; /* [n_microphones][format.n_samples] */
};

/* {0}: may be cleared.  For walls up to reach_m away, behind all direct sound by
 * clearance_m of its path.  The survey must outlive it.  0, or a negative errno with a
 * error: -EINVAL also when two speakers sound together and cannot be told apart. */
int wall_receiver_open(struct wall_receiver *r, const struct survey *s, double reach_m,
                       double clearance_m, struct error *why);

/* Into r->traces; false: a ping that cannot be used. */
bool wall_receiver_take(struct wall_receiver *r, const struct ping *ping);

void wall_receiver_clear(struct wall_receiver *r);

#endif
