#include "msgs/bag/summary.h"

struct group {
    uint8_t opcode;
    const struct bytes_buffer *records;
};

static void list_groups(const struct bag_summary *s, struct group out[BAG_SUMMARY_GROUPS])
{
    out[0] = (struct group){BAG_SCHEMA, &s->schemas};
    out[1] = (struct group){BAG_CHANNEL, &s->channels};
    out[2] = (struct group){BAG_STATISTICS, &s->statistics};
    out[3] = (struct group){BAG_CHUNK_INDEX, &s->chunk_indexes};
    out[4] = (struct group){BAG_ATTACHMENT_INDEX, &s->attachment_indexes};
    out[5] = (struct group){BAG_METADATA_INDEX, &s->metadata_indexes};
}

void bag_summary_free(struct bag_summary *s)
{
    bytes_free(&s->schemas);
    bytes_free(&s->channels);
    bytes_free(&s->statistics);
    bytes_free(&s->chunk_indexes);
    bytes_free(&s->attachment_indexes);
    bytes_free(&s->metadata_indexes);
}

uint64_t bag_summary_size(const struct bag_summary *s)
{
    struct group groups[BAG_SUMMARY_GROUPS];
    uint64_t size = 64 + BAG_MAGIC_SIZE; /* end of data, footer */

    list_groups(s, groups);
    for (size_t i = 0; i < BAG_SUMMARY_GROUPS; i++)
        size += groups[i].records->size + 32; /* and its offset */
    return size;
}

static void put_data_end(struct bytes_buffer *out, uint32_t data_crc)
{
    struct bag_record end = {.opcode = BAG_DATA_END};

    end.data_end.data_section_crc = data_crc;
    bag_record_put(out, &end);
}

/* The checksum covers all of the footer before it. */
static void put_footer(struct bytes_buffer *out, size_t summary, uint64_t summary_start,
                       uint64_t offset_start)
{
    struct bag_record footer = {.opcode = BAG_FOOTER};

    footer.footer.summary_start = summary_start;
    footer.footer.summary_offset_start = offset_start;
    bag_record_put(out, &footer);
    if (out->failed)
        return;
    size_t at = out->size - 4;
    bytes_set_number(out, at,
                     bag_crc(0, (struct bytes){out->data + summary, at - summary}), 4);
}

void bag_summary_put(struct bytes_buffer *out, const struct bag_summary *s,
                     bool with_offsets, uint64_t start, uint32_t data_crc)
{
    struct group groups[BAG_SUMMARY_GROUPS];
    size_t begin = out->size;
    uint64_t offset_start = 0;

    list_groups(s, groups);
    put_data_end(out, data_crc);
    size_t summary = out->size, at = summary;
    for (size_t i = 0; i < BAG_SUMMARY_GROUPS; i++) {
        bytes_put(out, bytes_in(groups[i].records));
        out->failed |= groups[i].records->failed;
    }
    bool empty = out->size == summary;
    if (with_offsets && !empty)
        offset_start = start + (out->size - begin);
    for (size_t i = 0; with_offsets && i < BAG_SUMMARY_GROUPS; i++) {
        struct bag_record r = {.opcode = BAG_SUMMARY_OFFSET};
        r.summary_offset.group_opcode = groups[i].opcode;
        r.summary_offset.group_start = start + (at - begin);
        r.summary_offset.group_length = groups[i].records->size;
        at += groups[i].records->size;
        if (groups[i].records->size)
            bag_record_put(out, &r);
    }
    put_footer(out, summary, empty ? 0 : start + (summary - begin), offset_start);
    bytes_put(out, (struct bytes){(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE});
}
