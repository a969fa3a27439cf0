/* SPDX-License-Identifier: MIT */
#include "msgs/bag/copy.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>

#include "dsp/list.h"

#define NONE 0 /* no id of the new bag */

struct source {
    const struct bag_catalog *catalog;
    uint16_t schema_id[1 << 16], channel_id[1 << 16]; /* in the new bag, by old id */
    uint16_t channel_schema[1 << 16]; /* what channel_id was defined with */
};

struct piece { /* what is in the new bag: a record, its id taken out */
    struct bytes_buffer bytes;
    uint16_t id;
};

struct pieces {
    struct piece *list; /* [n] */
    size_t n, room;
};

struct bag_copy {
    struct bag_writer *writer;
    struct source **sources; /* [n_sources] */
    size_t n_sources, room;
    struct pieces schemas, channels, rest;
};

int bag_copy_create(struct bag_copy **out, struct bag_writer *to)
{
    struct bag_copy *c = calloc(1, sizeof *c);

    if (!c)
        return -ENOMEM;
    c->writer = to;
    *out = c;
    return 0;
}

int bag_copy_add(struct bag_copy *c, const struct bag_catalog *from)
{
    if (list_grow(&c->sources, c->n_sources, &c->room, sizeof(struct source *)))
        return -ENOMEM;
    struct source *s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    s->catalog = from;
    c->sources[c->n_sources++] = s;
    return 0;
}

/* The piece with the bytes of the record; NULL: none is there yet. */
static const struct piece *find_piece(const struct pieces *p, struct bytes bytes)
{
    for (size_t i = 0; i < p->n; i++)
        if (bytes_equal(bytes_in(&p->list[i].bytes), bytes))
            return &p->list[i];
    return NULL;
}

/* Takes the bytes over, also when it fails. */
static int add_piece(struct pieces *p, struct bytes_buffer *bytes, uint16_t id)
{
    if (list_grow(&p->list, p->n, &p->room, sizeof *p->list)) {
        bytes_free(bytes);
        return -ENOMEM;
    }
    p->list[p->n++] = (struct piece){*bytes, id};
    return 0;
}

/* Writes a schema or channel unless an equal one is there.  r's id is NONE. */
static int define(struct bag_copy *c, struct pieces *p, const struct bag_record *r,
                  uint16_t *id, struct error *why)
{
    struct bytes_buffer bytes = {0};

    bag_record_put(&bytes, r);
    const struct piece *there = find_piece(p, bytes_in(&bytes));
    if (there || bytes.failed) {
        *id = there ? there->id : NONE;
        bytes_free(&bytes);
        return there ? 0 : error_say(why, -ENOMEM, "out of memory");
    }
    int err = r->opcode == BAG_SCHEMA
                  ? bag_writer_schema(c->writer, &r->schema, id, why)
                  : bag_writer_channel(c->writer, &r->channel, id, why);
    if (err) {
        bytes_free(&bytes);
        return err;
    }
    return add_piece(p, &bytes, *id) ? error_say(why, -ENOMEM, "out of memory") : 0;
}

int bag_copy_channel(struct bag_copy *c, size_t from, uint16_t old, uint16_t *id,
                     struct error *why)
{
    struct source *s = c->sources[from];
    const struct bag_channel *channel = bag_catalog_channel(s->catalog, old);
    struct bag_record r = {.opcode = BAG_SCHEMA};
    int err = 0;

    *id = s->channel_id[old];
    if (!channel || (*id && s->channel_schema[old] == s->schema_id[channel->schema_id]))
        return 0;
    const struct bag_schema *schema = bag_catalog_schema(s->catalog, channel->schema_id);
    if (schema && !s->schema_id[schema->id]) {
        r.schema = *schema;
        r.schema.id = NONE;
        err = define(c, &c->schemas, &r, &s->schema_id[schema->id], why);
    }
    if (err)
        return err;
    r = (struct bag_record){.opcode = BAG_CHANNEL};
    r.channel = *channel;
    r.channel.id = NONE;
    r.channel.schema_id = schema ? s->schema_id[schema->id] : NONE;
    err = define(c, &c->channels, &r, &s->channel_id[old], why);
    s->channel_schema[old] = r.channel.schema_id;
    *id = s->channel_id[old];
    return err;
}

void bag_copy_redefined(struct bag_copy *c, size_t from, const struct bag_record *r)
{
    if (r->opcode == BAG_SCHEMA)
        c->sources[from]->schema_id[r->schema.id] = NONE;
    else
        c->sources[from]->channel_id[r->channel.id] = NONE;
}

int bag_copy_message(struct bag_copy *c, size_t from, const struct bag_message *m,
                     struct error *why)
{
    struct bag_message copy = *m;
    int err = bag_copy_channel(c, from, m->channel_id, &copy.channel_id, why);

    if (!err && copy.channel_id == NONE)
        err = error_say(why, -EBADMSG,
                        "%s: a message of channel %u, which is not defined",
                        c->sources[from]->catalog->file.path, m->channel_id);
    return err ? err : bag_writer_message(c->writer, &copy, why);
}

/* An attachment or metadata, by its index. */
static int copy_one(struct bag_copy *c, const struct bag_catalog *from,
                    const struct bag_record *index, struct bytes_buffer *scratch,
                    struct error *why)
{
    struct bytes_buffer bytes = {0};
    struct bag_record r;
    int err = bag_catalog_read(from, index, scratch, &r, why);

    if (err)
        return err;
    bag_record_put(&bytes, &r);
    if (bytes.failed || find_piece(&c->rest, bytes_in(&bytes))) {
        err = bytes.failed ? error_say(why, -ENOMEM, "out of memory") : 0;
        bytes_free(&bytes);
        return err;
    }
    err = r.opcode == BAG_ATTACHMENT
              ? bag_writer_attachment(c->writer, &r.attachment, why)
              : bag_writer_metadata(c->writer, &r.metadata, why);
    if (err) {
        bytes_free(&bytes);
        return err;
    }
    return add_piece(&c->rest, &bytes, NONE) ? error_say(why, -ENOMEM, "out of memory")
                                             : 0;
}

int bag_copy_rest(struct bag_copy *c, size_t from, struct error *why)
{
    const struct bag_catalog *f = c->sources[from]->catalog;
    struct bytes_buffer scratch = {0};
    int err = 0;

    for (size_t i = 0; i < f->n_attachments && !err; i++)
        err = copy_one(c, f, &f->attachments[i].record, &scratch, why);
    for (size_t i = 0; i < f->n_metadata && !err; i++)
        err = copy_one(c, f, &f->metadata[i].record, &scratch, why);
    bytes_free(&scratch);
    return err;
}

static void free_pieces(struct pieces *p)
{
    for (size_t i = 0; i < p->n; i++)
        bytes_free(&p->list[i].bytes);
    free(p->list);
}

void bag_copy_destroy(struct bag_copy *c)
{
    if (!c)
        return;
    for (size_t i = 0; i < c->n_sources; i++)
        free(c->sources[i]);
    free(c->sources);
    free_pieces(&c->schemas);
    free_pieces(&c->channels);
    free_pieces(&c->rest);
    free(c);
}
