/* SPDX-License-Identifier: MIT */
/* nodes/view/plan.h -- what the page is told of the plan view (nodes/rt/plan_view.h). */
#ifndef ANLOS_NODES_VIEW_PLAN_H
#define ANLOS_NODES_VIEW_PLAN_H

#include <jansson.h>

#include "msgs/detections.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/rt/plan_view.h"
#include "nodes/rt/trails.h"
#include "recon/walls/walls.h"

/* "scene": frame, source, the walls that the survey was given, array, air. */
json_t *plan_scene_json(const struct survey *s);

/* "objects" of a list of detections; those of tracks with velocity and trail. */
json_t *plan_objects_json(const Anlos__DetectionList *list, const struct trails *trails);

/* "walls" that node wall tells of, walls being list's. */
json_t *plan_walls_json(const struct survey *s, const Anlos__WallList *list,
                        const struct walls *walls);

/* The corners of what an image covers, where it really is: [[right, ahead], ...] of 4,
 * from that of voxel [0][][0] over x first.  wall NULL: none is known, where it is
 * imaged.
 */
json_t *plan_footprint_json(const struct survey *s, const struct wall *wall,
                            const struct grid *grid);

#endif
