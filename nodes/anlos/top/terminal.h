/* nodes/anlos/top/terminal.h -- a page on the whole terminal, and its keys (ncurses).
 * There is one terminal; it is given back as it was found. */
#ifndef ANLOS_NODES_ANLOS_TOP_TERMINAL_H
#define ANLOS_NODES_ANLOS_TOP_TERMINAL_H

#include "dsp/error.h"
#include "nodes/anlos/top/page.h"

/* Takes the terminal of stdin and stdout over.  Signals that end the program have to be
 * caught before.  Colour unless the terminal has none or NO_COLOR is set.  0, -ENOTTY
 * (of a kind that cannot be drawn on). */
int terminal_open(struct error *why);

void terminal_size(int *width, int *height);
void terminal_draw(const struct page *p);

/* The next key as look.h names it, or -1: none has been pressed.  A change of size and a
 * key without meaning are 0. */
int terminal_key(void);
void terminal_close(void);

#endif
