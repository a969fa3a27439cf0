#include "msgs/stand_in.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "msgs/endpoint.h"
#include "msgs/outlet.h"
#include "msgs/remote.h"

struct place {
    char node[ENVELOPE_NODE_SIZE];
    int lock_fd;
};

struct part {
    size_t place; /* index */
    struct outlet *outlet;
};

struct stand_in {
    char *run_dir;
    struct remote *remote;
    int64_t epoch_ns;
    struct place *places; /* [n_places] */
    struct part *parts;   /* [n_parts] */
    size_t n_places, n_parts;
};

int stand_in_create(struct stand_in **out, const char *run_dir, int64_t epoch_ns,
                    struct complaint *why)
{
    struct stand_in *s = calloc(1, sizeof *s);
    int err = s && (s->run_dir = strdup(run_dir)) ? endpoint_make_folder(run_dir, why)
                                                  : complain(why, -ENOMEM, "no memory");

    if (!err)
        err = remote_create(&s->remote, run_dir, why);
    if (err) {
        stand_in_destroy(s);
        return err;
    }
    s->epoch_ns = epoch_ns;
    *out = s;
    return 0;
}

static struct outlet *find_outlet(const struct stand_in *s, const char *node,
                                  const struct topic *t)
{
    for (size_t i = 0; i < s->n_parts; i++)
        if (outlet_topic(s->parts[i].outlet) == t &&
            !strcmp(s->places[s->parts[i].place].node, node))
            return s->parts[i].outlet;
    return NULL;
}

/* The node's place, taken if it was not.  Its index, or a negative errno. */
static int take_place(struct stand_in *s, const char *node, struct complaint *why)
{
    for (size_t i = 0; i < s->n_places; i++)
        if (!strcmp(s->places[i].node, node))
            return (int)i;
    struct place *grown = realloc(s->places, (s->n_places + 1) * sizeof *grown);
    if (!grown)
        return complain(why, -ENOMEM, "out of memory");
    s->places = grown;
    struct place *p = &grown[s->n_places];
    snprintf(p->node, sizeof p->node, "%s", node);
    p->lock_fd = endpoint_lock(s->run_dir, node, true, why);
    return p->lock_fd < 0 ? p->lock_fd : (int)s->n_places++;
}

int stand_in_add(struct stand_in *s, const char *node, const struct topic *t,
                 struct complaint *why)
{
    const struct bus_config cfg = {
        .node = node, .run_dir = s->run_dir, .epoch_ns = s->epoch_ns};

    if (find_outlet(s, node, t))
        return 0;
    if (!topic_is_published_by(t, node))
        return complain(why, -EINVAL, "node \"%s\" does not publish %s", node, t->name);
    int place = take_place(s, node, why);
    if (place < 0)
        return place;
    struct part *grown = realloc(s->parts, (s->n_parts + 1) * sizeof *grown);
    if (!grown)
        return complain(why, -ENOMEM, "out of memory");
    s->parts = grown;
    struct part *p = &grown[s->n_parts];
    p->place = (size_t)place;
    int err = outlet_create(&p->outlet, &cfg, s->remote, t, why);
    if (!err) {
        outlet_set_replayed(p->outlet, true);
        s->n_parts++;
    }
    return err;
}

bool stand_in_has(const struct stand_in *s, const char *node, const struct topic *t)
{
    return find_outlet(s, node, t) != NULL;
}

int stand_in_publish(struct stand_in *s, const char *node, const struct topic *t,
                     int64_t capture_ns, int64_t publish_ns, const void *payload,
                     size_t size)
{
    struct outlet *o = find_outlet(s, node, t);

    return o ? outlet_send_copy(o, capture_ns, publish_ns, payload, size) : -EINVAL;
}

/* All but the last have to be with the kernel, which counts its own overhead too. */
size_t stand_in_window(const struct stand_in *s, const char *node, const struct topic *t,
                       size_t size)
{
    const struct outlet *o = find_outlet(s, node, t);

    return 1 + (o ? outlet_room(o) / (2 * (ENVELOPE_SIZE + size)) : 0);
}

bool stand_in_sent(const struct stand_in *s, size_t i, const char **node,
                   const struct topic **t, uint64_t *n)
{
    struct bus_count count;

    if (i >= s->n_parts)
        return false;
    outlet_count(s->parts[i].outlet, &count);
    *node = s->places[s->parts[i].place].node;
    *t = count.topic;
    *n = count.messages;
    return true;
}

const char *stand_in_node(const struct stand_in *s, size_t i)
{
    return i < s->n_places ? s->places[i].node : NULL;
}

void stand_in_destroy(struct stand_in *s)
{
    if (!s)
        return;
    for (size_t i = 0; i < s->n_parts; i++)
        outlet_destroy(s->parts[i].outlet);
    for (size_t i = 0; i < s->n_places; i++)
        close(s->places[i].lock_fd); /* last: until here the socket files are ours */
    remote_destroy(s->remote);
    free(s->parts);
    free(s->places);
    free(s->run_dir);
    free(s);
}
