/* SPDX-License-Identifier: MIT */
/* nodes/launcher/process_group.h -- the node processes of a launch together: who runs,
 * who is still to be started, and signals to many at once.
 *
 * One that is aside (the recorder) does not keep the launch going, is started first and
 * stopped last. */
#ifndef ANLOS_NODES_LAUNCHER_PROCESS_GROUP_H
#define ANLOS_NODES_LAUNCHER_PROCESS_GROUP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "dsp/error.h"
#include "nodes/launcher/launcher.h"
#include "nodes/launcher/program.h"
#include "nodes/rt/log.h"

/* One node process as the launcher has it: started, its output read line by line,
 * started again after a crash with a growing pause. */

#define CHILD_MAX_CRASHES 5             /* without a good run between them */
#define CHILD_GOOD_RUN_NS 10000000000LL /* a run that makes up for earlier crashes */
#define CHILD_LINE_SIZE   LOG_LINE_SIZE

enum child_phase {
    CHILD_RUNNING,
    CHILD_PAUSING,    /* crashed; starts again at restart_ns */
    CHILD_ENDED,      /* by itself, exit code 0 */
    CHILD_BAD_CONFIG, /* exit code 2: no use in starting it again */
    CHILD_FAILED,     /* crashed too often */
};

struct child_pipe {
    int fd; /* -1: closed */
    size_t used;
    char text[CHILD_LINE_SIZE];
};

struct child {
    const char *name;  /* not owned */
    char *const *argv; /* not owned */
    bool aside;        /* the others go on without it, and it ends after them */
    pid_t pid;         /* 0: not running */
    enum child_phase phase;
    unsigned crashes;
    int64_t started_ns, restart_ns;
    struct child_pipe pipes[2]; /* stdout, stderr */
};

/* Called for each line of output, without its end. */
typedef void child_print(void *ctx, const struct child *c, const char *line);

void child_init(struct child *c, const char *name, char *const *argv);

/* Starts the process in a process group of its own, so that Ctrl-C reaches the launcher
 * only; it inherits no descriptor but its standard three.  0, -ENOENT (no such program),
 * other negative errno. */
int child_start(struct child *c, int64_t now_ns, struct error *why);

/* The process is gone; status as waitpid gave it.  Returns the new phase. */
enum child_phase child_exited(struct child *c, int status, int64_t now_ns);

/* "exit code 1", "signal 11 (Segmentation fault)". */
void child_describe_exit(int status, char *text, size_t size);

/* Reads what a pipe has and prints whole lines; at its end, the rest too. */
void child_read(struct child *c, struct child_pipe *pipe, child_print *print, void *ctx);
void child_signal(const struct child *c, int number);

/* Closes the pipes after printing what is left in them. */
void child_close(struct child *c, child_print *print, void *ctx);

#define PROCESS_GROUP_MAX 16

struct process_group {
    unsigned n;
    struct child children[PROCESS_GROUP_MAX];
    struct program programs[PROCESS_GROUP_MAX];
};

/* Those of the launch file's nodes that run on this host; none is started yet.  c must
 * stay where it is, and cfg what it is.  0, -ENAMETOOLONG. */
int process_group_fill(struct process_group *c, const struct launcher_config *cfg);

/* Does the process of any live?  aside: those count too. */
bool process_group_runs(const struct process_group *c, bool aside);

/* Does any run that is not aside, or is about to? */
bool process_group_goes_on(const struct process_group *c);

/* Is the one of this name aside?  NULL: is any? */
bool process_group_has_aside(const struct process_group *c, const char *name);
unsigned process_group_count(const struct process_group *c, enum child_phase phase);

/* Those that should run and do not, but for optional nodes (nodes/rt/node.h):
 * what comes out of the system is less without them. */
unsigned process_group_lost(const struct process_group *c);

/* To those that are aside, or to all others. */
void process_group_signal(const struct process_group *c, bool aside, int number);

/* Those that were never started and are not aside are to be, at start_ns. */
void process_group_start_rest(struct process_group *c, int64_t start_ns);

#endif
