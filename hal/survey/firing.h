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
 *   alsa:DEVICE?rig=rig.yaml&stagger=no                 all slots of one length
 */
#ifndef ANLOS_HAL_SURVEY_FIRING_H
#define ANLOS_HAL_SURVEY_FIRING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "hal/device.h"
#include "recon/survey.h"

/* Keys for device_parse. */
#define FIRING_KEYS                                                                      \
    "slot_samples", "together", "alternates", "chirp_s", "far_m", "continuous",          \
        "positions", "jitter_samples", "stagger"

enum firing_chirps { FIRING_AS_THEY_ARE, FIRING_ONE_WAY, FIRING_BOTH_WAYS };
enum firing_stage { FIRING_STAGE_AS_IT_IS, FIRING_STAGE_STOPS, FIRING_STAGE_GOES_ON };

enum firing_stagger { FIRING_STAGGER_AS_IT_IS, FIRING_STAGGER_NO, FIRING_STAGGER_YES };

struct firing { /* 0: as the file says */
    double slot_samples, together;
    double positions; /* of the stage, evenly from the first to the last */
    double chirp_s;   /* its duration */
    double far_m;     /* of the gate */
    /* PRF jitter of an endless shot: slots are so much longer, and each emission begins
     * at a random one of these samples.  So the chirps of another array come at another
     * delay from ping to ping (dsp/async_pulse.h), whatever its clock. */
    double jitter_samples;
    enum firing_stagger stagger; /* not yes beside jitter: firing_slots */
    enum firing_chirps chirps;
    enum firing_stage stage;
};

/* 0, -EINVAL. */
int firing_from_device(struct firing *out, const struct device *d, struct error *why);

/* The same of a URI whose other options are somebody else's.  0, -EINVAL, -ENOMEM. */
int firing_from_uri(struct firing *out, const char *uri, struct error *why);

/* Into a survey that passes survey_check, and does so afterwards.  0, -EINVAL. */
int firing_apply(struct survey *s, const struct firing *f, struct error *why);

/* Where all slots have one length and more is asked for: -EINVAL, "option jitter_samples:
 * " or "option stagger: " and why_not.  Else 0. */
int firing_refuse_uneven(const struct firing *f, const char *why_not, struct error *why);

/* When the emissions of an endless shot begin.  Two arrays with slots of one length would
 * hear each other at one delay for seconds, as if something stood there.  So of each
 * FIRING_STAGGER_SLOTS slots one, drawn, is longer by stagger_samples: what is not ours
 * is heard so much earlier from then on (recon/frontend/interference.h). */
struct firing_slots {
    size_t slot_samples;
    size_t jitter_samples, stagger_samples; /* one of them, or neither */
    uint64_t seed;
};

#define FIRING_STAGGER_SLOTS 8
#define FIRING_STAGGER_PART  16 /* of a slot; 0.8 % of the pings are lost by that */

/* staggers: where f does not say. */
struct firing_slots firing_slots(const struct survey *s, const struct firing *f,
                                 bool staggers, uint64_t seed);

/* Samples from the first slot to the emission of another, the same each time; from each
 * emission to the next it is a slot at least. */
uint64_t firing_start(const struct firing_slots *f, uint64_t slot);

/* A slot that begins no later than the first one whose emission comes at a sample or
 * later, and some slots before that at most. */
uint64_t firing_slot_before(const struct firing_slots *f, double sample);

/* What a speaker is to emit: the survey's chirp, of amplitude 1, or the same from its
 * stop to its start.  free() the result, [*n]; NULL: no memory.  Each sample is right to
 * a float's rounding, however long the chirp. */
float *firing_emission(const struct survey *s, bool down, size_t *n);

#endif
