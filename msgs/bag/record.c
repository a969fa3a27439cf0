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
