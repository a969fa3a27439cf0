/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/bag/stream.h"

#include <errno.h>
#include <stdlib.h>

#include "msgs/unpack.h"
#include "nodes/anlos/bag/bag.h"
#include "nodes/rt/stop.h"

struct stream {
    struct bag_catalog *catalog;
    struct bag_cursor *cursor;
    struct bag_source *sources; /* [n_channels]; topic NULL: not ours */
    uint64_t at;                /* log time of the newest message; 0: none was taken */
};

static int open_parts(struct stream *s, const char *path, struct error *why)
{
    int err = bag_catalog_open(&s->catalog, path, why);

    if (err)
        return err;
    s->sources = calloc(s->catalog->n_channels + 1, sizeof *s->sources);
    if (!s->sources || bag_cursor_create(&s->cursor, s->catalog))
        return error_say(why, -ENOMEM, "out of memory");
    for (size_t i = 0; i < s->catalog->n_channels; i++)
        if (bag_source_of(&s->sources[i], &s->catalog->channels[i].record.channel))
            s->sources[i].topic = NULL;
    return 0;
}

int stream_open(struct stream **out, const char *path, struct error *why)
{
    struct stream *s = calloc(1, sizeof *s);
    int err = s ? open_parts(s, path, why) : error_say(why, -ENOMEM, "out of memory");

    if (err)
        stream_close(s);
    else
        *out = s;
    return err;
}

int stream_require(const struct stream *s, const char *topics, struct error *why)
{
    char stray[64];

    return verb_finds_stray(topics, &s->catalog, 1, stray)
               ? error_say(why, -EINVAL,
                           "%s: no topic is called \"%s\"; 'anlos bag info' "
                           "has their names",
                           s->catalog->file.path, stray)
               : 0;
}

void stream_select(struct stream *s, const char *topics)
{
    for (size_t i = 0; i < s->catalog->n_channels; i++) {
        const struct bag_channel *h = &s->catalog->channels[i].record.channel;
        bag_cursor_select(s->cursor, h->id, verb_matches(topics, h->topic));
    }
}

const struct bag_catalog *stream_catalog(const struct stream *s)
{
    return s->catalog;
}

void stream_rewind(struct stream *s)
{
    bag_cursor_seek(s->cursor, 0);
    s->at = 0;
}

static int stopped(const struct stream *s, struct error *why)
{
    const struct bag_catalog *c = s->catalog;
    uint64_t taken_ns = s->at > c->start_time ? s->at - c->start_time : 0;

    return error_say(why, -EINTR, "%s: interrupted at %.1f of %.1f s", c->file.path,
                     1e-9 * (double)taken_ns,
                     1e-9 * (double)(c->end_time - c->start_time));
}

int stream_next(struct stream *s, struct stream_message *out, struct error *why)
{
    struct bag_message m;
    int err = interrupt_requested() ? stopped(s, why)
                                    : bag_cursor_next(s->cursor, &m, why);

    if (err)
        return err;
    s->at = m.log_time;
    *out =
        (struct stream_message){.channel = bag_catalog_channel(s->catalog, m.channel_id),
                                .payload = m.data,
                                .raw = m};
    if (!out->channel)
        return error_say(why, -EBADMSG,
                         "%s: a message of channel %u, which is not defined",
                         s->catalog->file.path, m.channel_id);
    const struct bag_source *source =
        &s->sources[s->catalog->channel_at[m.channel_id] - 1];
    out->topic = source->topic;
    if (out->topic)
        bag_source_envelope(source, &m, &out->envelope);
    else
        out->envelope = (struct envelope){.sequence = m.sequence,
                                          .capture_ns = (int64_t)m.publish_time,
                                          .publish_ns = (int64_t)m.log_time,
                                          .payload_size = (uint32_t)m.data.size};
    return 0;
}

int stream_unpack(ProtobufCMessage **out, const struct stream *s,
                  const struct stream_message *m, struct error *why)
{
    bool ours = m->topic && m->payload.size <= m->topic->max_size;

    *out = ours ? message_unpack(m->topic->schema, m->payload.size, m->payload.data)
                : NULL;
    if (*out)
        return 0;
    if (ours && errno == ENOMEM)
        return error_say(why, -ENOMEM, "out of memory");
    return error_say(why, -EBADMSG, "%s: a message of \"%.*s\" is none",
                     s->catalog->file.path, (int)m->channel->topic.size,
                     (const char *)m->channel->topic.data);
}

void stream_close(struct stream *s)
{
    if (!s)
        return;
    bag_cursor_destroy(s->cursor);
    bag_catalog_close(s->catalog);
    free(s->sources);
    free(s);
}
