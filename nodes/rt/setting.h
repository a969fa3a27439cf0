/* SPDX-License-Identifier: MIT */
/* nodes/rt/setting.h -- where things stand, for who draws them: the newest survey, and
 * the walls that it was given or that node wall tells of. */
#ifndef ANLOS_NODES_RT_SETTING_H
#define ANLOS_NODES_RT_SETTING_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/survey.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "recon/survey.h"
#include "recon/walls/walls.h"

struct setting { /* begins zeroed; clear with setting_clear */
    bool has_survey;
    uint64_t survey_id;
    struct survey survey;
    double stage_m;     /* where the stage is; 0 before it says so */
    bool has_walls;     /* node wall tells of them */
    struct walls walls; /* the surest first, or those of the survey */
};

/* true: there is another survey now, and what was made with the one before does not hold;
 * false: it is the same, or none that holds. */
bool setting_survey(struct setting *s, const Anlos__Survey *m);

/* false: they do not hold, and those before stay. */
bool setting_walls(struct setting *s, const Anlos__WallList *m);

/* The surest wall, when there is a survey.  NULL: none is known. */
const struct wall *setting_wall(const struct setting *s);
void setting_clear(struct setting *s);

#endif
