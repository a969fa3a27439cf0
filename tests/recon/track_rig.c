/* SPDX-License-Identifier: MIT */
#include "tests/recon/track_rig.h"

#include <stdlib.h>
#include <string.h>

#include "tests/recon/dice.h"
#include "tests/recon/near.h"

int track_rig_setup(void **state)
{
    struct track_rig *r = calloc(1, sizeof *r);
    struct track_config cfg;

    if (!r)
        return -1;
    track_config_default(&cfg);
    r->scan = (struct track_scan){.detections = r->detections,
                                  .fresh = 0.25,
                                  .clutter_m2 = 0.01,
                                  .ego_known = true};
    r->seed = 5;
    *state = r;
    return tracker_create(&r->tracker, &cfg);
}

int track_rig_teardown(void **state)
{
    struct track_rig *r = *state;

    tracker_destroy(r->tracker);
    free(r);
    return 0;
}

void track_rig_see(struct track_rig *r, double x, double y, double power)
{
    struct track_detection *d = &r->detections[r->scan.n++];

    *d =
        (struct track_detection){.position_m = {x + SIGMA_M * dice_normal(&r->seed),
                                                y + SIGMA_M * dice_normal(&r->seed), 0.5},
                                 .existence = 1.0,
                                 .power = power,
                                 .height_assumed = true};
    d->covariance_m2[0] = d->covariance_m2[3] = SIGMA_M * SIGMA_M;
    d->covariance_m2[5] = 0.25;
    memcpy(d->sight, r->sight, sizeof d->sight);
}

void track_rig_step(struct track_rig *r)
{
    r->scan.stamp_ns += FRAME_NS;
    assert_int_equal(tracker_step(r->tracker, &r->scan), 0);
    r->scan.n = 0;
    r->n = tracker_report(r->tracker, r->reports);
}
