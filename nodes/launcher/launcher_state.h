/* nodes/launcher/launcher_state.h -- the launcher inside: launcher.c waits and listens,
 * launcher_nodes.c starts the nodes, starts them again and ends them. */
#ifndef ANLOS_NODES_LAUNCHER_LAUNCHER_STATE_H
#define ANLOS_NODES_LAUNCHER_LAUNCHER_STATE_H

#include "hal/clock.h"
#include "msgs/bus.h"
#include "nodes/launcher/crew.h"
#include "nodes/launcher/fellowship.h"
#include "nodes/launcher/launcher.h"
#include "nodes/launcher/progress.h"
#include "nodes/launcher/screen.h"
#include "nodes/launcher/service.h"
#include "nodes/launcher/signals.h"
#include "nodes/launcher/supervisor.h"
#include "nodes/launcher/voice.h"
#include "nodes/rt/log_history.h"

struct launcher {
    const struct launcher_config *cfg;
    const struct clock_source *clock;
    struct crew crew;
    struct signals signals;
    struct bus *bus;
    struct progress progress;
    struct fellowship fellowship; /* with the other hosts */
    struct screen screen;
    struct voice voice;
    struct log_history history;
    struct service service;
    struct supervisor supervisor;
    bool stopping, stopping_aside, killed;
    bool reported;
    bool incomplete; /* the recording, or what a node was to do at its end */
    int64_t kill_ns;
    int64_t asked_ns; /* to stop, by a signal; 0: never */
    int exit_code;    /* once stopping */
};

/* A line of the launcher itself, or about a node; and one that a node printed. */
void launcher_say(struct launcher *l, const char *node, enum log_level level,
                  const char *text);
void launcher_print(void *ctx, const struct child *c, const char *line);

/* Whom not to outlive, since when there have been results of this run, and the clock: in
 * the environment of the nodes.  0 or a negative errno. */
int launcher_tell_nodes(void);

/* What is aside comes first, so that it misses nothing of the others. */
void launcher_start_all(struct launcher *l);

/* Asks all to end.  The first reason decides the exit code. */
void launcher_stop(struct launcher *l, int exit_code);

/* What is aside has seen everything when the others have ended. */
void launcher_stop_aside(struct launcher *l, int64_t now_ns);

/* Takes note of those that have ended. */
void launcher_reap(struct launcher *l);

/* Kills those that hang; they are started again as others that crash.  When to look
 * again. */
int64_t launcher_supervise(struct launcher *l, int64_t now_ns);

/* Starts those whose pause is over, and kills those that do not end by themselves.  When
 * the next one is due; INT64_MAX: none is. */
int64_t launcher_restart(struct launcher *l, int64_t now_ns);
int64_t launcher_kill(struct launcher *l, int64_t now_ns);

#endif
