/* SPDX-License-Identifier: MIT */
/* recon/tracking/track_life.h -- is there an object at all?  Its probability by recursive
 * Bayes (integrated probabilistic data association: Musicki, Evans and Stankovic 1994,
 * "IPDA", IEEE Trans. AC-39, for the one position that assignment leaves a track), and
 * confirmation by M of N (Blackman and Popoli 1999, "Design and Analysis of Modern
 * Tracking Systems", section 6.3).
 *
 * Who is there may be hidden, behind a corner or turned away, and is then not heard for a
 * while: looks that show nothing tell that he is hidden or gone, in the shares that
 * either happens in ("Markov chain two" of the same paper).
 *
 * Images whose pings overlap say the same again.  Each counts by its fresh part only: as
 * that power of its likelihood, and toward one of the N looks, which is a hit when the
 * object was seen in half of it. */
#ifndef ANLOS_RECON_TRACKING_TRACK_LIFE_H
#define ANLOS_RECON_TRACKING_TRACK_LIFE_H

#include <stdbool.h>
#include <stdint.h>

#define TRACK_LOOKS_MAX 32

struct track_life_config {
    unsigned confirm_hits, confirm_of; /* M, N: 1 <= M <= N <= TRACK_LOOKS_MAX */
    double confirm_existence;          /* also needed; 0: M of N decides alone */
    double delete_existence;           /* below it a track ends */
    double survival_s;                 /* mean time that an object stays, */
    double hides_s, hidden_s; /* is heard, and is hidden; hides_s 0: it never is */
};

struct track_life {
    double existence; /* 0..1 */
    double hidden;    /* of it: there, and not to be heard */
    bool confirmed;
    uint32_t hits;            /* a bit for each look, the newest is the lowest */
    unsigned looks;           /* up to N */
    double fresh, seen_fresh; /* of the look that is not whole yet */
};

/* With the first look, a hit. */
void track_life_start(struct track_life *l, const struct track_life_config *cfg,
                      double existence);
void track_life_predict(struct track_life *l, const struct track_life_config *cfg,
                        double dt_s);

/* ratio: how much likelier what came (or did not come) is with the object to be heard
 * than without it.  fresh: 0..1. */
void track_life_update(struct track_life *l, const struct track_life_config *cfg,
                       bool seen, double ratio, double fresh);

/* Somebody else has looked at it ping by ping, and is so sure that it is there: as sure
 * as confirm_existence, it is confirmed. */
void track_life_prove(struct track_life *l, const struct track_life_config *cfg,
                      double existence);

/* Too unlikely, or not to be confirmed any more. */
bool track_life_is_over(const struct track_life *l, const struct track_life_config *cfg);

#endif
