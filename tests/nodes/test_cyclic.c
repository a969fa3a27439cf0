/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/can/cyclic.h"
#include "nodes/can/sender.h"

#define MS 1000000LL

struct rig {
    struct sender sender;
    struct outbox outbox;
    struct diagnosis diagnosis;
    struct watch watch;
    struct cyclic cyclic;
};

static int setup(void **state)
{
    const struct watch_config watched = {.replayed = true};
    struct sender_config cfg;
    struct rig *r = calloc(1, sizeof *r);

    if (!r)
        return -1;
    sender_config_set(&cfg, NULL);
    sender_init(&r->sender, &cfg);
    outbox_init(&r->outbox, NULL, clock_system(), &r->sender);
    watch_init(&r->watch, &watched);
    diagnosis_init(&r->diagnosis, 2);
    r->cyclic = (struct cyclic){.sender = &r->sender,
                                .outbox = &r->outbox,
                                .diagnosis = &r->diagnosis,
                                .watch = &r->watch};
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    free(*state);
    return 0;
}

/* Was one put since? */
static bool goes(struct rig *r, enum outbox_cyclic kind)
{
    bool was = r->outbox.waits[kind];

    r->outbox.waits[kind] = false;
    return was;
}

static void status_and_diagnosis_keep_their_cycles(void **state)
{
    struct rig *r = *state;
    int statuses = 0, diagnoses = 0;

    for (int64_t ms = 0; ms < 3000; ms += 7) { /* never exactly when it is due */
        cyclic_step(&r->cyclic, (1000 + ms) * MS);
        statuses += goes(r, OUTBOX_STATUS);
        diagnoses += goes(r, OUTBOX_DIAGNOSIS);
    }
    assert_int_equal(statuses, 30);
    assert_int_equal(diagnoses, 3);
    assert_int_equal(r->outbox.n_lists, 0);
}

static void a_change_of_the_status_does_not_wait(void **state)
{
    struct rig *r = *state;

    cyclic_step(&r->cyclic, 1000 * MS);
    assert_true(goes(r, OUTBOX_STATUS));
    cyclic_step(&r->cyclic, 1010 * MS);
    assert_false(goes(r, OUTBOX_STATUS));
    r->sender.status.faults = 1;
    cyclic_step(&r->cyclic, 1011 * MS);
    assert_true(goes(r, OUTBOX_STATUS));
}

/* A status that never stays what it is, for ten seconds: in no second more than its cycle
 * and the changes that the bus's load is judged by. */
static void a_status_that_flickers_is_bounded_and_keeps_its_cycle(void **state)
{
    struct rig *r = *state;
    int64_t sent_ns[1000], last_ns = 0;
    size_t n = 0;

    for (int64_t ms = 1; ms < 10000; ms++) {
        r->sender.status.faults ^= 1;
        cyclic_step(&r->cyclic, ms * MS);
        if (!goes(r, OUTBOX_STATUS))
            continue;
        assert_true(!n || ms * MS - last_ns <= 100 * MS);
        sent_ns[n++] = last_ns = ms * MS;
    }
    assert_true(n > 150);
    for (size_t i = 0; i + 1 < n; i++) {
        size_t within = 0;
        for (size_t k = i; k < n && sent_ns[k] - sent_ns[i] < 1000 * MS; k++)
            within++;
        assert_in_range(within, 1, 11 + CAN_STATUS_CHANGES);
    }
}

/* Four times a second while no image comes; of the newest sound that there was. */
static void where_no_image_comes_empty_lists_go(void **state)
{
    struct rig *r = *state;

    r->watch.faults = 1u << CAN_FAULT_IMAGE_STALE;
    r->watch.capture_ns = 77 * MS;
    for (int64_t ms = 1000; ms < 1750; ms += 10)
        cyclic_step(&r->cyclic, ms * MS);
    assert_int_equal(r->outbox.n_lists, 3);
    assert_int_equal(r->outbox.lists[2].n_objects, 0);
    assert_int_equal(r->outbox.lists[2].capture_ns, 77 * MS);
    r->watch.faults = 0;
    cyclic_step(&r->cyclic, 3000 * MS);
    assert_int_equal(r->outbox.n_lists, 3);
}

/* It is well again, and not yet for long enough. */
static void lists_that_come_while_the_sensor_is_faulty_go_alone(void **state)
{
    const Anlos__DetectionList message = ANLOS__DETECTION_LIST__INIT;
    struct rig *r = *state;

    r->watch.faults = 1u << CAN_FAULT_IMAGE_STALE;
    for (int64_t ms = 1000; ms < 2000; ms += 10) {
        if (ms % 200 == 0)
            watch_list(&r->watch, &message, ms * MS, ms * MS);
        cyclic_step(&r->cyclic, ms * MS);
    }
    assert_int_equal(r->outbox.n_lists, 0);
    cyclic_step(&r->cyclic, 2060 * MS);
    assert_int_equal(r->outbox.n_lists, 1);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(status_and_diagnosis_keep_their_cycles),
        TEST(a_change_of_the_status_does_not_wait),
        TEST(a_status_that_flickers_is_bounded_and_keeps_its_cycle),
        TEST(where_no_image_comes_empty_lists_go),
        TEST(lists_that_come_while_the_sensor_is_faulty_go_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
