/* SPDX-License-Identifier: MIT */
/* nodes/anlos/live.h -- a text that is drawn again and again in the same place of a
 * terminal. */
#ifndef ANLOS_NODES_ANLOS_LIVE_H
#define ANLOS_NODES_ANLOS_LIVE_H

#include <stddef.h>
#include <stdio.h>

struct live {
    FILE *f;
    size_t n_lines; /* that stand there */
};

/* Draws the text over the one before, cut to as many lines (the last then says how many
 * are missing) and bytes in a line as the terminal has.  0, -errno of writing. */
int live_draw(struct live *l, const char *text, size_t rows, size_t columns);

/* Of the terminal on a descriptor; 24 and 80 where it does not say. */
void live_size(int fd, size_t *rows, size_t *columns);

#endif
