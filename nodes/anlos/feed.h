/* nodes/anlos/feed.h -- brings what a running system says to the collector. */
#ifndef ANLOS_NODES_ANLOS_FEED_H
#define ANLOS_NODES_ANLOS_FEED_H

#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"
#include "nodes/anlos/top/table.h"

struct feed;

/* Listens to health, scan/status and log; to nothing larger, so that looking costs the
 * system nothing.  0, -EINVAL, -ENOMEM, other negative errno. */
int feed_open(struct feed **out, const char *run_dir, struct error *why);

/* Readable when feed_take has something to take. */
int feed_fd(const struct feed *f);

/* Takes all that has come, and looks now and then who lives.  0, other negative errno. */
int feed_take(struct feed *f);
void feed_table(struct feed *f, struct table *out);

/* Does anybody live, or may somebody on another machine?  Looks at once. */
bool feed_is_anybody(struct feed *f);

/* Do we know the rates of all that live? */
bool feed_is_ready(struct feed *f);
void feed_close(struct feed *f);

int64_t feed_now_ns(void); /* the clock of rates and silences: monotonic */

#endif
