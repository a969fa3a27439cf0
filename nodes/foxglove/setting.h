/* SPDX-License-Identifier: MIT */
/* nodes/foxglove/setting.h -- where things stand: what the newest survey and the stage
 * say, which the conversions of other messages need.
 *
 * Frames, as Foxglove draws them:
 *   vehicle  x forward, y left, z up; the root, where the survey has a mount
 *   array    x along the stage, y up, z forward to the wall; the root without a mount
 *   stage    the array frame, moved with the elements along the stage */
#ifndef ANLOS_NODES_FOXGLOVE_SETTING_H
#define ANLOS_NODES_FOXGLOVE_SETTING_H

#include <stdbool.h>
#include <stdint.h>

#include "nodes/foxglove/message.h"
#include "recon/survey.h"
#include "recon/walls/walls.h"

#define FRAME_VEHICLE "vehicle"
#define FRAME_ARRAY   "array"
#define FRAME_STAGE   "stage"

struct setting { /* begins zeroed; clear with setting_clear */
    bool has_survey;
    uint64_t survey_id;
    struct survey survey;
    double stage_m;     /* where the stage is; 0 before it says so */
    bool has_walls;     /* node wall tells of them */
    struct walls walls; /* the surest first, or those of the survey */
};

/* Takes what concerns it from any message.  true: there is another survey now, and what
 * was made with the one before does not hold. */
bool setting_take(struct setting *s, const struct foxglove_message *m);

/* The surest wall, when there is a survey.  false: none is known. */
bool setting_wall(const struct setting *s, struct wall *out);
void setting_clear(struct setting *s);

#endif
