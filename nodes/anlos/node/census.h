/* nodes/anlos/node/census.h -- listens to a running system for a moment: which nodes
 * live, what they say and how they work. */
#ifndef ANLOS_NODES_ANLOS_NODE_CENSUS_H
#define ANLOS_NODES_ANLOS_NODE_CENSUS_H

#include "dsp/error.h"
#include "msgs/hosts.h"
#include "nodes/anlos/top/table.h"

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
