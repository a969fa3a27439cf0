/* SPDX-License-Identifier: MIT */
/* recon/tracking/track_ids.h -- names of tracks, 1 to 254, that are not given again while
 * whoever heard them may still mean the object they belonged to. */
#ifndef ANLOS_RECON_TRACKING_TRACK_IDS_H
#define ANLOS_RECON_TRACKING_TRACK_IDS_H

#include <stdbool.h>
#include <stdint.h>

#define TRACK_ID_MAX 254

struct track_ids { /* {0}: none was given yet */
    bool taken[TRACK_ID_MAX + 1];
    int64_t rest_until_ns[TRACK_ID_MAX + 1]; /* 0: never given */
    unsigned last;
};

/* To begin with: the first one is another in each second.  Who was started again, and had
 * given less than one a second, begins with ids that nobody has heard of lately. */
void track_ids_begin(struct track_ids *ids, int64_t now_ns);

/* The next one round after the last; 0: all are taken or at rest. */
unsigned track_ids_take(struct track_ids *ids, int64_t now_ns);
void track_ids_give_back(struct track_ids *ids, unsigned id, int64_t now_ns,
                         double rest_s);

/* After a clock that jumped: all that were given rest from now. */
void track_ids_rest(struct track_ids *ids, int64_t now_ns, double rest_s);

#endif
