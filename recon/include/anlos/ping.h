/* SPDX-License-Identifier: MIT */
/* anlos/ping.h -- what goes in: one emission and what every microphone recorded of it on
 * one clock. */
#ifndef ANLOS_PING_H
#define ANLOS_PING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <anlos/error.h>

struct anlos_ping {
    size_t size;          /* sizeof(struct anlos_ping) */
    uint64_t survey;      /* anlos_survey_id of the one it was taken with; 0: not said */
    int64_t capture_ns;   /* when sample 0 was taken, the nominal start of the emission */
    int64_t received_ns;  /* when it was whole; 0: a ping's length later */
    uint32_t scan;        /* another number than before: a new scan begins */
    uint32_t frame;       /* of a static array: the round of its speakers, from 1; 0: they
                             are counted, a new one begins when a speaker's turn comes
                             again */
    uint32_t position;    /* of the stage, from 0 */
    uint32_t speaker;     /* that emitted, from 0 */
    bool background;      /* of the same room without the hidden objects */
    bool down;            /* the chirp ran from its stop to its start */
    bool has_temperature; /* it was measured with the ping: */
    double temperature_c;
    size_t n_microphones;
    size_t n_samples;        /* at least a slot; anlos_survey_ping_samples is best */
    const float *samples;    /* [n_microphones][n_samples], full scale +-1.  What is not
                                finite is taken for a fault of its microphone */
    const uint32_t *clipped; /* [n_microphones] samples at full scale, as who recorded
                                them knows; NULL: runs of 3 and more at +-0.9999 */
};

#endif
