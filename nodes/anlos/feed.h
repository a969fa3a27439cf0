/* SPDX-License-Identifier: MIT */
/* nodes/anlos/feed.h -- brings what a running system says to the collector, and tells who
 * of its nodes lives. */
#ifndef ANLOS_NODES_ANLOS_FEED_H
#define ANLOS_NODES_ANLOS_FEED_H

#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"
#include "msgs/hosts.h"
#include "nodes/anlos/collector.h"

struct feed;

/* Looks who lives; run_dir need not exist.  0, -EINVAL, -ENOMEM, other negative errno. */
int feed_open(struct feed **out, const char *run_dir, struct error *why);

/* Listens to health, scan/status, detections and log from now on; to nothing larger, so
 * that looking costs the system nothing.  Errors as of feed_open. */
int feed_listen(struct feed *f, struct error *why);

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

/* Does anybody publish in the folder?  Tries each socket in it. */
bool feed_answers(const char *run_dir);

/* Says that nothing is running there; waits: and that the command waits for it. */
void feed_say_nothing_runs(const char *command, const char *run_dir, bool waits);

/* A census: every node there is, after listening for a moment. */

enum { CENSUS_MAX = TABLE_MAX_NODES };

enum census_life {
    CENSUS_NEVER, /* no trace of it in the run folder */
    CENSUS_ENDED, /* it ran there, and went as it should */
    CENSUS_DIED,  /* it ran there, and left its sockets: killed or crashed */
    CENSUS_ALIVE,
    CENSUS_SILENT,    /* the process is there, its health does not come */
    CENSUS_ELSEWHERE, /* on another machine of the system, from where it is heard */
};

struct census_node {
    const char *name;
    enum census_life life;
    long pid;                     /* 0: not known */
    const struct table_node *row; /* NULL: it has not been heard */
    char host[HOSTS_NAME_SIZE];   /* the other machine where it is to run, or empty */
};

struct census {
    size_t n;
    struct census_node nodes[CENSUS_MAX]; /* every node there is, as in msgs/topics.h */
    struct table table;
};

struct census_config {
    const char *run_dir; /* it need not exist */
    const char *node;    /* whom to wait for; NULL: everybody who lives */
    bool rates;          /* wait until they are known */
    bool (*stop)(void);  /* true: enough; may be NULL */
};

/* Listens until everybody who lives has been heard, for 3.5 s at most, and not at all
 * when nobody lives here and there is no other machine.  census_free the result.  0,
 * -EINTR (stop said so), -ENOMEM, other negative errno. */
int census_take(struct census **out, const struct census_config *cfg, struct error *why);
const struct census_node *census_find(const struct census *c, const char *node);
size_t census_count_alive(const struct census *c);
void census_free(struct census *c);

const char *census_life_name(enum census_life life);

#endif
