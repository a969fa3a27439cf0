/* SPDX-License-Identifier: MIT */
#include "dsp/list.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

int list_grow(void *list, size_t n, size_t *room, size_t element_size)
{
    size_t more = *room ? 2 * *room : 16;
    void *first;

    if (n < *room)
        return 0;
    memcpy(&first, list, sizeof first); /* of whatever type the pointer is */
    first = realloc(first, more * element_size);
    if (!first)
        return -ENOMEM;
    memcpy(list, &first, sizeof first);
    *room = more;
    return 0;
}
