/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "msgs/can/frames.h"
#include "nodes/can/sender.h"

#define MS 1000000LL

enum { LISTS = 4000, WANTED = CAN_MAX_OBJECTS };

static const struct bus_budget_config usual = {.rate = {500e3, 2e6}, .load = 0.5};

/* 11-bit identifier and eight bytes: 135 bits with all stuff bits; 87 frames of others in
 * a second at most. */
static double list_s(size_t n_objects, double bit_s)
{
    return 135 * (2 + 3 * (double)n_objects) / bit_s;
}

struct sent {
    int64_t ns;
    size_t objects;
};

static size_t send(struct bus_budget *a, const struct bus_budget_config *cfg, int64_t ns,
                   size_t wanted)
{
    size_t room = bus_budget_objects(a, cfg, ns, 0);
    size_t n = room < wanted ? room : wanted;

    assert_in_range(room, 0, CAN_MAX_OBJECTS);
    bus_budget_begin(a, cfg, ns, n, 0);
    return n;
}

/* The lists with objects that begin in a second, and what is still on its way of the one
 * before. */
static double busiest_s(const struct sent *sent, size_t n, double bit_s)
{
    double most = 0.0;

    for (size_t from = 0; from < n; from++) {
        double sum = from ? list_s(sent[from - 1].objects, bit_s) : 0.0;
        for (size_t i = from; i < n && sent[i].ns - sent[from].ns < 1000 * MS; i++)
            sum += sent[i].objects ? list_s(sent[i].objects, bit_s) : 0.0;
        most = fmax(most, sum);
    }
    return most;
}

static double uniform(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005ull + 1442695040888963407ull;
    return (double)(*seed >> 11) / 9007199254740992.0;
}

/* Lists at a pace that wanders, in bursts and with silences. */
static void no_second_is_busier_than_allowed_however_lists_come(void **state)
{
    static const double loads[] = {0.1, 0.25, 0.5, 0.9};
    static struct sent sent[LISTS];
    uint64_t seed = 3;

    (void)state;
    for (size_t k = 0; k < sizeof loads / sizeof *loads; k++) {
        struct bus_budget_config cfg = usual;
        struct bus_budget a = {0};
        int64_t now = 1700000000000 * MS;
        double gap_ms = 24;
        cfg.load = loads[k];
        for (size_t i = 0; i < LISTS; i++) {
            if (uniform(&seed) < 0.01)
                gap_ms = 5 + 200 * uniform(&seed);
            now += (int64_t)(uniform(&seed) < 0.005 ? 3000 * MS
                                                    : gap_ms * uniform(&seed) * 2 * MS);
            sent[i] = (struct sent){now, send(&a, &cfg, now, WANTED)};
        }
        assert_true(busiest_s(sent, LISTS, 500e3) <= loads[k] - 87 * 135 / 500e3);
    }
}

/* The first second is one, too: what it may take is 0.5 s less the 87 frames. */
static void the_first_second_keeps_the_bound(void **state)
{
    struct bus_budget a = {0};
    struct sent sent[42];

    (void)state;
    for (size_t i = 0; i < 42; i++)
        sent[i] = (struct sent){(int64_t)i * 24 * MS,
                                send(&a, &usual, (int64_t)i * 24 * MS, WANTED)};
    assert_true(busiest_s(sent, 42, 500e3) <= 0.5 - 87 * 135 / 500e3);
    assert_int_equal(sent[0].objects, 32); /* nobody knows yet how fast they come */
}

/* 0.477 s for 42 to 44 lists are 40 to 42 frames each, 13 objects; and in the first
 * second nine of ten have some. */
static void each_list_has_its_share(void **state)
{
    struct bus_budget a = {0};
    uint64_t seed = 5;
    int some = 0;

    (void)state;
    for (int64_t i = 0; i < 1000; i++) {
        int64_t late_ns = (int64_t)(uniform(&seed) * 20 * MS);
        size_t n = send(&a, &usual, i * 24 * MS + late_ns, WANTED);
        some += i < 42 && n >= 8;
        if (i >= 44)
            assert_in_range(n, 12, 14);
    }
    assert_in_range(some, 38, 42);
}

/* What lists did not take, others may. */
static void a_crowd_after_empty_lists_is_let_through(void **state)
{
    struct bus_budget a = {0};
    int64_t i = 0;

    (void)state;
    for (; i < 100; i++)
        assert_int_equal(send(&a, &usual, i * 100 * MS, 0), 0);
    for (; i < 200; i++)
        assert_int_equal(send(&a, &usual, i * 100 * MS, WANTED), WANTED);
}

/* 0.5 / (135 / 125e3) = 462 frames, less 87, for 12 lists of 2 + 3 n. */
static void a_slow_bus_carries_fewer_objects(void **state)
{
    const struct bus_budget_config slow = {.rate = {125e3, 125e3}, .load = 0.5};
    const struct bus_budget_config crawling = {.rate = {10e3, 10e3}, .load = 0.5};
    struct bus_budget a = {0}, b = {0};
    size_t n = 0;

    (void)state;
    for (int64_t i = 0; i < 50; i++) {
        n = send(&a, &slow, i * 100 * MS, WANTED);
        assert_int_equal(send(&b, &crawling, i * 100 * MS, WANTED), 0);
    }
    assert_int_equal(n, 9);
}

static void a_clock_that_goes_back_begins_anew(void **state)
{
    struct bus_budget a = {0};

    (void)state;
    for (int64_t i = 0; i < 100; i++)
        send(&a, &usual, (1000000 + i) * MS, WANTED);
    assert_int_equal(send(&a, &usual, (1000000 + 100) * MS, WANTED), 0);
    assert_int_equal(send(&a, &usual, 5 * MS, WANTED), WANTED);
    assert_int_equal(send(&a, &usual, INT64_MIN, WANTED), WANTED);
    assert_int_equal(send(&a, &usual, INT64_MAX, WANTED), WANTED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_second_is_busier_than_allowed_however_lists_come),
        cmocka_unit_test(the_first_second_keeps_the_bound),
        cmocka_unit_test(each_list_has_its_share),
        cmocka_unit_test(a_crowd_after_empty_lists_is_let_through),
        cmocka_unit_test(a_slow_bus_carries_fewer_objects),
        cmocka_unit_test(a_clock_that_goes_back_begins_anew),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
