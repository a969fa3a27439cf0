/* SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "msgs/bag/writer.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/seeds.h"

#define N_MESSAGES 12

static void define(struct bag_writer *w)
{
    struct error why = {""};
    struct bag_channel channel = {.schema_id = 1, .message_encoding = bytes_of("json")};
    struct bytes_buffer metadata = {0};
    uint16_t id;

    bag_map_put(&metadata, bytes_of("node"), bytes_of("array"));
    channel.metadata = bytes_in(&metadata);
    FUZZ_REQUIRE(!bag_writer_schema(
        w, &(struct bag_schema){.name = bytes_of("text"), .encoding = bytes_of("json")},
        &id, &why));
    channel.topic = bytes_of("even");
    FUZZ_REQUIRE(!bag_writer_channel(w, &channel, &id, &why));
    channel.topic = bytes_of("odd");
    FUZZ_REQUIRE(!bag_writer_channel(w, &channel, &id, &why));
    bytes_free(&metadata);
}

static void put_messages(struct bag_writer *w)
{
    struct error why = {""};

    for (unsigned i = 0; i < N_MESSAGES; i++) {
        char text[64];
        snprintf(text, sizeof text, "{\"message\": %u}", i);
        const struct bag_message m = {.channel_id = (uint16_t)(1 + i % 2),
                                      .sequence = i,
                                      .log_time = 1000 + 10 * (i ^ 3),
                                      .publish_time = 1000,
                                      .data = bytes_of(text)};
        FUZZ_REQUIRE(!bag_writer_message(w, &m, &why));
    }
}

static void put_rest(struct bag_writer *w)
{
    struct error why = {""};
    struct bytes_buffer map = {0};

    bag_map_put(&map, bytes_of("git"), bytes_of("0123"));
    const struct bag_attachment a = {.name = bytes_of("survey.yaml"),
                                     .media_type = bytes_of("application/yaml"),
                                     .data = bytes_of("chirp: {}")};
    const struct bag_metadata m = {.name = bytes_of("anlos"), .metadata = bytes_in(&map)};
    FUZZ_REQUIRE(!bag_writer_attachment(w, &a, &why));
    FUZZ_REQUIRE(!bag_writer_metadata(w, &m, &why));
    bytes_free(&map);
}

/* Checksum 0 stands for not known: a fuzzer hits no checksum by chance. */
static void forget_checksums(struct bytes_buffer *b)
{
    struct bytes_cursor c = {
        .left = {b->data + BAG_MAGIC_SIZE, b->size - 2 * BAG_MAGIC_SIZE}};
    struct bag_record r;

    while (c.left.size) {
        size_t content = (size_t)(c.left.data - b->data) + BAG_RECORD_HEAD_SIZE;
        FUZZ_REQUIRE(!bag_record_take(&c, &r));
        if (r.opcode == BAG_CHUNK)
            bytes_set_number(b, content + 24, 0, 4);
        if (r.opcode == BAG_FOOTER)
            bytes_set_number(b, content + 16, 0, 4);
        if (r.opcode == BAG_DATA_END)
            bytes_set_number(b, content, 0, 4);
        if (r.opcode == BAG_ATTACHMENT)
            bytes_set_number(b, (size_t)(c.left.data - b->data) - 4, 0, 4);
    }
}

static void put_both(const struct seeds *s, const char *name, struct bytes content)
{
    seeds_put(s, "bag_read", name, content);
    seeds_put(s, "bag_write", name, content);
}

static void put_bag(const struct seeds *s, const char *name,
                    const struct bag_writer_config *cfg)
{
    struct error why = {""};
    struct bag_writer *w;
    char path[4096];

    snprintf(path, sizeof path, "%s", seeds_path(s, "bag_read", name));
    unlink(path);
    FUZZ_REQUIRE(!bag_writer_create(&w, path, cfg, &why));
    define(w);
    put_messages(w);
    put_rest(w);
    FUZZ_REQUIRE(!bag_writer_close(w, &why));
    struct bytes_buffer b = seeds_read(path);
    if (strstr(name, "checksums"))
        forget_checksums(&b);
    if (strstr(name, "cut"))
        b.size -= b.size / 3;
    put_both(s, name, bytes_in(&b));
    bytes_free(&b);
}

void seeds_bags(const struct seeds *s)
{
    struct bag_writer_config cfg = {.profile = "anlos", .library = "seeds"};

    put_bag(s, "plain", &cfg);
    put_bag(s, "plain-no-checksums", &cfg);
    cfg.chunk_size = 200;
    put_bag(s, "chunks", &cfg);
    put_bag(s, "chunks-no-checksums", &cfg);
    put_bag(s, "chunks-no-checksums-cut", &cfg);
    cfg.compression = BAG_ZSTD;
    put_bag(s, "zstd-no-checksums", &cfg);
    cfg.compression = BAG_LZ4;
    put_bag(s, "lz4", &cfg);
    put_bag(s, "lz4-no-checksums", &cfg);
    cfg.without_chunk_index = cfg.without_statistics = cfg.without_message_index = true;
    put_bag(s, "lz4-no-checksums-no-summary", &cfg);
}
