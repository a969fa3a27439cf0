/* SPDX-License-Identifier: MIT */
/* nodes/play/run.h -- the loop of a player in its process: what comes over the bus goes
 * to it, and "clock" and health say where it is. */
#ifndef ANLOS_NODES_PLAY_RUN_H
#define ANLOS_NODES_PLAY_RUN_H

#include "nodes/play/playback.h"
#include "nodes/rt/node.h"

struct play_control { /* of a person; all NULL: none */
    int fd;           /* readable when there is something to be read; -1: none */
    /* -ESHUTDOWN: ends the loop. */
    int (*read)(void *ctx, struct playback *p, int64_t now_ns);
    void (*show)(void *ctx, const struct playback_status *s); /* often */
    void *ctx;
};

/* Returns at the end of the bag, unless `stays`: then it goes on saying the last survey
 * and status for who comes late, until a signal.  0, -ESHUTDOWN, errors of playback_step,
 * which are logged. */
int play_run(struct node *node, struct playback *p, const struct play_control *control,
             bool stays);

/* "1024 messages ... " with what was lost; empty text: nothing was played. */
void play_summary(const struct playback_status *s, char *text, size_t size);

#endif
