/* A bag for Foxglove: what is in it, and what a live client would be shown of that. */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/copy.h"
#include "msgs/bag/schemas.h"
#include "nodes/anlos/bag/export.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/foxglove/channels.h"

struct view { /* a channel that is added */
    bool known;
    uint16_t id, schema_id;
    uint32_t n; /* messages */
};

struct work {
    struct stream *stream;
    struct bag_writer *writer;
    struct bag_copy *copy;
    struct setting setting;
    struct view *views; /* [n_views]: all of channels_count */
    size_t n_views;
    uint64_t n_copied, n_added, n_left_out;
};

/* The id of its schema, which another channel may have had before. */
static int define_schema(struct work *w, const struct channel *c, uint16_t *id,
                         struct complaint *why)
{
    struct channel other;

    for (size_t i = 0; i < w->n_views; i++) {
        channel_get(i, &other);
        if (w->views[i].known && bytes_equal(other.schema.name, c->schema.name)) {
            *id = w->views[i].schema_id;
            return 0;
        }
    }
    return bag_writer_schema(w->writer, &c->schema, id, why);
}

static int define(struct work *w, const struct channel *c, struct view *v,
                  struct complaint *why)
{
    struct bag_channel channel = {.topic = bytes_of(c->name),
                                  .message_encoding = bytes_of(BAG_PROTOBUF)};
    int err = define_schema(w, c, &v->schema_id, why);

    channel.schema_id = v->schema_id;
    if (!err)
        err = bag_writer_channel(w->writer, &channel, &v->id, why);
    v->known = !err;
    return err;
}

static int add_view(struct work *w, size_t index, const struct channel *c,
                    const struct foxglove_message *m, const struct bag_message *raw,
                    struct complaint *why)
{
    struct view *v = &w->views[index];
    uint8_t *data;
    size_t size;
    int err = channel_pack(c, &w->setting, m, &data, &size);

    if (err == -ENOMEM)
        return complain(why, err, "out of memory");
    if (err) {
        w->n_left_out++;
        return 0;
    }
    if (!v->known)
        err = define(w, c, v, why);
    if (!err) {
        const struct bag_message out = {.channel_id = v->id,
                                        .sequence = v->n++,
                                        .log_time = raw->log_time,
                                        .publish_time = raw->publish_time,
                                        .data = {data, size}};
        err = bag_writer_message(w->writer, &out, why);
        w->n_added += !err;
    }
    free(data);
    return err;
}

static int add_views(struct work *w, const struct stream_message *m,
                     struct complaint *why)
{
    ProtobufCMessage *content = stream_unpack(m);
    const struct foxglove_message in = {.topic = m->topic,
                                        .node = m->envelope.node,
                                        .content = content,
                                        .capture_ns = m->envelope.capture_ns,
                                        .publish_ns = m->envelope.publish_ns};
    struct channel c;
    int err = 0;

    if (!content) {
        w->n_left_out++;
        return 0;
    }
    setting_take(&w->setting, &in);
    for (size_t i = 0; i < w->n_views && !err; i++) {
        channel_get(i, &c);
        if (c.convert && channel_is_from(&c, m->topic))
            err = add_view(w, i, &c, &in, &m->raw, why);
    }
    protobuf_c_message_free_unpacked(content, NULL);
    return err;
}

static bool is_source(const struct work *w, const struct topic *t)
{
    struct channel c;

    for (size_t i = 0; t && i < w->n_views; i++) {
        channel_get(i, &c);
        if (c.convert && channel_is_from(&c, t))
            return true;
    }
    return false;
}

/* One that was made like this one is not to have everything twice. */
static bool is_view(const struct bag_channel *channel)
{
    const size_t n = sizeof CHANNEL_VIEW - 1;

    return channel->topic.size > n && !memcmp(channel->topic.data, CHANNEL_VIEW, n);
}

/* An image may come before the first survey of its bag, which is repeated every second.
 */
static int find_survey(struct work *w, struct complaint *why)
{
    struct stream_message m;
    int err = 0;

    stream_select(w->stream, "survey");
    while (!err && !w->setting.has_survey && !(err = stream_next(w->stream, &m, why))) {
        ProtobufCMessage *content = stream_unpack(&m);
        const struct foxglove_message in = {.topic = m.topic, .content = content};
        if (!content)
            continue;
        setting_take(&w->setting, &in);
        protobuf_c_message_free_unpacked(content, NULL);
    }
    stream_select(w->stream, NULL);
    stream_rewind(w->stream);
    return err == -ENODATA ? 0 : err;
}

static int copy_all(struct work *w, struct complaint *why)
{
    struct stream_message m;
    int err = bag_copy_rest(w->copy, 0, why);

    while (!err && !(err = stream_next(w->stream, &m, why))) {
        if (is_view(m.channel))
            continue;
        err = bag_copy_message(w->copy, 0, &m.raw, why);
        w->n_copied += !err;
        if (!err && is_source(w, m.topic))
            err = add_views(w, &m, why);
    }
    return err == -ENODATA ? 0 : err;
}

static int write_bag(struct work *w, const struct export_options *o,
                     struct complaint *why)
{
    const struct bytes profile = stream_catalog(w->stream)->header.record.header.profile;
    struct verb_output output;
    char text[64];
    int err = verb_output_begin(&output, o->out, why);

    if (err)
        return err;
    snprintf(text, sizeof text, "%.*s", (int)(profile.size < 64 ? profile.size : 0),
             (const char *)profile.data);
    err = verb_writer_create(&w->writer, &output, text, BAG_ZSTD, why);
    if (err)
        return verb_output_end(&output, err, why);
    if (bag_copy_create(&w->copy, w->writer) ||
        bag_copy_add(w->copy, stream_catalog(w->stream)))
        err = complain(why, -ENOMEM, "out of memory");
    if (!err)
        err = find_survey(w, why);
    if (!err)
        err = copy_all(w, why);
    int closed = bag_writer_close(w->writer, err ? NULL : why);
    return verb_output_end(&output, err ? err : closed, why);
}

int export_foxglove(struct stream *s, const struct export_options *o,
                    struct complaint *why)
{
    struct work w = {.stream = s, .n_views = channels_count()};
    int err;

    w.views = calloc(w.n_views, sizeof *w.views);
    err = w.views ? write_bag(&w, o, why) : complain(why, -ENOMEM, "out of memory");
    if (!err)
        printf("%s: %" PRIu64 " messages, and %" PRIu64 " made of them for Foxglove\n",
               o->out, w.n_copied, w.n_added);
    if (!err && w.n_left_out)
        fprintf(stderr,
                "anlos bag export: %s: %" PRIu64
                " could not be made: the survey is missing, or a message does not hold\n",
                o->file, w.n_left_out);
    bag_copy_destroy(w.copy);
    setting_clear(&w.setting);
    free(w.views);
    return err;
}
