/* msgs/stand_in.h -- publishes in the place of other nodes: under their names, at their
 * endpoints, holding their locks, so that nobody can tell who speaks and no live node of
 * the name can start beside it.  Sequence numbers count anew, in an epoch of its own. */
#ifndef ANLOS_MSGS_STAND_IN_H
#define ANLOS_MSGS_STAND_IN_H

#include "msgs/bus.h"

struct stand_in;

/* Everything that it sends is marked as replayed.  run_dir is copied.  0, -ENOMEM; errors
 * of making the folder and of reading its hosts. */
int stand_in_create(struct stand_in **out, const char *run_dir, int64_t epoch_ns,
                    struct complaint *why);

/* Takes the place of a node for a topic; a second time does nothing.  0, -EADDRINUSE (the
 * node is alive), -EINVAL (it does not publish the topic), -ENOMEM, as bus_create. */
int stand_in_add(struct stand_in *s, const char *node, const struct topic *t,
                 struct complaint *why);
bool stand_in_has(const struct stand_in *s, const char *node, const struct topic *t);

/* As bus_publish.  -EINVAL: not added. */
int stand_in_publish(struct stand_in *s, const char *node, const struct topic *t,
                     int64_t capture_ns, int64_t publish_ns, const void *payload,
                     size_t size);

/* How many messages of that size can be sent without a sign that one arrived, and none is
 * dropped on its way to a slow reader: 1 or more. */
size_t stand_in_window(const struct stand_in *s, const char *node, const struct topic *t,
                       size_t size);

/* Of the i-th node and topic, how many messages were sent; false: there is none. */
bool stand_in_sent(const struct stand_in *s, size_t i, const char **node,
                   const struct topic **t, uint64_t *n);

/* Nodes whose places are taken; the i-th name, or NULL. */
const char *stand_in_node(const struct stand_in *s, size_t i);
void stand_in_destroy(struct stand_in *s);

#endif
