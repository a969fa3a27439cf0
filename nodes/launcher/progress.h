/* nodes/launcher/progress.h -- how far the scan is, as a line of text: on a terminal
 * rewritten in place, in a pipe a new line for every 10 %, and when the scan
 * pauses, goes on or fails.  Of a scan without end: how fast it goes, and what was lost,
 * in a pipe when it begins and at the end. */
#ifndef ANLOS_NODES_LAUNCHER_PROGRESS_H
#define ANLOS_NODES_LAUNCHER_PROGRESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/health.pb-c.h"
#include "msgs/scan.pb-c.h"

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
