/* hal/room/room.h -- the simulated room behind `sim:`: what a scene file says, and the
 * sound in it.  Objects are given where they really are, in the array frame; the wall
 * mirrors the array to them and back.  Born and Kirchhoff: no multiple scattering, no
 * occlusion. Shares no propagation code with recon. */
#ifndef ANLOS_HAL_ROOM_ROOM_H
#define ANLOS_HAL_ROOM_ROOM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/survey/calibration.h"
#include "msgs/complaint.h"
#include "msgs/survey.h"

struct room;

/* What is hidden: for the truth table. */
struct room_object {
    char name[32];
    char kind[16];        /* point, rectangle, polygon, letter, corner */
    double position_m[3]; /* centre, array frame, where it really is */
    double virtual_m[3];  /* mirrored at the wall: where it is imaged */
    double extent_m[3];   /* full size along the axes; 0 for a point */
};

/* Reads a scene file (hal/room/scene.h says its keys) and plans: FFTW's planner wants one
 * thread at a time.  The noise of noise.snr_db is measured here, against the objects'
 * echoes at up to 8 positions.  0, -ENOENT, -EINVAL ("file:line: key: expected"),
 * -ENOMEM. */
int room_load(struct room **out, const char *path, struct complaint *why);

/* The survey as the processor should know it (without the unknown errors of the scene).
 */
const struct survey *room_survey(const struct room *r);

/* calibration_take() into what the processor knows; the room stays as it is.  Ahead of
 * asking for numbers of frames, which the latency changes. */
int room_calibrate(struct room *r, const char *path, struct calibration **out,
                   struct complaint *why);

/* Where a microphone clips; INFINITY: never. */
float room_limit(const struct room *r, size_t microphone);
size_t room_objects(const struct room *r, const struct room_object **out);

/* Frames that room_record yields for n_speakers emissions: their slots and the tail. */
size_t room_frames(const struct room *r, size_t n_speakers);
size_t room_tail(const struct room *r); /* tail_samples() of its survey, hal/tail.h */

/* What the microphones hear when speakers[n_speakers] emit one after the other, a slot
 * each: samples [n_microphones][room_frames(n_speakers)].  The noise depends on the
 * scene's seed, the pass, the position and `take` only.  The paper's 16 x 16 pairs and
 * 1000 facets take some 30 ms.  0, -EINVAL (no such position, speaker), -ENOMEM. */
int room_record(struct room *r, Anlos__Pass pass, size_t position,
                const uint32_t *speakers, size_t n_speakers, uint32_t take,
                float *samples);
double room_temperature_c(const struct room *r, Anlos__Pass pass, size_t position);
void room_destroy(struct room *r);

#endif
