/* SPDX-License-Identifier: MIT */
/* msgs/bag/schema_table.h -- what schemas.cmake writes: every message of every schema
 * file, and the descriptor set of its file. */
#ifndef ANLOS_MSGS_BAG_SCHEMA_TABLE_H
#define ANLOS_MSGS_BAG_SCHEMA_TABLE_H

#include <stddef.h>
#include <stdint.h>

struct bag_schema_entry {
    const char *name; /* "anlos.Ping" */
    const uint8_t *data;
    size_t size;
};

/* Ends with name == NULL. */
extern const struct bag_schema_entry bag_schema_table[];

#endif
