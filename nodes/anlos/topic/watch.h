/* nodes/anlos/topic/watch.h -- listening to a running system. */
#ifndef ANLOS_NODES_ANLOS_TOPIC_WATCH_H
#define ANLOS_NODES_ANLOS_TOPIC_WATCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "dsp/error.h"
#include "msgs/bus.h"
#include "nodes/anlos/topic/tally.h"

/* Opens a bus that only listens, to topics[n].  0 or a negative errno. */
int topic_watch_open(struct bus **out, const char *run_dir,
                     const struct topic *const *topics, size_t n, struct error *why);

/* Prints messages as JSON lines until count (0: no end), Ctrl-C or a closed stdout.
 * 0, -EINTR, -ENOMEM, -EIO. */
int topic_watch_echo(struct bus *bus, size_t count, bool full);

struct topic_watch {
    void (*table)(const struct tally *t, double elapsed_s, FILE *f);
    bool delays;    /* keep them for the table */
    bool survey;    /* the table asks what it says of pings */
    bool live;      /* stdout is a terminal: drawn anew every second */
    double seconds; /* 0: until Ctrl-C */
};

/* Listens and prints a table, at Ctrl-C too.  0, -EINTR, -ENOMEM, other negative errno of
 * writing. */
int topic_watch_tally(struct bus *bus, const struct topic *const *topics, size_t n,
                      const struct topic_watch *w);

#endif
