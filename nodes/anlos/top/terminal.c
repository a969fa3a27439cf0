#include "nodes/anlos/top/terminal.h"

#include <curses.h>
#include <errno.h>
#include <locale.h>
#include <stdlib.h>
#include <unistd.h>

#include "nodes/anlos/top/look.h"
#include "nodes/anlos/top/terminal_kind.h"
#include "nodes/rt/colour.h"

#define ESCAPE_MS 25 /* what follows an escape within it is a key, not the escape key */

static SCREEN *whole;
static bool coloured;

static void choose_colours(void)
{
    coloured = has_colors() && colour_wanted(STDOUT_FILENO) && start_color() == OK;
    if (!coloured)
        return;
    use_default_colors();
    init_pair(PAGE_GOOD, COLOR_GREEN, -1);
    init_pair(PAGE_NOTE, COLOR_YELLOW, -1);
    init_pair(PAGE_BAD, COLOR_RED, -1);
}

int terminal_open(struct error *why)
{
    const char *kind = getenv("TERM");

    setlocale(LC_CTYPE, "");
    whole = terminal_kind_can_place(kind) ? newterm(NULL, stdout, stdin) : NULL;
    if (!whole)
        return error_say(
            why, -ENOTTY,
            "a terminal of the kind \"%s\" (TERM) cannot be drawn on; --once "
            "prints one table",
            kind ? kind : "");
    choose_colours();
    cbreak(); /* Ctrl-C stays a signal */
    noecho();
    nonl();
    keypad(stdscr, TRUE);
    nodelay(stdscr, TRUE);
    set_escdelay(ESCAPE_MS);
    curs_set(0);
    return 0;
}

void terminal_size(int *width, int *height)
{
    *width = COLS;
    *height = LINES;
}

static attr_t tone_attributes(enum page_tone tone)
{
    return tone == PAGE_BAD ? A_BOLD : tone == PAGE_FAINT ? A_DIM : A_NORMAL;
}

static attr_t line_attributes(const struct page_line *l)
{
    return l->kind == PAGE_FOCUSED_TITLE ? A_REVERSE | A_BOLD
           : l->kind == PAGE_TITLE       ? A_BOLD | A_UNDERLINE
           : l->selected                 ? A_BOLD
                                         : A_NORMAL;
}

/* Outside of UTF-8 curses would show its bytes one by one. */
static void put(const char *text)
{
    for (const char *s = text; *s; s++)
        if (MB_CUR_MAX > 1 || (unsigned char)*s < 0x80)
            addch((unsigned char)*s);
        else if (((unsigned char)*s & 0xc0) != 0x80)
            addch('?');
}

static void draw_line(int y, const struct page_line *l)
{
    attr_t attributes = line_attributes(l);

    move(y, 0);
    put(l->text);
    if (attributes)
        mvchgat(y, 0, -1, attributes, 0, NULL);
    if (l->tone)
        mvchgat(y, l->tone_at, l->tone_n, attributes | tone_attributes(l->tone),
                (short)(coloured && l->tone != PAGE_FAINT ? l->tone : 0), NULL);
}

void terminal_draw(const struct page *p)
{
    erase();
    for (int y = 0; y < p->n_lines; y++)
        draw_line(y, &p->lines[y]);
    refresh();
}

static int translate(int key)
{
    switch (key) {
    case KEY_UP:
        return LOOK_KEY_UP;
    case KEY_DOWN:
        return LOOK_KEY_DOWN;
    case KEY_PPAGE:
        return LOOK_KEY_PAGE_UP;
    case KEY_NPAGE:
        return LOOK_KEY_PAGE_DOWN;
    case KEY_HOME:
        return LOOK_KEY_HOME;
    case KEY_END:
        return LOOK_KEY_END;
    case KEY_BTAB:
    case KEY_LEFT:
        return LOOK_KEY_BACK_TAB;
    case KEY_RIGHT:
        return '\t';
    case KEY_BACKSPACE:
    case 0x7f:
    case '\b':
        return LOOK_KEY_BACKSPACE;
    case KEY_ENTER:
        return '\n';
    case 0x1b:
        return LOOK_KEY_ESCAPE;
    case 'L' - '@': /* what was written over comes back */
        clearok(curscr, TRUE);
        return 0;
    default:
        return key < 0x80 ? key : 0;
    }
}

int terminal_key(void)
{
    int key = getch();

    return key == ERR ? -1 : translate(key);
}

void terminal_close(void)
{
    endwin();
    delscreen(whole);
}
