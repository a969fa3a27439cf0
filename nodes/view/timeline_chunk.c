/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/view/timeline_state.h"
#include "nodes/view/view.h"

#define MOST_SEVERAL     256 /* of a chunk */
#define ENOUGH_PINGS     16  /* of a speaker each, as a rule */
#define MOST_HELD        4096
#define CHUNK_HEAD       49 /* of a chunk that is not compressed, up to its records */
#define COMPRESSION_SIZE 37 /* where a chunk says how long that name is */

bool track_gives_several(const struct track *k)
{
    return k->source.topic == topic_log() || k->source.topic == topic_ping();
}

bool track_gives_trail(const struct track *k)
{
    return k->source.topic == topic_detections() || k->source.topic == topic_ego();
}

/* Is something of that time one of several? */
static bool is_of_several(const struct timeline *t, const struct track *k, uint64_t time)
{
    return track_gives_several(k) ||
           (track_gives_trail(k) && time + VIEW_TRAIL_NS >= t->time);
}

static struct track *track_of(struct timeline *t, uint64_t id)
{
    uint32_t at = id < sizeof t->track_at / sizeof *t->track_at ? t->track_at[id] : 0;

    return at ? &t->tracks[at - 1] : NULL;
}

/* Of a chunk that ends then. */
static bool is_wanted(const struct timeline *t, const struct track *k, uint64_t end)
{
    return k && (!k->found || k->newest.log_time < end ||
                 (track_gives_trail(k) && is_of_several(t, k, end)));
}

/* Could the chunk have something newer than what was found? */
static bool is_of_use(struct timeline *t, const struct bag_block *b, uint64_t time)
{
    uint64_t end = b->end_time < time ? b->end_time : time, id, offset;
    struct bytes list = b->channels;
    bool any = false;

    if (b->start_time > time)
        return false;
    for (size_t i = 0; i < t->n_tracks && !any; i++)
        any = is_wanted(t, &t->tracks[i], end);
    if (!any || !list.size)
        return any;
    while (bag_list_next(&list, 2, &id, &offset))
        if (is_wanted(t, track_of(t, id), end))
            return true;
    return false;
}

static int hold(struct held *h, const struct bag_message *m)
{
    h->log_time = m->log_time;
    h->publish_time = m->publish_time;
    h->payload.size = 0;
    bytes_put(&h->payload, m->data);
    return h->payload.failed ? -ENOMEM : 0;
}

static int hold_more(struct timeline *t, const struct bag_source *source,
                     const struct bag_message *m)
{
    if (t->n_several == MOST_HELD)
        return 0;
    if (t->n_several == t->room) {
        size_t room = t->room ? 2 * t->room : 64;
        struct held *grown = realloc(t->several, room * sizeof *grown);
        if (!grown)
            return -ENOMEM;
        memset(grown + t->room, 0, (room - t->room) * sizeof *grown);
        t->several = grown;
        t->room = room;
    }
    t->several[t->n_several].source = source;
    return hold(&t->several[t->n_several++], m);
}

static int take_message(struct timeline *t, const struct bag_message *m, uint64_t time)
{
    struct track *k = track_of(t, m->channel_id);

    if (!k || m->log_time > time)
        return 0;
    bool several = is_of_several(t, k, m->log_time);
    k->n_given += several;
    if (track_gives_several(k)) {
        if (k->n_given >= ENOUGH_PINGS || k->source.topic == topic_log())
            k->newest.log_time = time; /* no older chunk is opened for its sake */
    } else if (k->found && m->log_time < k->newest.log_time) {
        return several ? hold_more(t, &k->source, m) : 0;
    } else {
        k->newest.log_time = m->log_time;
    }
    k->found = true;
    return several ? hold_more(t, &k->source, m) : hold(&k->newest, m);
}

/* The record of a block into *r, and of a chunk the records inside into t->records. */
static int read_block(struct timeline *t, const struct bag_block *b, struct bag_record *r,
                      struct error *why)
{
    const struct bag_file *f = &t->catalog->file;
    uint64_t allowance = bag_file_allowance(f);
    int err = bag_file_record(f, b->offset, &t->record, why);

    if (err)
        return err;
    struct bytes_cursor whole = {.left = bytes_in(&t->record)};
    err = bag_record_take(&whole, r);
    if (!err && r->opcode == BAG_MESSAGE)
        return 0;
    if (!err && r->opcode == BAG_CHUNK)
        return bag_file_chunk(f, b->offset, &r->chunk, &allowance, &t->records, why);
    return error_say(why, -EBADMSG, "%s: byte %" PRIu64 ": no chunk", f->path, b->offset);
}

int timeline_check(struct timeline *t, bool (*stop)(void *ctx), void *ctx,
                   struct error *why)
{
    struct bag_record r;
    int err = 0;

    for (size_t i = 0; !err && i < t->n_unchecked; i++)
        err = stop(ctx) ? -EINTR : read_block(t, t->unchecked[i], &r, why);
    return err;
}

static int take_whole(struct timeline *t, const struct bag_block *b, uint64_t time,
                      struct error *why)
{
    struct bag_record r;
    int err = read_block(t, b, &r, why);

    if (!err && r.opcode == BAG_MESSAGE)
        return take_message(t, &r.message, time);
    struct bytes_cursor left = {.left = bytes_in(&t->records)};
    while (!err && left.left.size) {
        int wrong = bag_record_take(&left, &r);
        if (wrong == -EBADMSG)
            return error_say(why, wrong, "%s: byte %" PRIu64 ": a chunk that is damaged",
                             t->catalog->file.path, b->offset);
        if (!wrong && r.opcode == BAG_MESSAGE)
            err = take_message(t, &r.message, time);
    }
    return err;
}

/* The message at an offset among the records of a chunk that is not compressed. */
static int take_at(struct timeline *t, const struct bag_block *b, uint64_t place,
                   uint64_t time, struct error *why)
{
    const struct bag_file *f = &t->catalog->file;
    struct bag_record r;

    if (place >= b->length)
        return error_say(why, -EBADMSG, "%s: byte %" PRIu64 ": an index that is damaged",
                         f->path, b->offset);
    int err = bag_file_record(f, b->offset + CHUNK_HEAD + place, &t->record, why);
    struct bytes_cursor at = {.left = bytes_in(&t->record)};
    if (!err && !bag_record_take(&at, &r) && r.opcode == BAG_MESSAGE)
        return take_message(t, &r.message, time);
    return err ? err
               : error_say(why, -EBADMSG, "%s: byte %" PRIu64 ": no message", f->path,
                           b->offset + CHUNK_HEAD + place);
}

/* By one message index of the chunk: the newest, or several. */
static int take_indexed(struct timeline *t, const struct bag_block *b,
                        const struct track *k, uint64_t index, uint64_t time,
                        struct error *why)
{
    uint64_t places[MOST_SEVERAL], newest = 0, at_time, place;
    size_t n = 0, n_several = 0;
    struct bag_record r;
    int err = bag_file_record(&t->catalog->file, index, &t->record, why);
    struct bytes_cursor at = {.left = bytes_in(&t->record)};

    if (err)
        return err;
    if (bag_record_take(&at, &r) || r.opcode != BAG_MESSAGE_INDEX)
        return error_say(why, -EBADMSG, "%s: byte %" PRIu64 ": no index",
                         t->catalog->file.path, index);
    while (bag_list_next(&r.message_index.entries, 8, &at_time, &place)) {
        if (at_time > time)
            continue;
        if (is_of_several(t, k, at_time)) {
            places[n_several++ % MOST_SEVERAL] = place;
            n = n_several;
        } else if (!n_several && (!n || at_time >= newest)) {
            newest = at_time;
            places[0] = place;
            n = 1;
        }
    }
    for (size_t i = 0; !err && i < n && i < MOST_SEVERAL; i++)
        err = take_at(t, b, places[i], time, why);
    return err;
}

static bool is_plain_chunk(struct timeline *t, const struct bag_block *b)
{
    struct error why;

    if (b->length <= CHUNK_HEAD || !b->channels.size ||
        bag_file_read(&t->catalog->file, b->offset, CHUNK_HEAD, &t->record, &why))
        return false;
    struct bytes_cursor at = {.left = bytes_in(&t->record)};
    bool is_chunk = bytes_number(&at, 1) == BAG_CHUNK;
    bytes_take(&at, COMPRESSION_SIZE - 1);
    return is_chunk && bytes_number(&at, 4) == 0;
}

/* Of a chunk that is not compressed, the messages alone are read that its indexes name:
 * kilobytes in place of megabytes.  timeline_check looks at its checksum. */
int timeline_take_chunk(struct timeline *t, const struct bag_block *b, uint64_t time,
                        struct error *why)
{
    uint64_t end = b->end_time < time ? b->end_time : time, id, index;
    struct bytes list = b->channels;
    int err = 0;

    if (!is_of_use(t, b, time))
        return 0;
    if (!is_plain_chunk(t, b))
        return take_whole(t, b, time, why);
    t->unchecked[t->n_unchecked++] = b;
    while (!err && bag_list_next(&list, 2, &id, &index)) {
        const struct track *k = track_of(t, id);
        if (is_wanted(t, k, end))
            err = take_indexed(t, b, k, index, time, why);
    }
    return err;
}

/* A list of objects goes to take, anything else nowhere. */
static int give_list(struct timeline *t, const struct bag_message *m,
                     void (*take)(void *ctx, const struct view_message *m), void *ctx)
{
    const struct track *k = track_of(t, m->channel_id);

    if (!k || k->source.topic != topic_detections())
        return 0;
    t->list.source = &k->source;
    if (hold(&t->list, m))
        return -ENOMEM;
    timeline_give(&t->list, take, ctx);
    return 0;
}

static int give_whole(struct timeline *t, const struct bag_block *b,
                      void (*take)(void *ctx, const struct view_message *m), void *ctx)
{
    struct error why;
    struct bag_record r;
    int err = read_block(t, b, &r, &why);

    if (err)
        return err;
    if (r.opcode == BAG_MESSAGE)
        return give_list(t, &r.message, take, ctx);
    struct bytes_cursor left = {.left = bytes_in(&t->records)};
    while (!err && left.left.size && (err = bag_record_take(&left, &r)) != -EBADMSG)
        err = !err && r.opcode == BAG_MESSAGE ? give_list(t, &r.message, take, ctx) : 0;
    return err;
}

/* Those that one message index of a chunk names that is not compressed. */
static int give_indexed(struct timeline *t, const struct bag_block *b, uint64_t index,
                        void (*take)(void *ctx, const struct view_message *m), void *ctx)
{
    const struct bag_file *f = &t->catalog->file;
    struct bytes_buffer record = {0};
    struct error why;
    struct bag_record r;
    uint64_t time, place;
    int err = bag_file_record(f, index, &record, &why);
    struct bytes_cursor at = {.left = bytes_in(&record)};

    if (!err && (bag_record_take(&at, &r) || r.opcode != BAG_MESSAGE_INDEX))
        err = -EBADMSG;
    while (!err && bag_list_next(&r.message_index.entries, 8, &time, &place)) {
        struct bag_record m;
        err = place < b->length
                  ? bag_file_record(f, b->offset + CHUNK_HEAD + place, &t->record, &why)
                  : -EBADMSG;
        struct bytes_cursor message = {.left = bytes_in(&t->record)};
        if (!err && !bag_record_take(&message, &m) && m.opcode == BAG_MESSAGE)
            err = give_list(t, &m.message, take, ctx);
    }
    bytes_free(&record);
    return err;
}

static int give_chunk(struct timeline *t, const struct bag_block *b,
                      void (*take)(void *ctx, const struct view_message *m), void *ctx)
{
    struct bytes list = b->channels;
    uint64_t id, index;
    int err = 0;
    bool plain = is_plain_chunk(t, b), any = !list.size;

    while (!err && bag_list_next(&list, 2, &id, &index)) {
        const struct track *k = track_of(t, id);
        if (!k || k->source.topic != topic_detections())
            continue;
        any = true;
        if (plain)
            err = give_indexed(t, b, index, take, ctx);
    }
    return any && !plain ? give_whole(t, b, take, ctx) : err;
}

int timeline_lists(struct timeline *t,
                   void (*take)(void *ctx, const struct view_message *m),
                   bool (*stop)(void *ctx), void *ctx)
{
    for (; t->lists_next < t->catalog->n_blocks; t->lists_next++) {
        if (stop(ctx))
            return -EINTR;
        if (give_chunk(t, &t->catalog->blocks[t->lists_next], take, ctx) == -ENOMEM)
            return -ENOMEM;
    }
    return 0;
}
