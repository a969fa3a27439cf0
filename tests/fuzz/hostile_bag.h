/* SPDX-License-Identifier: MIT */
/* tests/fuzz/hostile_bag.h -- bags byte by byte, as no writer would make them. */
#ifndef ANLOS_TESTS_FUZZ_HOSTILE_BAG_H
#define ANLOS_TESTS_FUZZ_HOSTILE_BAG_H

#include "tests/hal/scratch.h"

#include <zstd.h>

#include "msgs/bag/record.h"

static const struct bytes hostile_magic = {(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE};

static inline struct bytes_buffer hostile_begin(void)
{
    struct bytes_buffer b = {0};

    bytes_put(&b, hostile_magic);
    bag_record_put(&b, &(struct bag_record){.opcode = BAG_HEADER});
    return b;
}

static inline void hostile_put_channel(struct bytes_buffer *b, uint16_t id,
                                       const char *topic)
{
    struct bag_record r = {.opcode = BAG_CHANNEL};

    r.channel.id = id;
    r.channel.topic = bytes_of(topic);
    bag_record_put(b, &r);
}

static inline void hostile_put_message(struct bytes_buffer *b, uint64_t time)
{
    struct bag_record r = {.opcode = BAG_MESSAGE};

    r.message.channel_id = 1;
    r.message.log_time = time;
    bag_record_put(b, &r);
}

/* Frees records. */
static inline void hostile_put_chunk(struct bytes_buffer *b, struct bytes_buffer *records,
                                     uint64_t claimed)
{
    struct bag_record r = {.opcode = BAG_CHUNK};
    struct bytes_buffer packed = {0};
    size_t room = ZSTD_compressBound(records->size);

    assert_int_equal(bytes_reserve(&packed, room), 0);
    packed.size = ZSTD_compress(packed.data, room, records->data, records->size, 1);
    assert_false(ZSTD_isError(packed.size));
    r.chunk.compression = bytes_of("zstd");
    r.chunk.uncompressed_size = claimed ? claimed : records->size;
    r.chunk.records = bytes_in(&packed);
    bag_record_put(b, &r);
    bytes_free(&packed);
    bytes_free(records);
}

/* Writes the file and frees b. */
static inline void hostile_finish(struct bytes_buffer *b, const char *path,
                                  uint64_t summary, uint64_t offsets)
{
    struct bag_record footer = {.opcode = BAG_FOOTER};
    FILE *f = fopen(path, "wb");

    footer.footer.summary_start = summary;
    footer.footer.summary_offset_start = offsets;
    bag_record_put(b, &footer);
    bytes_put(b, hostile_magic);
    assert_false(b->failed);
    assert_int_equal(fwrite(b->data, 1, b->size, f), b->size);
    assert_int_equal(fclose(f), 0);
    bytes_free(b);
}

static inline void hostile_end_data(struct bytes_buffer *b)
{
    bag_record_put(b, &(struct bag_record){.opcode = BAG_DATA_END});
}

#endif
