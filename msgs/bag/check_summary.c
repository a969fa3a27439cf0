#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/check_state.h"

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

static int compare_pairs(const void *a, const void *b)
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
            qsort(pairs.data, pairs.size / 10, 10, compare_pairs);
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

int check_summary_record(struct bag_check *c, const struct bag_record *r)
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

void check_footer(struct bag_check *c, const struct bag_footer *f)
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
