/* SPDX-License-Identifier: MIT */
/* hal/room/room_state.h -- what a room is made of, for its own sources: room_create.c,
 * room.c (its sound), room_truth.c (where everything is), stream.c. */
#ifndef ANLOS_HAL_ROOM_ROOM_STATE_H
#define ANLOS_HAL_ROOM_ROOM_STATE_H

#include "hal/room/drive.h"
#include "hal/room/emitter.h"
#include "hal/room/faults.h"
#include "hal/room/interferer.h"
#include "hal/room/noise.h"
#include "hal/room/pose.h"
#include "hal/room/propagate.h"
#include "hal/room/room.h"
#include "hal/room/scene.h"
#include "hal/room/traffic.h"
#include "hal/room/world.h"

/* What is heard besides the hidden objects while the vehicle stands: the same from round
 * to round, and most of the work. */
struct room_still {
    enum pass pass;
    double sound_speed_m_s;
    struct drive_frame frame; /* where it stands */
    size_t moves;             /* of its elements, so far */
    float **heard; /* [up, down][n_speakers]: [n_microphones][n_heard], or NULL: not
                      rendered yet */
};

/* When an object is in view. */
struct sight_spans {
    size_t n, room;
    struct sight_span {
        double from_s, to_s;
    } * spans; /* [n], in their order */
};

struct room {
    struct scene *scene;
    struct survey survey; /* as the processor knows it */
    double sound_speed_m_s, temperature_c, latency_samples; /* as they are */
    struct faults faults;
    struct noise noise;
    struct interferers interferers;
    struct firing_slots slots; /* of our endless shots */
    struct world world;
    struct pose pose;
    struct drive drive;
    struct traffic traffic;
    struct sight_spans *sights;     /* [world.n_objects] of a drive */
    struct propagate *propagate[2]; /* standing: upward and, where chirps alternate,
                                       downward */
    struct emitter *emitter;        /* of a drive */
    struct room_still still;
    struct doppler_point *microphones, *microphone_images; /* [n_microphones] */
    float *heard;            /* [n_microphones][n_heard] of one emission */
    float *rendered;         /* the same before the cables of a drive's microphones */
    size_t n_chirp, n_heard; /* samples of a chirp; heard of it by a microphone */
};

/* What is heard in a standing scene: the hidden objects, or what is there anyway, or
 * both; by the propagation of one direction.  0, -ENOMEM. */
int room_prepare(struct room *r, bool down, enum pass pass, size_t position, bool objects,
                 bool surroundings);

/* An emission into r->heard, without noise.  0, -EINVAL, -ENOMEM. */
int room_hear(struct room *r, const struct room_emission *e);

/* An interferer's emission, from where everything is at its time; latency_samples: when
 * it begins, after sample 0 of what is heard then, r->interferers.heard. */
void room_hear_interferer(struct room *r, size_t interferer, size_t speaker, double t_s,
                          double latency_samples);

/* Into r->sights, when each object of a drive is in view (room_truth.c).  0, -ENOMEM. */
int room_set_sights(struct room *r);

enum { ROOM_NOISE_SHOT = 8, ROOM_NOISE_EMISSION = 10, ROOM_NOISE_STREAM = 11 };

#endif
