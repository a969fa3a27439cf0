/* SPDX-License-Identifier: MIT */
#include "msgs/bag/check.h"

#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "msgs/bag/catalog.h"
#include "msgs/bag/compression.h"
#include "msgs/bag/record.h"

/* What the parts of the check share. */

struct check_entry { /* a message of the chunk that came last */
    uint16_t channel_id;
    uint64_t log_time, offset;
};

struct check_chunk { /* the one that came last, and the message indexes after it */
    bool there;
    bool unread;                       /* damaged: nothing is known of its messages */
    uint64_t offset, end, indexes_end; /* in the file: it, its message indexes */
    struct bag_record index;           /* the chunk index that it should have */
    struct check_entry *entries;       /* [n] by channel, then offset */
    size_t n, room;
    size_t n_indexes, n_indexed; /* message indexes, and messages in them */
    struct bytes_buffer offsets; /* of its index */
};

struct check_group { /* records of one kind in the summary */
    uint64_t start, length;
};

struct bag_check {
    struct bag_catalog *found; /* what is really there, with the indexes it should have */
    const struct bag_check_watch *watch;
    uint64_t n_faults;
    enum bag_section section;
    uint64_t offset, next; /* of the record that came last, of the one to come */
    uint32_t crc;          /* of the section up to next */
    uint64_t allowance;    /* bytes that chunks may still hold */
    struct bytes_buffer bytes, plain;
    struct check_chunk chunk;
    uint32_t n_chunks; /* with the one that came last */
    /* of the summary */
    uint64_t summary_start;
    struct check_group groups[16]; /* by opcode */
    struct bag_kept *offsets;      /* summary offset records */
    size_t n_offsets;
    struct bag_kept statistics;
    bool *seen[3]; /* [found->n_..] of chunks, attachments, metadata: has an index */
    size_t n_seen[3];
};

static int compare_entries(const void *a, const void *b)
{
    const struct check_entry *x = a, *y = b;

    if (x->channel_id != y->channel_id)
        return x->channel_id < y->channel_id ? -1 : 1;
    return x->offset < y->offset ? -1 : x->offset > y->offset;
}

static int add_entry(struct check_chunk *k, const struct bag_message *m, uint64_t offset)
{
    if (list_grow(&k->entries, k->n, &k->room, sizeof *k->entries))
        return -ENOMEM;
    k->entries[k->n++] = (struct check_entry){m->channel_id, m->log_time, offset};
    return 0;
}

static void check_fault(struct bag_check *c, const char *format, ...);

static int check_definition(struct bag_check *c, const struct bag_record *r);

static void check_message(struct bag_check *c, const struct bag_message *m);

static int take_record(struct bag_check *c, const struct bag_chunk *k,
                       const struct bag_record *r, uint64_t offset)
{
    if (!bag_chunk_allows(r->opcode)) {
        check_fault(c, "the chunk holds a %s", bag_opcode_name(r->opcode));
        return 0;
    }
    if (r->opcode != BAG_MESSAGE)
        return check_definition(c, r);
    if (r->message.log_time < k->message_start_time ||
        r->message.log_time > k->message_end_time)
        check_fault(c, "a message of the chunk lies outside of the chunk's times");
    check_message(c, &r->message);
    return add_entry(&c->chunk, &r->message, offset);
}

static int take_records(struct bag_check *c, const struct bag_chunk *k)
{
    struct bytes_cursor left = {.left = bytes_in(&c->plain)};
    struct bag_record r;

    while (left.left.size) {
        uint64_t offset = c->plain.size - left.left.size;
        int err = bag_record_take(&left, &r);
        if (err == -EBADMSG) {
            check_fault(c, "byte %" PRIu64 " of the chunk: a record does not fit",
                        offset);
            return 0;
        }
        if (!err)
            err = take_record(c, k, &r, offset);
        if (err && err != -ENOTSUP)
            return err;
    }
    return 0;
}

/* A chunk with its records in c->plain; a message index; the end of those.  0, -ENOMEM.
 */
static int check_chunk_begin(struct bag_check *c, const struct bag_chunk *k)
{
    struct check_chunk *chunk = &c->chunk;
    struct bag_record index = {.opcode = BAG_CHUNK_INDEX};

    chunk->there = true;
    chunk->offset = c->offset;
    chunk->end = chunk->indexes_end = c->next;
    chunk->n = chunk->n_indexes = chunk->n_indexed = 0;
    chunk->offsets.size = 0;
    c->n_chunks++;
    index.chunk_index = (struct bag_chunk_index){
        .message_start_time = k->message_start_time,
        .message_end_time = k->message_end_time,
        .chunk_start_offset = c->offset,
        .chunk_length = c->next - c->offset,
        .compressed_size = k->records.size,
        .uncompressed_size = k->uncompressed_size,
    };
    /* The name outlives the chunk: it is one of those that can be read. */
    enum bag_compression compression;
    if (!bag_compression_find(&compression, k->compression))
        index.chunk_index.compression = bytes_of(bag_compression_name(compression));
    chunk->index = index;
    int err = take_records(c, k);
    if (chunk->n)
        qsort(chunk->entries, chunk->n, sizeof *chunk->entries, compare_entries);
    else if (!err && !chunk->unread && (k->message_start_time || k->message_end_time))
        check_fault(c, "the chunk has times, but no messages");
    return err;
}

/* The first entry of that channel or a later one. */
static size_t find_first(const struct check_chunk *k, uint32_t id)
{
    size_t low = 0, high = k->n;

    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (k->entries[middle].channel_id < id)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static int compare_pairs(const void *a, const void *b)
{
    const uint64_t *x = a, *y = b;

    return x[1] < y[1] ? -1 : x[1] > y[1];
}

/* Are the index's pairs the entries, in any order?  0, -ENOMEM. */
static int compare_index(const struct check_entry *entries, size_t n, struct bytes list,
                         bool *same)
{
    *same = list.size == 16 * n;
    if (!*same || !n)
        return 0;
    uint64_t(*pairs)[2] = malloc(n * sizeof *pairs);
    if (!pairs)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++)
        bag_list_next(&list, 8, &pairs[i][0], &pairs[i][1]);
    qsort(pairs, n, sizeof *pairs, compare_pairs);
    for (size_t i = 0; *same && i < n; i++)
        *same = pairs[i][0] == entries[i].log_time && pairs[i][1] == entries[i].offset;
    free(pairs);
    return 0;
}

static int check_message_index(struct bag_check *c, const struct bag_message_index *m)
{
    struct check_chunk *k = &c->chunk;
    bool same;

    if (!k->there) {
        check_fault(c, "a message index that follows no chunk");
        return 0;
    }
    size_t first = find_first(k, m->channel_id);
    size_t n = find_first(k, m->channel_id + 1u) - first;
    int err = compare_index(n ? k->entries + first : NULL, n, m->entries, &same);
    if (!err && !same && !k->unread)
        check_fault(c,
                    "the index of channel %u does not match its %zu messages in the "
                    "chunk at byte %" PRIu64,
                    m->channel_id, n, k->offset);
    k->indexes_end = c->next;
    k->n_indexes++;
    k->n_indexed += n;
    bytes_put_number(&k->offsets, m->channel_id, 2);
    bytes_put_number(&k->offsets, c->offset, 8);
    return err;
}

static void check_fault_at(struct bag_check *c, uint64_t offset, const char *what)
{
    c->n_faults++;
    if (c->watch && c->watch->fault)
        c->watch->fault(c->watch->context, offset, what);
}

static int check_chunk_end(struct bag_check *c)
{
    struct check_chunk *k = &c->chunk;

    if (!k->there)
        return 0;
    k->there = false;
    if (k->n_indexes && k->n_indexed != k->n)
        check_fault_at(c, k->offset, "the chunk's message indexes leave messages out");
    k->index.chunk_index.message_index_offsets = bytes_in(&k->offsets);
    k->index.chunk_index.message_index_length = k->indexes_end - k->end;
    return k->offsets.failed
               ? -ENOMEM
               : bag_catalog_keep(&c->found->chunks, &c->found->n_chunks, &k->index);
}

enum { CHUNKS, ATTACHMENTS, METADATA, KINDS };

static int kind_of(uint8_t opcode)
{
    return opcode == BAG_CHUNK_INDEX        ? CHUNKS
           : opcode == BAG_ATTACHMENT_INDEX ? ATTACHMENTS
                                            : METADATA;
}

static const struct bag_kept *list_of(const struct bag_check *c, int kind, size_t *n)
{
    const struct bag_catalog *f = c->found;

    *n = kind == CHUNKS        ? f->n_chunks
         : kind == ATTACHMENTS ? f->n_attachments
                               : f->n_metadata;
    return kind == CHUNKS        ? f->chunks
           : kind == ATTACHMENTS ? f->attachments
                                 : f->metadata;
}

static uint64_t offset_of(const struct bag_record *index)
{
    return index->opcode == BAG_CHUNK_INDEX        ? index->chunk_index.chunk_start_offset
           : index->opcode == BAG_ATTACHMENT_INDEX ? index->attachment_index.offset
                                                   : index->metadata_index.offset;
}

/* The index that should be there; *n is past the list: nothing stands at its offset. */
static size_t find_expected(const struct bag_kept *list, size_t n, uint64_t offset)
{
    size_t low = 0, high = n;

    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (offset_of(&list[middle].record) < offset)
            low = middle + 1;
        else
            high = middle;
    }
    return low < n && offset_of(&list[low].record) == offset ? low : n;
}

static int check_summary_compare_pairs(const void *a, const void *b)
{
    return memcmp(a, b, 10);
}

/* The pairs of a chunk index stand in any order. */
static int put_sorted(struct bytes_buffer *out, const struct bag_record *r)
{
    struct bag_record copy = *r;
    struct bytes_buffer pairs = {0};

    if (r->opcode == BAG_CHUNK_INDEX) {
        bytes_put(&pairs, r->chunk_index.message_index_offsets);
        if (pairs.size)
            qsort(pairs.data, pairs.size / 10, 10, check_summary_compare_pairs);
        copy.chunk_index.message_index_offsets = bytes_in(&pairs);
    }
    bag_record_put(out, &copy);
    out->failed |= pairs.failed;
    bytes_free(&pairs);
    return out->failed ? -ENOMEM : 0;
}

static int is_equal(const struct bag_record *a, const struct bag_record *b, bool *equal)
{
    struct bytes_buffer x = {0}, y = {0};
    int err = put_sorted(&x, a);

    if (!err)
        err = put_sorted(&y, b);
    *equal = !err && bytes_equal(bytes_in(&x), bytes_in(&y));
    bytes_free(&x);
    bytes_free(&y);
    return err;
}

static int check_index(struct bag_check *c, const struct bag_record *r)
{
    size_t n;
    int kind = kind_of(r->opcode);
    const struct bag_kept *list = list_of(c, kind, &n);
    size_t at = find_expected(list, n, offset_of(r));
    bool equal;

    if (at == n) {
        check_fault(c, "the %s names byte %" PRIu64 ", where there is no such thing",
                    bag_opcode_name(r->opcode), offset_of(r));
        return 0;
    }
    if (!c->seen[kind])
        c->seen[kind] = calloc(n, sizeof *c->seen[kind]);
    if (!c->seen[kind])
        return -ENOMEM;
    if (c->seen[kind][at])
        check_fault(c, "a second %s of what stands at byte %" PRIu64,
                    bag_opcode_name(r->opcode), offset_of(r));
    c->n_seen[kind] += !c->seen[kind][at];
    c->seen[kind][at] = true;
    int err = is_equal(&list[at].record, r, &equal);
    if (!err && !equal)
        check_fault(c, "the %s does not match what stands at byte %" PRIu64,
                    bag_opcode_name(r->opcode), offset_of(r));
    return err;
}

static int keep_statistics(struct bag_check *c, const struct bag_record *r)
{
    struct bag_kept *kept = NULL;
    size_t n = 0;

    if (c->statistics.copy.size) {
        check_fault(c, "there are statistics already");
        return 0;
    }
    int err = bag_catalog_keep(&kept, &n, r);
    if (kept)
        c->statistics = *kept;
    free(kept);
    return err;
}

/* A record of the summary; all of them at the footer.  0, -ENOMEM. */
static int check_summary_record(struct bag_check *c, const struct bag_record *r)
{
    struct check_group *g = &c->groups[r->opcode];

    if (g->length && g->start + g->length != c->offset)
        check_fault(c, "the summary's %s records do not stand together",
                    bag_opcode_name(r->opcode));
    if (!g->length)
        g->start = c->offset;
    g->length += c->next - c->offset;
    switch (r->opcode) {
    case BAG_SCHEMA:
    case BAG_CHANNEL:
        return check_definition(c, r);
    case BAG_STATISTICS:
        return keep_statistics(c, r);
    case BAG_SUMMARY_OFFSET:
        return bag_catalog_keep(&c->offsets, &c->n_offsets, r);
    case BAG_CHUNK_INDEX:
    case BAG_ATTACHMENT_INDEX:
    case BAG_METADATA_INDEX:
        return check_index(c, r);
    default:
        return 0;
    }
}

static void check_count(struct bag_check *c, const char *what, uint64_t said,
                        uint64_t there)
{
    char text[160];

    if (said == there)
        return;
    snprintf(text, sizeof text,
             "the statistics say %" PRIu64 " for %s, but it is %" PRIu64, said, what,
             there);
    check_fault_at(c, c->groups[BAG_STATISTICS].start, text);
}

static void check_statistics(struct bag_check *c)
{
    const struct bag_statistics *s = &c->statistics.record.statistics;
    const struct bag_catalog *f = c->found;
    struct bytes list = s->channel_message_counts;
    uint64_t id, count, sum = 0;

    check_count(c, "the messages", s->message_count, f->n_messages);
    check_count(c, "the schemas", s->schema_count, f->n_schemas);
    check_count(c, "the channels", s->channel_count, f->n_channels);
    check_count(c, "the attachments", s->attachment_count, f->n_attachments);
    check_count(c, "the metadata", s->metadata_count, f->n_metadata);
    check_count(c, "the chunks", s->chunk_count, c->n_chunks);
    check_count(c, "the first time", s->message_start_time, f->start_time);
    check_count(c, "the last time", s->message_end_time, f->end_time);
    while (bag_list_next(&list, 2, &id, &count)) {
        char what[40];
        snprintf(what, sizeof what, "the messages of channel %u", (unsigned)id);
        check_count(c, what, count, f->counts[id]);
        sum += count;
    }
    if (s->channel_message_counts.size)
        check_count(c, "the messages of all channels", sum, f->n_messages);
}

static void check_offsets(struct bag_check *c, const struct bag_footer *f)
{
    const struct check_group *own = &c->groups[BAG_SUMMARY_OFFSET];

    if (f->summary_offset_start != own->start)
        check_fault(c, "the footer names another beginning of the summary offsets");
    for (size_t i = 0; i < c->n_offsets; i++) {
        const struct bag_summary_offset *o = &c->offsets[i].record.summary_offset;
        const struct check_group *g =
            &c->groups[o->group_opcode < 16 ? o->group_opcode : 0];
        if (!g->length || g->start != o->group_start || g->length != o->group_length)
            check_fault_at(c, own->start,
                           "a summary offset does not match the records it names");
    }
}

static void check_footer(struct bag_check *c, const struct bag_footer *f)
{
    static const char *const names[KINDS] = {"chunks", "attachments", "metadata"};
    struct bytes head = {c->bytes.data, BAG_RECORD_HEAD_SIZE + 16};
    bool empty = c->offset == c->summary_start;

    if (f->summary_start != (empty ? 0 : c->summary_start))
        check_fault(c, "the footer names another beginning of the summary");
    if (f->summary_crc && bag_crc(c->crc, head) != f->summary_crc)
        check_fault(c, "the summary does not have its checksum");
    if (c->statistics.copy.size)
        check_statistics(c);
    check_offsets(c, f);
    for (int kind = 0; kind < KINDS; kind++) {
        size_t n;
        list_of(c, kind, &n);
        if (c->n_seen[kind] && c->n_seen[kind] != n)
            check_fault(c, "the summary has an index for %zu of %zu %s", c->n_seen[kind],
                        n, names[kind]);
    }
}

/* A fault of the record that came last, or at another offset. */
static void check_fault(struct bag_check *c, const char *format, ...)
{
    char text[256];
    va_list args;

    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    check_fault_at(c, c->offset, text);
}

/* "FILE: byte N: what" as a fault. */
static void fault_of(struct bag_check *c, const struct error *why)
{
    const char *at = strstr(why->text, ": byte ");
    const char *what = at ? strchr(at + 2, ':') : NULL;

    check_fault(c, "%s", what ? what + 2 : why->text);
}

/* A schema or channel, wherever it stands.  0, -ENOMEM. */
static int check_definition(struct bag_check *c, const struct bag_record *r)
{
    const struct bag_catalog *f = c->found;
    bool schema = r->opcode == BAG_SCHEMA;
    uint16_t id = schema ? r->schema.id : r->channel.id;
    uint32_t at = schema ? f->schema_at[id] : f->channel_at[id];
    struct bytes_buffer bytes = {0};

    if (!schema && r->channel.schema_id && !f->schema_at[r->channel.schema_id])
        check_fault(c, "channel %u has the schema %u, which is not defined before", id,
                    r->channel.schema_id);
    if (!at)
        return bag_catalog_define(c->found, r);
    const struct bag_kept *before = schema ? &f->schemas[at - 1] : &f->channels[at - 1];
    bag_record_put(&bytes, r);
    int err = bytes.failed ? -ENOMEM : 0;
    if (!err && !bytes_equal(bytes_in(&bytes), bytes_in(&before->copy)))
        check_fault(c, "%s %u is not what it was before", bag_opcode_name(r->opcode), id);
    bytes_free(&bytes);
    return err;
}

static void check_message(struct bag_check *c, const struct bag_message *m)
{
    struct bag_catalog *f = c->found;

    if (!f->channel_at[m->channel_id])
        check_fault(c, "a message of channel %u, which is not defined before",
                    m->channel_id);
    bag_catalog_count(f, m);
}

static int take_chunk(struct bag_check *c, const struct bag_chunk *k)
{
    struct error why = {""};
    int err =
        bag_file_chunk(&c->found->file, c->offset, k, &c->allowance, &c->plain, &why);

    if (err == -ENOMEM)
        return err;
    c->chunk.unread = err != 0;
    if (err) { /* its messages cannot be told; its index still can */
        fault_of(c, &why);
        c->plain.size = 0;
    }
    return check_chunk_begin(c, k);
}

static int take_data(struct bag_check *c, const struct bag_record *r)
{
    struct bag_catalog *f = c->found;
    struct error why = {""};
    uint64_t length = c->next - c->offset;

    switch (r->opcode) {
    case BAG_SCHEMA:
    case BAG_CHANNEL:
        return check_definition(c, r);
    case BAG_MESSAGE:
        check_message(c, &r->message);
        return 0;
    case BAG_CHUNK:
        return take_chunk(c, &r->chunk);
    case BAG_MESSAGE_INDEX:
        return check_message_index(c, &r->message_index);
    case BAG_ATTACHMENT:
        if (bag_file_attachment(&f->file, c->offset, &r->attachment, &why))
            fault_of(c, &why);
        return bag_catalog_add_attachment(f, c->offset, length, &r->attachment);
    case BAG_METADATA:
        return bag_catalog_add_metadata(f, c->offset, length, &r->metadata);
    case BAG_DATA_END:
        if (r->data_end.data_section_crc && r->data_end.data_section_crc != c->crc)
            check_fault(c, "the data section does not have its checksum");
        return 0;
    default:
        return 0;
    }
}

static int check_take_record(struct bag_check *c, const struct bag_record *r)
{
    int err = 0;

    if (!bag_section_allows(c->section, r->opcode))
        check_fault(c, "a %s out of its place", bag_opcode_name(r->opcode));
    else if (r->opcode == BAG_FOOTER)
        check_footer(c, &r->footer);
    else if (c->section == BAG_IN_SUMMARY)
        err = check_summary_record(c, r);
    else
        err = take_data(c, r);
    c->crc = bag_crc(c->crc, bytes_in(&c->bytes));
    c->section = bag_section_after(c->section, r->opcode);
    if (r->opcode == BAG_DATA_END) {
        c->summary_start = c->next;
        c->crc = 0;
    }
    return err;
}

/* -ENODATA: nothing after it can be found. */
static int next_record(struct bag_check *c)
{
    struct error why = {""};
    struct bag_record r;

    c->offset = c->next;
    int err = bag_file_record(&c->found->file, c->offset, &c->bytes, &why);
    if (err == -EBADMSG || err == -EFBIG) {
        fault_of(c, &why);
        return -ENODATA;
    }
    if (err)
        return err;
    c->next = c->offset + c->bytes.size;
    struct bytes_cursor whole = {.left = bytes_in(&c->bytes)};
    err = bag_record_take(&whole, &r);
    if (!err && r.opcode != BAG_MESSAGE_INDEX)
        err = check_chunk_end(c);
    if (!err)
        return check_take_record(c, &r);
    c->crc = bag_crc(c->crc, bytes_in(&c->bytes));
    if (err == -EBADMSG)
        check_fault(c, "a record's lengths do not fit");
    return err == -ENOMEM ? err : 0;
}

static int check_end(struct bag_check *c)
{
    c->offset = c->next;
    int err = bag_file_read(&c->found->file, c->next, BAG_MAGIC_SIZE, &c->bytes, NULL);
    if (err && err != -EBADMSG) /* it is not known what is there */
        return err;
    if (err || memcmp(c->bytes.data, BAG_MAGIC, BAG_MAGIC_SIZE))
        check_fault(c, "no closing magic after the footer");
    else if (c->next + BAG_MAGIC_SIZE != c->found->file.size)
        check_fault(c, "something follows the closing magic");
    return 0;
}

static int walk(struct bag_check *c, struct error *why)
{
    int err = 0;

    c->next = BAG_MAGIC_SIZE;
    c->allowance = bag_file_allowance(&c->found->file);
    c->crc = bag_crc(0, (struct bytes){(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE});
    while (!err && c->section != BAG_AT_END) {
        if (c->watch && c->watch->stop && c->watch->stop())
            return error_say(why, -EINTR,
                             "%s: interrupted after %.1f of %.1f MB, %" PRIu64
                             " fault%s so far",
                             c->found->file.path, 1e-6 * (double)c->next,
                             1e-6 * (double)c->found->file.size, c->n_faults,
                             c->n_faults == 1 ? "" : "s");
        err = next_record(c);
    }
    if (!err)
        err = check_end(c);
    if (err && err != -ENODATA)
        return error_say(why, err, "%s: %s", c->found->file.path, strerror(-err));
    return 0;
}

static void clear(struct bag_check *c)
{
    bag_catalog_close(c->found);
    bytes_free(&c->bytes);
    bytes_free(&c->plain);
    bytes_free(&c->chunk.offsets);
    bytes_free(&c->statistics.copy);
    free(c->chunk.entries);
    for (size_t i = 0; i < c->n_offsets; i++)
        bytes_free(&c->offsets[i].copy);
    free(c->offsets);
    for (size_t i = 0; i < sizeof c->seen / sizeof *c->seen; i++)
        free(c->seen[i]);
}

int bag_check(uint64_t *n_faults, const char *path, const struct bag_check_watch *watch,
              struct error *why)
{
    struct bag_check c = {.watch = watch, .found = calloc(1, sizeof *c.found)};

    if (!c.found)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    c.found->file.fd = -1;
    int err = bag_file_open(&c.found->file, path, why);
    if (!err)
        err = walk(&c, why);
    *n_faults = c.n_faults;
    clear(&c);
    return err;
}
