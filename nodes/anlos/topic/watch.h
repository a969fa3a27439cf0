/* nodes/anlos/topic/watch.h -- listening to a running system: echo and hz. */
#ifndef ANLOS_NODES_ANLOS_TOPIC_WATCH_H
#define ANLOS_NODES_ANLOS_TOPIC_WATCH_H

#include <stdbool.h>
#include <stddef.h>

#include "msgs/bus.h"
#include "msgs/complaint.h"

/* Does anybody publish in the folder?  Tries each socket in it. */
bool topic_watch_alive(const char *run_dir);

/* Opens a bus that only listens, to topics[n].  0 or a negative errno. */
int topic_watch_open(struct bus **out, const char *run_dir,
                     const struct topic *const *topics, size_t n, struct complaint *why);

/* Prints messages as JSON lines until count (0: no end), Ctrl-C or a closed stdout.
 * 0, -EINTR, -ENOMEM, -EIO. */
int topic_watch_echo(struct bus *bus, size_t count, bool full);

/* Listens for some seconds (Ctrl-C ends it early) and prints a table: rate measured and
 * expected, bandwidth, gaps.  0, -EINTR, -ENOMEM, -EIO. */
int topic_watch_rates(struct bus *bus, const struct topic *const *topics, size_t n,
                      double seconds);

#endif
