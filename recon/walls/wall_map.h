/* SPDX-License-Identifier: MIT */
/* recon/walls/wall_map.h -- the walls that are known, over time: those of a survey, those
 * that the vehicle gives, or those that were heard (recon/walls/wall_listener.h). */
#ifndef ANLOS_RECON_WALLS_WALL_MAP_H
#define ANLOS_RECON_WALLS_WALL_MAP_H

#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"
#include "recon/ego.h"
#include "recon/survey.h"
#include "recon/walls/wall_estimate.h"
#include "recon/walls/wall_track.h"
#include "recon/walls/walls.h"

enum wall_from { WALL_FROM_SURVEY, WALL_FROM_TOPIC, WALL_FROM_ECHOES };

struct wall_map_config {
    enum wall_from from;
    double lost_s;                            /* without being seen or given */
    double vertical_rad;                      /* how upright given walls are, one sigma */
    size_t n_corners;                         /* of what the array sees directly */
    double free_view_m[WALLS_MAX_CORNERS][2]; /* x, z in the array's plane */
};

struct wall_map {
    enum wall_from from;
    struct wall_track_config cfg;
    double vertical_rad;     /* how upright given walls are, one sigma */
    struct walls configured; /* of the survey */
    const struct survey *survey;
    struct wall_tracks tracks;
    struct ego_path path;
    bool has_ego;        /* somebody tells how the vehicle moves */
    bool blind;          /* but not lately */
    int64_t at_ns;       /* that the tracks are for; 0: never */
    size_t undetermined; /* of the newest look; */
    double bent_1_m;     /* the curvature of a wall that is too round; 0: there is none */
    struct walls list;   /* what wall_map_list hands out, */
    char text[160];      /* and what is wrong then; empty when all is well */
};

void wall_map_init(struct wall_map *k, const struct wall_map_config *cfg);

/* From now on this survey, which must outlive it; keep: of the same array in the same
 * air, and what is known of walls still holds.  Else other walls are forgotten. */
void wall_map_survey(struct wall_map *k, const struct survey *s, bool keep);

/* How the vehicle moves; NULL: somebody told of it, but not that. */
void wall_map_ego(struct wall_map *k, const struct ego_motion *motion, int64_t stamp_ns);

/* How the vehicle moved; NULL: nobody has told ever, it counts as standing. */
const struct ego_path *wall_map_path(const struct wall_map *k);

/* Carries all to an instant; an earlier one is left alone. */
void wall_map_advance(struct wall_map *k, int64_t to_ns);

/* What was heard, in the frame of the stamp that it was advanced to. */
void wall_map_estimates(struct wall_map *k, const struct wall_estimates *e);

/* What the vehicle says: all the walls that it knows, in its frame, each as it was
 * unseen_s before the stamp; one that is in the list no more is lost.  0, or -EINVAL with
 * an error (walls_check). */
int wall_map_given(struct wall_map *k, const struct walls *given, int64_t stamp_ns,
                   struct error *why);

/* The surest first; borrows from the wall map until its next call. */
const struct walls *wall_map_list(struct wall_map *k);

#endif
