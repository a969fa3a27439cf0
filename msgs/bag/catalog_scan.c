#include <errno.h>
#include <inttypes.h>

#include "msgs/bag/catalog_build.h"

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

static int scan_chunk(struct scan *s, uint64_t offset, const struct bag_chunk *k,
                      struct complaint *why)
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
            return complain(why, err, "%s: byte %" PRIu64 ": a damaged chunk",
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
                       struct complaint *why)
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

int bag_catalog_scan(struct bag_catalog *c, struct complaint *why)
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
            complain(why, err, "%s: byte %" PRIu64 ": a damaged record", c->file.path,
                     offset);
        else if (err == -ENOTSUP)
            err = 0;
        offset += s.bytes.size;
    }
    bytes_free(&s.bytes);
    bytes_free(&s.plain);
    return err;
}
