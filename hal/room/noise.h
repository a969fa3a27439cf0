/* SPDX-License-Identifier: MIT */
/* hal/room/noise.h -- what the microphones of a room record besides our sound: a scene's
 * `noise`, and other vehicles' arrays (below).  The noise is hiss, which may rise for a
 * while; slams, that is sounds from outside that begin at once and fade: white noise
 * under an exponential, from one place, the same for all microphones but for when it gets
 * to them; tones, electrical noise in the cables: sines in all microphones. */
#ifndef ANLOS_HAL_ROOM_NOISE_H
#define ANLOS_HAL_ROOM_NOISE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/room/drive.h"
#include "hal/room/elements.h"
#include "hal/room/emitter.h"
#include "hal/room/scene.h"
#include "hal/survey/firing.h"
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

/* Another vehicle's array in the same street, a scene's `interferers`: of the same
 * design, it sends its chirps round its speakers by a clock and slots of its own.  They
 * are heard straight, by way of the wall and from what stands around; not from the hidden
 * objects, whose echoes of them are fainter by far. */

struct interferer {
    const struct scene_interferer *scene; /* not owned */
    double (*speakers_m)[3];              /* [n_speakers], over ground */
    size_t n_speakers;
    double clock_hz; /* in world time */
    struct firing_slots slots;
    double direct, wall_echo; /* gains of those two ways */
    struct emitter *emitter;  /* its one chirp */
};

struct interferers {
    size_t n, n_heard; /* how many; samples that a microphone hears of an emission */
    struct interferer *list;
    float *heard; /* [n_microphones][n_heard] */
};

struct interferers_config {
    const struct scene *scene;
    const struct survey *survey;
    const struct mirror *mirror;
    const struct faults *faults;
    double sound_speed_m_s;
    double longest_m; /* no way of the array's own sound is longer */
};

/* No drive, none of them: n 0.  0, -ENOMEM. */
int interferers_create(struct interferers *out, const struct interferers_config *cfg);
void interferers_clear(struct interferers *all);

/* The emissions of one, numbered from world time 0 on. */
struct interferer_emission {
    double t_s; /* world time when it begins */
    size_t speaker;
    bool sounds; /* at that time it is there */
};

/* period_s: of the drive, which repeats. */
void interferer_emission(const struct interferer *i, double period_s, uint64_t number,
                         struct interferer_emission *out);

/* The number of the first emission that begins at a time or later. */
uint64_t interferer_next(const struct interferer *i, double t_s);

#endif
