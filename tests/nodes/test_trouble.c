/* SPDX-License-Identifier: MIT */
/* The status byte of one fault through what may happen to it, by ISO 14229-1, annex D.2:
 * 01 fails, 02 failed in this cycle, 04 pending, 08 confirmed, 10 not tested since it was
 * cleared, 20 failed since then, 40 not tested in this cycle. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "nodes/can/trouble.h"

#define S     1000000000LL
#define FAULT CAN_FAULT_ARRAY_AWAY

static uint8_t step(struct trouble_memory *m, bool fails, bool begun, int64_t now_ns)
{
    const struct freeze_frame now = {.unix_ms = (uint64_t)(now_ns / 1000000),
                                     .faults = (uint16_t)(fails << FAULT)};

    trouble_step(m, &now, begun, now_ns);
    return m->codes[FAULT].status;
}

static void a_code_keeps_what_has_been(void **state)
{
    struct trouble_memory m;

    (void)state;
    trouble_init(&m, 1u << FAULT);
    assert_int_equal(m.codes[FAULT].status, 0x50);
    assert_int_equal(step(&m, false, true, 1 * S), 0x00);
    assert_int_equal(step(&m, true, true, 2 * S), 0x2f);
    assert_int_equal(step(&m, true, true, 3 * S), 0x2f);
    assert_int_equal(step(&m, false, true, 4 * S), 0x2e);
    assert_int_equal(step(&m, true, true, 5 * S), 0x2f);
    assert_true(m.codes[FAULT].has_frame);
    assert_int_equal(m.codes[FAULT].first.unix_ms, 2000);
}

static void a_code_that_is_cleared_and_fails_on_has_failed_anew(void **state)
{
    struct trouble_memory m;

    (void)state;
    trouble_init(&m, 1u << FAULT);
    step(&m, true, true, 2 * S);
    trouble_clear(&m, FAULT);
    assert_int_equal(m.codes[FAULT].status, 0x50);
    assert_false(m.codes[FAULT].has_frame);
    assert_int_equal(step(&m, true, true, 3 * S), 0x2f);
    assert_int_equal(m.codes[FAULT].first.unix_ms, 3000);
    trouble_clear(&m, FAULT);
    assert_int_equal(step(&m, false, true, 4 * S), 0x00);
}

/* Before a sensor has begun there are no images yet, say, and none are missed. */
static void what_is_missing_at_the_start_has_failed_after_ten_seconds(void **state)
{
    struct trouble_memory m;

    (void)state;
    trouble_init(&m, 1u << FAULT);
    assert_int_equal(step(&m, true, false, 5 * S), 0x50);
    assert_int_equal(step(&m, false, false, 6 * S), 0x50);
    assert_int_equal(step(&m, true, false, 7 * S), 0x50);
    assert_int_equal(step(&m, true, false, 17 * S - 1), 0x50);
    assert_int_equal(step(&m, true, false, 17 * S), 0x2f);
    assert_int_equal(step(&m, false, false, 18 * S), 0x2e);
}

static void a_fault_that_is_not_tested_has_no_code(void **state)
{
    struct trouble_memory m;

    (void)state;
    trouble_init(&m, 1u << CAN_FAULT_CLIPPED);
    assert_true(trouble_supports(&m, CAN_FAULT_CLIPPED));
    assert_false(trouble_supports(&m, FAULT));
    assert_int_equal(step(&m, true, true, 1 * S), 0x50);
    assert_false(m.codes[FAULT].has_frame);
    assert_int_equal(m.codes[CAN_FAULT_CLIPPED].status, 0x00);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_code_keeps_what_has_been),
        cmocka_unit_test(a_code_that_is_cleared_and_fails_on_has_failed_anew),
        cmocka_unit_test(what_is_missing_at_the_start_has_failed_after_ten_seconds),
        cmocka_unit_test(a_fault_that_is_not_tested_has_no_code),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
