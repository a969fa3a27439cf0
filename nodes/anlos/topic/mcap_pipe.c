/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/topic/mcap_pipe.h"

#include <errno.h>
#include <stdlib.h>

#include "msgs/bag/schemas.h"

static int write_out(struct mcap_pipe *p)
{
    if (p->out.failed)
        return -ENOMEM;
    errno = 0;
    size_t written = fwrite(p->out.data, 1, p->out.size, p->f);
    if (written != p->out.size || fflush(p->f))
        return errno ? -errno : -EIO;
    p->out.size = 0;
    return 0;
}

int mcap_pipe_begin(struct mcap_pipe *p, FILE *f)
{
    const struct bytes magic = {(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE};
    const struct bag_record header = {.opcode = BAG_HEADER,
                                      .header = {.library = bytes_of("anlos")}};

    *p = (struct mcap_pipe){.f = f};
    bytes_put(&p->out, magic);
    bag_record_put(&p->out, &header);
    return write_out(p);
}

static uint16_t schema_id(const struct topic *t)
{
    return (uint16_t)(t - topics_all() + 1);
}

static void put_schema(struct mcap_pipe *p, const struct topic *t)
{
    struct bag_record r = {.opcode = BAG_SCHEMA, .schema = bag_schema_of(t)};

    for (size_t i = 0; i < p->n; i++)
        if (p->sources[i].topic == t)
            return;
    r.schema.id = schema_id(t);
    bag_record_put(&p->out, &r);
}

static int put_channel(struct mcap_pipe *p, const struct bag_source *s)
{
    struct bytes_buffer metadata = {0};

    if (p->n == UINT16_MAX)
        return -E2BIG;
    if (!(p->n & (p->n - 1))) { /* 0 and powers of two */
        void *grown = realloc(p->sources, (p->n ? 2 * p->n : 1) * sizeof *p->sources);
        if (!grown)
            return -ENOMEM;
        p->sources = grown;
    }
    put_schema(p, s->topic);
    p->sources[p->n++] = *s;
    bag_source_describe(s, &metadata);
    const struct bag_record r = {.opcode = BAG_CHANNEL,
                                 .channel = {.id = (uint16_t)p->n,
                                             .schema_id = schema_id(s->topic),
                                             .topic = bytes_of(s->topic->name),
                                             .message_encoding = bytes_of(BAG_PROTOBUF),
                                             .metadata = bytes_in(&metadata)}};
    bag_record_put(&p->out, &r);
    p->out.failed |= metadata.failed;
    bytes_free(&metadata);
    return 0;
}

int mcap_pipe_put(struct mcap_pipe *p, const struct bus_message *m)
{
    struct bag_record r = {.opcode = BAG_MESSAGE};
    struct bag_source source;
    size_t i = 0;

    bag_source_from(&source, &r.message, &m->envelope, m->payload);
    while (i < p->n && !bag_source_is_same(&p->sources[i], &source))
        i++;
    int err = i == p->n ? put_channel(p, &source) : 0;
    if (err)
        return err;
    r.message.channel_id = (uint16_t)(i + 1);
    bag_record_put(&p->out, &r);
    return write_out(p);
}

int mcap_pipe_end(struct mcap_pipe *p)
{
    const struct bytes magic = {(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE};
    const struct bag_record end = {.opcode = BAG_DATA_END},
                            footer = {.opcode = BAG_FOOTER};

    bag_record_put(&p->out, &end);
    bag_record_put(&p->out, &footer);
    bytes_put(&p->out, magic);
    return write_out(p);
}

void mcap_pipe_free(struct mcap_pipe *p)
{
    free(p->sources);
    bytes_free(&p->out);
}
