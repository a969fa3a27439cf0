/* SPDX-License-Identifier: MIT */
#include "nodes/view/timeline.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "msgs/bag/catalog.h"
#include "msgs/bag/manifest.h"
#include "msgs/bag/topic_message.h"
#include "msgs/unpack.h"
#include "nodes/rt/log.h"

#define MOST_IMAGES      1000
#define MOST_SEVERAL     256 /* of a chunk */
#define ENOUGH_PINGS     16  /* of a speaker each, as a rule */
#define MOST_HELD        4096
#define CHUNK_HEAD       49 /* of a chunk that is not compressed, up to its records */
#define COMPRESSION_SIZE 37 /* where a chunk says how long that name is */

struct held { /* a message */
    const struct bag_source *source;
    uint64_t log_time, publish_time;
    struct bytes_buffer payload;
};

struct track { /* a channel that is shown */
    struct bag_source source;
    uint16_t id;
    bool found;
    size_t n_given;     /* of those that give several */
    struct held newest; /* without payload when track_gives_several */
};

struct timeline {
    struct bag_catalog *catalog;
    struct track *tracks; /* [n_tracks] */
    size_t n_tracks;
    uint64_t time;              /* that is looked for */
    uint32_t track_at[1 << 16]; /* index + 1 of a channel; 0: not shown */
    struct held *several; /* [n_several], of tracks of which more than one is given */
    size_t n_several, room;
    struct bytes_buffer record, records;
    const struct bag_block **unchecked; /* [n_unchecked] chunks of the place of which only
                                         * single messages were read; room for all */
    size_t n_unchecked;
    size_t lists_next; /* the chunk with which timeline_lists goes on */
    struct held list;
};

static bool is_shown(const struct topic *topic)
{
    const struct topic *shown;

    for (size_t i = 0; (shown = view_topic(i)); i++)
        if (shown == topic)
            return true;
    return false;
}

static int list_tracks(struct timeline *t, struct error *why)
{
    const struct bag_catalog *c = t->catalog;

    t->tracks = calloc(c->n_channels ? c->n_channels : 1, sizeof *t->tracks);
    t->unchecked = calloc(c->n_blocks ? c->n_blocks : 1, sizeof(struct bag_block *));
    if (!t->tracks || !t->unchecked)
        return error_say(why, -ENOMEM, "%s: out of memory", c->file.path);
    for (size_t i = 0; i < c->n_channels; i++) {
        const struct bag_channel *channel = &c->channels[i].record.channel;
        struct track *k = &t->tracks[t->n_tracks];
        if (!c->counts[channel->id] || bag_source_of(&k->source, channel) ||
            !is_shown(k->source.topic))
            continue;
        k->id = channel->id;
        t->track_at[k->id] = (uint32_t)++t->n_tracks;
    }
    for (size_t i = 0; i < t->n_tracks; i++)
        t->tracks[i].newest.source = &t->tracks[i].source;
    return t->n_tracks
               ? 0
               : error_say(why, -ENODATA, "%s: nothing in it can be shown", c->file.path);
}

int timeline_open(struct timeline **out, const char *path, struct error *why)
{
    struct timeline *t = calloc(1, sizeof *t);

    if (!t)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    int err = bag_catalog_open(&t->catalog, path, why);
    if (!err)
        err = list_tracks(t, why);
    if (err)
        timeline_close(t);
    else
        *out = t;
    return err;
}

void timeline_span(const struct timeline *t, int64_t *start_ns, int64_t *end_ns)
{
    *start_ns = (int64_t)t->catalog->start_time;
    *end_ns = (int64_t)t->catalog->end_time;
}

/* Appends the times of a chunk's images from one of its message indexes. */
static void list_images(const struct timeline *t, uint64_t offset, json_t *all)
{
    struct bytes_buffer record = {0};
    struct error why;
    struct bag_record r;

    if (!bag_file_record(&t->catalog->file, offset, &record, &why)) {
        struct bytes_cursor at = {.left = bytes_in(&record)};
        uint64_t time, place;
        if (!bag_record_take(&at, &r) && r.opcode == BAG_MESSAGE_INDEX)
            while (bag_list_next(&r.message_index.entries, 8, &time, &place))
                json_array_append_new(
                    all, json_integer((json_int_t)(time - t->catalog->start_time + 999) /
                                      1000));
    }
    bytes_free(&record);
}

json_t *timeline_images(const struct timeline *t)
{
    json_t *all = json_array(), *some = json_array();

    for (size_t i = 0; i < t->catalog->n_blocks; i++) {
        struct bytes list = t->catalog->blocks[i].channels;
        uint64_t id, offset;
        while (bag_list_next(&list, 2, &id, &offset))
            if (t->track_at[id] &&
                t->tracks[t->track_at[id] - 1].source.topic == topic_volume())
                list_images(t, offset, all);
    }
    size_t n = json_array_size(all), step = (n + MOST_IMAGES - 1) / MOST_IMAGES;
    for (size_t i = 0; i < n; i += step)
        json_array_append(some, json_array_get(all, i));
    json_decref(all);
    return some;
}

/* Lines of the log, and pings: each is of one speaker. */
static bool track_gives_several(const struct track *k)
{
    return k->source.topic == topic_log() || k->source.topic == topic_ping();
}

/* Lists of objects, and the vehicle's motion: those of the time that trails show, and the
 * newest if there are none. */
static bool track_gives_trail(const struct track *k)
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
    size_t known = t->room;

    if (t->n_several == MOST_HELD)
        return 0;
    if (list_grow(&t->several, t->n_several, &t->room, sizeof *t->several))
        return -ENOMEM;
    memset(t->several + known, 0, (t->room - known) * sizeof *t->several);
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

/* Takes from a chunk what is the newest up to that time, if there may be something newer
 * than what was found.  Of one that is not compressed, the messages alone are read that
 * its indexes name: kilobytes in place of megabytes.  timeline_check looks at its
 * checksum.  0, errors as bag_file_record and bag_file_chunk. */
static int take_chunk(struct timeline *t, const struct bag_block *b, uint64_t time,
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

/* Unpacked, to take; not what is no message of its topic. */
static void give_held(const struct held *h,
                      void (*take)(void *ctx, const struct view_message *m), void *ctx)
{
    const struct topic *topic = h->source->topic;

    if (h->payload.size > topic->max_size)
        return;
    ProtobufCMessage *content =
        message_unpack(topic->schema, h->payload.size, h->payload.data);
    if (!content)
        return;
    const struct view_message m = {
        .topic = topic,
        .from = h->source->node,
        .content = content,
        .capture_ns = h->source->captured ? (int64_t)h->publish_time : 0,
        .publish_ns = (int64_t)h->log_time,
        .epoch_ns = h->source->epoch_ns};
    take(ctx, &m);
    protobuf_c_message_free_unpacked(content, NULL);
}

static int compare(const void *a, const void *b)
{
    const struct held *x = *(const struct held *const *)a;
    const struct held *y = *(const struct held *const *)b;
    bool survey_x = x->source->topic == topic_survey();
    bool survey_y = y->source->topic == topic_survey();

    if (survey_x != survey_y)
        return survey_x ? -1 : 1;
    return (x->log_time > y->log_time) - (x->log_time < y->log_time);
}

static int give_all(const struct timeline *t,
                    void (*take)(void *ctx, const struct view_message *m), void *ctx)
{
    const struct held **all = calloc(t->n_tracks + t->n_several, sizeof *all);
    size_t n = 0;

    if (!all)
        return -ENOMEM;
    for (size_t i = 0; i < t->n_tracks; i++)
        if (t->tracks[i].found && !t->tracks[i].n_given)
            all[n++] = &t->tracks[i].newest;
    for (size_t i = 0; i < t->n_several; i++)
        all[n++] = &t->several[i];
    if (n)
        qsort(all, n, sizeof(const struct held *), compare);
    for (size_t i = 0; i < n; i++)
        give_held(all[i], take, ctx);
    free(all);
    return 0;
}

int timeline_at(struct timeline *t, int64_t time_ns,
                void (*take)(void *ctx, const struct view_message *m), void *ctx,
                struct error *why)
{
    uint64_t time = time_ns > 0 ? (uint64_t)time_ns : 0;
    int err = 0;

    for (size_t i = 0; i < t->n_tracks; i++)
        t->tracks[i] = (struct track){.source = t->tracks[i].source,
                                      .id = t->tracks[i].id,
                                      .newest.source = &t->tracks[i].source,
                                      .newest.payload = t->tracks[i].newest.payload};
    t->time = time;
    t->n_several = 0;
    t->n_unchecked = 0;
    for (size_t i = t->catalog->n_blocks; i-- > 0;) {
        int wrong = take_chunk(t, &t->catalog->blocks[i], time, why);
        err = wrong ? wrong : err;
        if (wrong == -ENOMEM)
            return wrong;
    }
    int failed = give_all(t, take, ctx);
    return failed ? failed : err;
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
    give_held(&t->list, take, ctx);
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

int timeline_check(struct timeline *t, bool (*stop)(void *ctx), void *ctx,
                   struct error *why)
{
    struct bag_record r;
    int err = 0;

    for (size_t i = 0; !err && i < t->n_unchecked; i++)
        err = stop(ctx) ? -EINTR : read_block(t, t->unchecked[i], &r, why);
    return err;
}

static void copy_bytes(char *out, size_t size, struct bytes from)
{
    size_t n = from.size < size ? from.size : size - 1;

    memcpy(out, from.data, n);
    out[n] = '\0';
}

bool timeline_saved(const struct timeline *t, int64_t *at_ns, char *reason, size_t size)
{
    const struct bag_catalog *c = t->catalog;
    struct bytes_buffer bytes = {0};
    struct bag_record r;
    struct error why;
    bool found = false;

    for (size_t i = 0; i < c->n_metadata && !found; i++) {
        struct bytes key, value;
        if (bag_catalog_read(c, &c->metadata[i].record, &bytes, &r, &why) ||
            !bytes_equal(r.metadata.name, bytes_of(MANIFEST_SNAPSHOT)))
            continue;
        snprintf(reason, size, "saved");
        for (struct bytes map = r.metadata.metadata; bag_map_next(&map, &key, &value);) {
            char number[24];
            if (bytes_equal(key, bytes_of(MANIFEST_REASON)) && value.size)
                copy_bytes(reason, size, value);
            if (!bytes_equal(key, bytes_of(MANIFEST_AT_NS)))
                continue;
            copy_bytes(number, sizeof number, value);
            *at_ns = strtoll(number, NULL, 10);
            found = true;
        }
    }
    bytes_free(&bytes);
    if (found)
        log_text_clean(reason); /* cut off, maybe in the middle of a character */
    return found;
}

void timeline_close(struct timeline *t)
{
    if (!t)
        return;
    for (size_t i = 0; i < t->n_tracks; i++)
        bytes_free(&t->tracks[i].newest.payload);
    for (size_t i = 0; i < t->room; i++)
        bytes_free(&t->several[i].payload);
    free(t->several);
    free(t->tracks);
    bytes_free(&t->list.payload);
    bytes_free(&t->record);
    bytes_free(&t->records);
    free(t->unchecked);
    bag_catalog_close(t->catalog);
    free(t);
}
