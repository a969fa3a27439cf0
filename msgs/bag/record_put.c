#include "msgs/bag/record.h"

#define U16 2
#define U32 4
#define U64 8

static void text(struct bytes_buffer *b, struct bytes what)
{
    bytes_put_sized(b, what, U32);
}

static void u64(struct bytes_buffer *b, uint64_t value)
{
    bytes_put_number(b, value, U64);
}

static void u32(struct bytes_buffer *b, uint32_t value)
{
    bytes_put_number(b, value, U32);
}

static void u16(struct bytes_buffer *b, uint16_t value)
{
    bytes_put_number(b, value, U16);
}

static void put_chunk(struct bytes_buffer *b, const struct bag_chunk *k)
{
    u64(b, k->message_start_time);
    u64(b, k->message_end_time);
    u64(b, k->uncompressed_size);
    u32(b, k->uncompressed_crc);
    text(b, k->compression);
    bytes_put_sized(b, k->records, U64);
}

static void put_chunk_index(struct bytes_buffer *b, const struct bag_chunk_index *k)
{
    u64(b, k->message_start_time);
    u64(b, k->message_end_time);
    u64(b, k->chunk_start_offset);
    u64(b, k->chunk_length);
    text(b, k->message_index_offsets);
    u64(b, k->message_index_length);
    text(b, k->compression);
    u64(b, k->compressed_size);
    u64(b, k->uncompressed_size);
}

/* start: where the content begins, for its checksum. */
static void put_attachment(struct bytes_buffer *b, const struct bag_attachment *a,
                           size_t start)
{
    u64(b, a->log_time);
    u64(b, a->create_time);
    text(b, a->name);
    text(b, a->media_type);
    bytes_put_sized(b, a->data, U64);
    if (!b->failed)
        u32(b, bag_crc(0, (struct bytes){b->data + start, b->size - start}));
}

static void put_attachment_index(struct bytes_buffer *b,
                                 const struct bag_attachment_index *a)
{
    u64(b, a->offset);
    u64(b, a->length);
    u64(b, a->log_time);
    u64(b, a->create_time);
    u64(b, a->data_size);
    text(b, a->name);
    text(b, a->media_type);
}

static void put_statistics(struct bytes_buffer *b, const struct bag_statistics *s)
{
    u64(b, s->message_count);
    u16(b, s->schema_count);
    u32(b, s->channel_count);
    u32(b, s->attachment_count);
    u32(b, s->metadata_count);
    u32(b, s->chunk_count);
    u64(b, s->message_start_time);
    u64(b, s->message_end_time);
    text(b, s->channel_message_counts);
}

static void put_small(struct bytes_buffer *b, const struct bag_record *r)
{
    switch (r->opcode) {
    case BAG_HEADER:
        text(b, r->header.profile);
        text(b, r->header.library);
        break;
    case BAG_FOOTER:
        u64(b, r->footer.summary_start);
        u64(b, r->footer.summary_offset_start);
        u32(b, r->footer.summary_crc);
        break;
    case BAG_MESSAGE_INDEX:
        u16(b, r->message_index.channel_id);
        text(b, r->message_index.entries);
        break;
    case BAG_METADATA:
        text(b, r->metadata.name);
        text(b, r->metadata.metadata);
        break;
    case BAG_METADATA_INDEX:
        u64(b, r->metadata_index.offset);
        u64(b, r->metadata_index.length);
        text(b, r->metadata_index.name);
        break;
    case BAG_SUMMARY_OFFSET:
        bytes_put_number(b, r->summary_offset.group_opcode, 1);
        u64(b, r->summary_offset.group_start);
        u64(b, r->summary_offset.group_length);
        break;
    case BAG_DATA_END:
        u32(b, r->data_end.data_section_crc);
        break;
    }
}

static void put_message(struct bytes_buffer *b, const struct bag_message *m)
{
    u16(b, m->channel_id);
    u32(b, m->sequence);
    u64(b, m->log_time);
    u64(b, m->publish_time);
    bytes_put(b, m->data);
}

static void put_schema(struct bytes_buffer *b, const struct bag_schema *s)
{
    u16(b, s->id);
    text(b, s->name);
    text(b, s->encoding);
    text(b, s->data);
}

static void put_channel(struct bytes_buffer *b, const struct bag_channel *h)
{
    u16(b, h->id);
    u16(b, h->schema_id);
    text(b, h->topic);
    text(b, h->message_encoding);
    text(b, h->metadata);
}

static void put_content(struct bytes_buffer *b, const struct bag_record *r, size_t start)
{
    switch (r->opcode) {
    case BAG_SCHEMA:
        put_schema(b, &r->schema);
        break;
    case BAG_CHANNEL:
        put_channel(b, &r->channel);
        break;
    case BAG_MESSAGE:
        put_message(b, &r->message);
        break;
    case BAG_CHUNK:
        put_chunk(b, &r->chunk);
        break;
    case BAG_CHUNK_INDEX:
        put_chunk_index(b, &r->chunk_index);
        break;
    case BAG_ATTACHMENT:
        put_attachment(b, &r->attachment, start);
        break;
    case BAG_ATTACHMENT_INDEX:
        put_attachment_index(b, &r->attachment_index);
        break;
    case BAG_STATISTICS:
        put_statistics(b, &r->statistics);
        break;
    default:
        put_small(b, r);
    }
}

void bag_record_put(struct bytes_buffer *b, const struct bag_record *r)
{
    bytes_put_number(b, r->opcode, 1);
    size_t at = b->size;
    u64(b, 0);
    size_t start = b->size;
    put_content(b, r, start);
    bytes_set_number(b, at, b->size - start, U64);
}
