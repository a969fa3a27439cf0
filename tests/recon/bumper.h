/* SPDX-License-Identifier: MIT */
/* tests/recon/bumper.h -- a bumper's array on a vehicle, 8 speakers and 8 microphones by
 * default, its pings (tests/recon/moving.h, pulse compression), and images of them. */
#ifndef ANLOS_TESTS_RECON_BUMPER_H
#define ANLOS_TESTS_RECON_BUMPER_H

#include "dsp/pool.h"
#include "recon/static_array/frames.h"
#include "tests/recon/moving.h"

#define BUMPER_MAX    16
#define BUMPER_OTHERS 4

struct bumper { /* do not copy */
    struct geometry geometry;
    double speakers_m[BUMPER_MAX][3], microphones_m[BUMPER_MAX][3], position_m;
    struct moving world;
    struct moving others[BUMPER_OTHERS]; /* as heard beside it: bumper_also */
    size_t n_others;
    double noise; /* rms, of what is recorded; a chirp from the point 1 m off has 0.7 */
    unsigned long long seed;
    double slot_s;
    bool alternates; /* every second chirp runs down */
    size_t together; /* speakers that start in one slot */
    bool crosstalk;  /* pings hear the others' chirps too */
    double reach_m;  /* how far the gate goes */
    struct frames_config cfg;
    struct ego_path path;
    struct frames_motion motion;
    struct pulse_compress *compress[2]; /* up, down */
    size_t n_rx;
    float *rx;
    float complex *traces;
    struct pool *pool;
};

/* A standing point 1.6 m ahead, 0.4 m to the left; chirps of 5 ms, slots of 24 ms; frames
 * of as many pings as there are speakers on a grid of 41 x 1 x 41 voxels of 1 cm around
 * the point.  Change what is to be otherwise, then start. */
void bumper_default(struct bumper *b);
void bumper_elements(struct bumper *b, size_t n_speakers, size_t n_microphones);
void bumper_start(struct bumper *b);
void bumper_stop(struct bumper *b);

/* One more point or plane, in the same world: at first where the world's own is. */
struct moving *bumper_also(struct bumper *b);

/* A frames of it. */
struct frames *bumper_frames(struct bumper *b);

/* Ping k of the endless shot; good until the next. */
void bumper_ping(struct bumper *b, size_t k, struct frames_ping *out);
double bumper_time_s(const struct bumper *b, size_t k);

/* Pings 0..n-1 into a frames. */
void bumper_add(struct bumper *b, struct frames *f, size_t n);

/* Where the point stands in the array frame at ping k. */
void bumper_point(const struct bumper *b, size_t k, double out[3]);

/* Its ego path, a motion every 20 ms. */
void bumper_drive(struct bumper *b);

/* The grid, n x 1 x n voxels around a place. */
void bumper_look_at(struct bumper *b, const double at_m[3], size_t n, double step_m);

/* The strongest voxel: its intensity, and where, by recon/detection/peak.h. */
float bumper_peak(const struct bumper *b, const float *image, double at_m[3]);

#endif
