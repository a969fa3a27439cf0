/* SPDX-License-Identifier: MIT */
/* anlos/compressor.h -- pings to traces: which microphones are fit, pulse compression
 * (matched filter, Turin 1960; or the paper's deramp), and the background subtracted, as
 * it would sound in the air of now.  The chirp itself: anlos_survey_emission.
 *
 * One thread at a time.  It keeps a copy of what it needs of configuration and survey. */
#ifndef ANLOS_COMPRESSOR_H
#define ANLOS_COMPRESSOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <anlos/config.h>
#include <anlos/error.h>
#include <anlos/ping.h>
#include <anlos/survey.h>

ANLOS_BEGIN

struct anlos_traces {   /* of one ping: an echo's energy lies at its delay */
    size_t size;        /* sizeof(struct anlos_traces) */
    uint64_t survey;    /* anlos_survey_id; 0: not said */
    int64_t capture_ns; /* of the ping's sample 0 */
    uint32_t scan, frame, position, speaker; /* as the ping has them */
    bool down;
    bool background_subtracted;
    bool blanked; /* a sound from outside drowned it: empty, all masked */
    uint64_t clipped_samples;
    size_t n_microphones, n_samples;
    double t0_s, rate_hz; /* sample n belongs to the delay t0_s + n / rate_hz, */
    double carrier_hz; /* and is complex baseband: y[n] exp(2 pi i carrier_hz t) there */
    const float *samples; /* [n_microphones][n_samples][re, im]; |y| = 1 for an echo of
                             gain 1 */
    const bool *masked;   /* [n_microphones]: not to be used, 0 there; NULL: none */
};

struct anlos_compressor; /* opaque */

/* Of the configuration: window, compression, background, array.  destroy it. */
ANLOS_API int anlos_compressor_create(struct anlos_compressor **out,
                                      const struct anlos_config *cfg,
                                      const struct anlos_survey *survey,
                                      struct anlos_error *why);
ANLOS_API void anlos_compressor_destroy(struct anlos_compressor *c);

/* out->size is set; its samples are good until the next ping.  Returns 1 with traces, 0
 * for a ping of the background, which is kept; ANLOS_INVALID, ANLOS_NOT_READY (the
 * background of this ping has to come before). */
ANLOS_API int anlos_compressor_ping(struct anlos_compressor *c,
                                    const struct anlos_ping *ping,
                                    struct anlos_traces *out, struct anlos_error *why);

/* An adaptive background is the mean while the vehicle stands (anlos_pipeline_ego). */
ANLOS_API int anlos_compressor_ego(struct anlos_compressor *c, double speed_m_s,
                                   double yaw_rate_rad_s, int64_t capture_ns,
                                   struct anlos_error *why);

ANLOS_END

#endif
