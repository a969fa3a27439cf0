/* SPDX-License-Identifier: MIT */
/* recon/ping.h -- one emission of one speaker, and what every microphone recorded of it
 * on one clock. */
#ifndef ANLOS_RECON_PING_H
#define ANLOS_RECON_PING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum pass {
    PASS_SCENE,
    PASS_BACKGROUND, /* the same room without the hidden objects */
};

struct ping {
    uint64_t survey_id;
    int64_t capture_ns; /* when sample 0 was taken: the nominal start of the emission */
    uint32_t scan;
    uint32_t frame; /* the round, from 1, of a static array; 0: of a scan */
    enum pass pass;
    uint32_t position, speaker;
    double stage_m;       /* where the stage stood */
    double temperature_c; /* NaN: not measured */
    bool down;            /* the chirp ran from its stop to its start */
    bool valid;           /* false: of no use, a stream that broke off */
    size_t n_microphones, n_samples;
    const float *samples;       /* [n_microphones][n_samples], full scale +-1 */
    const uint32_t *clipped;    /* [n_microphones] samples at full scale */
    const uint32_t *not_finite; /* [n_microphones]; those samples were set to 0 */
};

#endif
