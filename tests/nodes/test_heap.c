/* SPDX-License-Identifier: MIT */
/* heap_share, in a node, a bag and a tap beside it: what the C library says of its heaps.
 * AddressSanitizer has its own, of which it knows nothing. */
#include "tests/hal/scratch.h"

#include <malloc.h>
#include <pthread.h>
#include <sys/mman.h>

#include "msgs/bag/writer.h"
#include "nodes/record/tap.h"
#include "nodes/rt/node.h"
#include "nodes/rt/process.h"

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define OTHER_HEAP 1
#endif
#endif
#ifdef __SANITIZE_ADDRESS__
#define OTHER_HEAP 1
#endif

#ifndef OTHER_HEAP
static size_t count_heaps(void)
{
    char *text = NULL;
    size_t size, n = 0;
    FILE *f = open_memstream(&text, &size);

    assert_non_null(f);
    assert_int_equal(malloc_info(0, f), 0);
    assert_int_equal(fclose(f), 0);
    for (const char *at = text; (at = strstr(at, "<heap nr=")); at++)
        n++;
    free(text);
    return n;
}

static void *allocate(void *block)
{
    return *(void **)block = malloc(100000);
}

static void threads_of_a_node_share_one_heap(void **state)
{
    const struct scratch *scratch = *state;
    const struct arguments args = {.run_dir = scratch->folder};
    struct error why = {""};
    pthread_t threads[4];
    void *blocks[4];
    struct node *node; /* its bus has threads */

    assert_int_equal(node_start(&node, "scan", &args, &why), 0);
    for (size_t i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, allocate, &blocks[i]), 0);
    for (size_t i = 0; i < 4; i++)
        pthread_join(threads[i], NULL);
    assert_int_equal(count_heaps(), 1);
    for (size_t i = 0; i < 4; i++) {
        assert_non_null(blocks[i]);
        free(blocks[i]);
    }
    node_finish(node, 0);
}

/* Fills and empties the end of the heap; how much of it is there then, and was before. */
static void pile(size_t n, size_t *full, size_t *empty)
{
    void *blocks[40];

    assert_true(n <= 40);
    for (size_t i = 0; i < n; i++) {
        blocks[i] = malloc(100000);
        assert_non_null(blocks[i]);
    }
    *full = mallinfo2().arena;
    while (n)
        free(blocks[--n]);
    *empty = mallinfo2().arena;
}

static void what_a_few_messages_took_stays_what_a_pile_took_goes(void **state)
{
    size_t full, empty;

    (void)state;
    heap_share();
    pile(5, &full, &empty);
    assert_int_equal(empty, full);
    pile(40, &full, &empty);
    assert_true(empty <= full - 2500000);
}

static size_t in_use(void)
{
    struct mallinfo2 m = mallinfo2();

    return m.uordblks + m.hblkhd;
}

/* A recorder makes one every half minute, for days: what were large blocks of the heap
 * would leave holes there, and have it keep twice as much at its end. */
static void what_a_bag_gathers_is_none_of_the_heap(void **state)
{
    static uint8_t data[100000];
    const struct bag_writer_config cfg = {
        .profile = "", .library = "", .chunk_size = 4 << 20};
    const struct bag_channel channel = {.topic = bytes_of("sound")};
    struct bag_message m = {.data = {data, sizeof data}};
    struct bag_writer *w;
    size_t full, empty;

    assert_int_equal(bag_writer_create(&w, scratch_path(*state, "a.mcap"), &cfg, NULL),
                     0);
    assert_int_equal(bag_writer_channel(w, &channel, &m.channel_id, NULL), 0);
    size_t before = in_use();
    for (size_t i = 0; i < 80; i++) /* a chunk, and most of another */
        assert_int_equal(bag_writer_message(w, &m, NULL), 0);
    assert_true(in_use() < before + 500000);
    assert_int_equal(bag_writer_close(w, NULL), 0);
    pile(40, &full, &empty);
    assert_true(empty <= full - 2500000);
}

/* Bytes from one block to another that take memory. */
static size_t there(const char *from, const char *to)
{
    static unsigned char pages[4096];
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    char *begin = (char *)from + (page - (uintptr_t)from % page) % page;
    size_t n = (size_t)(to - begin) / page, sum = 0;

    assert_true(n <= sizeof pages);
    assert_int_equal(mincore(begin, n * page, pages), 0);
    for (size_t i = 0; i < n; i++)
        sum += pages[i] & 1 ? page : 0;
    return sum;
}

static void step(struct tap *t, struct fake_clock *clock, int64_t now_ns)
{
    struct error why = {""};

    clock->now_ns = now_ns;
    if (tap_step(t, 0, &why))
        fail_msg("%s", why.text);
}

/* It stays in the heap, but takes no memory. */
static void what_a_pile_took_below_a_block_that_stays_goes_in_a_recorder(void **state)
{
    const struct scratch *scratch = *state;
    const struct bus_config cfg = {.run_dir = scratch->folder, .listen_only = true};
    const int64_t start_ns = 1772366400000000000;
    enum { N = 40, SIZE = 100000 };
    struct fake_clock clock;
    struct error why = {""};
    struct bus *bus;
    struct tap tap;
    char *blocks[N], *last;

    fake_clock_set(&clock, start_ns);
    assert_int_equal(bus_create(&bus, &cfg, &why), 0);
    assert_int_equal(tap_open(&tap, bus, NULL, NULL, NULL, 0, &clock.source), 0);
    step(&tap, &clock, start_ns);
    for (size_t i = 0; i < N; i++) {
        assert_non_null(blocks[i] = malloc(SIZE));
        memset(blocks[i], 1, SIZE);
    }
    assert_non_null(last = malloc(SIZE));
    assert_true(last >= blocks[0] + N * SIZE);
    for (size_t i = 0; i < N; i++)
        free(blocks[i]);
    step(&tap, &clock, start_ns + 9000000000);
    assert_true(there(blocks[0], last) > (N - 1) * SIZE);
    step(&tap, &clock, start_ns + 10000000000);
    assert_true(there(blocks[0], last) < N * SIZE / 8);
    free(last);
    tap_close(&tap);
    bus_destroy(bus);
}
#endif

int main(void)
{
#ifdef OTHER_HEAP
    puts("skipped: the heap is AddressSanitizer's");
    return 77;
#else
    const struct CMUnitTest tests[] = {
        /* before anything that is large is freed */
        cmocka_unit_test(what_a_few_messages_took_stays_what_a_pile_took_goes),
        cmocka_unit_test_setup_teardown(what_a_bag_gathers_is_none_of_the_heap,
                                        scratch_open, scratch_close),
        cmocka_unit_test_setup_teardown(
            what_a_pile_took_below_a_block_that_stays_goes_in_a_recorder, scratch_open,
            scratch_close),
        cmocka_unit_test_setup_teardown(threads_of_a_node_share_one_heap, scratch_open,
                                        scratch_close),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
#endif
}
