/* SPDX-License-Identifier: MIT */
/* hal/room/noise.h -- what the microphones of a room record besides our sound, a scene's
 * `noise`: hiss, which may rise for a while; slams, that is sounds from outside that
 * begin at once and fade: white noise under an exponential, from one place, the same for
 * all microphones but for when it gets to them; tones, electrical noise in the cables:
 * sines in all microphones. */
#ifndef ANLOS_HAL_ROOM_NOISE_H
#define ANLOS_HAL_ROOM_NOISE_H

#include <stddef.h>
#include <stdint.h>

#include "hal/room/drive.h"
#include "hal/room/scene.h"
#include "recon/survey.h"

struct noise {
    const struct scene_noise *scene; /* not owned */
    double rms;                      /* of the hiss */
    uint32_t seed;
    size_t n_microphones;
    double period_s, sample_rate_hz;
    size_t n_slams;
    struct slam {
        double *heard_s; /* [n_microphones] of the drive: when it begins there */
        float *wave;     /* [n_wave] */
        size_t n_wave;
    } * slams; /* [n_slams] */
};

/* rms is 0.  Slams are a drive's; of a standing scene drive is NULL.  0, -ENOMEM. */
int noise_create(struct noise *out, const struct scene *scene, const struct survey *s,
                 double sound_speed_m_s);
void noise_clear(struct noise *x);

/* Of the whole array from world time t_s on: onto samples [n_microphones], stride apart,
 * n of each.  But for how loud it is then, and for what slams and sounds, which go by the
 * world's time whoever asks, it depends on the words alone. */
void noise_add(const struct noise *x, const struct drive *drive, double t_s,
               const uint64_t *words, size_t n_words, float *samples, size_t stride,
               size_t n);

#endif
