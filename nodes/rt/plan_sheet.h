/* SPDX-License-Identifier: MIT */
/* nodes/rt/plan_sheet.h -- how a plan view lies on paper: what there is to see, and how
 * metres become units of the picture. */
#ifndef ANLOS_NODES_RT_PLAN_SHEET_H
#define ANLOS_NODES_RT_PLAN_SHEET_H

#include <cairo.h>
#include <stdbool.h>

#include "nodes/rt/export_plan.h"

#define SHEET_LEFT 78.0 /* of the plot, in units of the picture */
#define SHEET_TOP  52.0
#define SHEET_TEXT 15.0

struct sheet {
    cairo_t *cr;
    double low[2], high[2]; /* metres to the right and ahead, at the plot's edges */
    double per_metre, w, h; /* units; of the plot */
};

/* Leaves cr alone. */
void sheet_lay_out(struct sheet *p, const struct plan_picture *pic);

/* A place on the plan, in units from the picture's upper left corner. */
void sheet_place(const struct sheet *p, const double at[2], double out[2]);

/* Moves cr to a place on the plan, or draws a line to it. */
void sheet_go(const struct sheet *p, const double at[2], bool draws);

bool sheet_in_vehicle(const struct plan_picture *pic);

/* Of the i-th element, speakers first, on the plan; and the foremost of them all. */
void sheet_element(const struct plan_picture *pic, size_t i, double out[2]);
double sheet_front_of_car(const struct plan_picture *pic);

/* The last word of a track; NULL: there is none. */
const struct plan_track *sheet_track(const struct plan_picture *pic, uint32_t id);

/* The tip of a track's arrow on the plan: where it would be a second later.  false: its
 * velocity is not known, or too great to be drawn. */
bool sheet_tip(const struct plan_picture *pic, const struct trail *k, double out[2]);

/* The wall that the image is mirrored at; NULL: none. */
const struct wall *sheet_first_wall(const struct plan_picture *pic);

/* Has the vehicle moved?  Its own trail ends at its origin. */
bool sheet_has_gone(const struct trail *own);

#endif
