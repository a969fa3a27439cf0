/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/play.h -- what `anlos bag play` says on a terminal of where it is. */
#ifndef ANLOS_NODES_ANLOS_BAG_PLAY_H
#define ANLOS_NODES_ANLOS_BAG_PLAY_H

#include "nodes/play/run.h"

/* "  12.3 of 64.1 s  plays at 2x  512 pings, 510 used"; at most size - 1 characters. */
void play_keys_line(const struct playback_status *s, char *text, size_t size);

#endif
