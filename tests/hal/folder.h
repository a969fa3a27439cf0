/* SPDX-License-Identifier: MIT */
/* tests/hal/folder.h -- the end of a test's folder. */
#ifndef ANLOS_TESTS_HAL_FOLDER_H
#define ANLOS_TESTS_HAL_FOLDER_H

#include <stdio.h>
#include <stdlib.h>

/* Removes it with all that is in it.  0, or what system() says. */
static inline int folder_remove(const char *folder)
{
    char command[600];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

#endif
