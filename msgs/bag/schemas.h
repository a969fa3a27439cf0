/* SPDX-License-Identifier: MIT */
/* msgs/bag/schemas.h -- the schema that a bag names for each topic: "anlos.Ping" as a
 * protobuf file descriptor set with all that it imports, so that any MCAP tool can decode
 * the messages without us; and those of ASAM OSI and of Foxglove.  Built in; made by
 * protoc-c (schemas.cmake). */
#ifndef ANLOS_MSGS_BAG_SCHEMAS_H
#define ANLOS_MSGS_BAG_SCHEMAS_H

#include <stddef.h>
#include <stdint.h>

#include "msgs/bag/record.h"
#include "msgs/topics.h"

#define BAG_PROTOBUF "protobuf" /* the encoding of schemas and messages */

/* What schemas.cmake writes: every message of every schema file, and the descriptor set
 * of its file. */
struct bag_schema_entry {
    const char *name; /* "anlos.Ping" */
    const uint8_t *data;
    size_t size;
};

/* Each ends with name == NULL. */
extern const struct bag_schema_entry bag_schema_table[];
extern const struct bag_schema_entry osi_schema_table[];      /* "osi3.SensorData" */
extern const struct bag_schema_entry foxglove_schema_table[]; /* "foxglove.PointCloud" */

/* Without an id, and without data where the table has none of that name.  Points to the
 * table, and to name. */
struct bag_schema bag_schema_find(const struct bag_schema_entry *table, const char *name);

/* That of a topic of msgs/topics.h, each of which has one; what it points to lives as
 * long as the program. */
struct bag_schema bag_schema_of(const struct topic *t);

#define OSI_MAJOR   3 /* whose names and numbers the schemas have */
#define OSI_MINOR   7
#define OSI_PATCH   0
#define OSI_VERSION "3.7.0"

#endif
