/* SPDX-License-Identifier: MIT */
/* recon/tracking/track_models.h -- who walks either keeps his pace or changes it: two
 * filters of recon/tracking/track_filter.h, one that hardly accelerates and one that
 * brakes and sets off, with probabilities (interacting multiple models: Blom and
 * Bar-Shalom 1988, IEEE Trans. AC-33).
 *
 * What is heard of him is the limb or the shoulder that glints just then, 12 cm off along
 * the array, one sigma, for a step or so: one model that follows him when he stops
 * follows each step, too.
 *
 * Private to recon/tracking/track*.c. */
#ifndef ANLOS_RECON_TRACKING_TRACK_MODELS_H
#define ANLOS_RECON_TRACKING_TRACK_MODELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "recon/tracking/track_filter.h"

enum { TRACK_KEEPS_PACE, TRACK_CHANGES_PACE, TRACK_MODELS };

struct track_models {
    bool begun;
    struct track_filter of[TRACK_MODELS];
    double share[TRACK_MODELS]; /* probabilities */
};

/* All the same, as likely as they are in the long run. */
void track_models_begin(struct track_models *m, const struct track_filter *f);

/* psd_m2_s3: of what changes its pace and what keeps it, dt_s >= 0.  lost: it was not
 * heard the last time.  *out is the mean of all, with what they disagree by in its
 * covariance. */
void track_models_predict(struct track_models *m, double dt_s, bool lost,
                          const double psd_m2_s3[TRACK_MODELS], struct track_filter *out);
void track_models_update(struct track_models *m, const struct track_position *p,
                         struct track_filter *out);

/* What is heard last of somebody, before he is heard no more, is a part of him: what is
 * left in front of the end of a wall, or in the gate, and few pairs hear it.  So the
 * looks just before a loss are taken back. */
#define TRACK_PAST 6

struct track_past {
    size_t n; /* the newest first */
    struct {
        int64_t at_ns;
        struct track_models models;
    } list[TRACK_PAST];
};

/* After a look; not more often than needed. */
void track_past_keep(struct track_past *p, const struct track_models *m, int64_t at_ns);

/* Makes of *m, which is for now_ns, what it would be without the looks since some time
 * before the last one, seen_ns, once; where that knows the speed as well, and they do not
 * show that he stopped or turned. */
void track_past_restore(struct track_past *p, int64_t seen_ns, int64_t now_ns,
                        const double psd_m2_s3[TRACK_MODELS], struct track_models *m,
                        struct track_filter *out);

#endif
