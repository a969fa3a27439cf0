/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "msgs/can/e2e.h"
#include "msgs/can/frames.h"

static struct can_frame_data status(uint32_t base)
{
    struct can_frame_data f;

    can_pack_status(&f, base, &(struct can_status){.state = CAN_ACTIVE});
    return f;
}

static struct can_frame_data object(uint32_t base)
{
    struct can_frame_data f;

    can_pack_object_fd(&f, base, &(struct can_object){.id = 3});
    return f;
}

static enum e2e_verdict pass(struct can_protection *p, struct can_checks *c,
                             struct can_frame_data f)
{
    can_protect(p, &f);
    can_protection_sent(p, &f);
    return can_check(c, &f);
}

static void each_identifier_counts_for_itself(void **state)
{
    struct can_protection p = {.base = 0x410};
    struct can_checks c = {.base = 0x410};

    (void)state;
    for (int i = 0; i < 300; i++) {
        assert_int_equal(pass(&p, &c, status(0x410)), E2E_OK);
        assert_int_equal(pass(&p, &c, object(0x410)), E2E_OK);
        assert_int_equal(pass(&p, &c, object(0x410)), E2E_OK);
    }
    assert_int_equal(p.counters[CAN_ID_STATUS], 300 % 15);
    assert_int_equal(p.counters[CAN_ID_OBJECT_FD], 600 % 256);
}

/* The CRC here goes bit by bit over low byte, 0 and bytes 1..7: a second one. */
static void a_frame_carries_its_identifier_as_data_id(void **state)
{
    struct can_protection p = {.base = 0x400, .counters = {[CAN_ID_STATUS] = 1}};
    struct can_frame_data f = status(0x400);

    (void)state;
    can_protect(&p, &f);
    assert_int_equal(f.data[1], 0x41);
    uint8_t covered[9] = {0x00, 0x00}, crc = 0;
    memcpy(covered + 2, f.data + 1, 7);
    for (size_t i = 0; i < 9 * 8; i++) {
        unsigned in = covered[i / 8] >> (7 - i % 8) & 1u;
        crc = (uint8_t)((crc << 1) ^ (in != crc >> 7 ? 0x1d : 0));
    }
    assert_int_equal(f.data[0], crc);
}

static void protection_leaves_the_rest_of_a_frame_alone(void **state)
{
    struct can_protection p = {.base = 0x400, .counters = {[CAN_ID_OBJECT_FD] = 200}};
    struct can_frame_data f, bare;

    (void)state;
    can_pack_object_fd(&bare, 0x400,
                       &(struct can_object){.id = 255, .counter = 0xfff, .wall = 9});
    f = bare;
    can_protect(&p, &f);
    assert_int_equal(f.data[2], 200);
    assert_memory_equal(f.data + 3, bare.data + 3, sizeof f.data - 3);
}

static void a_frame_tried_twice_leaves_no_gap(void **state)
{
    struct can_protection p = {.base = 0x400};
    struct can_checks c = {.base = 0x400};
    struct can_frame_data f = status(0x400);

    (void)state;
    assert_int_equal(pass(&p, &c, f), E2E_OK);
    can_protect(&p, &f); /* which the bus does not take */
    assert_int_equal(pass(&p, &c, f), E2E_OK);
}

static void lost_repeated_and_foreign_frames_are_known(void **state)
{
    struct can_protection p = {.base = 0x400}, other = {.base = 0x410};
    struct can_checks c = {.base = 0x400};
    struct can_frame_data f = status(0x400);

    (void)state;
    assert_int_equal(pass(&p, &c, f), E2E_OK);
    can_protection_sent(&p, &f);
    can_protection_sent(&p, &f);
    assert_int_equal(pass(&p, &c, f), E2E_SOME_LOST);
    for (int i = 0; i < CAN_MAX_DELTA; i++)
        can_protection_sent(&p, &f);
    assert_int_equal(pass(&p, &c, f), E2E_WRONG_SEQUENCE);
    p.counters[CAN_ID_STATUS]--;
    assert_int_equal(pass(&p, &c, f), E2E_REPEATED);

    f = status(0x410);
    can_protect(&other, &f);
    assert_int_equal(can_check(&c, &f), E2E_WRONG_CRC);
    f.id = 0x400; /* the frame of another sensor under our identifier */
    assert_int_equal(can_check(&c, &f), E2E_WRONG_CRC);
}

static void a_frame_of_another_length_or_kind_is_wrong(void **state)
{
    struct can_protection p = {.base = 0x400};
    struct can_checks c = {.base = 0x400};
    struct can_frame_data f = status(0x400);

    (void)state;
    can_protect(&p, &f);
    f.size = 7;
    assert_int_equal(can_check(&c, &f), E2E_WRONG_CRC);
    f.size = 8;
    f.fd = true;
    assert_int_equal(can_check(&c, &f), E2E_WRONG_CRC);
    f.fd = false;
    assert_int_equal(can_check(&c, &f), E2E_OK);
}

static void what_is_forgotten_begins_anew(void **state)
{
    struct can_protection p = {.base = 0x400};
    struct can_checks c = {.base = 0x400};

    (void)state;
    pass(&p, &c, status(0x400));
    pass(&p, &c, object(0x400));
    p.counters[CAN_ID_STATUS] = 9;
    p.counters[CAN_ID_OBJECT_FD] = 90;
    can_checks_forget(&c, CAN_ID_STATUS);
    assert_int_equal(pass(&p, &c, status(0x400)), E2E_OK);
    assert_int_equal(pass(&p, &c, object(0x400)), E2E_WRONG_SEQUENCE);
}

static void a_frame_that_is_not_ours_is_left_alone(void **state)
{
    struct can_protection p = {.base = 0x400};
    struct can_frame_data f = {.id = 0x40A, .size = 8}, before = f;

    (void)state;
    can_protect(&p, &f);
    can_protection_sent(&p, &f);
    assert_memory_equal(&f, &before, sizeof f);
    f.id = 0x400;
    f.size = 1;
    can_protect(&p, &f);
    assert_int_equal(f.data[0], 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_identifier_counts_for_itself),
        cmocka_unit_test(a_frame_carries_its_identifier_as_data_id),
        cmocka_unit_test(protection_leaves_the_rest_of_a_frame_alone),
        cmocka_unit_test(a_frame_tried_twice_leaves_no_gap),
        cmocka_unit_test(lost_repeated_and_foreign_frames_are_known),
        cmocka_unit_test(a_frame_of_another_length_or_kind_is_wrong),
        cmocka_unit_test(what_is_forgotten_begins_anew),
        cmocka_unit_test(a_frame_that_is_not_ours_is_left_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
