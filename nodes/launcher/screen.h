/* SPDX-License-Identifier: MIT */
/* nodes/launcher/screen.h -- what the launcher shows: log lines of the nodes on stderr,
 * with stamp, node and level, on a terminal with the local time and in colours
 * (nodes/rt/terminal.h); one line of progress on stdout, which on a terminal stays below
 * them.  A reader that does not read, or a terminal that was stopped, holds nothing up:
 * lines are left out, and how many is said when there is room again. */
#ifndef ANLOS_NODES_LAUNCHER_SCREEN_H
#define ANLOS_NODES_LAUNCHER_SCREEN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/health.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "nodes/rt/log.h"

struct screen {
    enum log_format format;
    bool out_terminal, err_terminal, coloured;
    bool progress_shown; /* on the terminal's last line */
    bool stuck[2];       /* stdout, stderr: nobody takes what is written */
    unsigned left_out;   /* lines of the log, for that */
    char progress[200];
};

void screen_init(struct screen *s, enum log_format format);

void screen_log(struct screen *s, const struct log_line *line);

/* What a node wrote: a line as nodes/rt/log.h writes it, or else, of now_ns, "level text"
 * or text, which counts as info. */
void screen_output(struct screen *s, const char *node, const char *text, int64_t now_ns);
void screen_progress(struct screen *s, const char *text);

/* Leaves the progress line where it is; what follows goes below it. */
void screen_end_progress(struct screen *s);

/* The end: says what is left to be said of lines that were left out. */
void screen_close(struct screen *s, int64_t now_ns);

/* How far the scan is, as a line of text: on a terminal rewritten in place, in a pipe a
 * new line for every 10 %, and when the scan pauses, goes on or fails.  Of a scan
 * without end: how fast it goes, and what was lost, in a pipe when it begins and at the
 * end. */

#define PROGRESS_MAX_NODES 16
#define PROGRESS_TEXT_SIZE 320

struct progress {
    bool terminal;
    char text[PROGRESS_TEXT_SIZE]; /* the newest line; empty: nothing to show yet */
    int step;                      /* tenths shown in a pipe so far; -1: none */
    Anlos__ScanStatus__State state;
    bool endless, paced; /* a scan without end; it runs, and pings have come */
    struct {
        char name[16];
        uint64_t lost; /* messages, as it counts them */
    } nodes[PROGRESS_MAX_NODES];
    size_t n_nodes;
};

void progress_init(struct progress *p, bool terminal);

/* true: p->text is to be shown now. */
bool progress_status(struct progress *p, const Anlos__ScanStatus *status);

/* It is over.  true: p->text has not been shown, and is the last word of a scan that has
 * no end of its own. */
bool progress_end(const struct progress *p);
void progress_health(struct progress *p, const Anlos__Health *health);

#endif
