/* SPDX-License-Identifier: MIT */
/* tests/nodes/record_rig.h -- messages as the bus brings them, each of which tells which
 * one it is, and a bag read back. */
#ifndef ANLOS_TESTS_NODES_RECORD_RIG_H
#define ANLOS_TESTS_NODES_RECORD_RIG_H

#include "tests/hal/scratch.h"

#include <stdbool.h>

#include "msgs/bag/catalog.h"
#include "msgs/bag/check.h"
#include "msgs/bag/cursor.h"
#include "msgs/bag/topic_message.h"
#include "nodes/record/recorder.h"
#include "nodes/record/tap.h"

#define EPOCH_NS    77000000000LL
#define PAYLOAD_MAX 4096

static inline size_t payload_size(size_t i)
{
    return 16 + i * 37 % 997;
}

/* A topic of every policy; the sequence counts within each. */
static inline const struct topic *topic_of(size_t i)
{
    return i % 3 == 0 ? topic_ping() : i % 3 == 1 ? topic_volume() : topic_scan_status();
}

static inline struct bus_message make_message(size_t i, uint8_t payload[PAYLOAD_MAX])
{
    struct bus_message m = {.topic = topic_of(i), .payload = payload};
    struct envelope *e = &m.envelope;

    snprintf(e->topic, sizeof e->topic, "%s", m.topic->name);
    snprintf(e->node, sizeof e->node, "%s", topic_publisher(m.topic, 0));
    e->epoch_ns = EPOCH_NS;
    e->sequence = i / 3;
    e->publish_ns = EPOCH_NS + 1000 * (int64_t)i;
    e->capture_ns = i % 3 == 2 ? 0 : e->publish_ns - 500;
    e->payload_size = (uint32_t)payload_size(i);
    for (size_t k = 0; k < e->payload_size; k++)
        payload[k] = (uint8_t)(i * 131 + k * k * 7 + (k >> 3));
    memcpy(payload, &i, sizeof i);
    return m;
}

static inline void put_at(struct recorder *r, size_t i, int64_t now_ns)
{
    uint8_t payload[PAYLOAD_MAX];
    struct error why = {""};
    struct bus_message m = make_message(i, payload);

    if (recorder_put(r, &m, now_ns, &why))
        fail_msg("%s", why.text);
}

static inline void tick_at(struct recorder *r, int64_t now_ns)
{
    struct error why = {""};
    int64_t due_ns;

    if (recorder_tick(r, now_ns, &due_ns, &why))
        fail_msg("%s", why.text);
}

static inline void end_at(struct recorder *r, int64_t now_ns)
{
    struct error why = {""};

    if (recorder_end(r, now_ns, &why))
        fail_msg("%s", why.text);
}

/* Is it message i, with everything that its envelope had? */
static inline void check_message(const struct bag_catalog *c, const struct bag_message *m,
                                 size_t i)
{
    uint8_t payload[PAYLOAD_MAX];
    struct bus_message sent = make_message(i, payload);
    struct bag_source source;
    struct envelope e;

    assert_int_equal(bag_source_of(&source, bag_catalog_channel(c, m->channel_id)), 0);
    bag_source_envelope(&source, m, &e);
    assert_string_equal(e.topic, sent.envelope.topic);
    assert_string_equal(e.node, sent.envelope.node);
    assert_int_equal(e.epoch_ns, sent.envelope.epoch_ns);
    assert_int_equal(e.sequence, sent.envelope.sequence);
    assert_int_equal(e.publish_ns, sent.envelope.publish_ns);
    assert_int_equal(e.capture_ns, sent.envelope.capture_ns);
    assert_int_equal(m->data.size, payload_size(i));
    assert_memory_equal(m->data.data, payload, m->data.size);
}

static inline struct bag_catalog *open_catalog(const char *path)
{
    struct bag_catalog *c;
    struct error why = {""};

    if (bag_catalog_open(&c, path, &why))
        fail_msg("%s", why.text);
    return c;
}

/* The bag has its end and no fault, and messages first..first+n-1 in their order; returns
 * n. */
static inline size_t check_bag(const char *path, size_t first)
{
    struct error why = {""};
    struct bag_cursor *cursor;
    struct bag_message m;
    uint64_t n_faults;
    size_t n = 0;

    if (bag_check(&n_faults, path, NULL, &why))
        fail_msg("%s", why.text);
    assert_int_equal(n_faults, 0);
    struct bag_catalog *c = open_catalog(path);
    assert_false(c->scanned);
    assert_int_equal(bag_cursor_create(&cursor, c), 0);
    while (!bag_cursor_next(cursor, &m, &why))
        check_message(c, &m, first + n++);
    assert_int_equal(n, c->n_messages);
    bag_cursor_destroy(cursor);
    bag_catalog_close(c);
    return n;
}

/* The k-th metadata record of that name, in out; false: there are no more. */
static inline bool find_metadata(const char *path, const char *name, size_t k,
                                 const char *key, char out[256])
{
    struct bag_catalog *c = open_catalog(path);
    struct bytes_buffer into = {0};
    struct error why = {""};
    bool found = false;

    for (size_t i = 0; i < c->n_metadata; i++) {
        const struct bag_record *index = &c->metadata[i].record;
        struct bag_record r;
        struct bytes name_there, value;
        if (!bytes_equal(index->metadata_index.name, bytes_of(name)) || k--)
            continue;
        assert_int_equal(bag_catalog_read(c, index, &into, &r, &why), 0);
        struct bytes map = r.metadata.metadata;
        while (bag_map_next(&map, &name_there, &value))
            if (bytes_equal(name_there, bytes_of(key))) {
                snprintf(out, 256, "%.*s", (int)value.size, (const char *)value.data);
                found = true;
            }
        break;
    }
    bytes_free(&into);
    bag_catalog_close(c);
    return found;
}

/* Writes the attachment of that name into a file; false: there is none. */
static inline bool save_attachment(const char *bag, const char *name, const char *path)
{
    struct bag_catalog *c = open_catalog(bag);
    struct bytes_buffer into = {0};
    struct error why = {""};
    bool found = false;

    for (size_t i = 0; i < c->n_attachments && !found; i++) {
        const struct bag_record *index = &c->attachments[i].record;
        struct bag_record r;
        found = bytes_equal(index->attachment_index.name, bytes_of(name));
        if (!found)
            continue;
        assert_int_equal(bag_catalog_read(c, index, &into, &r, &why), 0);
        FILE *f = fopen(path, "w");
        assert_non_null(f);
        assert_int_equal(fwrite(r.attachment.data.data, 1, r.attachment.data.size, f),
                         r.attachment.data.size);
        assert_int_equal(fclose(f), 0);
    }
    bytes_free(&into);
    bag_catalog_close(c);
    return found;
}

#endif
