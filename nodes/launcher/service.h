/* SPDX-License-Identifier: MIT */
/* nodes/launcher/service.h -- the launcher as a service of systemd (sd_notify(3)): ready
 * when every node has spoken, and alive as long as all go on doing so.  A launcher that
 * runs by itself says nothing.  Time is an argument. */
#ifndef ANLOS_NODES_LAUNCHER_SERVICE_H
#define ANLOS_NODES_LAUNCHER_SERVICE_H

#include <stdbool.h>
#include <stdint.h>

#include "nodes/launcher/process_group.h"

struct service {
    int64_t watchdog_ns; /* the service is stopped when it says nothing for so long; 0:
                            never */
    bool supervised;     /* nodes that hang are the launcher's affair */
    bool ready;
    int64_t due_ns;                      /* when to look again */
    int64_t heard_ns[PROCESS_GROUP_MAX]; /* of the process group's nodes, in their order;
                                            0: never */
    int (*notify)(const char *state);
};

/* What systemd asks for, from the environment. */
void service_open(struct service *s);

/* A node's health has come. */
void service_heard(struct service *s, const struct process_group *c, const char *node,
                   int64_t now_ns);

/* Tells systemd what is due: ready once, and four times in watchdog_ns that all is well,
 * if every node that runs was heard within half of it, or was started since; of
 * supervised nodes without a condition, for they are killed when they hang, and may be
 * busy for longer.  A node that pauses between a crash and its new start is the
 * launcher's to judge.  Returns when to call again. */
int64_t service_tick(struct service *s, const struct process_group *c, int64_t now_ns);

/* It ends on purpose. */
void service_ends(struct service *s);

#endif
