/* SPDX-License-Identifier: MIT */
/* nodes/view/bookmarks.h -- named times of a bag, in a text file beside it that a person
 * may write, too: BAG.bookmarks, a line each, seconds after the bag's start and a name:
 *
 *   12.34 cyclist behind the bus */
#ifndef ANLOS_NODES_VIEW_BOOKMARKS_H
#define ANLOS_NODES_VIEW_BOOKMARKS_H

#include <stddef.h>

#include "dsp/error.h"

#define BOOKMARKS_MOST     500
#define BOOKMARK_NAME_SIZE 81

struct bookmark {
    double at_s;
    char name[BOOKMARK_NAME_SIZE]; /* UTF-8 */
};

struct bookmarks { /* starts as {0} */
    char *path;
    struct bookmark *list; /* [n], in the order of their times */
    size_t n, room;
};

/* What there is for that bag; no file is no bookmark.  0, -EINVAL (a line that is none:
 * the list is empty then, and the file is left alone), -ENOMEM, errors of files. */
int bookmarks_read(struct bookmarks *b, const char *bag, struct error *why);

/* Writes the file anew.  0, -EINVAL (a time below 0, or a name that is empty, too long,
 * not UTF-8 or has control characters), -ENOSPC (too many), -ENOENT (none at that time),
 * -ENOMEM, errors of files; then all is as before. */
int bookmarks_add(struct bookmarks *b, double at_s, const char *name, struct error *why);
int bookmarks_remove(struct bookmarks *b, double at_s, struct error *why);
void bookmarks_clear(struct bookmarks *b);

#endif
