/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/bag/bag.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "msgs/bag/reader.h"
#include "msgs/bag/topic_message.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/json_whole.h"
#include "nodes/rt/stop.h"

/* -- how much of each topic is in a bag -------------------------------------------------
 */

struct entry {
    uint16_t channel_id;
    uint64_t log_time, offset;
};

struct entries {        /* of a chunk */
    struct entry *list; /* [n] */
    size_t n, room;
    uint64_t left; /* bytes of indexes that may still be read: indexes that are named
                    * again and again would become endless */
};

static void add_name(struct topic_contents *t, const char *node)
{
    size_t used = strlen(t->from), n = strlen(node);

    for (const char *at = t->from; (at = strstr(at, node)); at++)
        if ((at == t->from || at[-1] == ' ') && (at[n] == ' ' || !at[n]))
            return;
    snprintf(t->from + used, sizeof t->from - used, "%s%s", used ? " " : "", node);
}

/* Rows by their name and type: slots of index + 1, 0: free.  There can be 65535 channels,
 * which are too many to compare each with each. */
enum { N_SLOTS = 1 << 17 };

static uint32_t hash_of(struct bytes name, struct bytes type)
{
    return bag_crc(bag_crc(0, name), type) % N_SLOTS;
}

/* The row of a name and type; it is added when there is none yet. */
static size_t find_row(struct contents *out, uint32_t *slots, struct bytes name,
                       struct bytes type)
{
    uint32_t at = hash_of(name, type);

    for (; slots[at]; at = (at + 1) % N_SLOTS) {
        const struct topic_contents *t = &out->topics[slots[at] - 1];
        if (bytes_equal(t->name, name) && bytes_equal(t->type, type))
            return slots[at] - 1;
    }
    out->topics[out->n++] = (struct topic_contents){.name = name, .type = type};
    slots[at] = (uint32_t)out->n;
    return out->n - 1;
}

/* Channels of one topic and type are one row. */
static int list_topics(struct contents *out, const struct bag_catalog *c)
{
    uint32_t *slots = calloc(N_SLOTS, sizeof *slots);

    out->topics = calloc(c->n_channels + 1, sizeof *out->topics);
    if (!out->topics || !slots) {
        free(slots);
        return -ENOMEM;
    }
    for (size_t i = 0; i < c->n_channels; i++) {
        const struct bag_channel *h = &c->channels[i].record.channel;
        const struct bag_schema *s = bag_catalog_schema(c, h->schema_id);
        struct bytes type = s ? s->name : (struct bytes){NULL, 0};
        struct bag_source source;
        size_t row = find_row(out, slots, h->topic, type);
        if (!bag_source_of(&source, h))
            add_name(&out->topics[row], source.node);
        out->topic_of[h->id] = (uint16_t)row;
    }
    free(slots);
    return 0;
}

static void count(struct contents *out, uint16_t channel_id, uint64_t log_time,
                  uint64_t n_bytes)
{
    struct topic_contents *t = &out->topics[out->topic_of[channel_id]];

    if (!t->n_messages || log_time < t->first_time)
        t->first_time = log_time;
    if (!t->n_messages || log_time > t->last_time)
        t->last_time = log_time;
    t->n_messages++;
    t->n_bytes += n_bytes;
}

static int add_entries(struct entries *e, const struct bag_message_index *index)
{
    struct bytes list = index->entries;
    size_t n = list.size / 16;

    if (e->n + n > e->room) {
        size_t room = 2 * (e->n + n);
        struct entry *grown = realloc(e->list, room * sizeof *grown);
        if (!grown)
            return -ENOMEM;
        e->list = grown;
        e->room = room;
    }
    for (; n; n--) {
        struct entry *to = &e->list[e->n++];
        to->channel_id = index->channel_id;
        bag_list_next(&list, 8, &to->log_time, &to->offset);
    }
    return 0;
}

static int compare_entries(const void *a, const void *b)
{
    const struct entry *x = a, *y = b;

    return x->offset < y->offset ? -1 : x->offset > y->offset;
}

/* A message reaches to the next one: definitions that stand between count with it. */
static void count_entries(struct contents *out, const struct bag_catalog *c,
                          struct entries *e, uint64_t end)
{
    if (e->n)
        qsort(e->list, e->n, sizeof *e->list, compare_entries);
    for (size_t i = 0; i < e->n; i++) {
        uint64_t next = i + 1 < e->n ? e->list[i + 1].offset : end;
        if (bag_catalog_channel(c, e->list[i].channel_id) && next >= e->list[i].offset)
            count(out, e->list[i].channel_id, e->list[i].log_time,
                  next - e->list[i].offset);
    }
    e->n = 0;
}

/* A chunk by its message indexes.  -EBADMSG: they are not there, or wrong. */
static int read_chunk(struct contents *out, const struct bag_catalog *c,
                      const struct bag_chunk_index *k, struct entries *e,
                      struct bytes_buffer *bytes)
{
    struct bytes list = k->message_index_offsets;
    uint64_t id, offset;
    int err = !list.size && (k->message_start_time || k->message_end_time) ? -EBADMSG : 0;

    while (!err && bag_list_next(&list, 2, &id, &offset)) {
        struct bag_record r;
        err = bag_file_record(&c->file, offset, bytes, NULL);
        if (err)
            break;
        if (bytes->size > e->left)
            return -EBADMSG;
        e->left -= bytes->size;
        struct bytes_cursor whole = {.left = bytes_in(bytes)};
        err = bag_record_take(&whole, &r);
        if (!err)
            err = r.opcode == BAG_MESSAGE_INDEX && r.message_index.channel_id == id
                      ? add_entries(e, &r.message_index)
                      : -EBADMSG;
    }
    if (!err)
        count_entries(out, c, e, k->uncompressed_size);
    return err;
}

static int read_indexes(struct contents *out, const struct bag_catalog *c)
{
    struct entries e = {.left = c->file.size};
    struct bytes_buffer bytes = {0};
    uint64_t n = 0;
    int err = c->scanned ? -EBADMSG : 0;

    for (size_t i = 0; i < c->n_chunks && !err; i++)
        err = read_chunk(out, c, &c->chunks[i].record.chunk_index, &e, &bytes);
    for (size_t i = 0; i < out->n; i++)
        n += out->topics[i].n_messages;
    if (!err && n != c->n_messages)
        err = -EBADMSG;
    free(e.list);
    bytes_free(&bytes);
    return err == -ENOTSUP || err == -EFBIG ? -EBADMSG : err;
}

static int read_all(struct contents *out, const struct bag_catalog *c, struct error *why)
{
    struct bag_reader *r;
    struct bag_record record;
    int err = bag_reader_open(&r, c->file.path, why);

    if (err)
        return err;
    while (!(err = bag_reader_next(r, &record, why))) {
        const struct bag_message *m = &record.message;
        if (interrupt_requested()) {
            err = error_say(why, -EINTR, "%s: interrupted", c->file.path);
            break;
        }
        if (record.opcode == BAG_MESSAGE && bag_catalog_channel(c, m->channel_id))
            count(out, m->channel_id, m->log_time,
                  m->data.size + BAG_RECORD_HEAD_SIZE + 22);
    }
    bag_reader_close(r);
    return err == -ENODATA ? 0 : err;
}

int contents_read(struct contents *out, const struct bag_catalog *c, struct error *why)
{
    memset(out, 0, sizeof *out);
    int err = list_topics(out, c);
    if (!err)
        err = read_indexes(out, c);
    if (err == -EBADMSG) {
        contents_clear(out);
        err = list_topics(out, c);
        if (!err)
            err = read_all(out, c, why);
    }
    for (size_t i = 0; i < c->n_chunks; i++) {
        const struct bag_chunk_index *k = &c->chunks[i].record.chunk_index;
        out->packed_bytes += k->compressed_size;
        out->plain_bytes += k->uncompressed_size;
    }
    if (c->n_chunks)
        out->compression = c->chunks[0].record.chunk_index.compression;
    return err == -ENOMEM ? error_say(why, err, "%s: out of memory", c->file.path) : err;
}

void contents_clear(struct contents *c)
{
    free(c->topics);
    memset(c, 0, sizeof *c);
}

double topic_rate_hz(const struct topic_contents *t)
{
    return t->last_time > t->first_time
               ? (double)(t->n_messages - 1) /
                     (1e-9 * (double)(t->last_time - t->first_time))
               : 0.0;
}

/* From the first message to the last. */
static double contents_duration_s(const struct bag_catalog *bag)
{
    return 1e-9 * (double)(bag->end_time - bag->start_time);
}

/* By how much compression made the chunks smaller; 1 where that is not known. */
static double contents_ratio(const struct contents *c)
{
    return c->packed_bytes ? (double)c->plain_bytes / (double)c->packed_bytes : 1.0;
}

/* -- what is in a bag, on stdout --------------------------------------------------------
 */

/* What a file says of itself is not for a terminal to obey. */
static void print_text(struct bytes text)
{
    for (size_t i = 0; i < text.size; i++)
        putchar(text.data[i] >= 0x20 && text.data[i] != 0x7f ? text.data[i] : '?');
}

static int print_padded(struct bytes text, int width)
{
    print_text(text);
    return printf("%*s", text.size < (size_t)width ? width - (int)text.size : 0, "");
}

static void print_time(uint64_t ns)
{
    time_t s = (time_t)(ns / 1000000000u);
    struct tm tm;
    char text[40];

    gmtime_r(&s, &tm);
    strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", &tm);
    printf("%s.%03u", text, (unsigned)(ns / 1000000u % 1000u));
}

static void format_size(uint64_t n, char out[24])
{
    static const char *const units[] = {"B", "kB", "MB", "GB", "TB"};
    double size = (double)n;
    int unit = 0;

    for (; size >= 1000.0 && unit < 4; unit++)
        size /= 1000.0;
    snprintf(out, 24, unit ? "%.1f %s" : "%.0f %s", size, units[unit]);
}

static void print_head(const struct bag_catalog *bag, const struct contents *c)
{
    char size[24];

    format_size(bag->file.size, size);
    printf("file        %s, %s, by ", bag->file.path, size);
    print_text(bag->header.record.header.library);
    printf("\n");
    if (bag->n_messages) {
        printf("time        ");
        print_time(bag->start_time);
        printf(" to ");
        print_time(bag->end_time);
        printf(" UTC, %.1f s\n", contents_duration_s(bag));
    }
    printf("messages    %" PRIu64, bag->n_messages);
    if (bag->n_chunks) {
        printf(" in %zu chunk%s, ", bag->n_chunks, bag->n_chunks == 1 ? "" : "s");
        if (c->compression.size) {
            print_text(c->compression);
            printf(" %.2f : 1", contents_ratio(c));
        } else {
            printf("not compressed");
        }
    }
    printf("\n");
    if (bag->scanned)
        printf("summary     missing or damaged: the whole file was looked through\n");
}

static void print_topics(const struct contents *c)
{
    size_t width[2] = {14, 20};
    char size[24];

    for (size_t i = 0; i < c->n; i++) {
        const struct bytes *text[2] = {&c->topics[i].name, &c->topics[i].type};
        for (int k = 0; k < 2; k++)
            if (text[k]->size > width[k] && text[k]->size < 60)
                width[k] = text[k]->size;
    }
    printf("\n%-*s %-*s %9s %12s %10s  %s\n", (int)width[0], "topic", (int)width[1],
           "type", "messages", "rate", "size", "from");
    for (size_t i = 0; i < c->n; i++) {
        const struct topic_contents *t = &c->topics[i];
        char rate[24] = "-";
        if (topic_rate_hz(t) > 0.0)
            snprintf(rate, sizeof rate, "%.1f Hz", topic_rate_hz(t));
        format_size(t->n_bytes, size);
        print_padded(t->name, (int)width[0]);
        putchar(' ');
        print_padded(t->type, (int)width[1]);
        printf(" %9" PRIu64 " %12s %10s  %s\n", t->n_messages, rate, size, t->from);
    }
}

static void print_attachments(const struct bag_catalog *bag)
{
    char size[24];

    if (bag->n_attachments)
        printf("\n%-30s %-26s %10s\n", "attachment", "media type", "size");
    for (size_t i = 0; i < bag->n_attachments; i++) {
        const struct bag_attachment_index *a =
            &bag->attachments[i].record.attachment_index;
        format_size(a->data_size, size);
        print_padded(a->name, 30);
        putchar(' ');
        print_padded(a->media_type, 26);
        printf(" %10s\n", size);
    }
}

static int print_metadata(const struct bag_catalog *bag, struct error *why)
{
    struct bytes_buffer bytes = {0};
    struct bag_record r;
    int err = 0;

    if (bag->n_metadata)
        printf("\nmetadata\n");
    for (size_t i = 0; i < bag->n_metadata && !err; i++) {
        struct bytes map, key, value;
        err = bag_catalog_read(bag, &bag->metadata[i].record, &bytes, &r, why);
        if (err)
            break;
        for (map = r.metadata.metadata; bag_map_next(&map, &key, &value);) {
            print_text(r.metadata.name);
            putchar('.');
            print_text(key);
            printf(" = ");
            print_text(value);
            putchar('\n');
        }
    }
    bytes_free(&bytes);
    return err;
}

/* 0, errors of bag_catalog_read, -ENOMEM. */
static int info_print(const struct bag_catalog *bag, const struct contents *c,
                      struct error *why)
{
    print_head(bag, c);
    print_topics(c);
    print_attachments(bag);
    return print_metadata(bag, why);
}

/* What is not UTF-8 becomes null. */
static json_t *text_json(struct bytes text)
{
    json_t *j = json_stringn(text.size ? (const char *)text.data : "", text.size);

    return j ? j : json_null();
}

/* Times are ns since 1970: more than a double holds, so as text. */
static json_t *time_json(uint64_t ns)
{
    return json_sprintf("%" PRIu64, ns);
}

static json_t *topics_json(const struct contents *c)
{
    json_t *array = json_array();

    for (size_t i = 0; i < c->n; i++) {
        const struct topic_contents *t = &c->topics[i];
        json_array_append_new(array,
                              json_pack("{so, so, sI, sf, sI, so, so, ss}", "topic",
                                        text_json(t->name), "type", text_json(t->type),
                                        "messages", (json_int_t)t->n_messages, "rate_hz",
                                        topic_rate_hz(t), "bytes", (json_int_t)t->n_bytes,
                                        "first_ns", time_json(t->first_time), "last_ns",
                                        time_json(t->last_time), "from", t->from));
    }
    return array;
}

static json_t *attachments_json(const struct bag_catalog *bag)
{
    json_t *array = json_array();

    for (size_t i = 0; i < bag->n_attachments; i++) {
        const struct bag_attachment_index *a =
            &bag->attachments[i].record.attachment_index;
        json_array_append_new(array, json_pack("{so, so, sI}", "name", text_json(a->name),
                                               "media_type", text_json(a->media_type),
                                               "bytes", (json_int_t)a->data_size));
    }
    return array;
}

static int metadata_json(const struct bag_catalog *bag, json_t *array, struct error *why)
{
    struct bytes_buffer bytes = {0};
    struct bag_record r;
    int err = 0;

    for (size_t i = 0; i < bag->n_metadata && !err; i++) {
        struct bytes map, key, value;
        err = bag_catalog_read(bag, &bag->metadata[i].record, &bytes, &r, why);
        if (err)
            break;
        json_t *pairs = json_object();
        for (map = r.metadata.metadata; bag_map_next(&map, &key, &value);)
            json_object_setn_new(pairs, key.size ? (const char *)key.data : "", key.size,
                                 text_json(value));
        json_array_append_new(
            array,
            json_pack("{so, so}", "name", text_json(r.metadata.name), "values", pairs));
    }
    bytes_free(&bytes);
    return err;
}

static int info_print_json(const struct bag_catalog *bag, const struct contents *c,
                           struct error *why)
{
    json_t *metadata = json_array();
    int err = metadata_json(bag, metadata, why);

    if (err) {
        json_decref(metadata);
        return err;
    }
    json_t *o = json_pack(
        "{ss, sI, so, sI, so, so, sf, sI, so, sf, sb, so, so, so}", "file",
        bag->file.path, "bytes", (json_int_t)bag->file.size, "library",
        text_json(bag->header.record.header.library), "messages",
        (json_int_t)bag->n_messages, "start_ns", time_json(bag->start_time), "end_ns",
        time_json(bag->end_time), "duration_s", contents_duration_s(bag), "chunks",
        (json_int_t)bag->n_chunks, "compression", text_json(c->compression),
        "compression_ratio", contents_ratio(c), "summary", !bag->scanned, "topics",
        topics_json(c), "attachments", attachments_json(bag), "metadata", metadata);
    if (!json_whole(o))
        err = error_say(why, -ENOMEM, "out of memory");
    else if (json_dumpf(o, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9)) &&
             !ferror(stdout))
        err = error_say(why, -ENOMEM, "out of memory");
    putchar('\n');
    json_decref(o);
    return err;
}

static const char help[] =
    "anlos bag info -- what is in a bag\n"
    "\n"
    "usage: anlos bag info FILE [--json]\n"
    "\n"
    "Prints times, size and compression; each topic with its type, messages, rate, size\n"
    "before compression and the nodes that it is from; attachments and metadata.\n"
    "\n"
    "  --json          the same as JSON\n"
    "  --help          this text\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments, or no bag, or a damaged one; 130 "
    "stopped\n"
    "by Ctrl-C\n";

static const struct usage_option options[] = {
    {"json", USAGE_SWITCH('j')},
    {.name = NULL},
};

static int print(const char *path, bool json)
{
    struct bag_catalog *catalog = NULL;
    struct contents *contents = malloc(sizeof *contents);
    struct error why = {""};

    if (!contents)
        return verb_end("info", -ENOMEM, &why);
    interrupt_catch();
    int err = bag_catalog_open(&catalog, path, &why);
    if (!err) {
        err = contents_read(contents, catalog, &why);
        if (!err)
            err = json ? info_print_json(catalog, contents, &why)
                       : info_print(catalog, contents, &why);
        contents_clear(contents);
    }
    bag_catalog_close(catalog);
    free(contents);
    return err ? verb_end("info", err, &why) : usage_flush("bag info");
}

int bag_info(int argc, char **argv)
{
    struct usage usage = {.command = "bag info", .help = help, .options = options};
    bool json = false;
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        json = true;
    if (code)
        return ~code;
    code = verb_one_operand("bag info", "FILE", argc, argv);
    if (code)
        return code;
    return print(argv[optind], json);
}
