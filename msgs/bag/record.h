/* SPDX-License-Identifier: MIT */
/* msgs/bag/record.h -- the records of an MCAP file (https://mcap.dev/spec, format 0),
 * each as its bytes and as C.
 *
 * A record is opcode u8, length u64, content.  Content that is longer than what is known
 * of it here belongs to a later version of the format and is ignored; so are opcodes
 * that are not known.  Times are ns since 1970. */
#ifndef ANLOS_MSGS_BAG_RECORD_H
#define ANLOS_MSGS_BAG_RECORD_H

#include <stdbool.h>

#include "msgs/bag/bytes.h"

#define BAG_MAGIC            "\x89MCAP0\r\n"
#define BAG_MAGIC_SIZE       8
#define BAG_RECORD_HEAD_SIZE 9

enum bag_opcode {
    BAG_HEADER = 0x01,
    BAG_FOOTER = 0x02,
    BAG_SCHEMA = 0x03,
    BAG_CHANNEL = 0x04,
    BAG_MESSAGE = 0x05,
    BAG_CHUNK = 0x06,
    BAG_MESSAGE_INDEX = 0x07,
    BAG_CHUNK_INDEX = 0x08,
    BAG_ATTACHMENT = 0x09,
    BAG_ATTACHMENT_INDEX = 0x0a,
    BAG_STATISTICS = 0x0b,
    BAG_METADATA = 0x0c,
    BAG_METADATA_INDEX = 0x0d,
    BAG_SUMMARY_OFFSET = 0x0e,
    BAG_DATA_END = 0x0f,
};

struct bag_header {
    struct bytes profile, library;
};

struct bag_footer {
    uint64_t summary_start, summary_offset_start; /* 0: there is none */
    uint32_t summary_crc;                         /* 0: not known */
};

struct bag_schema {
    uint16_t id; /* not 0 */
    struct bytes name, encoding, data;
};

/* The maps below are the pairs as they stand in the file: bag_map_next and bag_list_next
 * walk over them, bag_map_put and bytes_put_number make them. */
struct bag_channel {
    uint16_t id, schema_id; /* schema 0: none */
    struct bytes topic, message_encoding;
    struct bytes metadata; /* text to text */
};

struct bag_message {
    uint16_t channel_id;
    uint32_t sequence;
    uint64_t log_time, publish_time;
    struct bytes data;
};

struct bag_chunk {
    uint64_t message_start_time, message_end_time; /* log times; 0 without messages */
    uint64_t uncompressed_size;
    uint32_t uncompressed_crc; /* 0: not known */
    struct bytes compression;  /* "", "zstd", "lz4" */
    struct bytes records;
};

struct bag_message_index { /* of one channel of the chunk before it */
    uint16_t channel_id;
    struct bytes entries; /* log time u64, offset in the uncompressed chunk u64 */
};

struct bag_chunk_index {
    uint64_t message_start_time, message_end_time;
    uint64_t chunk_start_offset, chunk_length;
    struct bytes message_index_offsets; /* channel id u16, offset in the file u64 */
    uint64_t message_index_length;
    struct bytes compression;
    uint64_t compressed_size, uncompressed_size;
};

struct bag_attachment {
    uint64_t log_time, create_time;
    struct bytes name, media_type, data;
    uint32_t crc; /* of all of the content before it; 0: not known */
};

struct bag_attachment_index {
    uint64_t offset, length, log_time, create_time, data_size;
    struct bytes name, media_type;
};

struct bag_statistics {
    uint64_t message_count;
    uint16_t schema_count;
    uint32_t channel_count, attachment_count, metadata_count, chunk_count;
    uint64_t message_start_time, message_end_time;
    struct bytes channel_message_counts; /* channel id u16, count u64 */
};

struct bag_metadata {
    struct bytes name, metadata; /* text to text */
};

struct bag_metadata_index {
    uint64_t offset, length;
    struct bytes name;
};

struct bag_summary_offset {
    uint8_t group_opcode;
    uint64_t group_start, group_length;
};

struct bag_data_end {
    uint32_t data_section_crc; /* 0: not known */
};

struct bag_record {
    uint8_t opcode; /* which of the union */
    union {
        struct bag_header header;
        struct bag_footer footer;
        struct bag_schema schema;
        struct bag_channel channel;
        struct bag_message message;
        struct bag_chunk chunk;
        struct bag_message_index message_index;
        struct bag_chunk_index chunk_index;
        struct bag_attachment attachment;
        struct bag_attachment_index attachment_index;
        struct bag_statistics statistics;
        struct bag_metadata metadata;
        struct bag_metadata_index metadata_index;
        struct bag_summary_offset summary_offset;
        struct bag_data_end data_end;
    };
};

/* The content of a record with that opcode; what *out points to lies in content.  0,
 * -ENOTSUP (an opcode that is not known), -EBADMSG (too short, or lengths that do not
 * fit). */
int bag_record_parse(struct bag_record *out, uint8_t opcode, struct bytes content);

/* The record at the cursor, head and content.  -EBADMSG when it reaches beyond the end
 * too; else as bag_record_parse. */
int bag_record_take(struct bytes_cursor *c, struct bag_record *out);

/* Appends head and content.  Memory that ran out shows in b->failed. */
void bag_record_put(struct bytes_buffer *b, const struct bag_record *r);

/* The next pair of a map of texts; false at its end. */
bool bag_map_next(struct bytes *map, struct bytes *key, struct bytes *value);
void bag_map_put(struct bytes_buffer *map, struct bytes key, struct bytes value);

/* The next pair of numbers, a key of key_size bytes and 8 bytes; false at the end. */
bool bag_list_next(struct bytes *list, size_t key_size, uint64_t *key, uint64_t *value);

/* "Chunk index"; "opcode 0x.." is not there: NULL. */
const char *bag_opcode_name(uint8_t opcode);

/* The format's checksum (CRC-32 of zlib), continued from one of what came before, or 0.
 */
uint32_t bag_crc(uint32_t before, struct bytes what);

/* Which records may stand where in a bag. */
enum bag_section {
    BAG_AT_START,   /* after the magic: the header */
    BAG_IN_DATA,    /* up to the data end */
    BAG_IN_SUMMARY, /* up to the footer */
    BAG_AT_END,     /* the closing magic */
};

/* The opcode is a known one. */
bool bag_section_allows(enum bag_section section, uint8_t opcode);

/* Where the file is after a record with that opcode. */
enum bag_section bag_section_after(enum bag_section section, uint8_t opcode);

/* May it stand in a chunk? */
bool bag_chunk_allows(uint8_t opcode);

#endif
