#include "nodes/anlos/bag/info_print.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <time.h>

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

static int print_metadata(const struct bag_catalog *bag, struct complaint *why)
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

static int finish(struct complaint *why)
{
    return fflush(stdout) || ferror(stdout) ? complain(why, -EIO, "stdout: cannot write")
                                            : 0;
}

int info_print(const struct bag_catalog *bag, const struct contents *c,
               struct complaint *why)
{
    print_head(bag, c);
    print_topics(c);
    print_attachments(bag);
    int err = print_metadata(bag, why);
    return err ? err : finish(why);
}
