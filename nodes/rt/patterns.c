/* SPDX-License-Identifier: MIT */
#include "nodes/rt/patterns.h"

#include <fnmatch.h>
#include <stdio.h>
#include <string.h>

const char *patterns_next(const char *patterns, char out[PATTERN_SIZE])
{
    size_t n = strcspn(patterns, ",");

    if (!*patterns)
        return NULL;
    snprintf(out, PATTERN_SIZE, "%.*s", (int)n, patterns);
    return patterns + n + (patterns[n] == ',');
}

bool patterns_match(const char *patterns, const char *name)
{
    char pattern[PATTERN_SIZE];

    if (!patterns)
        return true;
    while ((patterns = patterns_next(patterns, pattern)))
        if (!fnmatch(pattern, name, 0))
            return true;
    return false;
}
