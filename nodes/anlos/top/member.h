/* nodes/anlos/top/member.h -- one node as the collector knows it: what it said last, what
 * it had counted before, and whether its process lives. */
#ifndef ANLOS_NODES_ANLOS_TOP_MEMBER_H
#define ANLOS_NODES_ANLOS_TOP_MEMBER_H

#include "msgs/health.pb-c.h"
#include "nodes/anlos/top/history.h"
#include "nodes/rt/presence.h"

struct member {
    struct table_node row; /* counts and text; the rest is filled in member_row */
    Anlos__Health__State state;
    bool heard, locked; /* locked: its lock has been seen held */
    enum presence presence;
    int64_t met_ns; /* since when its process is seen to live */
    int64_t epoch_ns, heard_ns;
    int64_t twin_ns; /* when an older process of the name was heard; 0: never */
    struct history history;
};

void member_health(struct member *m, const Anlos__Health *h, int64_t epoch_ns,
                   int64_t now_ns);
void member_presence(struct member *m, enum presence presence, int64_t now_ns);

/* Is there anything to show of it? */
bool member_is_known(const struct member *m);
void member_row(const struct member *m, int64_t now_ns, const struct table_scan *scan,
                struct table_node *out);

#endif
