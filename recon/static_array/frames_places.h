/* SPDX-License-Identifier: MIT */
/* recon/static_array/frames_places.h -- inside recon/static_array/frames: where the
 * elements of a ping were, in the array frame of another instant. */
#ifndef ANLOS_RECON_STATIC_ARRAY_FRAMES_PLACES_H
#define ANLOS_RECON_STATIC_ARRAY_FRAMES_PLACES_H

#include "recon/static_array/frames.h"

struct frames_place {     /* of an element, seen from what is imaged */
    double delay_at_m[3]; /* at the instant that the ping's delays are those of, */
    double phase_at_m[3]; /* its phases; */
    double own_m_s[3];    /* how it goes on by itself while the sound is under way, */
    double
        thing_m_s[3]; /* and by the motion of what is imaged, until the sound is there */
};

/* places[1 + n_microphones]: of the speaker that sounded, of the microphones.  Seen from
 * the array at reference_ns.  false: the path does not reach; as if it stood. */
bool frames_places(const struct frames_config *cfg, const struct frames_motion *motion,
                   size_t speaker, bool down, int64_t stamp_ns, int64_t reference_ns,
                   struct frames_place *places);

/* No coordinate differs by more than tolerance_m, drift counted over sound_s. */
bool frames_places_agree(const struct frames_place *a, const struct frames_place *b,
                         size_t n, double sound_s, double tolerance_m);

#endif
