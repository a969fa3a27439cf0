/* nodes/launcher/signals.h -- the signals that end the launcher, and those of its
 * children, to be read where it waits. */
#ifndef ANLOS_NODES_LAUNCHER_SIGNALS_H
#define ANLOS_NODES_LAUNCHER_SIGNALS_H

#include <signal.h>

struct signals {
    int fd; /* poll(2) finds it readable when one has come; -1: closed */
    sigset_t before;
};

/* SIGINT, SIGTERM, SIGHUP (but under nohup) and SIGCHLD do not interrupt any more.  0 or
 * a negative errno. */
int signals_open(struct signals *s);

/* The number of one that has come; 0: none has. */
int signals_next(const struct signals *s);

/* What follows can be stopped as any program; signals that were for the nodes are not for
 * it. */
void signals_close(struct signals *s);

#endif
