/* SPDX-License-Identifier: MIT */
/* recon/planning/scan_plan.h -- what a scan of so many seconds will resolve, and how its
 * speakers fire and its stage goes best for it.  Every way is given a time, from what the
 * stage can do, and the image of one point (recon/planning/point_image.h):
 *
 *   stage      from position to position, or through without a stop
 *   slot       as the survey has it, or the shortest that its gate allows
 *   together   one speaker a slot, or two, their chirps up and down
 *   positions  all, three quarters, half, a quarter, or as many as the time allows
 *
 * The error is that of a point's place across the line of sight, the root of the sum of
 * squares of what its image lies beside and of the noise: width / sqrt(8 ln 4 SNR) an
 * axis (Cramer-Rao), where the image's SNR is the recording's,
 *
 *   SNR = raw x traces x slot / 4 / GAIN_LOST        (recon/planning/scan_plan.c)
 *
 * raw: power of the echoes in a recording of the survey as it is, over that of the noise,
 * in the scene and as much in its background. */
#ifndef ANLOS_RECON_PLANNING_SCAN_PLAN_H
#define ANLOS_RECON_PLANNING_SCAN_PLAN_H

#include "recon/planning/point_image.h"

/* Of a stage that goes on (nodes/scan/scan.c): before the first round it gets up to
 * speed, with so much acceleration, and goes at that for so long; and so much longer
 * behind the last slot, for its echoes, before it brakes.  One that is slower begins so
 * many times as far off, and again; it is tried so often. */
#define SCAN_RUN_UP_M_S2 0.5
#define SCAN_RUN_UP_S    0.3
#define SCAN_RUN_OUT_S   0.1
#define SCAN_MORE_RUN_UP 1.8
#define SCAN_RUN_TRIES   3

struct scan_stage { /* what it can do */
    double speed_m_s, acceleration_m_s2, settle_s;
    double reach_m[2]; /* from where to where it can be; both 0: anywhere */
};

struct scan_plan_config {
    const struct survey *survey; /* as it is; with a gate, of two positions or more */
    struct scan_stage stage;
    double time_s;  /* that a pass may take; INFINITY: any */
    double error_m; /* that is good enough: the quickest way is taken; 0: the best is */
    double snr_db;  /* raw; INFINITY: no noise */
    double at_m[3]; /* of the point, array frame, as imaged */
    struct pool *pool;
};

enum { SCAN_WAYS = 40, SCAN_WORDS = 200 };

#define SCAN_TOO_SLOW "takes too long" /* why_not of one that could be had */

struct scan_way {
    bool continuous, alternates;
    size_t slot_samples, together, n_positions;
    double speed_m_s; /* of a continuous stage, and from where it gets up to speed to */
    double room_m[2]; /* where it stands again */
    double time_s;    /* one pass, with the stage's way to its beginning */
    struct point_image image;
    double noise_m, error_m;
    char why_not[SCAN_WORDS]; /* empty: it can be had, keeps the time and shows a point
                               * about as the survey does as it is */
};

struct scan_plan {
    struct point_image whole; /* of the survey as it is, its stage standing */
    struct scan_way ways[SCAN_WAYS];
    size_t n_ways;
    const struct scan_way *best; /* one of them; NULL: none will do */
};

/* More than so much above those of the whole scan sidelobes may not be. */
#define SCAN_SIDELOBES_DB 2.0

/* 0, -EINVAL (the error says what about the survey or the point), -ENOMEM. */
int scan_plan(struct scan_plan *out, const struct scan_plan_config *cfg,
              struct error *why);

/* The survey that goes this way, from the one as it is.  0, -EINVAL (the error says why
 * it cannot be), -ENOMEM; survey_clear it after 0. */
int scan_way_survey(struct survey *out, const struct survey *s, const struct scan_way *w,
                    struct error *why);

#endif
