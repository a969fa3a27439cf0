/* SPDX-License-Identifier: MIT */
#include "tests/nodes/screen.h"

#include <ctype.h>
#include <string.h>

enum { NO_ESCAPE, AFTER_ESCAPE, IN_SEQUENCE, IN_CHARSET };

static void clear(struct screen *s, int y, int from, int to)
{
    for (int x = from; x < to && x < s->columns; x++)
        s->cells[y][x] = ' ';
}

void screen_begin(struct screen *s, int rows, int columns)
{
    bool coloured = s->coloured;

    memset(s, 0, sizeof *s);
    s->rows = rows;
    s->columns = columns;
    s->bottom = rows - 1;
    s->coloured = coloured;
    for (int y = 0; y < rows; y++)
        clear(s, y, 0, columns);
}

static int limit(int v, int n)
{
    return v < 0 ? 0 : v >= n ? n - 1 : v;
}

static void erase(struct screen *s, int how)
{
    for (int y = 0; y < s->rows; y++)
        if (how == 2 || (how == 0 && y > s->y) || (how == 1 && y < s->y))
            clear(s, y, 0, s->columns);
}

static void erase_line(struct screen *s, int how)
{
    clear(s, s->y, how == 0 ? s->x : 0, how == 1 ? s->x + 1 : s->columns);
}

/* Rows from the top to the bottom of what scrolls move by one, the new one is empty. */
static void scroll(struct screen *s, bool up)
{
    size_t row = sizeof s->cells[0], n = (size_t)(s->bottom - s->top);

    if (up)
        memmove(s->cells[s->top], s->cells[s->top + 1], n * row);
    else
        memmove(s->cells[s->top + 1], s->cells[s->top], n * row);
    clear(s, up ? s->bottom : s->top, 0, s->columns);
}

static void go_down(struct screen *s)
{
    if (s->y == s->bottom)
        scroll(s, true);
    else
        s->y = limit(s->y + 1, s->rows);
}

static void go_up(struct screen *s)
{
    if (s->y == s->top)
        scroll(s, false);
    else
        s->y = limit(s->y - 1, s->rows);
}

static void set_region(struct screen *s)
{
    int bottom = s->arguments[1] ? s->arguments[1] : s->rows;

    s->top = limit(s->arguments[0] - 1, s->rows);
    s->bottom = limit(bottom - 1, s->rows);
    if (s->bottom < s->top)
        s->bottom = s->top;
    s->y = s->x = 0;
}

static void select_graphics(struct screen *s)
{
    for (int i = 0; i < s->n_arguments; i++)
        s->coloured |= s->arguments[i] >= 30 && s->arguments[i] < 38;
}

static void finish(struct screen *s, char final)
{
    int first = s->arguments[0], step = first ? first : 1;
    switch (final) {
    case 'H':
        s->y = limit(first - 1, s->rows);
        s->x = limit(s->arguments[1] - 1, s->columns);
        break;
    case 'A':
        s->y = limit(s->y - step, s->rows);
        break;
    case 'B':
        s->y = limit(s->y + step, s->rows);
        break;
    case 'C':
        s->x = limit(s->x + step, s->columns);
        break;
    case 'D':
        s->x = limit(s->x - step, s->columns);
        break;
    case 'J':
        erase(s, first);
        if (first != 2)
            erase_line(s, first);
        break;
    case 'K':
        erase_line(s, first);
        break;
    case 'r':
        set_region(s);
        break;
    case 'm':
        select_graphics(s);
        break;
    default: /* modes of the terminal */
        break;
    }
}

static void take_sequence(struct screen *s, char c)
{
    if (isdigit((unsigned char)c) && s->n_arguments <= 8) {
        int *last = &s->arguments[s->n_arguments - 1];
        *last = 10 * *last + c - '0';
    } else if (c == ';' && s->n_arguments < 8) {
        s->n_arguments++;
    } else if (c >= '@') {
        finish(s, c);
        s->escape = NO_ESCAPE;
    }
}

static void take_plain(struct screen *s, char c)
{
    switch (c) {
    case 0x1b:
        s->escape = AFTER_ESCAPE;
        break;
    case '\r':
        s->x = 0;
        break;
    case '\n':
        go_down(s);
        break;
    case '\t':
        s->x = limit((s->x + 8) / 8 * 8, s->columns);
        break;
    case '\b':
        s->x = limit(s->x - 1, s->columns);
        break;
    default:
        if ((unsigned char)c >= ' ' && s->x < s->columns)
            s->cells[s->y][s->x++] = c;
    }
}

static void begin_sequence(struct screen *s, char c)
{
    memset(s->arguments, 0, sizeof s->arguments);
    s->n_arguments = 1;
    if (c == 'M')
        go_up(s);
    s->escape = c == '[' ? IN_SEQUENCE : c == '(' || c == ')' ? IN_CHARSET : NO_ESCAPE;
}

void screen_write(struct screen *s, const char *text, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        if (s->escape == NO_ESCAPE)
            take_plain(s, text[i]);
        else if (s->escape == AFTER_ESCAPE)
            begin_sequence(s, text[i]);
        else if (s->escape == IN_SEQUENCE)
            take_sequence(s, text[i]);
        else
            s->escape = NO_ESCAPE; /* the name of a character set */
    }
}

bool screen_shows(const struct screen *s, const char *text)
{
    for (int y = 0; y < s->rows; y++)
        if (strstr(s->cells[y], text))
            return true;
    return false;
}

bool screen_row_begins(const struct screen *s, int row, const char *text)
{
    return row < s->rows && !strncmp(s->cells[row], text, strlen(text));
}
