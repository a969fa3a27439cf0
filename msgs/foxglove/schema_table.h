/* SPDX-License-Identifier: MIT */
/* msgs/foxglove/schema_table.h -- Foxglove's messages by name, "foxglove.PointCloud",
 * with the descriptor sets that channels and bags carry. */
#ifndef ANLOS_MSGS_FOXGLOVE_SCHEMA_TABLE_H
#define ANLOS_MSGS_FOXGLOVE_SCHEMA_TABLE_H

#include "msgs/bag/schemas.h"

/* Ends with name == NULL. */
extern const struct bag_schema_entry foxglove_schema_table[];

#endif
