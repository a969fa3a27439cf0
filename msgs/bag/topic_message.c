/* SPDX-License-Identifier: MIT */
#include "msgs/bag/topic_message.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "msgs/bag/schemas.h"
#include "msgs/shuffle.h"

#define NUMBER_SIZE 24 /* digits of an int64 */

struct known_channel {
    struct bag_source source;
    uint16_t id;
};

struct bag_topics {
    struct bag_writer *writer;
    struct known_channel *channels; /* [n] */
    size_t n, room;
    const struct topic **schemas; /* [n_schemas]: the first topic that has it */
    uint16_t *schema_ids;         /* [n_schemas] */
    size_t n_schemas;
    bool shuffles;
    struct bytes_buffer shuffled;
};

int bag_topics_create(struct bag_topics **out, struct bag_writer *w)
{
    size_t n = 0;
    struct bag_topics *t = calloc(1, sizeof *t);

    while (topics_all()[n].name)
        n++;
    if (t) {
        t->writer = w;
        t->schemas = calloc(n, sizeof *t->schemas);
        t->schema_ids = calloc(n, sizeof *t->schema_ids);
    }
    if (!t || !t->schemas || !t->schema_ids) {
        bag_topics_destroy(t);
        return -ENOMEM;
    }
    *out = t;
    return 0;
}

void bag_topics_destroy(struct bag_topics *t)
{
    if (!t)
        return;
    free(t->channels);
    free(t->schemas);
    free(t->schema_ids);
    bytes_free(&t->shuffled);
    free(t);
}

void bag_topics_shuffle(struct bag_topics *t)
{
    t->shuffles = true;
}

bool bag_topic_is_shuffled(const struct topic *topic)
{
    return topic == topic_ping() || topic == topic_volume();
}

/* Topics may share a schema. */
static int find_schema(struct bag_topics *t, const struct topic *topic, uint16_t *id,
                       struct error *why)
{
    const struct bag_schema schema = bag_schema_of(topic);

    for (size_t i = 0; i < t->n_schemas; i++) {
        if (t->schemas[i]->schema == topic->schema) {
            *id = t->schema_ids[i];
            return 0;
        }
    }
    int err = bag_writer_schema(t->writer, &schema, id, why);
    if (!err) {
        t->schemas[t->n_schemas] = topic;
        t->schema_ids[t->n_schemas++] = *id;
    }
    return err;
}

void bag_source_describe(const struct bag_source *s, struct bytes_buffer *metadata)
{
    char epoch[NUMBER_SIZE];

    snprintf(epoch, sizeof epoch, "%" PRId64, s->epoch_ns);
    bag_map_put(metadata, bytes_of("node"), bytes_of(s->node));
    bag_map_put(metadata, bytes_of("epoch_ns"), bytes_of(epoch));
    bag_map_put(metadata, bytes_of("capture"),
                bytes_of(s->captured ? "publish_time" : "none"));
}

static int write_channel(struct bag_topics *t, const struct bag_source *s, uint16_t *id,
                         struct error *why)
{
    struct bag_channel channel = {.topic = bytes_of(s->topic->name),
                                  .message_encoding = bytes_of(BAG_PROTOBUF)};
    struct bytes_buffer metadata = {0};
    int err = find_schema(t, s->topic, &channel.schema_id, why);

    if (err)
        return err;
    bag_source_describe(s, &metadata);
    channel.metadata = bytes_in(&metadata);
    err = metadata.failed ? error_say(why, -ENOMEM, "out of memory")
                          : bag_writer_channel(t->writer, &channel, id, why);
    bytes_free(&metadata);
    return err;
}

bool bag_source_is_same(const struct bag_source *a, const struct bag_source *b)
{
    return a->topic == b->topic && a->epoch_ns == b->epoch_ns &&
           a->captured == b->captured && !strcmp(a->node, b->node);
}

static int find_channel(struct bag_topics *t, const struct bag_source *s, uint16_t *id,
                        struct error *why)
{
    for (size_t i = 0; i < t->n; i++) {
        if (bag_source_is_same(&t->channels[i].source, s)) {
            *id = t->channels[i].id;
            return 0;
        }
    }
    if (list_grow(&t->channels, t->n, &t->room, sizeof *t->channels))
        return error_say(why, -ENOMEM, "out of memory");
    int err = write_channel(t, s, id, why);
    if (!err)
        t->channels[t->n++] = (struct known_channel){*s, *id};
    return err;
}

void bag_source_from(struct bag_source *source, struct bag_message *m,
                     const struct envelope *e, const void *payload)
{
    *source = (struct bag_source){.topic = topics_find(e->topic),
                                  .epoch_ns = e->epoch_ns,
                                  .captured = e->capture_ns != 0};
    memcpy(source->node, e->node, sizeof source->node);
    *m = (struct bag_message){
        .sequence = (uint32_t)e->sequence,
        .log_time = (uint64_t)e->publish_ns,
        .publish_time = (uint64_t)(e->capture_ns ? e->capture_ns : e->publish_ns),
        .data = {payload, e->payload_size}};
}

int bag_topics_put(struct bag_topics *t, const struct envelope *e, const void *payload,
                   uint16_t *channel_id, struct error *why)
{
    struct bag_source source;
    struct bag_message m;

    bag_source_from(&source, &m, e, payload);
    if (!source.topic)
        return error_say(why, -EINVAL, "%s: no such topic", e->topic);
    /* What is none of its schema is kept as it came. */
    if (t->shuffles && bag_topic_is_shuffled(source.topic) &&
        !payload_shuffle(&t->shuffled, source.topic->schema, m.data, true))
        m.data = bytes_in(&t->shuffled);
    int err = find_channel(t, &source, &m.channel_id, why);
    if (err)
        return err;
    if (channel_id)
        *channel_id = m.channel_id;
    return bag_writer_message(t->writer, &m, why);
}

/* A borrowed text with a zero at its end.  -EINVAL: it does not fit, or is none. */
static int copy_text(char *out, size_t size, struct bytes from)
{
    if (from.size >= size || memchr(from.data, 0, from.size))
        return -EINVAL;
    memcpy(out, from.data, from.size);
    out[from.size] = '\0';
    return 0;
}

static int take_epoch(int64_t *out, struct bytes from)
{
    char text[NUMBER_SIZE], *end;

    if (copy_text(text, sizeof text, from))
        return -EINVAL;
    errno = 0;
    *out = strtoll(text, &end, 10);
    return errno || end == text || *end ? -EINVAL : 0;
}

int bag_source_of(struct bag_source *out, const struct bag_channel *channel)
{
    struct bytes map = channel->metadata, key, value;
    char topic[ENVELOPE_TOPIC_SIZE];
    bool node = false, epoch = false, capture = false;

    *out = (struct bag_source){.topic = NULL};
    if (copy_text(topic, sizeof topic, channel->topic))
        return -EINVAL;
    out->topic = topics_find(topic);
    while (bag_map_next(&map, &key, &value)) {
        if (bytes_equal(key, bytes_of("node")))
            node = value.size && !copy_text(out->node, sizeof out->node, value);
        else if (bytes_equal(key, bytes_of("epoch_ns")))
            epoch = !take_epoch(&out->epoch_ns, value);
        else if (bytes_equal(key, bytes_of("capture"))) {
            capture = true;
            out->captured = bytes_equal(value, bytes_of("publish_time"));
        }
    }
    return out->topic && node && epoch && capture &&
                   bytes_equal(channel->message_encoding, bytes_of(BAG_PROTOBUF))
               ? 0
               : -EINVAL;
}

/* A time that no bus would have taken is the last that it takes. */
static int64_t stamp(uint64_t ns)
{
    return ns < (uint64_t)ENVELOPE_MAX_STAMP ? (int64_t)ns : ENVELOPE_MAX_STAMP;
}

void bag_source_envelope(const struct bag_source *s, const struct bag_message *m,
                         struct envelope *out)
{
    *out = (struct envelope){.epoch_ns = s->epoch_ns,
                             .sequence = m->sequence,
                             .publish_ns = stamp(m->log_time),
                             .capture_ns = s->captured ? stamp(m->publish_time) : 0,
                             .payload_size = (uint32_t)m->data.size};
    snprintf(out->topic, sizeof out->topic, "%s", s->topic->name);
    memcpy(out->node, s->node, sizeof out->node);
}
