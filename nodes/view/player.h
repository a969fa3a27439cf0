/* SPDX-License-Identifier: MIT */
/* nodes/view/player.h -- shows a bag: a thread that brings the view to the place in it
 * that a page asked for last.  All pages show the same place. */
#ifndef ANLOS_NODES_VIEW_PLAYER_H
#define ANLOS_NODES_VIEW_PLAYER_H

#include "nodes/view/timeline.h"

struct player;

/* may_mark: pages may change the bag's bookmarks (nodes/view/bookmarks.h), which they see
 * in any case, with the moment at which the bag was saved, where it is one of the last
 * seconds.
 *
 * The player's thread is the one that the view takes messages from; the view outlives it.
 * tell is called with every message that is shown, also by that thread.  It starts at the
 * end of the bag, where the results are.  0, errors as timeline_open. */
int player_create(struct player **out, const char *path, bool may_mark, struct view *view,
                  struct error *why);
int player_start(struct player *p, void (*tell)(void *ctx, const struct view_message *m),
                 void *ctx); /* 0, -EAGAIN */

/* Any thread; of several requests that wait, the last one counts. */
void player_seek(void *player, double seconds);

/* A bookmark at a time; name NULL: the one that is there goes.  Any thread.  What cannot
 * be done the pages are told. */
void player_mark(void *player, double at_s, const char *name);

/* A sign of life for the pages, however long the player reads.  Any thread. */
void player_beat(struct player *p);

/* Ends the thread: nothing is shown or told any more.  NULL is fine. */
void player_stop(struct player *p);
void player_destroy(struct player *p);

#endif
