/* SPDX-License-Identifier: MIT */
#include "nodes/view/timeline.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/manifest.h"
#include "msgs/unpack.h"
#include "nodes/rt/log_line.h"
#include "nodes/view/timeline_state.h"

#define MOST_IMAGES 1000

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

void timeline_give(const struct held *h,
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
        timeline_give(all[i], take, ctx);
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
        int wrong = timeline_take_chunk(t, &t->catalog->blocks[i], time, why);
        err = wrong ? wrong : err;
        if (wrong == -ENOMEM)
            return wrong;
    }
    int failed = give_all(t, take, ctx);
    return failed ? failed : err;
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
