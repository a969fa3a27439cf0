/* SPDX-License-Identifier: MIT */
/* recon/tracking/track_body.h -- an object that an image shows in several places at once:
 * a car, whose bright panels come and go while it passes.  Its parts keep their places in
 * it, as those of a rigid body that does not turn do, so that each part says where the
 * whole is, and one that is seen first in the middle of its way does not pull it there.
 *
 * It comes about from tracks that run beside each other with the same velocity, faster
 * than persons walk and with no gap between them that a person would fit into; two that
 * ride so close together are one object.  (Group tracking: Blackman and Popoli 1999,
 * "Design and Analysis of Modern Tracking Systems", section 11.4; extended objects by
 * their outlines: Granstroem, Baum and Reuter 2017, "Extended object tracking".)
 *
 * Private to recon/tracking/track*.c. */
#ifndef ANLOS_RECON_TRACKING_TRACK_BODY_H
#define ANLOS_RECON_TRACKING_TRACK_BODY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define TRACK_PARTS      16
#define TRACK_PART_KNOWN 0.5 /* looks, after which a part counts for the size */

struct track_part {
    double offset_m[2], variance_m2; /* over ground, from the place of the filter */
    double looks;                    /* that it was seen in */
    int64_t seen_ns;
};

struct track_body {
    struct track_part parts[TRACK_PARTS];
    double sight[2]; /* over ground: along which the track was heard last */
    size_t n;        /* 0: all there is to see is one place */
};

struct track;
struct tracker;
struct track_scan;
struct track_position;

/* How well a position fits the track, or the best of its parts (*part; may be NULL). */
struct track_match track_body_match(const struct track *k, const struct track_position *p,
                                    size_t *part);

/* How far outside of what is known of a body a position is; INFINITY: too far to be a
 * part of it. */
double track_body_gap_m(const struct track *k, const struct track_position *p);

/* What was one place so far is a part of a body. */
void track_body_begin(struct track *k);

/* The filters take what is track i's, part by part; what is no part yet becomes one. */
void track_body_update(struct tracker *t, const struct track_scan *scan,
                       const size_t *whose, size_t i, double fresh);

/* Tracks that are one object: of each two the younger is over then.  Parts of one body,
 * which ride close together; */
void track_body_merge(struct tracker *t);

/* who walks within join_m of another one for a while, as he does, and is heard twice; */
void track_join_walkers(struct tracker *t, double fresh);

/* and what is nearer than join_m to a named track's place, which is not told beside it:
 * of a thing that stood there, which what passes by has taken along, it would become a
 * double. */
void track_absorb(struct tracker *t);

#endif
