/* SPDX-License-Identifier: MIT */
#include "nodes/play/bag_iterator.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/cursor.h"
#include "msgs/bag/schemas.h"
#include "msgs/bag/topic_message.h"
#include "msgs/convert.h"
#include "msgs/shuffle.h"
#include "msgs/tensor.pb-c.h"
#include "msgs/unpack.h"
#include "recon/survey.h"

/* A survey is repeated each second; who plays slowly looks no farther back than this. */
#define SURVEY_LOOK_BACK_NS 2000000000LL

struct channel {
    struct bag_source source;
    size_t part; /* index */
};

struct bag_iterator {
    struct bag_catalog *catalog;
    struct bag_cursor *cursor, *survey_cursor;
    struct channel *channels;        /* [n_channels]; topic NULL: not ours */
    struct bag_iterator_part *parts; /* [n_parts] */
    size_t n_parts, n_foreign;
    int64_t start_ns, end_ns;
};

/* The topic's name in the bag as the remap has it. */
static void rename_topic(const char *remap, struct bytes name, char out[64])
{
    snprintf(out, 64, "%.*s", (int)(name.size < 63 ? name.size : 63),
             (const char *)name.data);
    while (remap && *remap) {
        const char *to = strstr(remap, ":="), *end = remap + strcspn(remap, ",");
        if (to && to < end && strlen(out) == (size_t)(to - remap) &&
            !strncmp(out, remap, (size_t)(to - remap))) {
            snprintf(out, 64, "%.*s", (int)(end - to - 2), to + 2);
            return;
        }
        remap = end + (*end == ',');
    }
}

/* Who else writes MCAP with our schemas need not know our metadata. */
static bool read_source(struct bag_source *out, const struct bag_catalog *c,
                        const struct bag_channel *channel, const char *remap)
{
    const struct bag_schema *schema = bag_catalog_schema(c, channel->schema_id);
    struct bag_channel renamed = *channel;
    char name[64];

    rename_topic(remap, channel->topic, name);
    renamed.topic = bytes_of(name);
    const struct topic *topic = topics_find(name);
    if (!topic || !schema || !bytes_equal(schema->name, bytes_of(topic->schema->name)) ||
        !bytes_equal(channel->message_encoding, bytes_of(BAG_PROTOBUF)))
        return false;
    if (!bag_source_of(out, &renamed))
        return topic_is_published_by(topic, out->node);
    *out = (struct bag_source){.topic = topic, .captured = false};
    snprintf(out->node, sizeof out->node, "%s", topic_publisher(topic, 0));
    return true;
}

static size_t find_part(struct bag_iterator *t, const struct bag_source *s)
{
    size_t i = 0;

    while (i < t->n_parts &&
           (t->parts[i].topic != s->topic || strcmp(t->parts[i].node, s->node) != 0))
        i++;
    if (i == t->n_parts) {
        struct bag_iterator_part *p = &t->parts[t->n_parts++];
        *p = (struct bag_iterator_part){.topic = s->topic, .wanted = true};
        memcpy(p->node, s->node, sizeof p->node);
    }
    return i;
}

static int list_parts(struct bag_iterator *t, const struct bag_iterator_config *cfg,
                      struct error *why)
{
    size_t n = t->catalog->n_channels;

    t->channels = calloc(n + 1, sizeof *t->channels);
    t->parts = calloc(n + 1, sizeof *t->parts);
    if (!t->channels || !t->parts)
        return error_say(why, -ENOMEM, "out of memory");
    for (size_t i = 0; i < n; i++) {
        struct channel *c = &t->channels[i];
        if (read_source(&c->source, t->catalog, &t->catalog->channels[i].record.channel,
                        cfg->remap)) {
            c->part = find_part(t, &c->source);
        } else {
            c->source.topic = NULL;
            t->n_foreign++;
        }
    }
    return t->n_parts
               ? 0
               : error_say(why, -ENODATA, "%s: no messages of this system", cfg->bag);
}

/* Each pair names a topic of ours, and something in the bag. */
static int check_remap(const struct bag_iterator *t, const char *remap, struct error *why)
{
    while (remap && *remap) {
        const char *to = strstr(remap, ":="), *end = remap + strcspn(remap, ",");
        char from[64], topic[64];
        bool found = false;
        if (!to || to >= end || to == remap)
            return error_say(why, -EINVAL, "remap %s: expected FROM:=TO", remap);
        snprintf(from, sizeof from, "%.*s", (int)(to - remap), remap);
        snprintf(topic, sizeof topic, "%.*s", (int)(end - to - 2), to + 2);
        if (!topics_find(topic))
            return error_say(why, -EINVAL,
                             "remap: \"%s\" is no topic; 'anlos topic list' has their "
                             "names",
                             topic);
        for (size_t i = 0; i < t->catalog->n_channels && !found; i++)
            found =
                bytes_equal(t->catalog->channels[i].record.channel.topic, bytes_of(from));
        if (!found)
            return error_say(why, -EINVAL,
                             "remap: no topic of the bag is called \"%s\"; 'anlos bag "
                             "info' has their names",
                             from);
        remap = end + (*end == ',');
    }
    return 0;
}

static int64_t clamp_time(uint64_t ns)
{
    return ns > INT64_MAX ? INT64_MAX : (int64_t)ns;
}

static int set_times(struct bag_iterator *t, const struct bag_iterator_config *cfg,
                     struct error *why)
{
    int64_t first = clamp_time(t->catalog->start_time);
    int64_t last = clamp_time(t->catalog->end_time);
    double length_s = 1e-9 * (double)(last - first);

    if (!t->catalog->n_messages)
        return error_say(why, -ENODATA, "%s: no messages", cfg->bag);
    if (cfg->start_s > length_s)
        return error_say(why, -EINVAL, "%s: %g s is beyond its end, %.3f s", cfg->bag,
                         cfg->start_s, length_s);
    t->start_ns = first + llround(1e9 * cfg->start_s);
    t->end_ns = cfg->end_s >= length_s ? last : first + llround(1e9 * cfg->end_s);
    return 0;
}

static int open_parts(struct bag_iterator *t, const struct bag_iterator_config *cfg,
                      struct error *why)
{
    int err = bag_catalog_open(&t->catalog, cfg->bag, why);

    if (!err)
        err = set_times(t, cfg, why);
    if (!err)
        err = check_remap(t, cfg->remap, why);
    if (!err)
        err = list_parts(t, cfg, why);
    if (!err && (bag_cursor_create(&t->cursor, t->catalog) ||
                 bag_cursor_create(&t->survey_cursor, t->catalog)))
        err = error_say(why, -ENOMEM, "out of memory");
    for (size_t i = 0; !err && i < t->catalog->n_channels; i++)
        bag_cursor_select(t->survey_cursor, t->catalog->channels[i].record.channel.id,
                          t->channels[i].source.topic == topic_survey());
    return err;
}

int bag_iterator_open(struct bag_iterator **out, const struct bag_iterator_config *cfg,
                      struct error *why)
{
    struct bag_iterator *t = calloc(1, sizeof *t);
    int err = t ? open_parts(t, cfg, why) : error_say(why, -ENOMEM, "out of memory");

    if (err)
        bag_iterator_close(t);
    else
        *out = t;
    return err;
}

struct bag_iterator_part *bag_iterator_part(struct bag_iterator *t, size_t i)
{
    return i < t->n_parts ? &t->parts[i] : NULL;
}

size_t bag_iterator_foreign(const struct bag_iterator *t)
{
    return t->n_foreign;
}

int64_t bag_iterator_start_ns(const struct bag_iterator *t)
{
    return t->start_ns;
}

int64_t bag_iterator_end_ns(const struct bag_iterator *t)
{
    return t->end_ns;
}

void bag_iterator_seek(struct bag_iterator *t, int64_t publish_ns)
{
    for (size_t i = 0; i < t->catalog->n_channels; i++) {
        const struct channel *c = &t->channels[i];
        bag_cursor_select(t->cursor, t->catalog->channels[i].record.channel.id,
                          c->source.topic && t->parts[c->part].wanted);
    }
    bag_cursor_seek(t->cursor, (uint64_t)publish_ns);
}

static int take(struct bag_iterator *t, struct bag_cursor *from,
                struct bag_iterator_message *out, struct error *why)
{
    struct bag_message m;
    int err = bag_cursor_next(from, &m, why);

    if (err)
        return err;
    uint32_t at = t->catalog->channel_at[m.channel_id];
    if (!at)
        return error_say(why, -EBADMSG,
                         "%s: a message of channel %u, which is not defined",
                         t->catalog->file.path, m.channel_id);
    const struct channel *c = &t->channels[at - 1];
    out->part = &t->parts[c->part];
    bag_source_envelope(&c->source, &m, &out->envelope);
    out->payload = m.data;
    return 0;
}

int bag_iterator_next(struct bag_iterator *t, struct bag_iterator_message *out,
                      struct error *why)
{
    int err = take(t, t->cursor, out, why);

    /* A time that the bus has no room for is after all others. */
    if (!err && (out->envelope.publish_ns > t->end_ns || out->envelope.publish_ns < 0))
        err = -ENODATA;
    return err;
}

/* The cursor goes forward only: the one before is asked for once more. */
int bag_iterator_find_survey(struct bag_iterator *t, int64_t publish_ns,
                             struct bag_iterator_message *out, struct error *why)
{
    int64_t from = publish_ns - SURVEY_LOOK_BACK_NS, found = -1;
    int err;

    for (int round = 0; round < 2 && found < 0; round++) {
        bag_cursor_seek(t->survey_cursor, round || from < 0 ? 0 : (uint64_t)from);
        while (!(err = take(t, t->survey_cursor, out, why)) &&
               (found < 0 || out->envelope.publish_ns <= publish_ns))
            found = out->envelope.publish_ns;
        if (err && err != -ENODATA)
            return err;
        if (from <= 0)
            break;
    }
    if (found < 0)
        return -ENODATA;
    bag_cursor_seek(t->survey_cursor, (uint64_t)found);
    return take(t, t->survey_cursor, out, why);
}

void bag_iterator_close(struct bag_iterator *t)
{
    if (!t)
        return;
    bag_cursor_destroy(t->cursor);
    bag_cursor_destroy(t->survey_cursor);
    bag_catalog_close(t->catalog);
    free(t->channels);
    free(t->parts);
    free(t);
}

/* -- what is said otherwise than it was recorded ----------------------------------------
 */

static const ProtobufCFieldDescriptor *find(const ProtobufCMessageDescriptor *d,
                                            const char *name)
{
    const ProtobufCFieldDescriptor *f =
        protobuf_c_message_descriptor_get_field_by_name(d, name);

    return f && f->label != PROTOBUF_C_LABEL_REPEATED &&
                   (f->type == PROTOBUF_C_TYPE_UINT32 || f->type == PROTOBUF_C_TYPE_ENUM)
               ? f
               : NULL;
}

static uint32_t *at(const ProtobufCMessage *m, const ProtobufCFieldDescriptor *f)
{
    return (uint32_t *)(void *)((char *)m + f->offset);
}

int64_t rewrite_peek(const ProtobufCMessage *m, const char *field)
{
    const ProtobufCFieldDescriptor *f = find(m->descriptor, field);

    return f ? (int64_t)*at(m, f) : -1;
}

static int pack(const ProtobufCMessage *m, struct bytes *payload,
                struct bytes_buffer *into)
{
    size_t size = protobuf_c_message_get_packed_size(m);

    if (bytes_reserve(into, size ? size : 1))
        return -ENOMEM;
    into->size = protobuf_c_message_pack(m, into->data);
    *payload = bytes_in(into);
    return 0;
}

enum { FIRST_FIELD = 0x08 }; /* as a number: the id, in all that name a survey */

/* Where the survey's id is missing; NULL: it is there, or the topic has none. */
static const ProtobufCFieldDescriptor *find_missing(const struct topic *t,
                                                    const struct bytes *payload)
{
    const ProtobufCFieldDescriptor *f =
        protobuf_c_message_descriptor_get_field_by_name(t->schema, "survey_id");

    return f && f->id == 1 && f->type == PROTOBUF_C_TYPE_UINT64 &&
                   !(payload->size && payload->data[0] == FIRST_FIELD)
               ? f
               : NULL;
}

int rewrite(const struct topic *t, uint32_t scan_base, uint64_t survey_id,
            struct bytes *payload, struct bytes_buffer *into)
{
    const ProtobufCFieldDescriptor *missing = survey_id ? find_missing(t, payload) : NULL;
    const ProtobufCFieldDescriptor *scan = scan_base ? find(t->schema, "scan") : NULL;
    const ProtobufCFieldDescriptor *source = find(t->schema, "source");

    if (source && source->descriptor != &anlos__source__descriptor)
        source = NULL;
    bool changes = scan || source || missing;
    if (!changes && !bag_topic_is_shuffled(t))
        return 0;
    ProtobufCMessage *m =
        message_unpack_as_it_is(t->schema, payload->size, payload->data);
    if (!m)
        return errno == ENOMEM ? -ENOMEM : changes ? -EPROTO : 0;
    int err = 0;
    if (!changes && !message_is_shuffled(m))
        goto message;
    err = message_unshuffle(m);
    if (err)
        goto message;
    if (scan)
        *at(m, scan) += scan_base;
    if (missing && !*(uint64_t *)(void *)((char *)m + missing->offset))
        *(uint64_t *)(void *)((char *)m + missing->offset) = survey_id;
    if (t->schema == &anlos__survey__descriptor)
        survey_complete_id((Anlos__Survey *)m);
    if (source)
        *at(m, source) = ANLOS__SOURCE__REPLAY;
    err = pack(m, payload, into);
message:
    protobuf_c_message_free_unpacked(m, NULL);
    return err;
}
