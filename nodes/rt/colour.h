/* SPDX-License-Identifier: MIT */
/* nodes/rt/colour.h -- may what is written there have colours?  On a terminal that knows
 * any, unless NO_COLOR is set and not empty (no-color.org). */
#ifndef ANLOS_NODES_RT_COLOUR_H
#define ANLOS_NODES_RT_COLOUR_H

#include <stdbool.h>

bool colour_wanted(int fd);

#endif
