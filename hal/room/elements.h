/* SPDX-License-Identifier: MIT */
/* hal/room/elements.h -- the elements of a simulated array as they really are, which its
 * survey does not know (a scene's `errors` and `faults`): where they stand, with their
 * mirror images, how loud the microphones are, and what is wrong with them. */
#ifndef ANLOS_HAL_ROOM_ELEMENTS_H
#define ANLOS_HAL_ROOM_ELEMENTS_H

#include <stddef.h>
#include <stdint.h>

#include "hal/room/scene.h"
#include "recon/survey.h"

struct pose {
    const struct survey *survey; /* not owned */
    /* Really, at stage position 0: the survey, which may be calibrated later, knows less.
     */
    double (*speakers_at_m)[3], (*microphones_at_m)[3]; /* [n] */
    double (*stage_errors_m)[3];                        /* [n_positions] */
    /* Set by pose_move and pose_go: */
    double (*speakers_m)[3], (*microphones_m)[3];
    double (*speaker_images_m)[3], (*microphone_images_m)[3]; /* behind the wall */
};

/* Draws the errors: element_m, stage_m rms for each axis.  0, -ENOMEM. */
int pose_create(struct pose *out, const struct survey *s, double element_m,
                double stage_m, uint32_t seed);
void pose_move(struct pose *p, size_t position);

/* Anywhere along the stage: between two positions its error is between theirs. */
void pose_go(struct pose *p, double stage_m);
void pose_clear(struct pose *p);

/* The microphones' curves, which the processor knows, and what they really do. */

/* Gives each of s's microphones a smooth curve of rms ripple_db, serials "sim00"...
 * 0, -ENOMEM. */
int microphones_invent(struct survey *s, double ripple_db, uint32_t seed);

/* out[n_microphones][n_bins], bin k at k * bin_hz: level times the curve (flat without
 * one) times a gain error of rms gain_db that the survey does not know. */
void microphones_respond(const struct survey *s, double level, double gain_db,
                         uint32_t seed, size_t n_bins, double bin_hz, float *out);

/* What is wrong with them: a scene's `faults`, element by element. */

struct fault {
    size_t wired_to;    /* the element that this channel drives or hears */
    float gain;         /* below 0: inverted; 0: dead */
    float covered;      /* the gain on top of it... */
    double moved_m[3];  /* beside its place... */
    double during_s[2]; /* ...both from one time of a drive to another */
    float limit;        /* of the amplitude; INFINITY: none */
    float noise_rms;
};

struct faults {
    size_t n_speakers, n_microphones;
    struct fault *speakers;    /* [n_speakers] */
    struct fault *microphones; /* [n_microphones] */
};

/* 0, -ENOMEM. */
int faults_create(struct faults *out, const struct scene_faults *s, size_t n_speakers,
                  size_t n_microphones);
void faults_clear(struct faults *f);

/* The gain that comes and goes, at a time of a drive. */
float faults_cover(const struct fault *f, double t_s);

/* Where it stands that has its place at p, at a time of a drive. */
void faults_move(const struct fault *f, double t_s, const double p[3], double out[3]);

/* The same number: all elements stand as they do at the other time of the drive. */
size_t faults_moves(const struct faults *f, double t_s);

/* What each speaker makes of a chirp: [n_speakers][n_chirp].  free() it; NULL: no memory.
 */
float *faults_emit(const struct faults *f, const float *chirp, size_t n_chirp);

struct fault_slots { /* a recording of some speakers, one after the other */
    size_t n_frames, slot_samples;
    size_t together;          /* that share a slot; 0 or 1: one */
    const uint32_t *speakers; /* [n_speakers] */
    size_t n_speakers;
};

/* The noise of single channels into samples [n_microphones][n_frames], which then clip.
 * The noise depends on nothing but words[4] and the faults. */
void faults_record(const struct faults *f, const struct fault_slots *slots,
                   const uint64_t words[4], float *samples);

/* The two parts of that, for samples [n_microphones] that stand stride apart, n of each:
 * the noise of what a speaker emits, or FAULTS_NO_SPEAKER: the microphones' own; and the
 * clipping. */
#define FAULTS_NO_SPEAKER SIZE_MAX
void faults_add_noise(const struct faults *f, const uint64_t words[4], size_t speaker,
                      float *samples, size_t stride, size_t n);
void faults_limit(const struct faults *f, float *samples, size_t stride, size_t n);

#endif
