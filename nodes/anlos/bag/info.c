#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/contents.h"
#include "nodes/anlos/bag/verb.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/usage.h"

/* What is in a bag, on stdout. */

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

static int finish(struct error *why)
{
    return fflush(stdout) || ferror(stdout) ? error_say(why, -EIO, "stdout: cannot write")
                                            : 0;
}

/* 0, errors of bag_catalog_read, -EIO (stdout), -ENOMEM. */
static int info_print(const struct bag_catalog *bag, const struct contents *c,
                      struct error *why)
{
    print_head(bag, c);
    print_topics(c);
    print_attachments(bag);
    int err = print_metadata(bag, why);
    return err ? err : finish(why);
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
    err = !o || json_dumpf(o, stdout, JSON_INDENT(2)) || putchar('\n') == EOF
              ? error_say(why, -EIO, "stdout: cannot write")
              : 0;
    json_decref(o);
    return err || !fflush(stdout) ? err : error_say(why, -EIO, "stdout: cannot write");
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

static const struct option options[] = {
    {"json", no_argument, NULL, 'j'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
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
    return verb_end("info", err, &why);
}

int bag_info(int argc, char **argv)
{
    bool json = false;
    int code;

    opterr = 0;
    optind = 1;
    while ((code = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
        if (code == 'h')
            return fputs(help, stdout) < 0 ? EXIT_FAILED : EXIT_WORKED;
        if (code != 'j')
            return usage_option_error("bag info", code, argv, options);
        json = true;
    }
    code = verb_one_operand("bag info", "FILE", argc, argv);
    if (code)
        return code;
    return print(argv[optind], json);
}
