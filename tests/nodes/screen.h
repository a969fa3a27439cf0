/* SPDX-License-Identifier: MIT */
/* tests/nodes/screen.h -- a terminal of the kind vt100, as far as curses makes use of it:
 * what a program writes to it stands in a grid of characters. */
#ifndef ANLOS_TESTS_NODES_SCREEN_H
#define ANLOS_TESTS_NODES_SCREEN_H

#include <stdbool.h>
#include <stddef.h>

enum { SCREEN_MAX_ROWS = 60, SCREEN_MAX_COLUMNS = 200 };

struct screen {
    int rows, columns, y, x;
    int top, bottom; /* the rows that scroll, both included */
    char cells[SCREEN_MAX_ROWS][SCREEN_MAX_COLUMNS + 1]; /* each row ends with a zero */
    int escape;                                          /* 0: none is under way */
    int arguments[8], n_arguments;
    bool coloured; /* a colour was ever asked for */
};

void screen_begin(struct screen *s, int rows, int columns);

/* Takes what the program wrote. */
void screen_write(struct screen *s, const char *text, size_t n);

/* Does the row begin with the text? */
bool screen_row_begins(const struct screen *s, int row, const char *text);

/* Does any row hold the text? */
bool screen_shows(const struct screen *s, const char *text);

#endif
