/* SPDX-License-Identifier: MIT */
/* nodes/rt/plan_tracks.h -- what moves on a plan view: trails, where each track was last,
 * and its motion.  Each track has a colour of its own. */
#ifndef ANLOS_NODES_RT_PLAN_TRACKS_H
#define ANLOS_NODES_RT_PLAN_TRACKS_H

#include "nodes/rt/plan_sheet.h"

/* In the pen's colour; dashed where it was predicted. */
void plan_tracks_trail(const struct sheet *p, const struct plan_picture *pic,
                       const struct trail *k);

void plan_tracks_draw(const struct sheet *p, const struct plan_picture *pic);

/* Beside the plan, where no trail crosses them, as many as there is room for. */
void plan_tracks_name(const struct sheet *p, const struct plan_picture *pic);

#endif
