/* SPDX-License-Identifier: MIT */
/* Messages as a bag, and what `anlos bag export` makes of it.  What stands in the bag is
 * what went in. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/topic_message.h"
#include "msgs/bag/writer.h"
#include "nodes/anlos/bag/export.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/messages.h"

static void write_bag(const char *path, struct bytes input)
{
    const struct bag_writer_config cfg = {
        .profile = "anlos", .library = "fuzz", .chunk_size = 4096};
    struct error why = {""};
    struct bag_writer *w;
    struct bag_topics *topics;
    struct bytes payload;
    const struct topic *topic;
    struct envelope e = {.node = "fuzz", .epoch_ns = 5};

    FUZZ_REQUIRE(!bag_writer_create(&w, path, &cfg, &why));
    FUZZ_REQUIRE(!bag_topics_create(&topics, w));
    while (messages_next(&input, &topic, &payload)) {
        strcpy(e.topic, topic->name);
        e.publish_ns++;
        e.capture_ns = e.publish_ns / 2;
        e.payload_size = (uint32_t)payload.size;
        FUZZ_REQUIRE(!bag_topics_put(topics, &e, payload.data, NULL, &why));
        e.sequence++;
    }
    bag_topics_destroy(topics);
    FUZZ_REQUIRE(!bag_writer_close(w, &why));
}

static void compare(struct stream *s, struct bytes input)
{
    struct error why = {""};
    struct stream_message m;
    struct bytes payload;
    const struct topic *topic;
    int err;

    while (!(err = stream_next(s, &m, &why))) {
        FUZZ_REQUIRE(messages_next(&input, &topic, &payload));
        FUZZ_REQUIRE(m.topic == topic && bytes_equal(m.payload, payload));
    }
    FUZZ_REQUIRE(err == -ENODATA && !messages_next(&input, &topic, &payload));
}

static void export(struct stream *s, const char *topics,
                   int (*write)(struct stream *, const struct export_options *,
                                struct error *))
{
    struct error why = {""};
    struct export_options o = {
        .file = "in.mcap", .out = fuzz_path("out"), .full = true, .topics = topics};
    size_t n_missing = 0;

    stream_select(s, topics);
    stream_rewind(s);
    int err = write ? write(s, &o, &why) : export_wav(s, &o, &n_missing, &why);
    FUZZ_REQUIRE(!err == !why.text[0]);
    fuzz_remove("out");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const struct bytes input = {data, size};
    const char *path = fuzz_path("in.mcap");
    struct error why = {""};
    struct stream *s;

    write_bag(path, input);
    FUZZ_REQUIRE(!stream_open(&s, path, &why));
    compare(s, input);
    export(s, NULL, export_lines);
    export(s, "detections", export_csv);
    export(s, "volume,detections", export_nrrd_file);
    export(s, "survey,ping", NULL);
    stream_close(s);
    fuzz_remove("in.mcap");
    return 0;
}
