/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/play.h -- a person at a terminal who pauses, steps, seeks and
 * changes the pace, and a line that says where the bag is. */
#ifndef ANLOS_NODES_ANLOS_BAG_PLAY_H
#define ANLOS_NODES_ANLOS_BAG_PLAY_H

#include <termios.h>

#include "nodes/play/run.h"

struct play_keys {
    bool terminal, shown;
    struct termios before;
    struct playback_status status; /* as shown last */
    int64_t show_due_ns;
};

/* Keys come one by one from now on, when both ends are a terminal; else nothing is read
 * or shown. */
void play_keys_open(struct play_keys *k, struct play_control *out);
void play_keys_close(struct play_keys *k);

/* What n bytes from the keyboard ask for.  -ECANCELED: to end. */
int play_keys_take(struct play_keys *k, struct playback *p, const char *bytes, size_t n,
                   int64_t now_ns);

/* "  12.3 of 64.1 s  plays at 2x  512 pings, 510 used"; at most size - 1 characters. */
void play_keys_line(const struct playback_status *s, char *text, size_t size);

#endif
