/* nodes/anlos/top/screen.h -- table -> lines of text for a width and a height.  Pure. */
#ifndef ANLOS_NODES_ANLOS_TOP_SCREEN_H
#define ANLOS_NODES_ANLOS_TOP_SCREEN_H

#include "nodes/anlos/top/look.h"
#include "nodes/anlos/top/page.h"
#include "nodes/anlos/top/table.h"

/* Fills p->width x p->height (page_begin).  The panels share the height: each is there as
 * long as there is room for its first lines, the one in focus gets what it needs first.
 * Takes v->detail_line and v->log_line back to their last lines. */
void layout_draw(struct page *p, const struct table *t, struct look *v);

/* The lines that the two ways of showing have in common: who is alive and what was lost;
 * how far the scan is; a line of the log. */
void layout_summary(const struct table *t, char *out, size_t size);
void layout_scan(const struct table_scan *s, char *out, size_t size);
void layout_log(const struct table_log *l, char *out, size_t size);

#endif
