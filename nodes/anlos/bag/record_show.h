/* nodes/anlos/bag/record_show.h -- what `anlos bag record` shows: on a terminal a line
 * that is rewritten, elsewhere a line whenever messages get lost; at the end a table. */
#ifndef ANLOS_NODES_ANLOS_BAG_RECORD_SHOW_H
#define ANLOS_NODES_ANLOS_BAG_RECORD_SHOW_H

#include <stdbool.h>

#include "nodes/record/recorder.h"
#include "nodes/rt/log.h"

struct record_show {
    bool terminal;
    bool line_shown;
    uint64_t lost; /* as shown last */
};

/* How it is going; for every second or so. */
void record_show_progress(struct record_show *s, const struct recorder *r,
                          double elapsed_s, size_t queue_bytes);

/* A line from the recorder, above that of the progress.  context: a struct record_show.
 */
void record_show_text(void *context, enum log_level level, const char *text);

/* The table.  true: stdout took it. */
bool record_show_end(struct record_show *s, const struct recorder *r, double elapsed_s);

#endif
