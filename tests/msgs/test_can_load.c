/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "msgs/can/frames.h"
#include "msgs/can/load.h"

static const struct can_bus_rate rate = {500e3, 2e6};

static void assert_about(double value, double expected)
{
    if (fabs(value - expected) > 1e-9 + 1e-6 * fabs(expected))
        fail_msg("%.9g, expected %.9g", value, expected);
}

/* The table of Davis et al.: 55, 65, ... 135 bits for 0..8 bytes. */
static void a_classic_frame_has_the_bits_of_the_literature(void **state)
{
    (void)state;
    for (size_t n = 0; n <= 8; n++)
        assert_about(can_frame_s(&rate, n, false), (double)(55 + 10 * n) / 500e3);
}

/* The longest stuffing there is, bit by bit: the same five in a row, then each stuff bit
 * begins the next four. */
static size_t worst_stuff(size_t bits)
{
    size_t run = 0, stuff = 0;

    for (size_t i = 0; i < bits; i++) {
        run++;
        if (run == 5) {
            stuff++;
            run = 1; /* the stuff bit, and what follows is like it */
        }
    }
    return stuff;
}

/* 17 bits up to BRS and 13 from the delimiter on at the first rate; ESI, length, 512 bits
 * of data, stuff count, CRC-21 and its 7 fixed stuff bits at the second. */
static void an_fd_frame_of_64_bytes_takes_407_microseconds(void **state)
{
    (void)state;
    size_t slow = 17 + worst_stuff(17) + 13;
    size_t fast = 1 + 4 + 512 + worst_stuff(534) - worst_stuff(17) + 4 + 21 + 7;
    double expected = (double)slow / 500e3 + (double)fast / 2e6;
    assert_about(can_frame_s(&rate, 64, true), expected);
    assert_true(expected > 406e-6 && expected < 408e-6);
}

/* Header, time and three frames of 135 bits for each object. */
static void thirty_two_objects_take_98_frames(void **state)
{
    (void)state;
    assert_about(can_list_s(&rate, 0, false, true), 2 * 135 / 500e3);
    assert_about(can_list_s(&rate, 32, false, false), 98 * 135 / 500e3);
    assert_about(can_list_s(&rate, 32, false, true), 130 * 135 / 500e3);
    assert_about(can_list_s(&rate, 32, true, false),
                 2 * 135 / 500e3 + 32 * can_frame_s(&rate, 64, true));
    assert_about(can_list_s(&rate, 32, true, true),
                 34 * 135 / 500e3 + 32 * can_frame_s(&rate, 64, true));
}

/* A frame of 135 bits for each corner: at ten lists a second, 16 corners take 4.3 % of
 * 500 kbit/s. */
static void a_field_of_view_takes_a_frame_for_each_corner(void **state)
{
    (void)state;
    assert_about(can_view_s(&rate, 0), 0.0);
    assert_about(10 * can_view_s(&rate, 16), 0.0432);
}

/* 10 + 1 of status and diagnosis, 50 + 1 + 2 * 10 + 1 of the vehicle, each kind once
 * more, 10 changes of the status, and 5 repetitions of a request to save. */
static void what_comes_in_cycles_takes_105_frames_at_most(void **state)
{
    (void)state;
    assert_about(can_cycles_s(&rate), (83 + 7 + 10 + 5) * 135 / 500e3);
}

static void ten_full_lists_a_second_fit_in_three_tenths_of_500_kbit(void **state)
{
    (void)state;
    double load = 10 * can_list_s(&rate, 32, false, false) + can_cycles_s(&rate);
    assert_true(load > 0.29 && load < 0.295);
    assert_true(10 * can_list_s(&rate, 32, true, false) + can_cycles_s(&rate) < 0.17);
    load = 10 * can_list_s(&rate, 32, false, true) + can_cycles_s(&rate);
    assert_true(load > 0.37 && load < 0.38);
    assert_true(10 * can_list_s(&rate, 32, true, true) + can_cycles_s(&rate) < 0.26);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_classic_frame_has_the_bits_of_the_literature),
        cmocka_unit_test(an_fd_frame_of_64_bytes_takes_407_microseconds),
        cmocka_unit_test(thirty_two_objects_take_98_frames),
        cmocka_unit_test(a_field_of_view_takes_a_frame_for_each_corner),
        cmocka_unit_test(what_comes_in_cycles_takes_105_frames_at_most),
        cmocka_unit_test(ten_full_lists_a_second_fit_in_three_tenths_of_500_kbit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
