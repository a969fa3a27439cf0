/* SPDX-License-Identifier: MIT */
/* The last seconds of a bus: what is there follows from what was put, when, and how large
 * it was. */
#include "record_rig.h"

#include <sys/mman.h>
#include <unistd.h>

#include "msgs/array.pb-c.h"
#include "nodes/record/ring.h"

#define S    1000000000LL
#define WIDE ((size_t)1 << 40)

struct gone {
    size_t n;
    uint64_t lost;
};

static void count_gone(void *context, const struct ring_entry *e)
{
    struct gone *g = context;

    g->n++;
    g->lost += e->message.payload ? 1 : e->lost;
}

static struct ring *open_ring(int64_t span_ns, size_t max_bytes, struct gone *gone)
{
    const struct ring_config cfg = {.span_ns = span_ns,
                                    .max_bytes = max_bytes,
                                    .overrun = gone ? count_gone : NULL,
                                    .context = gone};
    struct ring *r;

    assert_int_equal(ring_create(&r, &cfg), 0);
    return r;
}

/* Messages are the test's own, of static memory. */
static void put_sized(struct ring *r, const struct topic *t, uint64_t sequence,
                      const uint8_t *payload, size_t size, int64_t at_ns)
{
    struct bus_message m = {.topic = t, .payload = payload};

    m.envelope.sequence = sequence;
    m.envelope.epoch_ns = EPOCH_NS;
    m.envelope.payload_size = (uint32_t)size;
    assert_int_equal(ring_put(r, &m, at_ns), 0);
    assert_null(m.payload); /* taken over */
}

static void put(struct ring *r, uint64_t sequence, size_t size, int64_t at_ns)
{
    static const uint8_t payload[100000] = {0xff}; /* no protobuf */

    put_sized(r, topic_traces(), sequence, payload, size, at_ns);
}

static void check_sequences(const struct ring *r, uint64_t first, uint64_t last)
{
    uint64_t k = ring_begin(r);

    for (uint64_t want = first; want <= last; want++, k++)
        assert_int_equal(ring_at(r, k)->message.envelope.sequence, want);
    assert_int_equal(k, ring_end(r));
    assert_null(ring_at(r, k));
    assert_true(!ring_begin(r) || !ring_at(r, ring_begin(r) - 1));
}

static size_t cost(size_t size)
{
    return sizeof(struct ring_entry) + ENVELOPE_SIZE + size;
}

static void what_is_older_than_its_span_goes_and_no_more(void **state)
{
    struct ring *r = open_ring(3 * S, WIDE, NULL);
    struct ring_totals t;

    (void)state;
    for (uint64_t i = 0; i < 5000;
         i++) { /* of which 300 are in 3 s, and the first of it */
        put(r, i, 10, (int64_t)i * S / 100);
        check_sequences(r, i < 300 ? 0 : i - 300, i);
    }
    ring_sum(r, &t);
    assert_int_equal(t.bytes, 301 * cost(10));
    assert_int_equal(t.n, 301);
    assert_int_equal(t.oldest_ns, 4699 * S / 100);
    assert_int_equal(t.shortened, 0);
    ring_trim(r, 4999 * S / 100 + S);
    check_sequences(r, 4799, 4999);
    ring_destroy(r);
}

/* It begins with room for fewer. */
static void all_of_a_long_span_are_kept(void **state)
{
    struct ring *r = open_ring(3600 * S, WIDE, NULL);

    (void)state;
    for (uint64_t i = 0; i < 10; i++) /* so that its beginning is not that of its list */
        put(r, i, 10, 0);
    for (uint64_t i = 10; i < 50000; i++)
        put(r, i, 10, 3601 * S);
    check_sequences(r, 10, 49999);
    ring_destroy(r);
}

static void more_than_its_bytes_are_never_there(void **state)
{
    struct ring *r = open_ring(3600 * S, 10 * cost(1000), NULL);
    struct ring_totals t;

    (void)state;
    for (uint64_t i = 0; i < 25; i++) {
        put(r, i, 1000, 0);
        check_sequences(r, i < 10 ? 0 : i - 9, i);
        ring_sum(r, &t);
        assert_int_equal(t.bytes, (i < 10 ? i + 1 : 10) * cost(1000));
        assert_int_equal(t.shortened, i < 10 ? 0 : i - 9);
    }
    /* One as large as five of them makes room for itself; one that is larger than all
     * does not fit at all. */
    put(r, 25, 5 * cost(1000) - cost(0), 0);
    check_sequences(r, 20, 25);
    put(r, 26, 10 * cost(1000), 0);
    ring_sum(r, &t);
    assert_int_equal(t.n, 0);
    assert_int_equal(t.bytes, 0);
    ring_destroy(r);
}

static void the_newest_survey_stays(void **state)
{
    static const uint8_t payload[200] = {1};
    struct ring *r = open_ring(S, WIDE, NULL);
    struct ring_totals t;

    (void)state;
    assert_null(ring_kept(r, 0));
    put_sized(r, topic_survey(), 1, payload, 200, 0);
    put_sized(r, topic_survey(), 2, payload, 200, S / 2);
    assert_null(ring_kept(r, 0)); /* both are there */
    put(r, 3, 10, 5 * S / 4);
    assert_int_equal(ring_kept(r, 0)->message.envelope.sequence, 1);
    put(r, 4, 10, 2 * S);
    assert_int_equal(ring_kept(r, 0)->message.envelope.sequence, 2);
    assert_null(ring_kept(r, 1));
    check_sequences(r, 3, 4);
    ring_sum(r, &t);
    assert_int_equal(t.bytes, 2 * cost(10) + cost(200));
    ring_destroy(r);
}

/* A packed ping of that pass and scan; its size. */
static size_t pack_ping(uint8_t out[100], Anlos__Pass pass, uint32_t scan)
{
    Anlos__Ping p = ANLOS__PING__INIT;
    Anlos__Tensor samples = ANLOS__TENSOR__INIT;

    p.samples = &samples;
    p.pass = pass;
    p.scan = scan;
    assert_true(anlos__ping__get_packed_size(&p) < 100);
    return anlos__ping__pack(&p, out);
}

static void put_ping(struct ring *r, uint64_t sequence, Anlos__Pass pass, uint32_t scan,
                     int64_t at_ns)
{
    static uint8_t rooms[64][100]; /* they stay in the ring */
    uint8_t *room = rooms[sequence % 64];

    put_sized(r, topic_ping(), sequence, room, pack_ping(room, pass, scan), at_ns);
}

static void the_background_of_the_newest_scan_stays(void **state)
{
    struct ring *r = open_ring(S, WIDE, NULL);

    (void)state;
    for (uint64_t i = 0; i < 3; i++)
        put_ping(r, i, ANLOS__PASS__BACKGROUND, 1, 0);
    put_ping(r, 3, ANLOS__PASS__SCENE, 1, 0);
    put_ping(r, 4, ANLOS__PASS__BACKGROUND, 2, 2 * S);
    put_ping(r, 5, ANLOS__PASS__SCENE, 2, 2 * S);
    for (size_t i = 0; i < 3; i++)
        assert_int_equal(ring_kept(r, i)->message.envelope.sequence, i);
    assert_null(ring_kept(r, 3));
    put(r, 6, 10, 4 * S); /* those of scan 2 go, and with them those of scan 1 */
    assert_int_equal(ring_kept(r, 0)->message.envelope.sequence, 4);
    assert_null(ring_kept(r, 1));
    check_sequences(r, 6, 6);
    ring_destroy(r);
}

static void a_background_of_more_than_half_of_all_is_counted_and_goes(void **state)
{
    uint8_t room[100];
    size_t one = cost(pack_ping(room, ANLOS__PASS__BACKGROUND, 1));
    struct ring *r = open_ring(S, 20 * one, NULL);
    struct ring_totals t;

    (void)state;
    for (uint64_t i = 0; i < 15; i++)
        put_ping(r, i, ANLOS__PASS__BACKGROUND, 1, 0);
    ring_trim(r, 2 * S);
    ring_sum(r, &t);
    assert_int_equal(t.background_gone, 15); /* not its first ten, nor its last five */
    assert_int_equal(t.bytes, 0);
    assert_null(ring_kept(r, 0));
    put_ping(r, 15, ANLOS__PASS__BACKGROUND, 2, 3 * S);
    ring_trim(r, 5 * S);
    assert_int_equal(ring_kept(r, 0)->message.envelope.sequence, 15);
    ring_destroy(r);
}

static void a_background_of_half_of_all_stays(void **state)
{
    uint8_t room[100];
    size_t one = cost(pack_ping(room, ANLOS__PASS__BACKGROUND, 1));
    struct ring *r = open_ring(S, 20 * one, NULL);
    struct ring_totals t;

    (void)state;
    for (uint64_t i = 0; i < 10; i++)
        put_ping(r, i, ANLOS__PASS__BACKGROUND, 1, 0);
    ring_trim(r, 2 * S);
    ring_sum(r, &t);
    assert_int_equal(t.background_gone, 0);
    assert_int_equal(t.background_bytes, 10 * one);
    for (size_t i = 0; i < 10; i++)
        assert_int_equal(ring_kept(r, i)->message.envelope.sequence, i);
    ring_destroy(r);
}

static void what_is_held_goes_only_for_want_of_room_and_is_reported(void **state)
{
    struct gone gone = {0};
    struct ring *r = open_ring(S, 10 * cost(1000), &gone);

    (void)state;
    for (uint64_t i = 0; i < 4; i++)
        put(r, i, 1000, 0);
    ring_hold(r, 2);
    put(r, 4, 1000, 5 * S); /* the others are too old, two of them are held */
    check_sequences(r, 2, 4);
    assert_int_equal(gone.n, 0);
    for (uint64_t i = 5; i < 12; i++)
        put(r, i, 1000, 5 * S);
    check_sequences(r, 2, 11);
    put(r, 12, 1000, 5 * S);
    check_sequences(r, 3, 12);
    assert_int_equal(gone.n, 1);
    ring_hold(r, UINT64_MAX);
    put(r, 13, 1000, 20 * S);
    check_sequences(r, 13, 13);
    assert_int_equal(gone.n, 1);
    ring_destroy(r);
}

static void what_got_lost_has_its_place(void **state)
{
    struct ring *r = open_ring(S, WIDE, NULL);

    (void)state;
    put(r, 0, 10, 0);
    assert_int_equal(ring_lost(r, topic_ping(), 7, S / 2), 0);
    put(r, 8, 10, S / 2);
    const struct ring_entry *e = ring_at(r, 1);
    assert_null(e->message.payload);
    assert_ptr_equal(e->message.topic, topic_ping());
    assert_int_equal(e->lost, 7);
    put(r, 9, 10, 3 * S / 2 + 1);
    check_sequences(r, 9, 9);
    ring_destroy(r);
}

/* Sizes as by chance; now and then what is large falls silent, as when a node was killed.
 * A segment may end with less room than a message takes; of the first and the last there
 * may be hardly anything, and one is spare. */
static void its_memory_is_that_of_what_is_there(void **state)
{
    enum { SEGMENT = 2 << 20, MOST = 100000 + 100 };
    struct ring *r = open_ring(3 * S, WIDE, NULL);
    uint32_t chance = 1;
    struct ring_totals t;

    (void)state;
    for (uint64_t i = 0; i < 200000; i++) { /* 1000 a second */
        chance = chance * 1664525u + 1013904223u;
        bool small = i / 5000 % 3 == 0 || chance >> 16 & 1;
        put(r, i, (chance >> 8) % (small ? 500 : 100000), (int64_t)i * S / 1000);
        ring_sum(r, &t);
        assert_true(t.store_bytes / SEGMENT <= t.bytes / (SEGMENT - MOST) + 3);
    }
    ring_destroy(r);
}

/* Those who come while it was stopped wait for it, and come at once. */
static void what_a_pile_took_goes_with_it(void **state)
{
    struct ring *r = open_ring(3 * S, WIDE, NULL);
    struct ring_totals usual, pile, after;
    uint64_t i = 0;

    (void)state;
    for (; i < 5000; i++)
        put(r, i, 50000, (int64_t)i * S / 1000);
    ring_sum(r, &usual);
    for (; i < 10000; i++)
        put(r, i, 50000, 10 * S);
    ring_sum(r, &pile);
    for (; i < 15000; i++)
        put(r, i, 50000, (int64_t)(i + 1000) * S / 1000);
    ring_sum(r, &after);
    assert_true(pile.store_bytes > usual.store_bytes + (80 << 20));
    assert_true(after.store_bytes <= usual.store_bytes + (2 << 20));
    ring_destroy(r);
}

/* Else each message that ends beyond those before it would make it a little larger. */
static void a_segment_is_there_as_a_whole(void **state)
{
    enum { SEGMENT = 2 << 20 };
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    struct ring *r = open_ring(S, WIDE, NULL);
    unsigned char there[SEGMENT / 4096];

    (void)state;
    put(r, 0, 100, 0);
    uintptr_t first = (uintptr_t)ring_at(r, 0)->message.payload / page * page;
    assert_int_equal(mincore((void *)first, SEGMENT, there), 0);
    for (size_t i = 0; i < SEGMENT / page; i++)
        assert_true(there[i] & 1);
    ring_destroy(r);
}

static void what_is_kept_is_what_came(void **state)
{
    static uint8_t payload[512 << 10];
    static const size_t sizes[] = {0, 1, 300, 300000, 512 << 10, 17, 500000};
    enum { N = sizeof sizes / sizeof *sizes };
    struct ring *r = open_ring(8 * S, WIDE, NULL);

    (void)state;
    for (uint64_t i = 0; i < 20 * N; i++) {
        memset(payload, (int)i, sizes[i % N]); /* of all that came before */
        put_sized(r, topic_traces(), i, payload, sizes[i % N], (int64_t)i * S / 4);
        for (uint64_t k = ring_begin(r); k != ring_end(r); k++) {
            const struct bus_message *m = &ring_at(r, k)->message;
            assert_int_equal(m->envelope.payload_size, sizes[k % N]);
            assert_non_null(m->payload);
            for (size_t at = 0; at < sizes[k % N]; at += 99)
                assert_int_equal(m->payload[at], (uint8_t)k);
        }
    }
    ring_destroy(r);
}

static void what_is_large_is_not_copied(void **state)
{
    static const uint8_t payload[(512 << 10) + 1];
    struct ring *r = open_ring(S, WIDE, NULL);
    struct ring_totals t;

    (void)state;
    put_sized(r, topic_traces(), 0, payload, sizeof payload, 0);
    assert_ptr_equal(ring_at(r, 0)->message.payload, payload);
    ring_sum(r, &t);
    assert_int_equal(t.store_bytes, 0);
    assert_int_equal(t.bytes, cost(sizeof payload));
    ring_destroy(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_older_than_its_span_goes_and_no_more),
        cmocka_unit_test(all_of_a_long_span_are_kept),
        cmocka_unit_test(more_than_its_bytes_are_never_there),
        cmocka_unit_test(the_newest_survey_stays),
        cmocka_unit_test(the_background_of_the_newest_scan_stays),
        cmocka_unit_test(a_background_of_more_than_half_of_all_is_counted_and_goes),
        cmocka_unit_test(a_background_of_half_of_all_stays),
        cmocka_unit_test(what_is_held_goes_only_for_want_of_room_and_is_reported),
        cmocka_unit_test(what_got_lost_has_its_place),
        cmocka_unit_test(its_memory_is_that_of_what_is_there),
        cmocka_unit_test(what_a_pile_took_goes_with_it),
        cmocka_unit_test(a_segment_is_there_as_a_whole),
        cmocka_unit_test(what_is_kept_is_what_came),
        cmocka_unit_test(what_is_large_is_not_copied),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
