/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/bag/bag.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/copy.h"
#include "msgs/bag/cursor.h"
#include "msgs/bag/topic_message.h"
#include "msgs/shuffle.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/stop.h"

struct input {
    struct bag_cursor *cursor;
    struct bag_message next;
    bool ended;
};

struct run {
    const struct selection *selection;
    struct bag_catalog **catalogs; /* [n_files] */
    struct input *inputs;          /* [n_files] */
    struct bag_writer *writer;
    struct bag_copy *copy;
    struct bytes_buffer reordered;
    uint64_t from, to; /* log times */
};

static int open_all(struct run *r, struct error *why)
{
    const struct selection *s = r->selection;
    int err = 0;

    r->catalogs = calloc(s->n_files, sizeof(struct bag_catalog *));
    r->inputs = calloc(s->n_files, sizeof *r->inputs);
    if (!r->catalogs || !r->inputs)
        return error_say(why, -ENOMEM, "out of memory");
    for (size_t i = 0; i < s->n_files && !err; i++)
        err = bag_catalog_open(&r->catalogs[i], s->files[i], why);
    return err;
}

static int check_patterns(const struct run *r, struct error *why)
{
    const struct selection *s = r->selection;
    char stray[64];

    if (verb_finds_stray(s->topics, r->catalogs, s->n_files, stray) ||
        verb_finds_stray(s->exclude, r->catalogs, s->n_files, stray))
        return error_say(why, -EINVAL,
                         "no topic is called \"%s\"; 'anlos bag info' has their "
                         "names",
                         stray);
    return 0;
}

static uint64_t after(uint64_t time, double s)
{
    double ns = 1e9 * s, room = (double)(UINT64_MAX - time);

    return ns < room ? time + (uint64_t)llround(fmin(ns, 9e18)) : UINT64_MAX;
}

static void set_times(struct run *r)
{
    const struct selection *s = r->selection;
    uint64_t first = UINT64_MAX;

    for (size_t i = 0; i < s->n_files; i++)
        if (r->catalogs[i]->n_messages && r->catalogs[i]->start_time < first)
            first = r->catalogs[i]->start_time;
    r->from = after(first, s->start_s);
    r->to = after(first, s->end_s);
}

static int advance(struct input *in, struct error *why)
{
    int err = bag_cursor_next(in->cursor, &in->next, why);

    in->ended = err != 0;
    return err == -ENODATA ? 0 : err;
}

static int start_input(struct run *r, size_t i, struct error *why)
{
    const struct selection *s = r->selection;
    const struct bag_catalog *c = r->catalogs[i];

    if (bag_cursor_create(&r->inputs[i].cursor, c) || bag_copy_add(r->copy, c))
        return error_say(why, -ENOMEM, "out of memory");
    for (size_t k = 0; k < c->n_channels; k++) {
        const struct bag_channel *h = &c->channels[k].record.channel;
        bag_cursor_select(r->inputs[i].cursor, h->id,
                          verb_matches(s->topics, h->topic) &&
                              !(s->exclude && verb_matches(s->exclude, h->topic)));
    }
    bag_cursor_seek(r->inputs[i].cursor, r->from);
    int err = bag_copy_rest(r->copy, i, why);
    return err ? err : advance(&r->inputs[i], why);
}

/* The input whose message comes first; n_files: all have ended. */
static size_t first_input(const struct run *r)
{
    size_t n = r->selection->n_files, best = n;

    for (size_t i = 0; i < n; i++)
        if (!r->inputs[i].ended &&
            (best == n || r->inputs[i].next.log_time < r->inputs[best].next.log_time))
            best = i;
    return best;
}

/* Sound or an image that a recorder of ours wrote; NULL: it is none. */
static const struct topic *shuffled_topic(const struct run *r, size_t i)
{
    const struct bag_channel *h =
        bag_catalog_channel(r->catalogs[i], r->inputs[i].next.channel_id);
    struct bag_source source;

    return h && !bag_source_of(&source, h) && bag_topic_is_shuffled(source.topic)
               ? source.topic
               : NULL;
}

/* What is none of its schema is kept as it is. */
static int copy_message(struct run *r, size_t i, struct error *why)
{
    struct bag_message m = r->inputs[i].next;
    const enum selection_order order = r->selection->order;
    const struct topic *t = order == ORDER_KEPT ? NULL : shuffled_topic(r, i);

    bool shuffled = order == ORDER_SHUFFLED;
    int err = t ? payload_shuffle(&r->reordered, t->schema, m.data, shuffled) : -EINVAL;

    if (err == -ENOMEM)
        return error_say(why, err, "out of memory");
    if (!err)
        m.data = bytes_in(&r->reordered);
    return bag_copy_message(r->copy, i, &m, why);
}

static int copy_all(struct run *r, struct selection_result *out, struct error *why)
{
    int err = 0;

    for (size_t i = 0; i < r->selection->n_files && !err; i++) {
        out->n_messages += r->catalogs[i]->n_messages;
        err = start_input(r, i, why);
    }
    while (!err) {
        size_t i = first_input(r);
        if (i == r->selection->n_files || r->inputs[i].next.log_time > r->to)
            return 0;
        if (interrupt_requested())
            return error_say(why, -EINTR, "interrupted after %" PRIu64 " messages",
                             out->n_written);
        err = copy_message(r, i, why);
        out->n_written += !err;
        if (!err)
            err = advance(&r->inputs[i], why);
    }
    return err;
}

/* What all of the bags have; empty: they differ. */
static void find_profile(const struct run *r, char out[64])
{
    struct bytes first = r->catalogs[0]->header.record.header.profile;

    for (size_t i = 0; i < r->selection->n_files; i++)
        if (!bytes_equal(r->catalogs[i]->header.record.header.profile, first))
            first.size = 0;
    snprintf(out, 64, "%.*s", (int)(first.size < 64 ? first.size : 0),
             (const char *)first.data);
}

static int write_bag(struct run *r, struct selection_result *out, struct error *why)
{
    struct verb_output o;
    char profile[64];
    int err = verb_output_begin(&o, r->selection->out, why);

    if (err)
        return err;
    find_profile(r, profile);
    err = verb_writer_create(&r->writer, &o, profile, r->selection->compression, why);
    if (!err && bag_copy_create(&r->copy, r->writer))
        err = error_say(why, -ENOMEM, "out of memory");
    if (!err)
        err = copy_all(r, out, why);
    int closed = bag_writer_close(r->writer, err ? NULL : why);
    return verb_output_end(&o, err ? err : closed, why);
}

int selection_write(const struct selection *s, struct selection_result *out,
                    struct error *why)
{
    struct run r = {.selection = s};
    int err = open_all(&r, why);

    *out = (struct selection_result){0};
    if (!err)
        err = check_patterns(&r, why);
    if (!err) {
        set_times(&r);
        err = write_bag(&r, out, why);
    }
    bag_copy_destroy(r.copy);
    bytes_free(&r.reordered);
    for (size_t i = 0; i < s->n_files; i++) {
        if (r.inputs)
            bag_cursor_destroy(r.inputs[i].cursor);
        if (r.catalogs)
            bag_catalog_close(r.catalogs[i]);
    }
    free(r.catalogs);
    free(r.inputs);
    return err;
}

/* -- the verbs merge and filter ---------------------------------------------------------
 */

static const char merge_help[] =
    "anlos bag merge -- several bags into one\n"
    "\n"
    "usage: anlos bag merge FILE... -o OUT [--compression C] [--shuffle | --plain]\n"
    "\n"
    "Messages come in the order of their times; attachments and metadata that are the "
    "same\n"
    "in several bags come once.\n"
    "\n"
    "  -o, --out OUT     the new bag; must not be there\n"
    "  --compression C   zstd (default), lz4 or none\n"
    "  --shuffle         sound and images byte by byte, of which more is compressed;\n"
    "                    programs of before cannot read them\n"
    "  --plain           and back: as every program can\n"
    "  --help            this text\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or files; 130 stopped by Ctrl-C (no "
    "OUT\n"
    "then)\n";

static const struct usage_option merge_options[] = {
    {"out", USAGE_TEXT(struct selection, out), .letter = 'o'},
    {"compression", USAGE_NAME('c', verb_compression_name)},
    {"shuffle", USAGE_SWITCH('u')},
    {"plain", USAGE_SWITCH('p')},
    {.name = NULL},
};

static const char filter_help[] =
    "anlos bag filter -- some of a bag's topics, or some of its time\n"
    "\n"
    "usage: anlos bag filter FILE -o OUT [--topics T] [--exclude T] [--start S] [--end "
    "S]\n"
    "                        [--compression C] [--shuffle | --plain]\n"
    "\n"
    "  -o, --out OUT     the new bag; must not be there\n"
    "  --topics T,...    only these: names or patterns with commas between, "
    "survey,scan/*\n"
    "  --exclude T,...   all but these; both may be given several times\n"
    "  --start S         from S seconds after the first message on\n"
    "  --end S           up to S seconds after the first message\n"
    "  --compression C   zstd (default), lz4 or none\n"
    "  --shuffle         sound and images byte by byte, of which more is compressed;\n"
    "                    programs of before cannot read them\n"
    "  --plain           and back: as every program can\n"
    "  --help            this text\n"
    "\n"
    "Attachments and metadata stay.\n"
    "\n"
    "example\n"
    "  anlos bag filter scan.mcap -o sound.mcap --topics survey,ping --end 20\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or files; 130 stopped by Ctrl-C (no "
    "OUT\n"
    "then)\n";

static const struct usage_option filter_options[] = {
    {"out", USAGE_TEXT(struct selection, out), .letter = 'o'},
    {"topics", USAGE_VALUE('t')},
    {"exclude", USAGE_VALUE('x')},
    {"start", USAGE_NUMBER(struct selection, start_s, 0, USAGE_ANY),
     .expected = "seconds, 0 or more"},
    {"end", USAGE_NUMBER(struct selection, end_s, 0, USAGE_ANY),
     .expected = "seconds, 0 or more"},
    {"compression", USAGE_NAME('c', verb_compression_name)},
    {"shuffle", USAGE_SWITCH('u')},
    {"plain", USAGE_SWITCH('p')},
    {.name = NULL},
};

/* 0, or an exit code. */
static int take_option(const char *command, struct selection *s, int code)
{
    switch (code) {
    case 't':
        return verb_add_patterns(command, optarg, s->topics_room, &s->topics);
    case 'x':
        return verb_add_patterns(command, optarg, s->exclude_room, &s->exclude);
    case 'c':
        s->compression = verb_compression(optarg);
        return 0;
    case 'u':
        s->order = ORDER_SHUFFLED;
        return 0;
    default:
        s->order = ORDER_PLAIN;
        return 0;
    }
}

/* 0, or ~exit code. */
static int read_arguments(struct usage *u, struct selection *s, int argc, char **argv)
{
    int code;

    *s = (struct selection){.end_s = INFINITY, .compression = BAG_ZSTD};
    u->into = s;
    while ((code = usage_next(u, argc, argv)) > 0)
        if ((code = take_option(u->command, s, code)) != 0)
            return ~code;
    if (!code && s->order == ORDER_SHUFFLED && s->compression == BAG_NONE)
        return ~usage_error(u->command, "--shuffle: is for --compression zstd or lz4");
    s->files = argv + optind;
    s->n_files = (size_t)(argc - optind);
    return code;
}

int bag_merge(int argc, char **argv)
{
    struct usage usage = {
        .command = "bag merge", .help = merge_help, .options = merge_options};
    struct selection_result result;
    struct error why = {""};
    struct selection s;
    int code = read_arguments(&usage, &s, argc, argv);

    if (code)
        return ~code;
    if (!s.n_files)
        return usage_error("bag merge", "FILE is missing");
    if (!s.out)
        return usage_error("bag merge", "-o OUT is missing");
    interrupt_catch();
    int err = selection_write(&s, &result, &why);
    if (err)
        return verb_end("merge", err, &why);
    printf("%s: %" PRIu64 " message%s of %zu bag%s\n", s.out, result.n_written,
           result.n_written == 1 ? "" : "s", s.n_files, s.n_files == 1 ? "" : "s");
    return usage_flush("bag merge");
}

int bag_filter(int argc, char **argv)
{
    struct usage usage = {
        .command = "bag filter", .help = filter_help, .options = filter_options};
    struct selection_result result;
    struct error why = {""};
    struct selection s;
    int code = read_arguments(&usage, &s, argc, argv);

    if (code)
        return ~code;
    code = verb_one_operand("bag filter", "FILE", argc, argv);
    if (code)
        return code;
    if (!s.out)
        return usage_error("bag filter", "-o OUT is missing");
    if (s.end_s < s.start_s)
        return usage_error("bag filter", "--end %g comes before --start %g", s.end_s,
                           s.start_s);
    interrupt_catch();
    int err = selection_write(&s, &result, &why);
    if (err)
        return verb_end("filter", err, &why);
    printf("%s: %" PRIu64 " of %" PRIu64 " messages\n", s.out, result.n_written,
           result.n_messages);
    return usage_flush("bag filter");
}
