/* nodes/anlos/collector.h -- gathers what the processes say of themselves into one
 * table.  Pure: messages and times come in, a table goes out.  Rates and shares are those
 * of the last three seconds, by the clock of whoever listens; a process that starts again
 * counts anew. */
#ifndef ANLOS_NODES_ANLOS_COLLECTOR_H
#define ANLOS_NODES_ANLOS_COLLECTOR_H

#include "msgs/health.pb-c.h"
#include "msgs/log.pb-c.h"
#include "nodes/anlos/top/table.h"
#include "nodes/rt/presence.h"

#define COLLECTOR_SILENT_NS                                                              \
    2500000000LL /* two health messages and a half are missing                           \
                  */

struct collector;

/* 0, -ENOMEM. */
int collector_create(struct collector **out);

/* epoch_ns: when the sender started (envelope). */
void collector_health(struct collector *c, const Anlos__Health *m, int64_t epoch_ns,
                      int64_t now_ns);
void collector_scan(struct collector *c, const Anlos__ScanStatus *m);
void collector_objects(struct collector *c, const Anlos__DetectionList *m);
void collector_log(struct collector *c, const Anlos__Log *m);

/* What the run folder tells of a node. */
void collector_presence(struct collector *c, const char *node, enum presence presence,
                        int64_t now_ns);

/* Rows in the order of msgs/topics.h; what is not of the system (run_dir, own_cpu,
 * own_refused) is left alone. */
void collector_table(const struct collector *c, int64_t now_ns, struct table *out);
void collector_destroy(struct collector *c);

#endif
