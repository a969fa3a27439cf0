/* SPDX-License-Identifier: MIT */
#include "nodes/rt/colour.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

bool colour_wanted(int fd)
{
    const char *no = getenv("NO_COLOR"), *kind = getenv("TERM");

    return isatty(fd) && !(no && *no) && kind && *kind && strcmp(kind, "dumb") != 0;
}
