/* SPDX-License-Identifier: MIT */
/* nodes/anlos/top/screen.h -- what of the table a person looks at, how keys change it,
 * and the lines of text that come of it for a width and a height.  Pure: no terminal;
 * keys are those of curses. */
#ifndef ANLOS_NODES_ANLOS_TOP_SCREEN_H
#define ANLOS_NODES_ANLOS_TOP_SCREEN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "nodes/anlos/collector.h"

enum look_panel {
    LOOK_NODES,
    LOOK_TOPICS,
    LOOK_DETAIL,
    LOOK_LOG,
    LOOK_OBJECTS,
    LOOK_PANELS
};

enum look_sort {                /* the greatest first, but for the first and the last */
                 LOOK_BY_ORDER, /* of msgs/topics.h */
                 LOOK_BY_LOAD,  /* CPU of nodes, bytes of topics */
                 LOOK_BY_RATE,
                 LOOK_BY_LATENCY,
                 LOOK_BY_LOSSES,
                 LOOK_BY_NAME,
                 LOOK_SORTS
};

enum { LOOK_MAX_ROWS = 64 }; /* of nodes, topics or objects */

struct look { /* zeroed: the first look */
    enum look_panel focus;
    bool detail_of_topic;          /* else of the node that is selected */
    char node[ENVELOPE_NODE_SIZE]; /* selected; empty: the first */
    const struct topic *topic;     /* NULL: the first */
    enum look_sort sort;
    bool paused, help, typing;
    char filter[24];    /* a part of the name; empty: all */
    size_t detail_line; /* first line of the detail that is seen */
    size_t object_line; /* first object that is seen */
    size_t log_line;    /* lines of the log below what is seen */
};

/* Takes a key.  true: it means quit. */
bool look_key(struct look *v, const struct table *t, int key);

/* The rows of nodes, topics or objects to show, as indices: filtered and sorted.  Returns
 * how many; *at: the place among them of the one selected, 0 when it is not there. */
size_t look_rows(const struct look *v, const struct table *t, enum look_panel panel,
                 size_t order[LOOK_MAX_ROWS], size_t *at);

enum { PAGE_MAX_LINES = 200, PAGE_MAX_COLUMNS = 400, PAGE_LINE_SIZE = 1601 };

enum page_tone { PAGE_PLAIN, PAGE_GOOD, PAGE_NOTE, PAGE_BAD, PAGE_FAINT };
enum page_kind { PAGE_TEXT, PAGE_TITLE, PAGE_FOCUSED_TITLE };

struct page {
    int width, height, n_lines;
    struct page_line {
        char text[PAGE_LINE_SIZE]; /* UTF-8 without control characters */
        enum page_kind kind;
        bool selected;
        enum page_tone tone; /* of tone_n columns from tone_at */
        int tone_at, tone_n;
    } lines[PAGE_MAX_LINES];
};

/* Fills width x height; a size beyond the largest is cut to that.  The panels share the
 * height: each is there as long as there is room for its first lines, the one in focus
 * gets what it needs first.  Takes v->detail_line, object_line and log_line back to their
 * last lines. */
void screen_draw(struct page *p, int width, int height, const struct table *t,
                 struct look *v);

/* The whole table as text, for pipes and files: every column of every node and of the
 * topics that are there, the objects, what devices count, the last lines of the log.  0,
 * -errno of the write. */
int screen_print(FILE *to, const struct table *t);

#endif
