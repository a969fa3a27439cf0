/* SPDX-License-Identifier: MIT */
/* nodes/rt/terminal.h -- what is shown on a terminal: in colours, as large as it is, in
 * the same place again and again. */
#ifndef ANLOS_NODES_RT_TERMINAL_H
#define ANLOS_NODES_RT_TERMINAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/* May what is written there have colours?  On a terminal that knows any, unless NO_COLOR
 * is set and not empty (no-color.org). */
bool colour_wanted(int fd);

/* A text that is drawn again and again in the same place of a terminal. */

struct live {
    FILE *f;
    size_t n_lines; /* that stand there */
};

/* Draws the text over the one before, cut to as many lines (the last then says how many
 * are missing) and bytes in a line as the terminal has.  0, -errno of writing. */
int live_draw(struct live *l, const char *text, size_t high, size_t wide);

/* Of the terminal on a descriptor; 24 and 80 where it does not say. */
void live_size(int fd, size_t *high, size_t *wide);

#endif
