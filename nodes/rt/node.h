/* SPDX-License-Identifier: MIT */
/* nodes/rt/node.h -- what every node process has: command line, launch file, bus, log,
 * health, stop signal.  A node's main is: node_create, what the launch file has it open,
 * loop_main (nodes/rt/loop.h). */
#ifndef ANLOS_NODES_RT_NODE_H
#define ANLOS_NODES_RT_NODE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/clock.h"
#include "hal/device.h"
#include "msgs/bus.h"
#include "msgs/health.pb-c.h"
#include "nodes/rt/arguments.h"
#include "nodes/rt/launchfile.h"
#include "nodes/rt/log.h"
#include "nodes/rt/stop.h"

struct node;

/* A message that came in, unpacked; node_next frees the one before. */
struct node_message {
    const struct topic *topic;
    const ProtobufCMessage *content;
    int64_t capture_ns;
    int64_t publish_ns;
    int64_t epoch_ns;  /* when the sender started: another one means it was restarted */
    uint64_t sequence; /* of the sender's, on this topic */
    char from[ENVELOPE_NODE_SIZE];
};

/* Parses `NODE --launch FILE [--run-dir DIR] [--out DIR] [--realtime] [--log-level L]`,
 * prints --help, loads the launch file, opens the bus, installs SIGINT and SIGTERM.
 * Prints what is wrong.  *out NULL: the process ends, with the exit code that it returns
 * (EXIT_WORKED after --help); else 0. */
int node_create(struct node **out, const char *name, const char *what_it_does, int argc,
                char **argv);

/* The same for a command that takes a node's place: args->launch may be NULL, and so is
 * node_launch then.  0 or a negative errno with an error. */
int node_start(struct node **out, const char *name, const struct arguments *args,
               struct error *why);

const struct launchfile *node_launch(const struct node *n);
const char *node_run_dir(const struct node *n);
int64_t node_epoch_ns(const struct node *n); /* when this process started */

/* For loops that wait for something else too; as bus_fd and bus_counts. */
int node_fd(const struct node *n);
size_t node_counts(struct node *n, struct bus_count *out, size_t max);

const struct clock_source *node_clock(const struct node *n);
int64_t node_now_ns(const struct node *n);

/* For what waits: now_ns stands still between the messages of a replay
 * (hal/clock.h), where it is the publish stamp of the newest message of sound. */
int64_t node_machine_ns(const struct node *n);

/* It lives in a replay: the launch file has the node play, or --replay was given.  Of
 * view and record, which take both: what came last was replayed. */
bool node_is_replayed(const struct node *n);

/* node_now_ns is the time of a replay: a message of it has come. */
bool node_follows_replay(const struct node *n);

int node_subscribe(struct node *n, const struct topic *t);

/* Waits for the next message; publishes health when it is due.  In a replay they come in
 * the order of their publish stamps (nodes/rt/replay_order.h): node_fd does not know of
 * those that wait for their turn, so take until -ETIMEDOUT before polling it.  timeout_ms
 * < 0: without end.  0, -ETIMEDOUT, -ESHUTDOWN (a signal asked the process to stop). */
int node_next(struct node *n, struct node_message *out, int timeout_ms);

int node_publish(struct node *n, const struct topic *t, int64_t capture_ns,
                 const ProtobufCMessage *m);

/* Sets this node's state and says so at once when it changed. */
void node_state(struct node *n, Anlos__Health__State state, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* What is wrong and lasts, for machines, beside what state and text say: so many of so
 * many have it, 0: none.  Said at once when it changes.  name: one of these. */
#define NODE_FAULT_ARRAY_AWAY          "array_away"       /* the device is not there */
#define NODE_FAULT_CHANNELS_SILENT     "channels_silent"  /* microphones hear nothing */
#define NODE_FAULT_SPEAKERS_MUTE       "speakers_mute"    /* no microphone hears them */
#define NODE_FAULT_ELEMENTS_DAMAGED    "elements_damaged" /* samples that are no numbers */
#define NODE_FAULT_CHANNELS_CLIPPED    "channels_clipped"
#define NODE_FAULT_NODES_LOST          "nodes_lost" /* processes that do not run */
#define NODE_FAULT_MICROPHONES_COVERED "microphones_covered"
#define NODE_FAULT_SPEAKERS_COVERED    "speakers_covered"
#define NODE_FAULT_MICROPHONES_MOVED   "microphones_moved" /* since the start */
#define NODE_FAULT_SPEAKERS_MOVED      "speakers_moved"
#define NODE_FAULT_RANGE_REDUCED       "range_reduced" /* of the array, by noise */
#define NODE_FAULT_INTERFERENCE        "interference"  /* another array is heard */
#define NODE_FAULT_TONE                "steady_tone"   /* or a comb, electrical maybe */
void node_fault(struct node *n, const char *name, size_t count, size_t of);

/* The launcher takes a node for hung, kills it and starts it again when its loop does not
 * come to node_next for 3 s (nodes/launcher/supervisor.h).  Whose turns may take longer
 * says so at its start; who is about to do something long says that before, and it holds
 * until the next node_next. */
void node_turn_limit(struct node *n, double limit_s);
void node_busy(struct node *n, double limit_s);

/* What this node plays has ended: said in each health message from now on. */
void node_ended(struct node *n, bool ended);

/* How well this node hears, in each health message from now on.  It stays where it is;
 * NULL: nothing to say. */
void node_sensing(struct node *n, const Anlos__Sensing *sensing);

/* The device that this node drives: each health message asks it for its counts.  device
 * NULL: none any more. */
void node_device(struct node *n, size_t (*counts)(void *device, struct device_count *out),
                 void *device);

void node_log(const struct node *n, enum log_level level, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Of changes: the same text is never counted instead (nodes/rt/log.h). */
void node_log_each(const struct node *n, enum log_level level, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Messages that are dropped before the survey is there, of which nobody can make anything
 * yet: processes start as they like, so that is no fault.  They are counted, and said
 * once, when the survey comes. */
struct node_dropped {
    const char *count; /* its name in health, such as "pings before the survey" */
    uint64_t n, said;
};

/* For node_device; returns 1. */
size_t node_dropped_count(const struct node_dropped *d, struct device_count *out);
void node_dropped_say(const struct node *n, struct node_dropped *d);

/* Those who only look on may come and go: a system hears and images without them. */
bool node_is_optional(const char *name);

#define NODE_TOLD 1 /* for node_finish: it failed, and said why already */

/* Says that the node ends of err, in the words of errno, unless an error was logged since
 * node_next: that says why.  Closes all and returns the process's exit code: 0 if err is
 * 0 or -ESHUTDOWN, 2 if it is one of configuration (-EINVAL, -ENOENT, -ENODEV, -ENOTSUP,
 * -EACCES, -ENOTDIR, -EROFS, -EADDRINUSE, -EADDRNOTAVAIL: no use in starting it again),
 * else 1. */
int node_finish(struct node *n, int err);

#endif
