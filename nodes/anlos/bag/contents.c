#include "nodes/anlos/bag/contents.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/reader.h"
#include "msgs/bag/topic_message.h"
#include "nodes/anlos/interrupt.h"

struct entry {
    uint16_t channel_id;
    uint64_t log_time, offset;
};

struct entries {        /* of a chunk */
    struct entry *list; /* [n] */
    size_t n, room;
    uint64_t left; /* bytes of indexes that may still be read: indexes that are named
                    * again and again would become endless */
};

static void add_name(struct topic_contents *t, const char *node)
{
    size_t used = strlen(t->from), n = strlen(node);

    for (const char *at = t->from; (at = strstr(at, node)); at++)
        if ((at == t->from || at[-1] == ' ') && (at[n] == ' ' || !at[n]))
            return;
    snprintf(t->from + used, sizeof t->from - used, "%s%s", used ? " " : "", node);
}

/* Rows by their name and type: slots of index + 1, 0: free.  There can be 65535 channels,
 * which are too many to compare each with each. */
enum { N_SLOTS = 1 << 17 };

static uint32_t hash_of(struct bytes name, struct bytes type)
{
    return bag_crc(bag_crc(0, name), type) % N_SLOTS;
}

/* The row of a name and type; it is added when there is none yet. */
static size_t find_row(struct contents *out, uint32_t *slots, struct bytes name,
                       struct bytes type)
{
    uint32_t at = hash_of(name, type);

    for (; slots[at]; at = (at + 1) % N_SLOTS) {
        const struct topic_contents *t = &out->topics[slots[at] - 1];
        if (bytes_equal(t->name, name) && bytes_equal(t->type, type))
            return slots[at] - 1;
    }
    out->topics[out->n++] = (struct topic_contents){.name = name, .type = type};
    slots[at] = (uint32_t)out->n;
    return out->n - 1;
}

/* Channels of one topic and type are one row. */
static int list_topics(struct contents *out, const struct bag_catalog *c)
{
    uint32_t *slots = calloc(N_SLOTS, sizeof *slots);

    out->topics = calloc(c->n_channels + 1, sizeof *out->topics);
    if (!out->topics || !slots) {
        free(slots);
        return -ENOMEM;
    }
    for (size_t i = 0; i < c->n_channels; i++) {
        const struct bag_channel *h = &c->channels[i].record.channel;
        const struct bag_schema *s = bag_catalog_schema(c, h->schema_id);
        struct bytes type = s ? s->name : (struct bytes){NULL, 0};
        struct bag_source source;
        size_t row = find_row(out, slots, h->topic, type);
        if (!bag_source_of(&source, h))
            add_name(&out->topics[row], source.node);
        out->topic_of[h->id] = (uint16_t)row;
    }
    free(slots);
    return 0;
}

static void count(struct contents *out, uint16_t channel_id, uint64_t log_time,
                  uint64_t n_bytes)
{
    struct topic_contents *t = &out->topics[out->topic_of[channel_id]];

    if (!t->n_messages || log_time < t->first_time)
        t->first_time = log_time;
    if (!t->n_messages || log_time > t->last_time)
        t->last_time = log_time;
    t->n_messages++;
    t->n_bytes += n_bytes;
}

static int add_entries(struct entries *e, const struct bag_message_index *index)
{
    struct bytes list = index->entries;
    size_t n = list.size / 16;

    if (e->n + n > e->room) {
        size_t room = 2 * (e->n + n);
        struct entry *grown = realloc(e->list, room * sizeof *grown);
        if (!grown)
            return -ENOMEM;
        e->list = grown;
        e->room = room;
    }
    for (; n; n--) {
        struct entry *to = &e->list[e->n++];
        to->channel_id = index->channel_id;
        bag_list_next(&list, 8, &to->log_time, &to->offset);
    }
    return 0;
}

static int compare_entries(const void *a, const void *b)
{
    const struct entry *x = a, *y = b;

    return x->offset < y->offset ? -1 : x->offset > y->offset;
}

/* A message reaches to the next one: definitions that stand between count with it. */
static void count_entries(struct contents *out, const struct bag_catalog *c,
                          struct entries *e, uint64_t end)
{
    if (e->n)
        qsort(e->list, e->n, sizeof *e->list, compare_entries);
    for (size_t i = 0; i < e->n; i++) {
        uint64_t next = i + 1 < e->n ? e->list[i + 1].offset : end;
        if (bag_catalog_channel(c, e->list[i].channel_id) && next >= e->list[i].offset)
            count(out, e->list[i].channel_id, e->list[i].log_time,
                  next - e->list[i].offset);
    }
    e->n = 0;
}

/* A chunk by its message indexes.  -EBADMSG: they are not there, or wrong. */
static int read_chunk(struct contents *out, const struct bag_catalog *c,
                      const struct bag_chunk_index *k, struct entries *e,
                      struct bytes_buffer *bytes)
{
    struct bytes list = k->message_index_offsets;
    uint64_t id, offset;
    int err = !list.size && (k->message_start_time || k->message_end_time) ? -EBADMSG : 0;

    while (!err && bag_list_next(&list, 2, &id, &offset)) {
        struct bag_record r;
        err = bag_file_record(&c->file, offset, bytes, NULL);
        if (err)
            break;
        if (bytes->size > e->left)
            return -EBADMSG;
        e->left -= bytes->size;
        struct bytes_cursor whole = {.left = bytes_in(bytes)};
        err = bag_record_take(&whole, &r);
        if (!err)
            err = r.opcode == BAG_MESSAGE_INDEX && r.message_index.channel_id == id
                      ? add_entries(e, &r.message_index)
                      : -EBADMSG;
    }
    if (!err)
        count_entries(out, c, e, k->uncompressed_size);
    return err;
}

static int read_indexes(struct contents *out, const struct bag_catalog *c)
{
    struct entries e = {.left = c->file.size};
    struct bytes_buffer bytes = {0};
    uint64_t n = 0;
    int err = c->scanned ? -EBADMSG : 0;

    for (size_t i = 0; i < c->n_chunks && !err; i++)
        err = read_chunk(out, c, &c->chunks[i].record.chunk_index, &e, &bytes);
    for (size_t i = 0; i < out->n; i++)
        n += out->topics[i].n_messages;
    if (!err && n != c->n_messages)
        err = -EBADMSG;
    free(e.list);
    bytes_free(&bytes);
    return err == -ENOTSUP || err == -EFBIG ? -EBADMSG : err;
}

static int read_all(struct contents *out, const struct bag_catalog *c, struct error *why)
{
    struct bag_reader *r;
    struct bag_record record;
    int err = bag_reader_open(&r, c->file.path, why);

    if (err)
        return err;
    while (!(err = bag_reader_next(r, &record, why))) {
        const struct bag_message *m = &record.message;
        if (interrupt_requested()) {
            err = -EINTR;
            break;
        }
        if (record.opcode == BAG_MESSAGE && bag_catalog_channel(c, m->channel_id))
            count(out, m->channel_id, m->log_time,
                  m->data.size + BAG_RECORD_HEAD_SIZE + 22);
    }
    bag_reader_close(r);
    return err == -ENODATA ? 0 : err;
}

int contents_read(struct contents *out, const struct bag_catalog *c, struct error *why)
{
    memset(out, 0, sizeof *out);
    int err = list_topics(out, c);
    if (!err)
        err = read_indexes(out, c);
    if (err == -EBADMSG) {
        contents_clear(out);
        err = list_topics(out, c);
        if (!err)
            err = read_all(out, c, why);
    }
    for (size_t i = 0; i < c->n_chunks; i++) {
        const struct bag_chunk_index *k = &c->chunks[i].record.chunk_index;
        out->packed_bytes += k->compressed_size;
        out->plain_bytes += k->uncompressed_size;
    }
    if (c->n_chunks)
        out->compression = c->chunks[0].record.chunk_index.compression;
    return err == -ENOMEM ? error_say(why, err, "%s: out of memory", c->file.path) : err;
}

void contents_clear(struct contents *c)
{
    free(c->topics);
    memset(c, 0, sizeof *c);
}

double topic_rate_hz(const struct topic_contents *t)
{
    return t->last_time > t->first_time
               ? (double)(t->n_messages - 1) /
                     (1e-9 * (double)(t->last_time - t->first_time))
               : 0.0;
}

double contents_duration_s(const struct bag_catalog *bag)
{
    return 1e-9 * (double)(bag->end_time - bag->start_time);
}

double contents_ratio(const struct contents *c)
{
    return c->packed_bytes ? (double)c->plain_bytes / (double)c->packed_bytes : 1.0;
}
