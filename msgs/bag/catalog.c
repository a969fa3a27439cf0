/* SPDX-License-Identifier: MIT */
#include "msgs/bag/catalog.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"

struct span {
    uint64_t offset, length;
};

static int compare_spans(const void *a, const void *b)
{
    const struct span *x = a, *y = b;

    return x->offset < y->offset ? -1 : x->offset > y->offset;
}

static size_t list_spans(const struct bag_catalog *c, struct span *out)
{
    size_t n = 0;

    for (size_t i = 0; i < c->n_blocks; i++)
        out[n++] = (struct span){c->blocks[i].offset, c->blocks[i].length};
    for (size_t i = 0; i < c->n_attachments; i++) {
        const struct bag_attachment_index *a = &c->attachments[i].record.attachment_index;
        out[n++] = (struct span){a->offset, a->length};
    }
    for (size_t i = 0; i < c->n_metadata; i++) {
        const struct bag_metadata_index *m = &c->metadata[i].record.metadata_index;
        out[n++] = (struct span){m->offset, m->length};
    }
    qsort(out, n, sizeof *out, compare_spans);
    return n;
}

/* Do any two things that the catalog names share bytes?  0, -EBADMSG, -ENOMEM. */
static int bag_catalog_check_spans(const struct bag_catalog *c, struct error *why)
{
    size_t room = c->n_blocks + c->n_attachments + c->n_metadata;
    struct span *spans = malloc((room + 1) * sizeof *spans);
    uint64_t end = BAG_MAGIC_SIZE;
    int err = 0;

    if (!spans)
        return -ENOMEM;
    size_t n = list_spans(c, spans);
    for (size_t i = 0; i < n && !err; i++) {
        const struct span *s = &spans[i];
        if (s->offset < end || s->offset > c->file.size ||
            s->length > c->file.size - s->offset)
            err = error_say(why, -EBADMSG,
                            "%s: byte %" PRIu64 ": the indexes name two things that "
                            "overlap, or one that reaches beyond the file",
                            c->file.path, s->offset);
        end = s->offset + s->length;
    }
    free(spans);
    return err;
}

struct scan {
    struct bag_catalog *catalog;
    struct bytes_buffer bytes, plain; /* of a record, of a chunk */
    uint64_t allowance;               /* bytes that chunks may still hold */
};

void bag_catalog_count(struct bag_catalog *c, const struct bag_message *m)
{
    if (!c->n_messages || m->log_time < c->start_time)
        c->start_time = m->log_time;
    if (!c->n_messages || m->log_time > c->end_time)
        c->end_time = m->log_time;
    c->n_messages++;
    c->counts[m->channel_id]++;
}

/* The chunk's own times are not relied on: whoever wrote no summary may not have known
 * them. */
static void widen(struct bag_block *block, uint64_t log_time, bool first)
{
    if (first || log_time < block->start_time)
        block->start_time = log_time;
    if (first || log_time > block->end_time)
        block->end_time = log_time;
}

/* 0, -ENOMEM. */
static int bag_catalog_add_block(struct bag_catalog *c, const struct bag_block *block)
{
    if (list_grow(&c->blocks, c->n_blocks, &c->blocks_room, sizeof *c->blocks))
        return -ENOMEM;
    c->blocks[c->n_blocks++] = *block;
    return 0;
}

static int scan_chunk(struct scan *s, uint64_t offset, const struct bag_chunk *k,
                      struct error *why)
{
    struct bag_catalog *c = s->catalog;
    struct bag_record r;
    struct bag_block block = {.offset = offset, .length = s->bytes.size};
    uint64_t before = c->n_messages;
    int err = bag_file_chunk(&c->file, offset, k, &s->allowance, &s->plain, why);
    struct bytes_cursor left = {.left = bytes_in(&s->plain)};

    while (!err && left.left.size) {
        err = bag_record_take(&left, &r);
        if (err == -EBADMSG)
            return error_say(why, err, "%s: byte %" PRIu64 ": a damaged chunk",
                             c->file.path, offset);
        if (!err && r.opcode == BAG_MESSAGE) {
            widen(&block, r.message.log_time, c->n_messages == before);
            bag_catalog_count(c, &r.message);
        } else if (!err && (r.opcode == BAG_SCHEMA || r.opcode == BAG_CHANNEL)) {
            err = bag_catalog_define(c, &r);
        }
        if (err == -ENOTSUP)
            err = 0;
    }
    return err || c->n_messages == before ? err : bag_catalog_add_block(c, &block);
}

int bag_catalog_add_attachment(struct bag_catalog *c, uint64_t offset, uint64_t length,
                               const struct bag_attachment *a)
{
    struct bag_record index = {.opcode = BAG_ATTACHMENT_INDEX};

    index.attachment_index = (struct bag_attachment_index){
        .offset = offset,
        .length = length,
        .log_time = a->log_time,
        .create_time = a->create_time,
        .data_size = a->data.size,
        .name = a->name,
        .media_type = a->media_type,
    };
    return bag_catalog_keep(&c->attachments, &c->n_attachments, &index);
}

int bag_catalog_add_metadata(struct bag_catalog *c, uint64_t offset, uint64_t length,
                             const struct bag_metadata *m)
{
    struct bag_record index = {.opcode = BAG_METADATA_INDEX};

    index.metadata_index =
        (struct bag_metadata_index){.offset = offset, .length = length, .name = m->name};
    return bag_catalog_keep(&c->metadata, &c->n_metadata, &index);
}

static int scan_record(struct scan *s, uint64_t offset, const struct bag_record *r,
                       struct error *why)
{
    struct bag_catalog *c = s->catalog;
    struct bag_block block = {.offset = offset, .length = s->bytes.size};

    switch (r->opcode) {
    case BAG_SCHEMA:
    case BAG_CHANNEL:
        return bag_catalog_define(c, r);
    case BAG_CHUNK:
        return scan_chunk(s, offset, &r->chunk, why);
    case BAG_MESSAGE:
        bag_catalog_count(c, &r->message);
        widen(&block, r->message.log_time, true);
        return bag_catalog_add_block(c, &block);
    case BAG_ATTACHMENT:
        return bag_catalog_add_attachment(c, offset, s->bytes.size, &r->attachment);
    case BAG_METADATA:
        return bag_catalog_add_metadata(c, offset, s->bytes.size, &r->metadata);
    default:
        return 0;
    }
}

/* Fills a catalog that knows its file alone from every record there is.  Errors as
 * bag_catalog_open. */
static int bag_catalog_scan(struct bag_catalog *c, struct error *why)
{
    struct scan s = {.catalog = c, .allowance = bag_file_allowance(&c->file)};
    struct bag_record r = {.opcode = 0};
    uint64_t offset = BAG_MAGIC_SIZE;
    int err = 0;

    while (!err && r.opcode != BAG_DATA_END) {
        err = bag_file_record(&c->file, offset, &s.bytes, why);
        if (err)
            break;
        struct bytes_cursor whole = {.left = bytes_in(&s.bytes)};
        err = bag_record_take(&whole, &r);
        if (!err)
            err = scan_record(&s, offset, &r, why);
        else if (err == -EBADMSG)
            error_say(why, err, "%s: byte %" PRIu64 ": a damaged record", c->file.path,
                      offset);
        else if (err == -ENOTSUP)
            err = 0;
        offset += s.bytes.size;
    }
    bytes_free(&s.bytes);
    bytes_free(&s.plain);
    return err;
}

#define FOOTER_SIZE (BAG_RECORD_HEAD_SIZE + 20)

static struct bytes content_of(const struct bytes_buffer *record)
{
    return (struct bytes){record->data + BAG_RECORD_HEAD_SIZE,
                          record->size - BAG_RECORD_HEAD_SIZE};
}

int bag_catalog_keep(struct bag_kept **list, size_t *n, const struct bag_record *r)
{
    if (!(*n & (*n - 1))) { /* 0 and powers of two */
        struct bag_kept *grown = realloc(*list, (*n ? 2 * *n : 1) * sizeof *grown);
        if (!grown)
            return -ENOMEM;
        *list = grown;
    }
    struct bag_kept *k = &(*list)[(*n)++];
    *k = (struct bag_kept){.copy = {0}};
    bag_record_put(&k->copy, r);
    return k->copy.failed ? -ENOMEM
                          : bag_record_parse(&k->record, r->opcode, content_of(&k->copy));
}

int bag_catalog_define(struct bag_catalog *c, const struct bag_record *r)
{
    bool schema = r->opcode == BAG_SCHEMA;
    uint32_t *at = schema ? &c->schema_at[r->schema.id] : &c->channel_at[r->channel.id];

    if (*at)
        return 0;
    int err = schema ? bag_catalog_keep(&c->schemas, &c->n_schemas, r)
                     : bag_catalog_keep(&c->channels, &c->n_channels, r);
    *at = (uint32_t)(schema ? c->n_schemas : c->n_channels);
    return err;
}

int bag_catalog_redefine(struct bag_catalog *c, const struct bag_record *r)
{
    bool schema = r->opcode == BAG_SCHEMA;
    uint32_t at = schema ? c->schema_at[r->schema.id] : c->channel_at[r->channel.id];
    struct bytes_buffer bytes = {0};

    if (!at)
        return bag_catalog_define(c, r);
    struct bag_kept *k = schema ? &c->schemas[at - 1] : &c->channels[at - 1];
    bag_record_put(&bytes, r);
    if (bytes.failed || bytes_equal(bytes_in(&bytes), bytes_in(&k->copy))) {
        int err = bytes.failed ? -ENOMEM : 0;
        bytes_free(&bytes);
        return err;
    }
    bytes_free(&k->copy);
    k->copy = bytes;
    bag_record_parse(&k->record, r->opcode, content_of(&k->copy));
    return 1;
}

static void take_statistics(struct bag_catalog *c, const struct bag_statistics *s)
{
    struct bytes list = s->channel_message_counts;
    uint64_t id, count;

    c->n_messages = s->message_count;
    c->start_time = s->message_start_time;
    c->end_time = s->message_end_time;
    while (bag_list_next(&list, 2, &id, &count))
        c->counts[id] = count;
}

static int take(struct bag_catalog *c, const struct bag_record *r)
{
    switch (r->opcode) {
    case BAG_SCHEMA:
    case BAG_CHANNEL:
        return bag_catalog_define(c, r);
    case BAG_STATISTICS:
        take_statistics(c, &r->statistics);
        return 0;
    case BAG_CHUNK_INDEX:
        return bag_catalog_keep(&c->chunks, &c->n_chunks, r);
    case BAG_ATTACHMENT_INDEX:
        return bag_catalog_keep(&c->attachments, &c->n_attachments, r);
    case BAG_METADATA_INDEX:
        return bag_catalog_keep(&c->metadata, &c->n_metadata, r);
    default:
        return 0;
    }
}

/* Does the summary say where everything is? */
static bool is_complete(const struct bag_catalog *c, const struct bag_statistics *s)
{
    return c->n_schemas == s->schema_count && c->n_channels == s->channel_count &&
           c->n_chunks == s->chunk_count && c->n_attachments == s->attachment_count &&
           c->n_metadata == s->metadata_count && (s->chunk_count || !s->message_count);
}

static int add_blocks(struct bag_catalog *c)
{
    int err = 0;

    for (size_t i = 0; i < c->n_chunks && !err; i++) {
        const struct bag_chunk_index *k = &c->chunks[i].record.chunk_index;
        const struct bag_block block = {.offset = k->chunk_start_offset,
                                        .length = k->chunk_length,
                                        .start_time = k->message_start_time,
                                        .end_time = k->message_end_time,
                                        .channels = k->message_index_offsets};
        err = bag_catalog_add_block(c, &block);
    }
    return err;
}

/* -EBADMSG: the summary is missing, damaged or says too little. */
static int walk_summary(struct bag_catalog *c, struct bytes section)
{
    struct bytes_cursor left = {.left = section};
    struct bag_record r;
    struct bag_statistics statistics = {.message_count = 0};
    bool has_statistics = false;

    while (left.left.size) {
        int err = bag_record_take(&left, &r);
        if (!err)
            err = take(c, &r);
        if (err && err != -ENOTSUP)
            return err;
        if (!err && r.opcode == BAG_STATISTICS) {
            statistics = r.statistics;
            has_statistics = true;
        }
    }
    return has_statistics && is_complete(c, &statistics) ? add_blocks(c) : -EBADMSG;
}

static int read_summary(struct bag_catalog *c, struct bytes_buffer *bytes)
{
    struct bag_record footer;
    uint64_t tail = FOOTER_SIZE + BAG_MAGIC_SIZE, start;
    int err = c->file.size < tail
                  ? -EBADMSG
                  : bag_file_read(&c->file, c->file.size - tail, tail, bytes, NULL);
    if (err)
        return err;
    if (bytes->data[0] != BAG_FOOTER ||
        memcmp(bytes->data + FOOTER_SIZE, BAG_MAGIC, BAG_MAGIC_SIZE) ||
        bag_record_parse(&footer, BAG_FOOTER,
                         (struct bytes){bytes->data + BAG_RECORD_HEAD_SIZE, 20}))
        return -EBADMSG;
    start = footer.footer.summary_start;
    if (!start || start > c->file.size - tail)
        return -EBADMSG;
    err = bag_file_read(&c->file, start, c->file.size - BAG_MAGIC_SIZE - start, bytes,
                        NULL);
    if (err)
        return err;
    if (footer.footer.summary_crc &&
        bag_crc(0, (struct bytes){bytes->data, bytes->size - 4}) !=
            footer.footer.summary_crc)
        return -EBADMSG;
    return walk_summary(c, bytes_in(bytes));
}

static int read_header(struct bag_catalog *c, struct bytes_buffer *bytes,
                       struct error *why)
{
    struct bag_record r;
    size_t n = 0;
    struct bag_kept *kept = NULL;
    int err = bag_file_record(&c->file, BAG_MAGIC_SIZE, bytes, why);

    if (err)
        return err;
    if (bytes->data[0] != BAG_HEADER ||
        bag_record_parse(&r, BAG_HEADER, content_of(bytes)))
        return error_say(why, -EBADMSG, "%s: the first record is no header",
                         c->file.path);
    err = bag_catalog_keep(&kept, &n, &r);
    if (kept)
        c->header = *kept;
    free(kept);
    return err;
}

static void free_list(struct bag_kept *list, size_t n)
{
    for (size_t i = 0; i < n; i++)
        bytes_free(&list[i].copy);
    free(list);
}

/* Forgets all but the file and the header. */
static void forget(struct bag_catalog *c)
{
    struct bag_file file = c->file;
    struct bag_kept header = c->header;

    free_list(c->schemas, c->n_schemas);
    free_list(c->channels, c->n_channels);
    free_list(c->attachments, c->n_attachments);
    free_list(c->metadata, c->n_metadata);
    free_list(c->chunks, c->n_chunks);
    free(c->blocks);
    memset(c, 0, sizeof *c);
    c->file = file;
    c->header = header;
}

static int compare_blocks(const void *a, const void *b)
{
    const struct bag_block *x = a, *y = b;

    if (x->start_time != y->start_time)
        return x->start_time < y->start_time ? -1 : 1;
    return x->offset < y->offset ? -1 : x->offset > y->offset;
}

static int fill(struct bag_catalog *c, const char *path, struct error *why)
{
    struct bytes_buffer bytes = {0};
    int err = bag_file_open(&c->file, path, why);

    if (!err)
        err = read_header(c, &bytes, why);
    if (!err) {
        err = read_summary(c, &bytes);
        if (err == -EBADMSG || err == -EFBIG) {
            forget(c);
            c->scanned = true;
            err = bag_catalog_scan(c, why);
        } else if (err) {
            error_say(why, err, "%s: %s", path, strerror(-err));
        }
    }
    bytes_free(&bytes);
    if (!err)
        err = bag_catalog_check_spans(c, why);
    if (!err && c->n_blocks)
        qsort(c->blocks, c->n_blocks, sizeof *c->blocks, compare_blocks);
    return err == -ENOMEM ? error_say(why, err, "%s: out of memory", path) : err;
}

int bag_catalog_open(struct bag_catalog **out, const char *path, struct error *why)
{
    struct bag_catalog *c = calloc(1, sizeof *c);
    if (!c)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    c->file.fd = -1;
    int err = fill(c, path, why);
    if (err)
        bag_catalog_close(c);
    else
        *out = c;
    return err;
}

const struct bag_channel *bag_catalog_channel(const struct bag_catalog *c, uint16_t id)
{
    return c->channel_at[id] ? &c->channels[c->channel_at[id] - 1].record.channel : NULL;
}

const struct bag_schema *bag_catalog_schema(const struct bag_catalog *c, uint16_t id)
{
    return c->schema_at[id] ? &c->schemas[c->schema_at[id] - 1].record.schema : NULL;
}

int bag_catalog_read(const struct bag_catalog *c, const struct bag_record *index,
                     struct bytes_buffer *into, struct bag_record *out, struct error *why)
{
    bool attachment = index->opcode == BAG_ATTACHMENT_INDEX;
    uint64_t offset = attachment ? index->attachment_index.offset
                                 : index->metadata_index.offset;
    uint8_t opcode = attachment ? BAG_ATTACHMENT : BAG_METADATA;
    int err = bag_file_record(&c->file, offset, into, why);

    if (err)
        return err;
    if (into->data[0] != opcode || bag_record_parse(out, opcode, content_of(into)))
        return error_say(why, -EBADMSG,
                         "%s: byte %" PRIu64 ": no %s, as the index has it", c->file.path,
                         offset, bag_opcode_name(opcode));
    return attachment ? bag_file_attachment(&c->file, offset, &out->attachment, why) : 0;
}

void bag_catalog_close(struct bag_catalog *c)
{
    if (!c)
        return;
    forget(c);
    bytes_free(&c->header.copy);
    bag_file_close(&c->file);
    free(c);
}
