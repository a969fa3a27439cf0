/* SPDX-License-Identifier: MIT */
#include "msgs/bag/record.h"

#include <errno.h>
#include <libdeflate.h>

#define U16 2
#define U32 4
#define U64 8

/* A text map whose lengths do not fit fails the cursor that it came from. */
static struct bytes take_map(struct bytes_cursor *c)
{
    struct bytes map = bytes_take_sized(c, U32);
    struct bytes_cursor pairs = {.left = map};

    while (pairs.left.size && !pairs.failed) {
        bytes_take_sized(&pairs, U32);
        bytes_take_sized(&pairs, U32);
    }
    c->failed |= pairs.failed;
    return map;
}

static struct bytes take_list(struct bytes_cursor *c, size_t key_size)
{
    struct bytes list = bytes_take_sized(c, U32);

    c->failed |= list.size % (key_size + U64) != 0;
    return list;
}

static struct bytes text(struct bytes_cursor *c)
{
    return bytes_take_sized(c, U32);
}

static uint64_t u64(struct bytes_cursor *c)
{
    return bytes_number(c, U64);
}

static uint32_t u32(struct bytes_cursor *c)
{
    return (uint32_t)bytes_number(c, U32);
}

static uint16_t u16(struct bytes_cursor *c)
{
    return (uint16_t)bytes_number(c, U16);
}

static void parse_chunk(struct bag_chunk *k, struct bytes_cursor *c)
{
    k->message_start_time = u64(c);
    k->message_end_time = u64(c);
    k->uncompressed_size = u64(c);
    k->uncompressed_crc = u32(c);
    k->compression = text(c);
    k->records = bytes_take_sized(c, U64);
}

static void parse_chunk_index(struct bag_chunk_index *k, struct bytes_cursor *c)
{
    k->message_start_time = u64(c);
    k->message_end_time = u64(c);
    k->chunk_start_offset = u64(c);
    k->chunk_length = u64(c);
    k->message_index_offsets = take_list(c, U16);
    k->message_index_length = u64(c);
    k->compression = text(c);
    k->compressed_size = u64(c);
    k->uncompressed_size = u64(c);
}

static void parse_attachment(struct bag_attachment *a, struct bytes_cursor *c)
{
    a->log_time = u64(c);
    a->create_time = u64(c);
    a->name = text(c);
    a->media_type = text(c);
    a->data = bytes_take_sized(c, U64);
    a->crc = u32(c);
}

static void parse_attachment_index(struct bag_attachment_index *a, struct bytes_cursor *c)
{
    a->offset = u64(c);
    a->length = u64(c);
    a->log_time = u64(c);
    a->create_time = u64(c);
    a->data_size = u64(c);
    a->name = text(c);
    a->media_type = text(c);
}

static void parse_statistics(struct bag_statistics *s, struct bytes_cursor *c)
{
    s->message_count = u64(c);
    s->schema_count = u16(c);
    s->channel_count = u32(c);
    s->attachment_count = u32(c);
    s->metadata_count = u32(c);
    s->chunk_count = u32(c);
    s->message_start_time = u64(c);
    s->message_end_time = u64(c);
    s->channel_message_counts = take_list(c, U16);
}

static void parse_small(struct bag_record *r, struct bytes_cursor *c)
{
    switch (r->opcode) {
    case BAG_HEADER:
        r->header.profile = text(c);
        r->header.library = text(c);
        break;
    case BAG_FOOTER:
        r->footer.summary_start = u64(c);
        r->footer.summary_offset_start = u64(c);
        r->footer.summary_crc = u32(c);
        break;
    case BAG_MESSAGE_INDEX:
        r->message_index.channel_id = u16(c);
        r->message_index.entries = take_list(c, U64);
        break;
    case BAG_METADATA:
        r->metadata.name = text(c);
        r->metadata.metadata = take_map(c);
        break;
    case BAG_METADATA_INDEX:
        r->metadata_index.offset = u64(c);
        r->metadata_index.length = u64(c);
        r->metadata_index.name = text(c);
        break;
    case BAG_SUMMARY_OFFSET:
        r->summary_offset.group_opcode = (uint8_t)bytes_number(c, 1);
        r->summary_offset.group_start = u64(c);
        r->summary_offset.group_length = u64(c);
        break;
    case BAG_DATA_END:
        r->data_end.data_section_crc = u32(c);
        break;
    }
}

static void parse_message(struct bag_message *m, struct bytes_cursor *c)
{
    m->channel_id = u16(c);
    m->sequence = u32(c);
    m->log_time = u64(c);
    m->publish_time = u64(c);
    m->data = bytes_take(c, c->left.size);
}

static void parse_schema(struct bag_schema *s, struct bytes_cursor *c)
{
    s->id = u16(c);
    s->name = text(c);
    s->encoding = text(c);
    s->data = text(c);
    c->failed |= s->id == 0;
}

static void parse_channel(struct bag_channel *h, struct bytes_cursor *c)
{
    h->id = u16(c);
    h->schema_id = u16(c);
    h->topic = text(c);
    h->message_encoding = text(c);
    h->metadata = take_map(c);
}

int bag_record_parse(struct bag_record *out, uint8_t opcode, struct bytes content)
{
    struct bytes_cursor c = {.left = content};

    if (!bag_opcode_name(opcode))
        return -ENOTSUP;
    *out = (struct bag_record){.opcode = opcode};
    switch (opcode) {
    case BAG_SCHEMA:
        parse_schema(&out->schema, &c);
        break;
    case BAG_CHANNEL:
        parse_channel(&out->channel, &c);
        break;
    case BAG_MESSAGE:
        parse_message(&out->message, &c);
        break;
    case BAG_CHUNK:
        parse_chunk(&out->chunk, &c);
        break;
    case BAG_CHUNK_INDEX:
        parse_chunk_index(&out->chunk_index, &c);
        break;
    case BAG_ATTACHMENT:
        parse_attachment(&out->attachment, &c);
        break;
    case BAG_ATTACHMENT_INDEX:
        parse_attachment_index(&out->attachment_index, &c);
        break;
    case BAG_STATISTICS:
        parse_statistics(&out->statistics, &c);
        break;
    default:
        parse_small(out, &c);
    }
    return c.failed ? -EBADMSG : 0;
}

int bag_record_take(struct bytes_cursor *c, struct bag_record *out)
{
    uint8_t opcode = (uint8_t)bytes_number(c, 1);
    struct bytes content = bytes_take_sized(c, U64);

    return c->failed ? -EBADMSG : bag_record_parse(out, opcode, content);
}

bool bag_map_next(struct bytes *map, struct bytes *key, struct bytes *value)
{
    struct bytes_cursor c = {.left = *map};

    if (!map->size)
        return false;
    *key = text(&c);
    *value = text(&c);
    *map = c.left;
    return !c.failed;
}

void bag_map_put(struct bytes_buffer *map, struct bytes key, struct bytes value)
{
    bytes_put_sized(map, key, U32);
    bytes_put_sized(map, value, U32);
}

bool bag_list_next(struct bytes *list, size_t key_size, uint64_t *key, uint64_t *value)
{
    struct bytes_cursor c = {.left = *list};

    if (!list->size)
        return false;
    *key = bytes_number(&c, key_size);
    *value = u64(&c);
    *list = c.left;
    return !c.failed;
}

const char *bag_opcode_name(uint8_t opcode)
{
    static const char *const names[] = {
        [BAG_HEADER] = "header",
        [BAG_FOOTER] = "footer",
        [BAG_SCHEMA] = "schema",
        [BAG_CHANNEL] = "channel",
        [BAG_MESSAGE] = "message",
        [BAG_CHUNK] = "chunk",
        [BAG_MESSAGE_INDEX] = "message index",
        [BAG_CHUNK_INDEX] = "chunk index",
        [BAG_ATTACHMENT] = "attachment",
        [BAG_ATTACHMENT_INDEX] = "attachment index",
        [BAG_STATISTICS] = "statistics",
        [BAG_METADATA] = "metadata",
        [BAG_METADATA_INDEX] = "metadata index",
        [BAG_SUMMARY_OFFSET] = "summary offset",
        [BAG_DATA_END] = "data end",
    };
    return opcode < sizeof names / sizeof *names ? names[opcode] : NULL;
}

uint32_t bag_crc(uint32_t before, struct bytes what)
{
    return what.size ? libdeflate_crc32(before, what.data, what.size) : before;
}

static void record_put_text(struct bytes_buffer *b, struct bytes what)
{
    bytes_put_sized(b, what, U32);
}

static void record_put_u64(struct bytes_buffer *b, uint64_t value)
{
    bytes_put_number(b, value, U64);
}

static void record_put_u32(struct bytes_buffer *b, uint32_t value)
{
    bytes_put_number(b, value, U32);
}

static void record_put_u16(struct bytes_buffer *b, uint16_t value)
{
    bytes_put_number(b, value, U16);
}

static void put_chunk(struct bytes_buffer *b, const struct bag_chunk *k)
{
    record_put_u64(b, k->message_start_time);
    record_put_u64(b, k->message_end_time);
    record_put_u64(b, k->uncompressed_size);
    record_put_u32(b, k->uncompressed_crc);
    record_put_text(b, k->compression);
    bytes_put_sized(b, k->records, U64);
}

static void put_chunk_index(struct bytes_buffer *b, const struct bag_chunk_index *k)
{
    record_put_u64(b, k->message_start_time);
    record_put_u64(b, k->message_end_time);
    record_put_u64(b, k->chunk_start_offset);
    record_put_u64(b, k->chunk_length);
    record_put_text(b, k->message_index_offsets);
    record_put_u64(b, k->message_index_length);
    record_put_text(b, k->compression);
    record_put_u64(b, k->compressed_size);
    record_put_u64(b, k->uncompressed_size);
}

/* start: where the content begins, for its checksum. */
static void put_attachment(struct bytes_buffer *b, const struct bag_attachment *a,
                           size_t start)
{
    record_put_u64(b, a->log_time);
    record_put_u64(b, a->create_time);
    record_put_text(b, a->name);
    record_put_text(b, a->media_type);
    bytes_put_sized(b, a->data, U64);
    if (!b->failed)
        record_put_u32(b, bag_crc(0, (struct bytes){b->data + start, b->size - start}));
}

static void put_attachment_index(struct bytes_buffer *b,
                                 const struct bag_attachment_index *a)
{
    record_put_u64(b, a->offset);
    record_put_u64(b, a->length);
    record_put_u64(b, a->log_time);
    record_put_u64(b, a->create_time);
    record_put_u64(b, a->data_size);
    record_put_text(b, a->name);
    record_put_text(b, a->media_type);
}

static void put_statistics(struct bytes_buffer *b, const struct bag_statistics *s)
{
    record_put_u64(b, s->message_count);
    record_put_u16(b, s->schema_count);
    record_put_u32(b, s->channel_count);
    record_put_u32(b, s->attachment_count);
    record_put_u32(b, s->metadata_count);
    record_put_u32(b, s->chunk_count);
    record_put_u64(b, s->message_start_time);
    record_put_u64(b, s->message_end_time);
    record_put_text(b, s->channel_message_counts);
}

static void put_small(struct bytes_buffer *b, const struct bag_record *r)
{
    switch (r->opcode) {
    case BAG_HEADER:
        record_put_text(b, r->header.profile);
        record_put_text(b, r->header.library);
        break;
    case BAG_FOOTER:
        record_put_u64(b, r->footer.summary_start);
        record_put_u64(b, r->footer.summary_offset_start);
        record_put_u32(b, r->footer.summary_crc);
        break;
    case BAG_MESSAGE_INDEX:
        record_put_u16(b, r->message_index.channel_id);
        record_put_text(b, r->message_index.entries);
        break;
    case BAG_METADATA:
        record_put_text(b, r->metadata.name);
        record_put_text(b, r->metadata.metadata);
        break;
    case BAG_METADATA_INDEX:
        record_put_u64(b, r->metadata_index.offset);
        record_put_u64(b, r->metadata_index.length);
        record_put_text(b, r->metadata_index.name);
        break;
    case BAG_SUMMARY_OFFSET:
        bytes_put_number(b, r->summary_offset.group_opcode, 1);
        record_put_u64(b, r->summary_offset.group_start);
        record_put_u64(b, r->summary_offset.group_length);
        break;
    case BAG_DATA_END:
        record_put_u32(b, r->data_end.data_section_crc);
        break;
    }
}

static void put_message(struct bytes_buffer *b, const struct bag_message *m)
{
    record_put_u16(b, m->channel_id);
    record_put_u32(b, m->sequence);
    record_put_u64(b, m->log_time);
    record_put_u64(b, m->publish_time);
    bytes_put(b, m->data);
}

static void put_schema(struct bytes_buffer *b, const struct bag_schema *s)
{
    record_put_u16(b, s->id);
    record_put_text(b, s->name);
    record_put_text(b, s->encoding);
    record_put_text(b, s->data);
}

static void put_channel(struct bytes_buffer *b, const struct bag_channel *h)
{
    record_put_u16(b, h->id);
    record_put_u16(b, h->schema_id);
    record_put_text(b, h->topic);
    record_put_text(b, h->message_encoding);
    record_put_text(b, h->metadata);
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
    record_put_u64(b, 0);
    size_t start = b->size;
    put_content(b, r, start);
    bytes_set_number(b, at, b->size - start, U64);
}

bool bag_section_allows(enum bag_section section, uint8_t opcode)
{
    switch (opcode) {
    case BAG_HEADER:
        return section == BAG_AT_START;
    case BAG_MESSAGE:
    case BAG_CHUNK:
    case BAG_MESSAGE_INDEX:
    case BAG_ATTACHMENT:
    case BAG_METADATA:
    case BAG_DATA_END:
        return section == BAG_IN_DATA;
    case BAG_SCHEMA:
    case BAG_CHANNEL:
        return section == BAG_IN_DATA || section == BAG_IN_SUMMARY;
    default:
        return section == BAG_IN_SUMMARY;
    }
}

enum bag_section bag_section_after(enum bag_section section, uint8_t opcode)
{
    switch (opcode) {
    case BAG_HEADER:
        return BAG_IN_DATA;
    case BAG_DATA_END:
        return BAG_IN_SUMMARY;
    case BAG_FOOTER:
        return BAG_AT_END;
    default:
        return section;
    }
}

bool bag_chunk_allows(uint8_t opcode)
{
    return opcode == BAG_SCHEMA || opcode == BAG_CHANNEL || opcode == BAG_MESSAGE;
}
