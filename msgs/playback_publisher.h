/* SPDX-License-Identifier: MIT */
/* msgs/playback_publisher.h -- publishes in the place of other nodes: under their names,
 * at their endpoints, holding their locks, so that nobody can tell who speaks and no live
 * node of the name can start beside it.  Sequence numbers count anew, in an epoch of its
 * own. */
#ifndef ANLOS_MSGS_PLAYBACK_PUBLISHER_H
#define ANLOS_MSGS_PLAYBACK_PUBLISHER_H

#include "msgs/bus.h"

struct playback_publisher;

/* Everything that it sends is marked as replayed.  run_dir is copied.  0, -ENOMEM; errors
 * of making the folder and of reading its hosts. */
int playback_publisher_create(struct playback_publisher **out, const char *run_dir,
                              int64_t epoch_ns, struct error *why);

/* Takes the place of a node for a topic; a second time does nothing.  0, -EADDRINUSE (the
 * node is alive), -EINVAL (it does not publish the topic), -ENOMEM, as bus_create. */
int playback_publisher_add(struct playback_publisher *s, const char *node,
                           const struct topic *t, struct error *why);
bool playback_publisher_has(const struct playback_publisher *s, const char *node,
                            const struct topic *t);

/* After the last one was added, before anything is sent: those who must have everything
 * hear the first message.  0, -ENOMEM. */
int playback_publisher_await_recorders(const struct playback_publisher *s);

/* As bus_publish.  -EINVAL: not added. */
int playback_publisher_publish(struct playback_publisher *s, const char *node,
                               const struct topic *t, int64_t capture_ns,
                               int64_t publish_ns, const void *payload, size_t size);

/* How many messages of that size can be sent without a sign that one arrived, and none is
 * dropped on its way to a slow reader: 1 or more. */
size_t playback_publisher_window(const struct playback_publisher *s, const char *node,
                                 const struct topic *t, size_t size);

/* Who is connected to it now, as bus_counts has them; 0: nobody, or not added. */
size_t playback_publisher_peers(const struct playback_publisher *s, const char *node,
                                const struct topic *t);

/* Of the i-th node and topic, how many messages were sent; false: there is none. */
bool playback_publisher_sent(const struct playback_publisher *s, size_t i,
                             const char **node, const struct topic **t, uint64_t *n);

/* Nodes whose places are taken; the i-th name, or NULL. */
const char *playback_publisher_node(const struct playback_publisher *s, size_t i);
void playback_publisher_destroy(struct playback_publisher *s);

#endif
