/* nodes/launcher/screen.h -- what the launcher shows: log lines of the nodes on stderr,
 * with node and level, coloured on a terminal; one line of progress on stdout, which on a
 * terminal stays below them. */
#ifndef ANLOS_NODES_LAUNCHER_SCREEN_H
#define ANLOS_NODES_LAUNCHER_SCREEN_H

#include <stdbool.h>

struct screen {
    bool out_terminal, err_terminal;
    bool progress_shown; /* on the terminal's last line */
    char progress[200];
};

void screen_init(struct screen *s);

/* line: "level text" as nodes/rt/log.h writes it; other text counts as info. */
void screen_log(struct screen *s, const char *node, const char *line);
void screen_progress(struct screen *s, const char *text);

/* Leaves the progress line where it is; what follows goes below it. */
void screen_end_progress(struct screen *s);

#endif
