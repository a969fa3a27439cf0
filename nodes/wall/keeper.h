/* nodes/wall/keeper.h -- the walls that are known, over time, and their message. */
#ifndef ANLOS_NODES_WALL_KEEPER_H
#define ANLOS_NODES_WALL_KEEPER_H

#include <stdbool.h>
#include <stdint.h>

#include "dsp/complaint.h"
#include "recon/survey.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/rt/launchfile.h"
#include "recon/walls.h"
#include "recon/ego.h"
#include "recon/wall_estimate.h"
#include "recon/wall_track.h"

struct keeper {
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

    Anlos__WallList message; /* storage of what keeper_list hands out */
    Anlos__Wall walls[WALLS_MAX], *each[WALLS_MAX];
    Anlos__Vec3 normals[WALLS_MAX];
    double free_view_m[2 * WALLS_MAX_CORNERS];
};

void keeper_init(struct keeper *k, const struct launchfile *l);

/* From now on this survey, which must outlive it; other walls are forgotten. */
void keeper_survey(struct keeper *k, const struct survey *s);

void keeper_ego(struct keeper *k, const Anlos__EgoMotion *m, int64_t stamp_ns);

/* How the vehicle moved; NULL: nobody has told ever, it counts as standing. */
const struct ego_path *keeper_path(const struct keeper *k);

/* Carries all to an instant; an earlier one is left alone. */
void keeper_advance(struct keeper *k, int64_t to_ns);

/* What was heard, in the frame of the stamp that it was advanced to. */
void keeper_estimates(struct keeper *k, const struct wall_estimates *e);

/* What the vehicle says: all the walls that it knows, each as it was unseen_s before the
 * stamp; one that is in the list no more is lost.  0, or -EINVAL with a complaint. */
int keeper_given(struct keeper *k, const Anlos__WallList *m, int64_t stamp_ns,
                 struct complaint *why);

/* The surest first; borrows from the keeper until its next call.  text is empty when all
 * is well. */
const Anlos__WallList *keeper_list(struct keeper *k);

#endif
