/* SPDX-License-Identifier: MIT */
#include "nodes/rt/optional_node.h"

#include <stddef.h>
#include <string.h>

bool optional_node_is(const char *node)
{
    static const char *const names[] = {"can", "play", "record", "report", "view"};

    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (!strcmp(node, names[i]))
            return true;
    return false;
}
