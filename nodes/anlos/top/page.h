/* nodes/anlos/top/page.h -- lines of text for a screen, with what they mean. */
#ifndef ANLOS_NODES_ANLOS_TOP_PAGE_H
#define ANLOS_NODES_ANLOS_TOP_PAGE_H

#include <stdbool.h>

enum { PAGE_MAX_LINES = 200, PAGE_MAX_COLUMNS = 400, PAGE_LINE_SIZE = 1601 };

enum page_tone { PAGE_PLAIN, PAGE_GOOD, PAGE_NOTE, PAGE_BAD, PAGE_FAINT };
enum page_kind { PAGE_TEXT, PAGE_TITLE, PAGE_FOCUSED_TITLE };

struct page_line {
    char text[PAGE_LINE_SIZE]; /* UTF-8 without control characters */
    enum page_kind kind;
    bool selected;
    enum page_tone tone; /* of tone_n columns from tone_at */
    int tone_at, tone_n;
};

struct page {
    int width, height, n_lines;
    struct page_line lines[PAGE_MAX_LINES];
};

/* Empties it; a size beyond the largest is cut to that. */
void page_begin(struct page *p, int width, int height);

/* Adds a line, cut to the width.  NULL: there is no room. */
struct page_line *page_add(struct page *p, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* Adds empty lines up to n. */
void page_fill(struct page *p, int n);

#endif
