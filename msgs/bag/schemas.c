/* SPDX-License-Identifier: MIT */
#include "msgs/bag/schemas.h"

#include <string.h>

struct bag_schema bag_schema_find(const struct bag_schema_entry *table, const char *name)
{
    struct bag_schema out = {.name = bytes_of(name), .encoding = bytes_of(BAG_PROTOBUF)};

    for (const struct bag_schema_entry *e = table; e->name; e++)
        if (!strcmp(e->name, name))
            out.data = (struct bytes){e->data, e->size};
    return out;
}

struct bag_schema bag_schema_of(const struct topic *t)
{
    return bag_schema_find(bag_schema_table, t->schema->name);
}
