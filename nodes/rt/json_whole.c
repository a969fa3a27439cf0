/* SPDX-License-Identifier: MIT */
#include "nodes/rt/json_whole.h"

#include <stdlib.h>

static _Thread_local bool starved;

static void *take(size_t size)
{
    void *p = malloc(size);

    starved = starved || !p;
    return p;
}

/* Before anything is built. */
__attribute__((constructor)) static void watch_memory(void)
{
    json_set_alloc_funcs(take, free);
}

bool json_whole(const json_t *value)
{
    bool whole = value && !starved;

    starved = false;
    return whole;
}
