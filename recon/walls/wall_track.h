/* SPDX-License-Identifier: MIT */
/* recon/walls/wall_track.h -- walls over time: ids that stay, motion of the array,
 * existence, and what is not seen any more.
 *
 * An estimate shares its errors with the one before: elements, speed of sound, the prior.
 * So the two are joined by covariance intersection, which is right for any correlation
 * (Julier and Uhlmann 1997), weighted by their traces (Niehsen 2002): what is estimated
 * again and again becomes steadier, not surer. */
#ifndef ANLOS_RECON_WALLS_WALL_TRACK_H
#define ANLOS_RECON_WALLS_WALL_TRACK_H

#include "recon/walls/wall.h"

#define WALL_TRACKS_MAX 8

struct wall_track_config {
    double seen; /* probability that a wall is estimated when it is there */
    double false_alarm;
    double lost_s;             /* without being seen */
    double lost_m;             /* one sigma of its distance */
    double drift_m, drift_rad; /* in a second of standstill, one sigma */
    double per_way, per_turn;  /* relative errors of the way and the turn */
    double turn_per_m;         /* rad of turn that nobody measured, per metre of way */
    double blind_m_s, blind_rad_s; /* of motion when it is not known */
};

void wall_track_default(struct wall_track_config *cfg);

struct wall_track {
    uint32_t id; /* from 1, not used again */
    struct wall wall;
    double existence; /* 0..1 */
    double unseen_s;
    bool confirmed; /* was sure once */
};

struct wall_tracks { /* {0}: none */
    size_t n;
    struct wall_track list[WALL_TRACKS_MAX];
    uint32_t last_id;
    size_t n_lost;    /* confirmed ones that were lost, of all time */
    uint32_t lost_id; /* the last of them */
};

struct wall_motion { /* of the array's frame in dt_s: a point that stands still goes to */
    double dt_s;
    double r[3][3], t[3]; /* r p + t */
    double way_m, turn_rad;
    bool known;
};

/* Carries the walls along, and what is not known of them grows; loses some. */
void wall_tracks_predict(struct wall_tracks *t, const struct wall_track_config *cfg,
                         const struct wall_motion *motion);

/* The walls that were seen now [n], in the present frame; the others were not. */
void wall_tracks_update(struct wall_tracks *t, const struct wall_track_config *cfg,
                        const struct wall *seen, size_t n);

/* A wall with an id of somebody else's, who is believed: from now on it is that. */
void wall_tracks_put(struct wall_tracks *t, uint32_t id, const struct wall *w);

/* The wall of an id; NULL: there is none. */
const struct wall_track *wall_tracks_find(const struct wall_tracks *t, uint32_t id);

/* Loses all walls but those with these ids [n]. */
void wall_tracks_keep(struct wall_tracks *t, const uint32_t *ids, size_t n);

/* Covariance (6 numbers) of the intersection of two, and how much of b's difference from
 * a the joined state takes: gain [3][3]. */
void wall_intersect(const double a[6], const double b[6], double out[6],
                    double gain[3][3]);

#endif
