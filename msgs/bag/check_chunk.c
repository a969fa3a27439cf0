#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/check_state.h"

static int compare_entries(const void *a, const void *b)
{
    const struct check_entry *x = a, *y = b;

    if (x->channel_id != y->channel_id)
        return x->channel_id < y->channel_id ? -1 : 1;
    return x->offset < y->offset ? -1 : x->offset > y->offset;
}

static int add_entry(struct check_chunk *k, const struct bag_message *m, uint64_t offset)
{
    if (k->n == k->room) {
        size_t room = k->room ? 2 * k->room : 64;
        struct check_entry *grown = realloc(k->entries, room * sizeof *grown);
        if (!grown)
            return -ENOMEM;
        k->entries = grown;
        k->room = room;
    }
    k->entries[k->n++] = (struct check_entry){m->channel_id, m->log_time, offset};
    return 0;
}

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

int check_chunk_begin(struct bag_check *c, const struct bag_chunk *k)
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

int check_message_index(struct bag_check *c, const struct bag_message_index *m)
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

int check_chunk_end(struct bag_check *c)
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
