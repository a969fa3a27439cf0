/* SPDX-License-Identifier: MIT */
/* nodes/anlos/top/top.c -- `anlos top`: the table of a running system, on the whole
 * terminal (ncurses) or as text. */
#include <curses.h>
#include <errno.h>
#include <locale.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <term.h>
#include <unistd.h>
#undef lines /* macros of <term.h>, and fields of a page */
#undef tone

#include "hal/clock.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/feed.h"
#include "nodes/anlos/top/screen.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/stop.h"
#include "nodes/rt/terminal.h"

#define LOOK_UP_MS     100          /* between looks at Ctrl-C and the clock */
#define FIRST_TABLE_NS 3500000000LL /* rates need two health messages of each node */
#define ESCAPE_MS      25           /* what follows an escape within it is a key */

static const char help[] =
    "anlos top -- watch the nodes and topics of a running system\n"
    "\n"
    "usage: anlos top [--run-dir DIR] [--interval S] [--once | --batch N] [--wait]\n"
    "\n"
    "Fills the terminal: each node with state, CPU, memory, rate against the expected\n"
    "one, age of the sound, queue and losses; each topic likewise; the hidden objects, "
    "of\n"
    "tracks with their velocity; how far the scan is; what the node or topic selected\n"
    "counts in detail; the log.  Key h explains all.\n"
    "Into a pipe or a file goes one plain table.\n"
    "\n"
    "  --once          print one plain table and end\n"
    "  --batch N       print N plain tables and end\n"
    "  --interval S    time between two tables, or two looks of the screen; default 1\n"
    "  --wait          plain tables: go on when nothing is running yet\n"
    "  --run-dir DIR   where the system's sockets are, default $XDG_RUNTIME_DIR/anlos, "
    "else\n"
    "                  /tmp/anlos-UID\n"
    "  --help          this text\n"
    "\n"
    "Without colour when NO_COLOR is set.  Writes no files.\n"
    "\n"
    "examples\n"
    "  anlos top\n"
    "  anlos top --batch 60 --interval 10 > night.txt\n"
    "\n"
    "exit codes: 0 done; 1 nothing is running, or failed; 2 bad arguments, or a "
    "terminal\n"
    "that cannot be drawn on; 130 stopped by Ctrl-C\n";

struct top {
    const char *asked_dir; /* NULL: the default */
    size_t tables;         /* plain ones; 0: the whole screen */
    double interval_s;
    bool wait;
    char run_dir[RUNDIR_SIZE];
    struct feed *feed;
    struct table table;
    struct look look;
    struct page page;
};

static const struct usage_option options[] = {
    {"once", USAGE_SWITCH('o')},
    {"batch", USAGE_COUNT(struct top, tables, 1, SIZE_MAX),
     .expected = "a whole number above 0"},
    {"interval", USAGE_NUMBER(struct top, interval_s, 0.1, 86400),
     .expected = "0.1 to 86400 seconds"},
    {"wait", USAGE_FLAG(struct top, wait)},
    {"run-dir", USAGE_TEXT(struct top, asked_dir)},
    {.name = NULL},
};

/* Waits for messages, for keys if fd is their source, until a time.  Returns an exit code
 * that ends the program, or 0; *keys: there may be some. */
static int listen_until(struct top *o, int64_t end_ns, int fd, bool *keys)
{
    int64_t left_ns = end_ns - clock_monotonic_ns();
    int left_ms = left_ns <= 0                       ? 0
                  : left_ns > LOOK_UP_MS * 1000000LL ? LOOK_UP_MS
                                                     : (int)(left_ns / 1000000) + 1;
    struct pollfd fds[2] = {{.fd = feed_fd(o->feed), .events = POLLIN},
                            {.fd = fd, .events = POLLIN}};

    *keys = poll(fds, 2, left_ms) < 0 || fds[1].revents; /* a new size is a key too */
    if (interrupt_requested())
        return EXIT_INTERRUPTED;
    if (fds[1].revents & (POLLHUP | POLLERR))
        return EXIT_FAILED; /* the terminal is gone */
    return feed_take(o->feed) ? EXIT_FAILED : EXIT_WORKED;
}

static int listen_for_first(struct top *o)
{
    int64_t end_ns = clock_monotonic_ns() + FIRST_TABLE_NS;
    bool keys;
    int code = 0;

    while (!code && clock_monotonic_ns() < end_ns && !feed_is_ready(o->feed))
        code = listen_until(o, end_ns, -1, &keys);
    return code;
}

static int run_plain(struct top *o)
{
    int code = listen_for_first(o);
    int64_t due_ns = clock_monotonic_ns();
    bool keys;

    for (size_t i = 0; !code && i < o->tables; i++) {
        while (!code && clock_monotonic_ns() < due_ns)
            code = listen_until(o, due_ns, -1, &keys);
        if (code)
            break;
        due_ns += (int64_t)(1e9 * o->interval_s);
        feed_table(o->feed, &o->table);
        if (i)
            putchar('\n');
        int err = screen_print(stdout, &o->table);
        if (err == -EPIPE)
            return EXIT_WORKED; /* `| head` has seen enough */
        if (err) {
            fprintf(stderr, "anlos top: standard output: %s\n", strerror(-err));
            return EXIT_FAILED;
        }
    }
    return code;
}

/* -- the terminal -----------------------------------------------------------------------
 */

static SCREEN *whole;
static bool coloured;

/* Can it put the cursor anywhere?  To be asked before newterm, which does not give back
 * all that it took when it fails. */
static bool can_place(const char *kind)
{
    int found;

    if (!kind || !*kind || setupterm(kind, STDOUT_FILENO, &found) == ERR)
        return false;
    bool can = cursor_address != NULL;
    del_curterm(cur_term);
    return can;
}

/* Takes the terminal of stdin and stdout over.  Signals that end the program have to be
 * caught before.  Colour unless the terminal has none or NO_COLOR is set.  0, -ENOTTY
 * (of a kind that cannot be drawn on). */
static int terminal_open(struct error *why)
{
    const char *kind = getenv("TERM");

    setlocale(LC_CTYPE, "");
    whole = can_place(kind) ? newterm(NULL, stdout, stdin) : NULL;
    if (!whole)
        return error_say(why, -ENOTTY,
                         "a terminal of the kind \"%s\" (TERM) cannot be drawn on; "
                         "--once prints one table",
                         kind ? kind : "");
    coloured = has_colors() && colour_wanted(STDOUT_FILENO) && start_color() == OK;
    if (coloured) {
        use_default_colors();
        init_pair(PAGE_GOOD, COLOR_GREEN, -1);
        init_pair(PAGE_NOTE, COLOR_YELLOW, -1);
        init_pair(PAGE_BAD, COLOR_RED, -1);
    }
    cbreak(); /* Ctrl-C stays a signal */
    noecho();
    nonl();
    keypad(stdscr, TRUE);
    nodelay(stdscr, TRUE);
    set_escdelay(ESCAPE_MS);
    curs_set(0);
    return 0;
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
    attr_t of_line = l->kind == PAGE_FOCUSED_TITLE ? A_REVERSE | A_BOLD
                     : l->kind == PAGE_TITLE       ? A_BOLD | A_UNDERLINE
                     : l->selected                 ? A_BOLD
                                                   : A_NORMAL;
    attr_t of_tone = l->tone == PAGE_BAD     ? A_BOLD
                     : l->tone == PAGE_FAINT ? A_DIM
                                             : A_NORMAL;

    move(y, 0);
    put(l->text);
    if (of_line)
        mvchgat(y, 0, -1, of_line, 0, NULL);
    if (l->tone)
        mvchgat(y, l->tone_at, l->tone_n, of_line | of_tone,
                (short)(coloured && l->tone != PAGE_FAINT ? l->tone : 0), NULL);
}

static void draw(struct top *o)
{
    screen_draw(&o->page, COLS, LINES, &o->table, &o->look);
    erase();
    for (int y = 0; y < o->page.n_lines; y++)
        draw_line(y, &o->page.lines[y]);
    refresh();
}

/* true: one of them means quit. */
static bool take_keys(struct top *o)
{
    for (int key; (key = getch()) != ERR;)
        if (key == 'L' - '@') /* what was written over comes back */
            clearok(curscr, TRUE);
        else if (look_key(&o->look, &o->table, key))
            return true;
    return false;
}

static int run_screen(struct top *o)
{
    struct error why = {.text = ""};
    int64_t due_ns = 0;
    bool keys = false;
    int code = 0;

    if (terminal_open(&why)) {
        fprintf(stderr, "anlos top: %s\n", why.text);
        return EXIT_BAD_INPUT;
    }
    while (!code) {
        if (keys && take_keys(o))
            break;
        bool due = clock_monotonic_ns() >= due_ns;
        if (due) {
            due_ns = clock_monotonic_ns() + (int64_t)(1e9 * o->interval_s);
            if (!o->look.paused)
                feed_table(o->feed, &o->table);
        }
        if (due || keys)
            draw(o);
        code = listen_until(o, due_ns, STDIN_FILENO, &keys);
    }
    endwin();
    delscreen(whole);
    return code;
}

/* Says that nothing runs.  false: and is not to be waited for. */
static bool may_wait(const struct top *o)
{
    feed_say_nothing_runs("top", o->run_dir, o->wait);
    return o->wait;
}

static int run(struct top *o)
{
    struct error why = {.text = ""};
    bool plain = o->tables || !isatty(STDIN_FILENO) || !isatty(STDOUT_FILENO);

    if (plain && !o->tables)
        o->tables = 1;
    if (plain && !o->wait && !rundir_name(o->run_dir, o->asked_dir, &why) &&
        access(o->run_dir, F_OK) && errno == ENOENT && !may_wait(o))
        return EXIT_FAILED; /* and no folder is made */
    if (rundir_open(o->run_dir, o->asked_dir, &why)) {
        fprintf(stderr, "anlos top: %s\n", why.text);
        return EXIT_BAD_INPUT;
    }
    interrupt_catch();
    if (feed_open(&o->feed, o->run_dir, &why) || feed_listen(o->feed, &why)) {
        fprintf(stderr, "anlos top: %s\n", why.text);
        return EXIT_FAILED;
    }
    if (!plain)
        return run_screen(o);
    if (!feed_is_anybody(o->feed) && !may_wait(o))
        return EXIT_FAILED;
    return run_plain(o);
}

int command_top(int argc, char **argv)
{
    struct top *o = calloc(1, sizeof *o);
    struct usage usage = {.command = "top", .help = help, .options = options, .into = o};
    int code;

    if (!o) {
        fprintf(stderr, "anlos top: out of memory\n");
        return EXIT_FAILED;
    }
    o->interval_s = 1.0;
    while ((code = usage_next(&usage, argc, argv)) > 0)
        o->tables = 1;
    if (code)
        code = ~code;
    else if (optind < argc)
        code = usage_error("top", "%s: expected no argument without --", argv[optind]);
    else
        code = run(o);
    feed_close(o->feed);
    free(o);
    return code;
}
