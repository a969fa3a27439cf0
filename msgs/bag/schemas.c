/* SPDX-License-Identifier: MIT */
#include "msgs/bag/schemas.h"

#include <string.h>

struct bag_schema bag_schema_of(const struct topic *t)
{
    struct bag_schema out = {.name = bytes_of(t->schema->name),
                             .encoding = bytes_of(BAG_PROTOBUF)};

    for (const struct bag_schema_entry *e = bag_schema_table; e->name; e++)
        if (!strcmp(e->name, t->schema->name))
            out.data = (struct bytes){e->data, e->size};
    return out;
}
