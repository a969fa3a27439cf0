/* SPDX-License-Identifier: MIT */
#include "nodes/record/ring.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "dsp/list.h"
#include "msgs/array.pb-c.h"

#define FIRST_ROOM    16384 /* entries, as of 30 s of a drive; a power of two */
#define SEGMENT_BYTES ((size_t)2 << 20)
#define STORED_BYTES  (SEGMENT_BYTES / 4) /* of a message at most */

/* Bytes of messages, of which the oldest goes first.  From the heap, where messages of
 * all sizes come and go for hours among what stays, they would take ever more than they
 * are: holes that fit nothing.  So segments are the system's pages.  All of one are there
 * at once, or each message that ends beyond those before it would add some for hours; and
 * they go back, or each pile that comes when something was stopped would raise what
 * stays. One is kept, as a full one and one that is taken follow each other. */

struct segment {
    struct segment *next;
    size_t used; /* bytes */
    size_t n;    /* messages that are there */
    uint8_t data[SEGMENT_BYTES - 3 * sizeof(size_t)];
};

_Static_assert(sizeof(struct segment) == SEGMENT_BYTES, "whole pages");

struct store {
    struct segment *first, *last; /* of the oldest message, of the newest */
    struct segment *spare;        /* NULL: none */
    size_t n;                     /* all segments */
};

/* NULL: no memory. */
static struct segment *take_segment(struct store *s)
{
    struct segment *g = s->spare;

    if (g) {
        s->spare = NULL;
    } else {
        g = mmap(NULL, sizeof *g, PROT_READ | PROT_WRITE,
                 MAP_PRIVATE | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
        if (g == MAP_FAILED)
            return NULL;
        s->n++;
    }
    g->next = NULL;
    g->used = g->n = 0;
    return g;
}

/* size: up to STORED_BYTES.  NULL: no memory. */
static const uint8_t *store_put(struct store *s, const uint8_t *message, size_t size)
{
    struct segment *g = s->last;

    if (!g || size > sizeof g->data - g->used) {
        g = take_segment(s);
        if (!g)
            return NULL;
        if (s->last)
            s->last->next = g;
        else
            s->first = g;
        s->last = g;
    }
    uint8_t *at = g->data + g->used;
    if (size)
        memcpy(at, message, size);
    g->used += size;
    g->n++;
    return at;
}

static void give_segment_back(struct store *s, struct segment *g)
{
    munmap(g, sizeof *g);
    s->n--;
}

/* The oldest message goes. */
static void store_drop(struct store *s)
{
    struct segment *g = s->first;

    if (--g->n)
        return;
    s->first = g->next;
    if (!s->first)
        s->last = NULL;
    if (s->spare)
        give_segment_back(s, g);
    else
        s->spare = g;
}

/* There is no message any more. */
static void store_clear(struct store *s)
{
    if (s->spare)
        give_segment_back(s, s->spare);
    s->spare = NULL;
}

struct background {          /* pings of one scan */
    struct ring_entry *list; /* [n] of room */
    size_t n, room, bytes;
    int64_t epoch_ns;
    uint32_t scan;
};

struct ring {
    struct ring_config cfg;
    struct ring_entry *list; /* [room], entry k at k % room */
    size_t room, bytes;      /* of all, kept ones too */
    uint64_t begin, end, hold;
    struct store store;
    struct ring_entry survey; /* payload NULL: none yet */
    struct background background;
    uint64_t shortened, background_gone;
};

int ring_create(struct ring **out, const struct ring_config *cfg)
{
    struct ring *r = calloc(1, sizeof *r);

    if (!r)
        return -ENOMEM;
    r->cfg = *cfg;
    r->hold = UINT64_MAX;
    r->room = FIRST_ROOM;
    r->list = calloc(r->room, sizeof *r->list);
    if (!r->list) {
        free(r);
        return -ENOMEM;
    }
    *out = r;
    return 0;
}

size_t ring_cost(const struct ring_entry *e)
{
    return sizeof *e +
           (e->message.payload ? ENVELOPE_SIZE + e->message.envelope.payload_size : 0);
}

static struct ring_entry *slot(const struct ring *r, uint64_t number)
{
    return &r->list[number & (r->room - 1)];
}

static int make_room(struct ring *r)
{
    if (r->end - r->begin < r->room)
        return 0;
    struct ring_entry *grown = calloc(2 * r->room, sizeof *grown);
    if (!grown)
        return -ENOMEM;
    for (uint64_t k = r->begin; k != r->end; k++)
        grown[k & (2 * r->room - 1)] = *slot(r, k);
    free(r->list);
    r->list = grown;
    r->room *= 2;
    return 0;
}

static void drop(struct ring *r, struct ring_entry *e)
{
    r->bytes -= ring_cost(e);
    if (e->stored)
        store_drop(&r->store);
    bus_message_free(&e->message); /* of what was stored, nothing */
}

static void drop_background(struct ring *r)
{
    struct background *b = &r->background;

    for (size_t i = 0; i < b->n; i++)
        drop(r, &b->list[i]);
    b->n = b->bytes = 0;
}

/* What may stay for beginnings, or is large, keeps the memory that it came in.
 * 0, -ENOMEM. */
static int move_to_store(struct ring *r, struct ring_entry *e)
{
    struct bus_message *m = &e->message;

    if (!m->payload || m->envelope.payload_size > STORED_BYTES ||
        m->topic == topic_survey() || e->background)
        return 0;
    const uint8_t *payload = store_put(&r->store, m->payload, m->envelope.payload_size);
    if (!payload)
        return -ENOMEM;
    struct bus_message moved = {
        .topic = m->topic, .envelope = m->envelope, .payload = payload};
    bus_message_free(m);
    *m = moved;
    e->stored = true;
    return 0;
}

/* Is it a ping of a background, and of which scan?  0, -ENOMEM. */
static int look_into(struct ring_entry *e)
{
    if (e->message.topic != topic_ping() || !e->message.payload)
        return 0;
    ProtobufCMessage *m = bus_message_unpack(&e->message);
    if (!m)
        return errno == ENOMEM ? -ENOMEM : 0;
    e->background = ((const Anlos__Ping *)m)->pass == ANLOS__PASS__BACKGROUND;
    e->scan = ((const Anlos__Ping *)m)->scan;
    protobuf_c_message_free_unpacked(m, NULL);
    return 0;
}

/* What of this scan did not fit is not begun in its middle either. */
static void keep_background(struct ring *r, struct ring_entry *e)
{
    struct background *b = &r->background;
    bool same = b->epoch_ns == e->message.envelope.epoch_ns && b->scan == e->scan;

    if (!same)
        drop_background(r);
    bool gone = same && !b->n;
    b->epoch_ns = e->message.envelope.epoch_ns;
    b->scan = e->scan;
    if (!gone && b->bytes + ring_cost(e) <= r->cfg.max_bytes / 2 &&
        !list_grow(&b->list, b->n, &b->room, sizeof *b->list)) {
        b->bytes += ring_cost(e);
        b->list[b->n++] = *e;
        return;
    }
    r->background_gone += b->n + 1;
    drop_background(r);
    drop(r, e);
}

/* The oldest goes, or stays for the beginnings of bags. */
static void shift(struct ring *r)
{
    struct ring_entry *e = slot(r, r->begin);

    if (r->begin >= r->hold && r->cfg.overrun)
        r->cfg.overrun(r->cfg.context, e);
    r->begin++;
    if (e->message.topic == topic_survey() && e->message.payload) {
        if (r->survey.message.payload)
            drop(r, &r->survey);
        r->survey = *e;
    } else if (e->background) {
        keep_background(r, e);
    } else {
        drop(r, e);
    }
}

void ring_trim(struct ring *r, int64_t now_ns)
{
    while (r->begin != r->end && r->begin < r->hold &&
           now_ns - slot(r, r->begin)->came_ns > r->cfg.span_ns)
        shift(r);
}

static int add(struct ring *r, struct ring_entry *e)
{
    int err = make_room(r);

    if (!err)
        err = move_to_store(r, e);
    if (err)
        return err;
    *slot(r, r->end++) = *e;
    r->bytes += ring_cost(e);
    ring_trim(r, e->came_ns);
    while (r->bytes > r->cfg.max_bytes && r->begin != r->end) {
        r->shortened++;
        shift(r);
    }
    return 0;
}

int ring_put(struct ring *r, struct bus_message *m, int64_t came_ns)
{
    struct ring_entry e = {.message = *m, .came_ns = came_ns};
    int err = look_into(&e);

    if (!err)
        err = add(r, &e);
    if (err)
        bus_message_free(m);
    memset(m, 0, sizeof *m);
    return err;
}

int ring_lost(struct ring *r, const struct topic *t, uint64_t n, int64_t came_ns)
{
    struct ring_entry e = {.message = {.topic = t}, .lost = n, .came_ns = came_ns};

    return add(r, &e);
}

const struct ring_entry *ring_at(const struct ring *r, uint64_t number)
{
    return number >= r->begin && number < r->end ? slot(r, number) : NULL;
}

uint64_t ring_begin(const struct ring *r)
{
    return r->begin;
}

uint64_t ring_end(const struct ring *r)
{
    return r->end;
}

const struct ring_entry *ring_kept(const struct ring *r, size_t i)
{
    bool survey = r->survey.message.payload != NULL;

    if (survey && !i)
        return &r->survey;
    i -= survey;
    return i < r->background.n ? &r->background.list[i] : NULL;
}

void ring_hold(struct ring *r, uint64_t number)
{
    r->hold = number;
}

void ring_sum(const struct ring *r, struct ring_totals *out)
{
    *out = (struct ring_totals){
        .bytes = r->bytes,
        .background_bytes = r->background.bytes,
        .store_bytes = r->store.n * SEGMENT_BYTES,
        .n = (size_t)(r->end - r->begin),
        .oldest_ns = r->begin != r->end ? slot(r, r->begin)->came_ns : 0,
        .shortened = r->shortened,
        .background_gone = r->background_gone,
    };
}

void ring_destroy(struct ring *r)
{
    if (!r)
        return;
    r->hold = UINT64_MAX;
    while (r->begin != r->end)
        drop(r, slot(r, r->begin++));
    drop_background(r);
    bus_message_free(&r->survey.message);
    store_clear(&r->store);
    free(r->background.list);
    free(r->list);
    free(r);
}
