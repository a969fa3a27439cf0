/* SPDX-License-Identifier: MIT */
#include "msgs/bag/cursor.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>

#include "dsp/list.h"

#define MOST_HELD (4 * BAG_MAX_SIZE) /* of records at once */

struct entry {
    uint64_t log_time;
    uint64_t offset; /* of the record in the chunk */
};

struct open_chunk {
    uint64_t file_offset;
    struct bytes_buffer records;
    struct entry *entries; /* [n] by time, then offset */
    size_t n, next;
};

struct bag_cursor {
    const struct bag_catalog *catalog;
    bool unwanted[1 << 16]; /* by channel id */
    uint64_t from;
    size_t next_block;
    struct open_chunk *open; /* [n_open], a heap by the message that comes next */
    size_t n_open, room;
    uint64_t held;      /* bytes of their records */
    uint64_t allowance; /* bytes that chunks may still hold */
    bool taken;         /* the first one's message came last */
    struct bytes_buffer scratch;
};

int bag_cursor_create(struct bag_cursor **out, const struct bag_catalog *catalog)
{
    struct bag_cursor *c = calloc(1, sizeof *c);

    if (!c)
        return -ENOMEM;
    c->catalog = catalog;
    c->allowance = bag_file_allowance(&catalog->file);
    *out = c;
    return 0;
}

void bag_cursor_select(struct bag_cursor *c, uint16_t channel_id, bool wanted)
{
    c->unwanted[channel_id] = !wanted;
}

/* Does x's next message come before y's? */
static bool is_before(const struct open_chunk *x, const struct open_chunk *y)
{
    uint64_t a = x->entries[x->next].log_time, b = y->entries[y->next].log_time;

    return a != b ? a < b : x->file_offset < y->file_offset;
}

static void swap(struct open_chunk *x, struct open_chunk *y)
{
    struct open_chunk held = *x;

    *x = *y;
    *y = held;
}

static void sift_up(struct bag_cursor *c, size_t i)
{
    for (; i && is_before(&c->open[i], &c->open[(i - 1) / 2]); i = (i - 1) / 2)
        swap(&c->open[i], &c->open[(i - 1) / 2]);
}

static void sift_down(struct bag_cursor *c)
{
    for (size_t i = 0, least = 0;; i = least) {
        for (size_t k = 2 * i + 1; k <= 2 * i + 2 && k < c->n_open; k++)
            if (is_before(&c->open[k], &c->open[least]))
                least = k;
        if (least == i)
            return;
        swap(&c->open[i], &c->open[least]);
    }
}

static void free_chunk(struct bag_cursor *c, struct open_chunk *k)
{
    c->held -= k->records.size;
    bytes_free(&k->records);
    free(k->entries);
}

void bag_cursor_seek(struct bag_cursor *c, uint64_t log_time)
{
    while (c->n_open)
        free_chunk(c, &c->open[--c->n_open]);
    c->from = log_time;
    c->next_block = 0;
    c->taken = false;
    c->allowance = bag_file_allowance(&c->catalog->file);
}

static bool is_wanted(const struct bag_cursor *c, const struct bag_block *b)
{
    struct bytes list = b->channels;
    uint64_t id, offset;

    if (b->end_time < c->from)
        return false;
    if (!list.size)
        return true;
    while (bag_list_next(&list, 2, &id, &offset))
        if (!c->unwanted[id])
            return true;
    return false;
}

static int compare_entries(const void *a, const void *b)
{
    const struct entry *x = a, *y = b;

    if (x->log_time != y->log_time)
        return x->log_time < y->log_time ? -1 : 1;
    return x->offset < y->offset ? -1 : x->offset > y->offset;
}

/* Lists the wanted messages of the chunk.  Its index must be right about their times, or
 * they would come out of order.  0, -EBADMSG, -ENOMEM. */
static int list_entries(const struct bag_cursor *c, const struct bag_block *b,
                        struct open_chunk *k)
{
    struct bytes_cursor left = {.left = bytes_in(&k->records)};
    struct bag_record r;
    size_t room = 0;

    while (left.left.size) {
        uint64_t offset = k->records.size - left.left.size;
        int err = bag_record_take(&left, &r);
        if (err == -EBADMSG)
            return err;
        if (err || r.opcode != BAG_MESSAGE)
            continue;
        if (r.message.log_time < b->start_time || r.message.log_time > b->end_time)
            return -EBADMSG;
        if (r.message.log_time < c->from || c->unwanted[r.message.channel_id])
            continue;
        if (list_grow(&k->entries, k->n, &room, sizeof *k->entries))
            return -ENOMEM;
        k->entries[k->n++] = (struct entry){r.message.log_time, offset};
    }
    if (k->n)
        qsort(k->entries, k->n, sizeof *k->entries, compare_entries);
    return 0;
}

/* A message outside of chunks becomes a chunk of its own. */
static int load(struct bag_cursor *c, const struct bag_block *b, struct open_chunk *k,
                struct error *why)
{
    const struct bag_file *f = &c->catalog->file;
    struct bag_record r;
    int err = bag_file_record(f, b->offset, &c->scratch, why);

    if (err)
        return err;
    struct bytes_cursor whole = {.left = bytes_in(&c->scratch)};
    err = bag_record_take(&whole, &r);
    if (!err && r.opcode == BAG_CHUNK) {
        err = bag_file_chunk(f, b->offset, &r.chunk, &c->allowance, &k->records, why);
        if (err)
            return err;
    } else if (!err && r.opcode == BAG_MESSAGE) {
        bytes_put(&k->records, bytes_in(&c->scratch));
        err = k->records.failed ? -ENOMEM : 0;
    } else {
        err = -EBADMSG;
    }
    if (!err)
        err = list_entries(c, b, k);
    return err ? error_say(why, err, "%s: byte %" PRIu64 ": %s", f->path, b->offset,
                           err == -ENOMEM ? "out of memory"
                                          : "no chunk such as its index says")
               : 0;
}

static int open_chunk(struct bag_cursor *c, const struct bag_block *b, struct error *why)
{
    struct open_chunk k = {.file_offset = b->offset};

    if (list_grow(&c->open, c->n_open, &c->room, sizeof *c->open))
        return error_say(why, -ENOMEM, "%s: out of memory", c->catalog->file.path);
    int err = load(c, b, &k, why);
    c->held += k.records.size;
    if (!err && c->held > MOST_HELD)
        err = error_say(why, -EFBIG, "%s: byte %" PRIu64 ": too many chunks of one time",
                        c->catalog->file.path, b->offset);
    if (err || !k.n) {
        free_chunk(c, &k);
        return err;
    }
    c->open[c->n_open++] = k;
    sift_up(c, c->n_open - 1);
    return 0;
}

/* Opens all chunks that may hold something before what is first now. */
static int open_due(struct bag_cursor *c, struct error *why)
{
    while (c->next_block < c->catalog->n_blocks) {
        const struct bag_block *b = &c->catalog->blocks[c->next_block];
        const struct open_chunk *first = c->open;
        uint64_t time = c->n_open ? first->entries[first->next].log_time : 0;
        if (c->n_open && (b->start_time > time ||
                          (b->start_time == time && b->offset > first->file_offset)))
            return 0;
        c->next_block++;
        int err = is_wanted(c, b) ? open_chunk(c, b, why) : 0;
        if (err)
            return err;
    }
    return 0;
}

/* The message that came last is no longer needed. */
static void step(struct bag_cursor *c)
{
    c->taken = false;
    if (++c->open->next == c->open->n) {
        free_chunk(c, c->open);
        c->open[0] = c->open[--c->n_open];
    }
    if (c->n_open)
        sift_down(c);
}

int bag_cursor_next(struct bag_cursor *c, struct bag_message *out, struct error *why)
{
    struct bag_record r;

    if (c->taken)
        step(c);
    int err = open_due(c, why);
    if (err || !c->n_open)
        return err ? err : -ENODATA;
    const struct open_chunk *k = c->open;
    size_t offset = (size_t)k->entries[k->next].offset;
    struct bytes_cursor at = {
        .left = {k->records.data + offset, k->records.size - offset}};
    err = bag_record_take(&at, &r); /* it was listed: it can be read */
    *out = r.message;
    c->taken = true;
    return err;
}

void bag_cursor_destroy(struct bag_cursor *c)
{
    if (!c)
        return;
    bag_cursor_seek(c, 0);
    free(c->open);
    bytes_free(&c->scratch);
    free(c);
}
