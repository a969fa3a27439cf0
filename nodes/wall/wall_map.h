/* nodes/wall/wall_map.h -- the walls that are known, over time, and their message. */
#ifndef ANLOS_NODES_WALL_WALL_MAP_H
#define ANLOS_NODES_WALL_WALL_MAP_H

#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/rt/launchfile.h"
#include "recon/ego.h"
#include "recon/survey.h"
#include "recon/wall_estimate.h"
#include "recon/wall_track.h"
#include "recon/walls.h"

struct wall_map {
    enum wall_from from;
    struct wall_track_config cfg;
    double vertical_rad;     /* how upright given walls are, one sigma */
    struct walls configured; /* of the survey, with what is in free view */
    const struct survey *survey;
    struct wall_tracks tracks;
    struct ego_path path;
    bool has_ego;        /* somebody tells how the vehicle moves */
    bool blind;          /* but not lately */
    int64_t at_ns;       /* that the tracks are for; 0: never */
    size_t undetermined; /* of the newest look */
    char text[160];

    Anlos__WallList message; /* storage of what wall_map_list hands out */
    Anlos__Wall walls[WALLS_MAX], *each[WALLS_MAX];
    Anlos__Vec3 normals[WALLS_MAX];
    double free_view_m[2 * WALLS_MAX_CORNERS];
};

void wall_map_init(struct wall_map *k, const struct launchfile *l);

/* From now on this survey, which must outlive it; other walls are forgotten. */
void wall_map_survey(struct wall_map *k, const struct survey *s);

void wall_map_ego(struct wall_map *k, const Anlos__EgoMotion *m, int64_t stamp_ns);

/* How the vehicle moved; NULL: nobody has told ever, it counts as standing. */
const struct ego_path *wall_map_path(const struct wall_map *k);

/* Carries all to an instant; an earlier one is left alone. */
void wall_map_advance(struct wall_map *k, int64_t to_ns);

/* What was heard, in the frame of the stamp that it was advanced to. */
void wall_map_estimates(struct wall_map *k, const struct wall_estimates *e);

/* What the vehicle says: all the walls that it knows, each as it was unseen_s before the
 * stamp; one that is in the list no more is lost.  0, or -EINVAL with an error. */
int wall_map_given(struct wall_map *k, const Anlos__WallList *m, int64_t stamp_ns,
                   struct error *why);

/* The surest first; borrows from the wall map until its next call.  text is empty when
 * all is well. */
const Anlos__WallList *wall_map_list(struct wall_map *k);

#endif
