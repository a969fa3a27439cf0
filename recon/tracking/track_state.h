/* SPDX-License-Identifier: MIT */
/* recon/tracking/track_state.h -- what a tracker holds; private to
 * recon/tracking/track*.c. */
#ifndef ANLOS_RECON_TRACKING_TRACK_STATE_H
#define ANLOS_RECON_TRACKING_TRACK_STATE_H

#include "recon/tracking/track.h"
#include "recon/tracking/track_body.h"
#include "recon/tracking/track_filter.h"
#include "recon/tracking/track_models.h"
#include "recon/tracking/track_outline.h"
#include "recon/tracking/track_passing.h"
#include "recon/tracking/track_rest.h"

#define TRACK_NONE    ((size_t)-1)
#define TRACK_FILTERS (2 + TRACK_PASSING + TRACK_MODELS * (1 + TRACK_PAST))

struct track {
    struct track_filter filter;
    struct track_past past;
    struct track_models models; /* of who walks: the filter is what they come to */
    struct track_filter steady; /* stiffer: only tells standing from moving */
    struct track_life life;
    unsigned id; /* 0: not confirmed yet */
    enum track_state state;
    enum track_motion motion;
    int64_t first_ns, seen_ns;
    int64_t since_ns; /* it came out then, between two scans */
    struct track_rest rest;
    double missed;             /* looks, since it was seen */
    int64_t moves_ns;          /* when it was last seen to move by itself; 0: never */
    double extent_m[3], power; /* of its strongest detections, lately */
    double usual;              /* the same over more looks; 0: not yet */
    double height_m2[2][2];    /* by the height that is assumed, over ground */
    struct track_body body;
    struct track_outline outline;
    struct track_passing passing;
    struct track_mirror mirror; /* over ground: that all of this holds for */
    bool placed;                /* it was measured by way of it */
    double waited;              /* for that: looks in which no mirror showed it */
    bool merged;                /* into another one */
    bool beside;                /* what is fast it began: it may be a part of that */
    double as_one;              /* looks, that it has gone with an older one as one */
    unsigned agreeing;          /* times in a row that phases had it go as it went, */
    double velocity_m_s[2];     /* by them with this velocity lately */
    unsigned courses;           /* times that phases had it moving, one like the other, */
    unsigned course_scans;      /* since then, */
    double course_m_s[2];       /* with this velocity lately */
    size_t detection;
};

/* Names.  They are not given again while whoever heard them may still mean the object
 * that they belonged to. */
struct track_ids { /* {0}: none was given yet */
    bool taken[TRACK_ID_MAX + 1];
    int64_t rest_until_ns[TRACK_ID_MAX + 1]; /* 0: never given */
    unsigned last;
};

struct tracker {
    struct track_config cfg;
    struct track_life_config life; /* of the newest scan */
    struct track tracks[TRACKS_MAX];
    size_t n;
    struct track_ids ids;
    struct ego_step pose; /* of the vehicle over ground */
    int64_t stamp_ns;
    double apart_s; /* from the scan before */
    bool began;
    struct track_counts counts;
    struct track_position positions[TRACK_DETECTIONS]; /* of the scan, over ground */
    struct track_rest_look looks[TRACK_DETECTIONS];    /* the same as heard */
    double cost[TRACKS_MAX * (TRACK_DETECTIONS + TRACKS_MAX)];
};

/* A position, and a direction, of the vehicle frame over ground. */
void track_to_ground(const struct ego_step *pose, const double from[2], double to[2]);
void track_turn(double angle, const double from[2], double to[2]);
void track_turn_matrix(double angle, const double from[2][2], double to[2][2]);

/* All that know its place, the filter first; returns how many. */
size_t track_filters(struct track *k, struct track_filter *out[TRACK_FILTERS]);

/* All tracks follow the mirrors of a scan, after its ego motion. */
void track_mirror_follow(struct tracker *t, const struct track_scan *scan);

/* A track was measured by way of the mirror with this id. */
void track_mirror_measured(struct tracker *t, const struct track_scan *scan,
                           struct track *k, uint32_t id);

/* How far a place over ground is beyond where things by this mirror may be; below 0: it
 * is before it. */
double track_mirror_beyond_m(const struct track_mirror *m, const double p[3]);

/* t->positions, t->looks: where the scan's detections are over ground. */
void track_place(struct tracker *t, const struct track_scan *scan, double fresh);

/* A scatterer at rest, as far as is known, which did not make this detection. */
bool track_rests_elsewhere(const struct tracker *t, const struct track_scan *scan,
                           size_t track, size_t detection);

/* Which detection each track gets, mine[t->n], and whose each detection is,
 * whose[scan->n]: TRACK_NONE where it is nobody's.  What is near to a track's own becomes
 * part of it too. */
void track_associate(struct tracker *t, const struct track_scan *scan, double fresh,
                     size_t *mine, size_t *whose);

/* The detections of one owner as one.  Each wall that shows it measures it anew. */
struct track_gathered {
    struct track_position middle;            /* by all walls together */
    struct track_position by[TRACK_MIRRORS]; /* [n_walls] by each, with their scatter */
    size_t n_walls;   /* the first is `followed`, unless another shows it far louder */
    size_t detection; /* the strongest by way of that */
    double extent_m[3], existence;
};
void track_gather(const struct tracker *t, const struct track_scan *scan,
                  const size_t *whose, size_t owner, uint32_t followed,
                  struct track_gathered *out);

#endif
