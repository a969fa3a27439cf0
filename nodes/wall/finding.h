/* SPDX-License-Identifier: MIT */
/* nodes/wall/finding.h -- the node wall: what comes goes to recon/walls/wall_finder.h,
 * and the walls come back as a list. */
#ifndef ANLOS_NODES_WALL_FINDING_H
#define ANLOS_NODES_WALL_FINDING_H

#include "msgs/survey.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/rt/loop.h"
#include "recon/walls/wall_finder.h"

struct finding;

extern const struct loop finding_loop;

/* node is not owned; NULL: for the steps below alone.  0, -ENOMEM. */
int finding_create(struct finding **out, struct node *node,
                   const struct wall_finder_config *cfg);

/* 0, or a negative errno with an error. */
int finding_survey(struct finding *f, const Anlos__Survey *m, struct error *why);
void finding_ego(struct finding *f, const Anlos__EgoMotion *m, int64_t capture_ns);

/* As wall_finder_returns.  What does not hold counts as a ping that cannot be used. */
bool finding_echoes(struct finding *f, const Anlos__Echoes *m, int64_t capture_ns,
                    int64_t now_ns);

/* 0, or -EINVAL with an error. */
int finding_given(struct finding *f, const Anlos__WallList *m, int64_t capture_ns,
                  struct error *why);

/* As wall_finder_list. */
const Anlos__WallList *finding_list(struct finding *f, int64_t now_ns, int64_t *stamp_ns);

/* The walls as they are known, to be told or not. */
const Anlos__WallList *finding_walls(struct finding *f);

/* What does the work. */
struct wall_finder *finding_finder(const struct finding *f);
void finding_destroy(struct finding *f);

#endif
