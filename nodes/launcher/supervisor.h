/* SPDX-License-Identifier: MIT */
/* nodes/launcher/supervisor.h -- alive supervision of the nodes: whose main loop stands
 * still is hung, whatever the reason, and is to be killed and started again.  As
 * AUTOSAR's watchdog manager does it, by health messages that count the loop's turns and
 * come once a second; one that its loop did not send counts for nothing.
 *
 * A node is hung when it has not been heard for alive_s (3 s: two messages are overdue),
 * or for what it said of itself (node_turn_limit, node_busy), and before its first
 * message for SUPERVISOR_START_NS.  Only time counts in which the launcher itself ran, as
 * a machine that was suspended or stopped has hung nobody; and none in which the node
 * had work and the processors had no time for it, up to four times as much again.  So one
 * that hangs is gone after 3 s, and on an overloaded machine after 15.  Who is being
 * debugged is not judged.  Time is an argument. */
#ifndef ANLOS_NODES_LAUNCHER_SUPERVISOR_H
#define ANLOS_NODES_LAUNCHER_SUPERVISOR_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/device.h"
#include "msgs/health.pb-c.h"
#include "nodes/launcher/process_group.h"

#define SUPERVISOR_TICK_NS  250000000LL   /* from look to look */
#define SUPERVISOR_START_NS 60000000000LL /* for a device to open */
#define SUPERVISOR_BAG_NS                                                                \
    600000000000LL           /* for a bag without an index, of play and view */
#define SUPERVISOR_STARVED 4 /* times the limit that waiting is forgiven */

struct supervisor_process { /* as the kernel has it */
    bool traced;
    bool runnable;             /* one of its threads: it runs, or waits for a processor */
    int64_t ran_ns, waited_ns; /* for one, all of its threads, since they began; a wait is
                                  told when it is over */
};

struct supervised {
    int64_t started_ns; /* of the process that is judged; 0: none */
    bool spoken;
    uint64_t turns;
    int64_t limit_ns, silent_ns;
    int64_t waited_ns, waits_ns;    /* for a processor while silent; and now */
    bool looked, told;              /* that it starves */
    struct supervisor_process last; /* look */
    unsigned starts, hangs;
    char name[24]; /* of its count */
};

struct supervisor { /* zeroed, and alive_ns 0: nobody is judged */
    int64_t alive_ns;
    int64_t tick_ns; /* the newest */
    struct supervised list[PROCESS_GROUP_MAX];
    void (*look)(pid_t pid, struct supervisor_process *out); /* NULL: /proc */
};

/* A node's health has come from the process that started at epoch_ns. */
void supervisor_heard(struct supervisor *s, const struct process_group *c,
                      const Anlos__Health *h, int64_t epoch_ns);

/* Counts the time; to be called every SUPERVISOR_TICK_NS at least, after what the nodes
 * said was read.  hung[]: of the process group's nodes, in their order, who is to be
 * killed, and how long it was silent, else 0.  Returns when to call again. */
int64_t supervisor_tick(struct supervisor *s, const struct process_group *c,
                        int64_t now_ns, int64_t hung_ns[PROCESS_GROUP_MAX]);

/* Is a node overdue because it waits for a processor?  true once each time that it is,
 * with how long it was silent and waited, and the silence after which it is killed. */
struct supervisor_starved {
    double silent_s, waited_s, killed_s;
};
bool supervisor_starves(struct supervisor *s, unsigned i, struct supervisor_starved *out);

/* "restarts", and "NODE hung" of each that ever was; names live as long as s.  At most
 * PROCESS_GROUP_MAX + 1; returns how many. */
size_t supervisor_counts(const struct supervisor *s, struct device_count *out);

#endif
