/* SPDX-License-Identifier: MIT */
/* The format's own conformance files, ../shared/data/mcap-conformance: each .mcap with a
 * .json that says what a reader finds in it. */
#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <unistd.h>

#include "../hal/scratch.h"
#include "../optional.h"

#include "msgs/bag/check.h"
#include "msgs/bag/reader.h"
#include "msgs/bag/writer.h"

#define FOLDER SOURCE_DIR "/../shared/data/mcap-conformance"

/* Runs do(path without suffix) for each file; returns how many there are. */
static size_t for_each(void (*check)(const char *stem))
{
    DIR *top = opendir(FOLDER);
    size_t n = 0;
    struct dirent *group, *file;

    if (!top)
        return 0;
    while ((group = readdir(top))) {
        char folder[2048];
        snprintf(folder, sizeof folder, FOLDER "/%s", group->d_name);
        DIR *inner = group->d_name[0] == '.' ? NULL : opendir(folder);
        while (inner && (file = readdir(inner))) {
            char stem[4096];
            char *dot = strrchr(file->d_name, '.');
            if (!dot || strcmp(dot, ".mcap"))
                continue;
            snprintf(stem, sizeof stem, "%s/%.*s", folder, (int)(dot - file->d_name),
                     file->d_name);
            check(stem);
            n++;
        }
        if (inner)
            closedir(inner);
    }
    closedir(top);
    return n;
}

static json_t *load(const char *stem)
{
    char path[4200];
    json_error_t error;

    snprintf(path, sizeof path, "%s.json", stem);
    json_t *o = json_load_file(path, 0, &error);
    if (!o)
        fail_msg("%s: %s", path, error.text);
    return o;
}

static void set(json_t *fields, const char *name, json_t *value)
{
    json_array_append_new(fields, json_pack("[so]", name, value));
}

static json_t *number(uint64_t value)
{
    char text[24];

    snprintf(text, sizeof text, "%" PRIu64, value);
    return json_string(text);
}

static json_t *text(struct bytes b)
{
    return json_stringn((const char *)b.data, b.size);
}

static json_t *octets(struct bytes b)
{
    json_t *list = json_array();

    for (size_t i = 0; i < b.size; i++)
        json_array_append_new(list, number(b.data[i]));
    return list;
}

static json_t *map(struct bytes b)
{
    json_t *o = json_object();
    struct bytes key, value;

    while (bag_map_next(&b, &key, &value))
        json_object_setn_new(o, (const char *)key.data, key.size, text(value));
    return o;
}

static json_t *counts(struct bytes b)
{
    json_t *o = json_object();
    uint64_t key, value;

    while (bag_list_next(&b, 2, &key, &value)) {
        char name[24];
        snprintf(name, sizeof name, "%" PRIu64, key);
        json_object_set_new(o, name, number(value));
    }
    return o;
}

static const char *summary_fields(json_t *f, const struct bag_record *r)
{
    switch (r->opcode) {
    case BAG_CHUNK_INDEX:
        set(f, "chunk_length", number(r->chunk_index.chunk_length));
        set(f, "chunk_start_offset", number(r->chunk_index.chunk_start_offset));
        set(f, "compressed_size", number(r->chunk_index.compressed_size));
        set(f, "compression", text(r->chunk_index.compression));
        set(f, "message_end_time", number(r->chunk_index.message_end_time));
        set(f, "message_index_length", number(r->chunk_index.message_index_length));
        set(f, "message_index_offsets", counts(r->chunk_index.message_index_offsets));
        set(f, "message_start_time", number(r->chunk_index.message_start_time));
        set(f, "uncompressed_size", number(r->chunk_index.uncompressed_size));
        return "ChunkIndex";
    case BAG_ATTACHMENT_INDEX:
        set(f, "create_time", number(r->attachment_index.create_time));
        set(f, "data_size", number(r->attachment_index.data_size));
        set(f, "length", number(r->attachment_index.length));
        set(f, "log_time", number(r->attachment_index.log_time));
        set(f, "media_type", text(r->attachment_index.media_type));
        set(f, "name", text(r->attachment_index.name));
        set(f, "offset", number(r->attachment_index.offset));
        return "AttachmentIndex";
    case BAG_STATISTICS:
        set(f, "attachment_count", number(r->statistics.attachment_count));
        set(f, "channel_count", number(r->statistics.channel_count));
        set(f, "channel_message_counts", counts(r->statistics.channel_message_counts));
        set(f, "chunk_count", number(r->statistics.chunk_count));
        set(f, "message_count", number(r->statistics.message_count));
        set(f, "message_end_time", number(r->statistics.message_end_time));
        set(f, "message_start_time", number(r->statistics.message_start_time));
        set(f, "metadata_count", number(r->statistics.metadata_count));
        set(f, "schema_count", number(r->statistics.schema_count));
        return "Statistics";
    case BAG_METADATA_INDEX:
        set(f, "length", number(r->metadata_index.length));
        set(f, "name", text(r->metadata_index.name));
        set(f, "offset", number(r->metadata_index.offset));
        return "MetadataIndex";
    case BAG_SUMMARY_OFFSET:
        set(f, "group_length", number(r->summary_offset.group_length));
        set(f, "group_opcode", number(r->summary_offset.group_opcode));
        set(f, "group_start", number(r->summary_offset.group_start));
        return "SummaryOffset";
    case BAG_FOOTER:
        set(f, "summary_crc", number(r->footer.summary_crc));
        set(f, "summary_offset_start", number(r->footer.summary_offset_start));
        set(f, "summary_start", number(r->footer.summary_start));
        return "Footer";
    }
    return NULL;
}

static const char *data_fields(json_t *f, const struct bag_record *r)
{
    switch (r->opcode) {
    case BAG_HEADER:
        set(f, "library", text(r->header.library));
        set(f, "profile", text(r->header.profile));
        return "Header";
    case BAG_SCHEMA:
        set(f, "data", octets(r->schema.data));
        set(f, "encoding", text(r->schema.encoding));
        set(f, "id", number(r->schema.id));
        set(f, "name", text(r->schema.name));
        return "Schema";
    case BAG_CHANNEL:
        set(f, "id", number(r->channel.id));
        set(f, "message_encoding", text(r->channel.message_encoding));
        set(f, "metadata", map(r->channel.metadata));
        set(f, "schema_id", number(r->channel.schema_id));
        set(f, "topic", text(r->channel.topic));
        return "Channel";
    case BAG_MESSAGE:
        set(f, "channel_id", number(r->message.channel_id));
        set(f, "data", octets(r->message.data));
        set(f, "log_time", number(r->message.log_time));
        set(f, "publish_time", number(r->message.publish_time));
        set(f, "sequence", number(r->message.sequence));
        return "Message";
    case BAG_ATTACHMENT:
        set(f, "create_time", number(r->attachment.create_time));
        set(f, "data", octets(r->attachment.data));
        set(f, "log_time", number(r->attachment.log_time));
        set(f, "media_type", text(r->attachment.media_type));
        set(f, "name", text(r->attachment.name));
        return "Attachment";
    case BAG_METADATA:
        set(f, "metadata", map(r->metadata.metadata));
        set(f, "name", text(r->metadata.name));
        return "Metadata";
    case BAG_DATA_END:
        set(f, "data_section_crc", number(r->data_end.data_section_crc));
        return "DataEnd";
    }
    return NULL;
}

static void add(json_t *records, const struct bag_record *r)
{
    json_t *fields = json_array();
    const char *type = data_fields(fields, r);

    if (!type)
        type = summary_fields(fields, r);
    if (type)
        json_array_append_new(records,
                              json_pack("{s:s,s:O}", "type", type, "fields", fields));
    json_decref(fields);
}

static void check_reading(const char *stem)
{
    char path[4200];
    struct bag_reader *r;
    struct bag_record record;
    struct error why = {""};
    json_t *found = json_array(), *wanted = load(stem);
    int err;

    snprintf(path, sizeof path, "%s.mcap", stem);
    if (bag_reader_open(&r, path, &why))
        fail_msg("%s", why.text);
    while (!(err = bag_reader_next(r, &record, &why)))
        add(found, &record);
    if (err != -ENODATA)
        fail_msg("%s", why.text);
    if (!json_equal(found, json_object_get(wanted, "records"))) {
        json_dumpf(found, stderr, JSON_INDENT(1));
        fail_msg("%s: other records than its JSON says", path);
    }
    bag_reader_close(r);
    json_decref(found);
    json_decref(wanted);
}

static void every_file_is_read_as_its_json_says(void **state)
{
    (void)state;
    optional_needs(FOLDER);
    assert_int_equal(for_each(check_reading), 416);
}

static void print_fault(void *context, uint64_t offset, const char *what)
{
    print_message("%s: byte %" PRIu64 ": %s\n", (const char *)context, offset, what);
}

static void check_faultless(const char *stem)
{
    char path[4200];
    struct error why = {""};
    uint64_t n_faults;
    const struct bag_check_watch watch = {.fault = print_fault, .context = path};

    snprintf(path, sizeof path, "%s.mcap", stem);
    assert_int_equal(bag_check(&n_faults, path, &watch, &why), 0);
    assert_int_equal(n_faults, 0);
}

static void no_fault_is_found_in_any(void **state)
{
    (void)state;
    optional_needs(FOLDER);
    assert_int_equal(for_each(check_faultless), 416);
}

static const json_t *field(const json_t *fields, const char *name)
{
    size_t i;
    json_t *pair;

    json_array_foreach(fields, i,
                       pair) if (!strcmp(json_string_value(json_array_get(pair, 0)),
                                         name)) return json_array_get(pair, 1);
    fail_msg("no field %s", name);
    return NULL;
}

static uint64_t number_in(const json_t *fields, const char *name)
{
    return strtoull(json_string_value(field(fields, name)), NULL, 10);
}

static struct bytes text_in(const json_t *fields, const char *name)
{
    return bytes_of(json_string_value(field(fields, name)));
}

static struct bytes octets_in(const json_t *fields, uint8_t *out)
{
    const json_t *list = field(fields, "data");
    size_t n = json_array_size(list);

    for (size_t i = 0; i < n; i++)
        out[i] = (uint8_t)atoi(json_string_value(json_array_get(list, i)));
    return (struct bytes){out, n};
}

static struct bytes map_in(const json_t *fields, struct bytes_buffer *out)
{
    const char *key;
    json_t *value;

    json_object_foreach((json_t *)field(fields, "metadata"), key, value)
        bag_map_put(out, bytes_of(key), bytes_of(json_string_value(value)));
    return bytes_in(out);
}

static void write_record(struct bag_writer *w, const char *type, const json_t *f)
{
    struct error why = {""};
    struct bytes_buffer pairs = {0};
    uint8_t data[256];
    uint16_t id;
    int err = 0;

    if (!strcmp(type, "Schema"))
        err = bag_writer_schema(w,
                                &(struct bag_schema){.name = text_in(f, "name"),
                                                     .encoding = text_in(f, "encoding"),
                                                     .data = octets_in(f, data)},
                                &id, &why);
    else if (!strcmp(type, "Channel"))
        err = bag_writer_channel(
            w,
            &(struct bag_channel){.schema_id = (uint16_t)number_in(f, "schema_id"),
                                  .topic = text_in(f, "topic"),
                                  .message_encoding = text_in(f, "message_encoding"),
                                  .metadata = map_in(f, &pairs)},
            &id, &why);
    else if (!strcmp(type, "Message"))
        err = bag_writer_message(
            w,
            &(struct bag_message){.channel_id = (uint16_t)number_in(f, "channel_id"),
                                  .sequence = (uint32_t)number_in(f, "sequence"),
                                  .log_time = number_in(f, "log_time"),
                                  .publish_time = number_in(f, "publish_time"),
                                  .data = octets_in(f, data)},
            &why);
    else if (!strcmp(type, "Attachment"))
        err = bag_writer_attachment(
            w,
            &(struct bag_attachment){.log_time = number_in(f, "log_time"),
                                     .create_time = number_in(f, "create_time"),
                                     .name = text_in(f, "name"),
                                     .media_type = text_in(f, "media_type"),
                                     .data = octets_in(f, data)},
            &why);
    else if (!strcmp(type, "Metadata"))
        err = bag_writer_metadata(w,
                                  &(struct bag_metadata){.name = text_in(f, "name"),
                                                         .metadata = map_in(f, &pairs)},
                                  &why);
    if (err)
        fail_msg("%s: %s", type, why.text);
    bytes_free(&pairs);
}

static struct bag_writer_config config_of(const json_t *wanted)
{
    json_t *features = json_object_get(
        json_object_get(json_object_get(wanted, "meta"), "variant"), "features");
    struct bag_writer_config cfg = {.profile = "", .library = ""};
    bool chunked = false;
    bool has[8] = {false};
    static const char *const names[] = {"mx",  "chx", "st", "sum",
                                        "rsh", "rch", "ax", "mdx"};
    size_t i;
    json_t *name;

    json_array_foreach(features, i, name)
    {
        chunked |= !strcmp(json_string_value(name), "ch");
        for (size_t k = 0; k < 8; k++)
            has[k] |= !strcmp(json_string_value(name), names[k]);
    }
    cfg.chunk_size = chunked ? 1 << 20 : 0;
    cfg.without_message_index = !has[0];
    cfg.without_chunk_index = !has[1];
    cfg.without_statistics = !has[2];
    cfg.without_summary_offsets = !has[3];
    cfg.without_schemas = !has[4];
    cfg.without_channels = !has[5];
    cfg.without_attachment_index = !has[6];
    cfg.without_metadata_index = !has[7];
    return cfg;
}

static size_t slurp(const char *path, uint8_t *out, size_t max)
{
    FILE *f = fopen(path, "rb");

    assert_non_null(f);
    size_t n = fread(out, 1, max, f);
    fclose(f);
    return n;
}

static char made[512]; /* the bag that is written */

static void check_writing(const char *stem)
{
    static uint8_t expected[1 << 16], written[1 << 16];
    char path[4200];
    struct bag_writer *w;
    struct error why = {""};
    json_t *wanted = load(stem), *record;
    struct bag_writer_config cfg = config_of(wanted);
    size_t i;

    if (!strstr(stem, "-pad")) {
        unlink(made);
        if (bag_writer_create(&w, made, &cfg, &why))
            fail_msg("%s", why.text);
        json_array_foreach(json_object_get(wanted, "records"), i, record)
        {
            const char *type = json_string_value(json_object_get(record, "type"));
            if (!strcmp(type, "DataEnd"))
                break;
            write_record(w, type, json_object_get(record, "fields"));
        }
        assert_int_equal(bag_writer_close(w, &why), 0);
        snprintf(path, sizeof path, "%s.mcap", stem);
        size_t n = slurp(path, expected, sizeof expected);
        if (slurp(made, written, sizeof written) != n || memcmp(expected, written, n))
            fail_msg("%s: other bytes", path);
        unlink(made);
    }
    json_decref(wanted);
}

static void what_is_written_is_what_others_write(void **state)
{
    optional_needs(FOLDER);
    snprintf(made, sizeof made, "%s", scratch_path(*state, "made.mcap"));
    assert_int_equal(for_each(check_writing), 416);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_file_is_read_as_its_json_says),
        cmocka_unit_test(no_fault_is_found_in_any),
        cmocka_unit_test_setup_teardown(what_is_written_is_what_others_write,
                                        scratch_open, scratch_close),
    };
    return optional_code(cmocka_run_group_tests(tests, NULL, NULL));
}
