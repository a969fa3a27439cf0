/* SPDX-License-Identifier: MIT */
/* msgs/osi/schema_table.h -- messages of ASAM OSI by name, "osi3.SensorData", with the
 * descriptor sets that channels of a bag carry. */
#ifndef ANLOS_MSGS_OSI_SCHEMA_TABLE_H
#define ANLOS_MSGS_OSI_SCHEMA_TABLE_H

#include "msgs/bag/schemas.h"

#define OSI_MAJOR   3 /* whose names and numbers the schemas have */
#define OSI_MINOR   7
#define OSI_PATCH   0
#define OSI_VERSION "3.7.0"

/* Ends with name == NULL. */
extern const struct bag_schema_entry osi_schema_table[];

#endif
