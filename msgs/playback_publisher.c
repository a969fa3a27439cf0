/* SPDX-License-Identifier: MIT */
#include "msgs/playback_publisher.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "dsp/list.h"
#include "msgs/endpoint.h"
#include "msgs/publisher.h"
#include "msgs/remote.h"

struct place {
    char node[ENVELOPE_NODE_SIZE];
    int lock_fd;
};

struct part {
    size_t place; /* index */
    struct publisher *publisher;
};

struct playback_publisher {
    char *run_dir;
    struct remote *remote;
    struct reliable *reliable;
    int64_t epoch_ns;
    struct place *places; /* [n_places] */
    struct part *parts;   /* [n_parts] */
    size_t n_places, places_room, n_parts, parts_room;
};

int playback_publisher_create(struct playback_publisher **out, const char *run_dir,
                              int64_t epoch_ns, struct error *why)
{
    struct playback_publisher *s = calloc(1, sizeof *s);
    int err = s && (s->run_dir = strdup(run_dir)) ? endpoint_make_folder(run_dir, why)
                                                  : error_say(why, -ENOMEM, "no memory");

    if (!err)
        err = remote_create(&s->remote, run_dir, why);
    if (!err)
        err = reliable_create(&s->reliable, why);
    if (err) {
        playback_publisher_destroy(s);
        return err;
    }
    s->epoch_ns = epoch_ns;
    *out = s;
    return 0;
}

static struct publisher *find_publisher(const struct playback_publisher *s,
                                        const char *node, const struct topic *t)
{
    for (size_t i = 0; i < s->n_parts; i++)
        if (publisher_topic(s->parts[i].publisher) == t &&
            !strcmp(s->places[s->parts[i].place].node, node))
            return s->parts[i].publisher;
    return NULL;
}

/* The node's place, taken if it was not.  Its index, or a negative errno. */
static int take_place(struct playback_publisher *s, const char *node, struct error *why)
{
    for (size_t i = 0; i < s->n_places; i++)
        if (!strcmp(s->places[i].node, node))
            return (int)i;
    if (list_grow(&s->places, s->n_places, &s->places_room, sizeof *s->places))
        return error_say(why, -ENOMEM, "out of memory");
    struct place *p = &s->places[s->n_places];
    snprintf(p->node, sizeof p->node, "%s", node);
    p->lock_fd = endpoint_lock(s->run_dir, node, true, why);
    return p->lock_fd < 0 ? p->lock_fd : (int)s->n_places++;
}

int playback_publisher_add(struct playback_publisher *s, const char *node,
                           const struct topic *t, struct error *why)
{
    const struct bus_config cfg = {
        .node = node, .run_dir = s->run_dir, .epoch_ns = s->epoch_ns};

    if (find_publisher(s, node, t))
        return 0;
    if (!topic_is_published_by(t, node))
        return error_say(why, -EINVAL, "node \"%s\" does not publish %s", node, t->name);
    int place = take_place(s, node, why);
    if (place < 0)
        return place;
    if (list_grow(&s->parts, s->n_parts, &s->parts_room, sizeof *s->parts))
        return error_say(why, -ENOMEM, "out of memory");
    struct part *p = &s->parts[s->n_parts];
    p->place = (size_t)place;
    int err = publisher_create(&p->publisher, &cfg, s->remote, s->reliable, t, why);
    if (!err) {
        publisher_set_replayed(p->publisher, true);
        s->n_parts++;
    }
    return err;
}

bool playback_publisher_has(const struct playback_publisher *s, const char *node,
                            const struct topic *t)
{
    return find_publisher(s, node, t) != NULL;
}

int playback_publisher_await_recorders(const struct playback_publisher *s)
{
    struct publisher **all = calloc(s->n_parts ? s->n_parts : 1, sizeof *all);

    if (!all)
        return -ENOMEM;
    for (size_t i = 0; i < s->n_parts; i++)
        all[i] = s->parts[i].publisher;
    publishers_await_recorders(all, s->n_parts, s->run_dir);
    free(all);
    return 0;
}

int playback_publisher_publish(struct playback_publisher *s, const char *node,
                               const struct topic *t, int64_t capture_ns,
                               int64_t publish_ns, const void *payload, size_t size)
{
    struct publisher *o = find_publisher(s, node, t);

    return o ? publisher_send_copy(o, capture_ns, publish_ns, payload, size) : -EINVAL;
}

/* All but the last have to be with the kernel, which counts its own overhead too. */
size_t playback_publisher_window(const struct playback_publisher *s, const char *node,
                                 const struct topic *t, size_t size)
{
    const struct publisher *o = find_publisher(s, node, t);

    return 1 + (o ? publisher_room(o) / (2 * (ENVELOPE_SIZE + size)) : 0);
}

size_t playback_publisher_peers(const struct playback_publisher *s, const char *node,
                                const struct topic *t)
{
    struct publisher *o = find_publisher(s, node, t);
    struct bus_count count = {.peers = 0};

    if (o)
        publisher_count(o, &count);
    return count.peers;
}

bool playback_publisher_sent(const struct playback_publisher *s, size_t i,
                             const char **node, const struct topic **t, uint64_t *n)
{
    struct bus_count count;

    if (i >= s->n_parts)
        return false;
    publisher_count(s->parts[i].publisher, &count);
    *node = s->places[s->parts[i].place].node;
    *t = count.topic;
    *n = count.messages;
    return true;
}

const char *playback_publisher_node(const struct playback_publisher *s, size_t i)
{
    return i < s->n_places ? s->places[i].node : NULL;
}

void playback_publisher_destroy(struct playback_publisher *s)
{
    if (!s)
        return;
    for (size_t i = 0; i < s->n_parts; i++)
        publisher_destroy(s->parts[i].publisher);
    for (size_t i = 0; i < s->n_places; i++)
        close(s->places[i].lock_fd); /* last: until here the socket files are ours */
    remote_destroy(s->remote);
    reliable_destroy(s->reliable);
    free(s->parts);
    free(s->places);
    free(s->run_dir);
    free(s);
}
