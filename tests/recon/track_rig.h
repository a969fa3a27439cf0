/* SPDX-License-Identifier: MIT */
/* tests/recon/track_rig.h -- a tracker of 20 images a second, each a quarter of which is
 * new, and what is heard in the next of them. */
#ifndef TESTS_RECON_TRACK_RIG_H
#define TESTS_RECON_TRACK_RIG_H

#include "recon/tracking/track.h"

#define FRAME_NS 50000000
#define FRAME_S  0.05
#define SIGMA_M  0.03

struct track_rig {
    struct tracker *tracker;
    struct track_detection detections[TRACK_DETECTIONS];
    struct track_scan scan;
    struct track_report reports[TRACKS_MAX];
    size_t n;
    unsigned long long seed;
    double sight[2];
};

/* Fixtures of cmocka: *state is the rig. */
int track_rig_setup(void **state);
int track_rig_teardown(void **state);

/* Along r->sight, SIGMA_M off. */
void track_rig_see(struct track_rig *r, double x, double y, double power);

/* The next image. */
void track_rig_step(struct track_rig *r);

#endif
