/* SPDX-License-Identifier: MIT */
/* The last that a vehicle hears: that the sensor was stopped in order, if it was, and is
 * there now. */
#include "tests/hal/scratch.h"

#include <errno.h>

#include "msgs/can/frames.h"
#include "nodes/can/vehicle.h"
#include "nodes/rt/stop.h"

/* Status frames of a log, and those of them that say so. */
static void count(const char *path, size_t *statuses, size_t *shutdowns)
{
    FILE *f = fopen(path, "r");
    char line[256];

    assert_non_null(f);
    *statuses = *shutdowns = 0;
    while (fgets(line, sizeof line, f)) {
        struct can_frame_data frame = {.size = 8};
        struct can_status status;
        const char *at = strstr(line, " 400#");
        if (sscanf(at ? at : "", " %x#", &frame.id) != 1)
            continue;
        for (size_t i = 0; i < 8; i++)
            assert_int_equal(sscanf(at + 5 + 2 * i, "%2hhx", &frame.data[i]), 1);
        assert_int_equal(can_unpack_status(&frame, &status), 0);
        ++*statuses;
        *shutdowns += status.shutdown;
    }
    fclose(f);
}

/* A node that ends with err, *shutdowns: of the status frames that it sent. */
static size_t end(struct scratch *s, bool replay, int err)
{
    char launch[512], text[300];
    struct error why = {""};
    struct vehicle *v = NULL;
    struct node *n;
    size_t statuses, shutdowns;

    snprintf(text, sizeof text,
             "nodes: [track, can]\ncan: {uri: 'log:can.candump'}\nreport: {folder: %s}\n",
             s->folder);
    snprintf(launch, sizeof launch, "%s", scratch_write(s, "can.yaml", text));
    const struct arguments arguments = {.launch = launch,
                                        .run_dir = s->folder,
                                        .replay = replay,
                                        .log_level = LOG_LEVEL_ERROR};
    if (node_start(&n, "can", &arguments, &why) || vehicle_open(&v, n, &why))
        fail_msg("%s", why.text);
    for (int i = 0; i < 3; i++)
        assert_int_equal(vehicle_loop.timers[0].run(v), 0);
    assert_int_equal(vehicle_loop.end(v, err), err);
    vehicle_loop.close(v);
    node_finish(n, NODE_TOLD);
    count(scratch_path(s, "can.candump"), &statuses, &shutdowns);
    assert_int_equal(statuses > 0, !replay);
    return shutdowns;
}

static void one_that_was_stopped_in_order_says_so_more_than_once(void **state)
{
    assert_in_range(end(*state, false, -ESHUTDOWN), 2, 5);
    assert_in_range(end(*state, false, 0), 2, 5);
}

static void one_that_fails_says_nothing_of_order(void **state)
{
    assert_int_equal(end(*state, false, -EIO), 0);
}

static void in_a_replay_nothing_is_said_that_was_not_recorded(void **state)
{
    assert_int_equal(end(*state, true, -ESHUTDOWN), 0);
}

/* /dev/full takes nothing, as a disk that is full. */
static void one_whose_log_is_not_whole_has_failed(void **state)
{
    struct scratch *s = *state;
    char launch[512], text[300];
    struct error why = {""};
    struct vehicle *v = NULL;
    struct node *n;

    snprintf(text, sizeof text,
             "nodes: [track, can]\ncan: {uri: 'log:/dev/full'}\nreport: {folder: %s}\n",
             s->folder);
    snprintf(launch, sizeof launch, "%s", scratch_write(s, "can.yaml", text));
    const struct arguments arguments = {
        .launch = launch, .run_dir = s->folder, .log_level = LOG_LEVEL_ERROR};
    if (node_start(&n, "can", &arguments, &why) || vehicle_open(&v, n, &why))
        fail_msg("%s", why.text);
    assert_int_equal(vehicle_loop.timers[0].run(v), 0);
    int err = vehicle_loop.end(v, -ESHUTDOWN);
    assert_int_equal(err, NODE_TOLD);
    vehicle_loop.close(v);
    assert_int_equal(node_finish(n, err), EXIT_FAILED);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(one_that_was_stopped_in_order_says_so_more_than_once),
        TEST(one_that_fails_says_nothing_of_order),
        TEST(in_a_replay_nothing_is_said_that_was_not_recorded),
        TEST(one_whose_log_is_not_whole_has_failed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
