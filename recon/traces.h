/* SPDX-License-Identifier: MIT */
/* recon/traces.h -- what the microphones heard of one ping, compressed: an echo's energy
 * lies at its delay. */
#ifndef ANLOS_RECON_TRACES_H
#define ANLOS_RECON_TRACES_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/pulse_compress.h"

struct traces {
    uint64_t survey_id;
    int64_t capture_ns;                      /* of the ping's sample 0 */
    uint32_t scan, frame, position, speaker; /* as the ping has them */
    double stage_m;
    double temperature_c; /* NaN: not known */
    bool down;
    bool background_subtracted;
    bool blanked; /* a sound from outside drowned it: empty, all masked */
    uint64_t clipped_samples;
    size_t n_microphones;
    struct trace_format format;
    const float complex *samples; /* [n_microphones][format.n_samples] */
    const bool *masked;           /* [n_microphones]; their traces are 0 */
};

#endif
