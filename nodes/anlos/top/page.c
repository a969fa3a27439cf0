#include "nodes/anlos/top/page.h"

#include <stdarg.h>
#include <stdio.h>

#include "nodes/anlos/text.h"

static int clamp(int v, int max)
{
    return v < 1 ? 1 : v > max ? max : v;
}

void page_begin(struct page *p, int width, int height)
{
    p->width = clamp(width, PAGE_MAX_COLUMNS);
    p->height = clamp(height, PAGE_MAX_LINES);
    p->n_lines = 0;
}

struct page_line *page_add(struct page *p, const char *format, ...)
{
    va_list args;

    if (p->n_lines == p->height)
        return NULL;
    struct page_line *line = &p->lines[p->n_lines++];
    line->kind = PAGE_TEXT;
    line->selected = false;
    line->tone = PAGE_PLAIN;
    line->tone_at = line->tone_n = 0;
    va_start(args, format);
    vsnprintf(line->text, sizeof line->text, format, args);
    va_end(args);
    text_cut(line->text, (size_t)p->width);
    return line;
}

void page_fill(struct page *p, int n)
{
    while (p->n_lines < n && page_add(p, "%s", ""))
        ;
}
