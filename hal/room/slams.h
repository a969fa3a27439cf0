/* SPDX-License-Identifier: MIT */
/* hal/room/slams.h -- sounds from outside that begin at once and fade, a scene's
 * `noise.slams`: white noise under an exponential, from one place, the same for all
 * microphones but for when it gets to them. */
#ifndef ANLOS_HAL_ROOM_SLAMS_H
#define ANLOS_HAL_ROOM_SLAMS_H

#include "hal/room/scene.h"
#include "recon/survey.h"

struct slams {
    size_t n, n_microphones;
    double period_s, sample_rate_hz;
    struct slam {
        double *heard_s; /* [n_microphones] of the drive: when it begins there */
        float *wave;     /* [n_wave] */
        size_t n_wave;
    } * list; /* [n] */
};

/* Of a drive; of a standing scene, which has none, drive is NULL.  0, -ENOMEM. */
int slams_create(struct slams *out, const struct scene *scene, const struct survey *s,
                 double sound_speed_m_s);
void slams_clear(struct slams *s);

/* Onto samples [n_microphones], stride apart, n of each, from time t_s of the drive on.
 */
void slams_add(const struct slams *s, double t_s, float *samples, size_t stride,
               size_t n);

#endif
