/* SPDX-License-Identifier: MIT */
/* hal/survey/firing.h -- how often and with what the speakers sound, chosen anew by the
 * URI of an array, in the place of what its scene or rig says:
 *
 *   sim:bumper.yaml?slot_samples=864&far_m=2.7          a shorter slot, a nearer gate
 *   sim:bumper.yaml?together=2&alternates=yes           two at once, one up, one down
 *   alsa:DEVICE?rig=rig.yaml&chirp_s=0.005
 *   sim:corner.yaml?continuous=yes&slot_samples=1632    while the stage goes on
 *   sim:corner.yaml?positions=16                        half as many
 *   sim:bumper.yaml?jitter_samples=192                  each emission up to 4 ms later
 */
#ifndef ANLOS_HAL_SURVEY_FIRING_H
#define ANLOS_HAL_SURVEY_FIRING_H

#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "hal/device.h"
#include "recon/survey.h"

/* Keys for device_parse. */
#define FIRING_KEYS                                                                      \
    "slot_samples", "together", "alternates", "chirp_s", "far_m", "continuous",          \
        "positions", "jitter_samples"

enum firing_chirps { FIRING_AS_THEY_ARE, FIRING_ONE_WAY, FIRING_BOTH_WAYS };
enum firing_stage { FIRING_STAGE_AS_IT_IS, FIRING_STAGE_STOPS, FIRING_STAGE_GOES_ON };

struct firing { /* 0: as the file says */
    double slot_samples, together;
    double positions; /* of the stage, evenly from the first to the last */
    double chirp_s;   /* its duration */
    double far_m;     /* of the gate */
    /* PRF jitter of an endless shot: slots are so much longer, and each emission begins
     * at a random one of these samples.  So the chirps of another array come at another
     * delay from ping to ping (dsp/async_pulse.h), whatever its clock. */
    double jitter_samples;
    enum firing_chirps chirps;
    enum firing_stage stage;
};

/* 0, -EINVAL. */
int firing_from_device(struct firing *out, const struct device *d, struct error *why);

/* The same of a URI whose other options are somebody else's.  0, -EINVAL, -ENOMEM. */
int firing_from_uri(struct firing *out, const char *uri, struct error *why);

/* Into a survey that passes survey_check, and does so afterwards.  0, -EINVAL. */
int firing_apply(struct survey *s, const struct firing *f, struct error *why);

/* Where slots have no jitter: 0, -EINVAL ("option jitter_samples: " and why_not). */
int firing_refuse_jitter(const struct firing *f, const char *why_not, struct error *why);

/* By how much the emission of a slot is later, 0..jitter_samples, the same each time. */
size_t firing_jitter(size_t jitter_samples, uint64_t seed, uint64_t slot);

#endif
