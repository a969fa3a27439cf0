/* SPDX-License-Identifier: MIT */
/* tests/recon/hard.h -- one recording after the other for every imaging method there is:
 * an array that all of them accept, what its traces may suffer, and how well a point must
 * still be seen. */
#ifndef ANLOS_TESTS_RECON_HARD_H
#define ANLOS_TESTS_RECON_HARD_H

#include "tests/recon/rig.h"

struct hard {
    struct rig rig;
    struct scatterer point;
    float complex *traces; /* [ping][n_microphones][rig.format.n_samples] */
};

/* 10 positions, 8 places with a speaker and a microphone 3 cm apart, 0.54 x 0.49 m; a
 * point 1.1 m before it, on no voxel and not in the middle.  Numbers less than these
 * leave the first ones, around the middle. */
void hard_create(struct hard *h, double sound_speed_m_s, size_t n_positions,
                 size_t n_speakers, size_t n_microphones);
void hard_clear(struct hard *h);

/* Of one ping and microphone. */
float complex *hard_trace(const struct hard *h, size_t ping, size_t microphone);
size_t hard_pings(const struct hard *h);

/* The image [grid] on the heap; NULL when the method refuses the geometry, in which case
 * it must say why.  masked [n_microphones] or NULL. */
float *hard_image(const struct hard *h, const char *method, const bool *masked);

/* Calls check for each of imager_methods(). */
void hard_every_method(void (*check)(const char *method));

/* How far a method may be off.  An aperture without extent in x or y leaves a point free
 * to move as long as the paths over it stay the same. */
struct hard_limits {
    double lateral_m, depth_m;
    double path_m;      /* rms over pairs between the paths over the peak and the point */
    double thin_path_m; /* the same for an aperture without extent in x or y, */
    double pair_path_m; /* and for a lone pair */
};
void hard_limits(const char *method, struct hard_limits *out);

/* The image is finite, not negative, not dark, and its maximum explains the recording:
 * the paths over it are those over the point. */
void hard_expect_paths(const struct hard *h, const char *method, const float *image);

/* And it is where the point is. */
void hard_expect_point(const struct hard *h, const char *method, const float *image);

#endif
