/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/ego_table.h -- ego.csv beside the recording of a drive: how the vehicle
 * moved, as topic "ego" has it.
 *
 *   time_s,speed_m_s,yaw_rate_rad_s,standstill,valid
 *
 * The first line names the columns, of which the first three must be there.  time_s: as
 * in emissions.csv; where that is not there or names none, from the first sample of the
 * recording on.  standstill: else it stands where speed and yaw rate are 0.  valid 0:
 * they are not known then, and may be empty. */
#ifndef ANLOS_NODES_ANLOS_BAG_EGO_TABLE_H
#define ANLOS_NODES_ANLOS_BAG_EGO_TABLE_H

#include <stdint.h>
#include <stdio.h>

#include "dsp/error.h"
#include "msgs/vehicle.pb-c.h"

#define EGO_FILE "ego.csv"

struct ego_row {
    int64_t time_ns;
    Anlos__EgoMotion motion;
};

struct ego_table {
    struct ego_row *rows; /* [n], in the order of time */
    size_t n, room;
};

/* Clear with ego_table_clear, also after an error.  The error is "file:line: what was
 * expected".  0, errors of table_load. */
int ego_table_load(struct ego_table *out, const char *path, struct error *why);
void ego_table_clear(struct ego_table *t);

/* A line; NULL: that of the names. */
void ego_row_print(FILE *f, const struct ego_row *row);

#endif
