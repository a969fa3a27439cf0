/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "nodes/can/sender.h"

static struct can_object at(double x, double y, double existence)
{
    return (struct can_object){.position_m = {x, y, 0}, .existence = existence};
}

static void all_are_picked_in_their_order_when_they_fit(void **state)
{
    const struct can_object objects[] = {at(9, 0, 0.1), at(1, 0, 0.9), at(5, 0, 0.5)};
    size_t picked[CAN_MAX_OBJECTS];

    (void)state;
    assert_int_equal(pick_objects(objects, 3, 3, picked), 3);
    for (size_t i = 0; i < 3; i++)
        assert_int_equal(picked[i], i);
}

static void the_unlikely_ones_are_left_out_first(void **state)
{
    const struct can_object objects[] = {at(1, 0, 0.3), at(9, 0, 0.9), at(5, 0, 0.6)};
    size_t picked[CAN_MAX_OBJECTS];

    (void)state;
    assert_int_equal(pick_objects(objects, 3, 2, picked), 2);
    assert_int_equal(picked[0], 1);
    assert_int_equal(picked[1], 2);
}

/* A few percent say nothing. */
static void of_equally_likely_ones_the_far_ones_are(void **state)
{
    const struct can_object objects[] = {at(5, 0, 0.97), at(0, -2, 0.98), at(3, 3, 1.0),
                                         at(NAN, NAN, 1.0)};
    size_t picked[CAN_MAX_OBJECTS];

    (void)state;
    assert_int_equal(pick_objects(objects, 4, 2, picked), 2);
    assert_int_equal(picked[0], 1);
    assert_int_equal(picked[1], 2);
    assert_int_equal(pick_objects(objects, 4, 3, picked), 3);
    assert_int_equal(picked[0], 0);
}

static void of_the_same_the_first_stay(void **state)
{
    const struct can_object objects[] = {at(1, 1, 0.5), at(1, 1, 0.5), at(1, 1, 0.5)};
    size_t picked[CAN_MAX_OBJECTS];

    (void)state;
    assert_int_equal(pick_objects(objects, 3, 2, picked), 2);
    assert_int_equal(picked[0], 0);
    assert_int_equal(picked[1], 1);
}

/* NaN is neither more nor less than anything, and 7 more than 1. */
static void what_is_no_probability_is_less_than_any(void **state)
{
    static const double none[] = {NAN, INFINITY, -INFINITY, 7.0, 1.01, -0.01};
    size_t picked[CAN_MAX_OBJECTS];

    (void)state;
    for (size_t i = 0; i < sizeof none / sizeof *none; i++) {
        const struct can_object objects[] = {at(1, 0, none[i]), at(9, 0, 0.1),
                                             at(1, 0, none[i]), at(20, 0, 0.0)};
        assert_int_equal(pick_objects(objects, 4, 3, picked), 3);
        assert_int_equal(picked[0], 0);
        assert_int_equal(picked[1], 1);
        assert_int_equal(picked[2], 3);
        assert_int_equal(pick_objects(objects, 4, 2, picked), 2);
        assert_int_equal(picked[0], 1);
        assert_int_equal(picked[1], 3);
    }
}

static void nothing_may_be_room_for_nothing(void **state)
{
    const struct can_object objects[] = {at(1, 1, 0.5)};
    size_t picked[CAN_MAX_OBJECTS];

    (void)state;
    assert_int_equal(pick_objects(objects, 1, 0, picked), 0);
    assert_int_equal(pick_objects(objects, 0, 5, picked), 0);
}

static void detections_are_picked_by_the_same_rule(void **state)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    Anlos__Detection d[40], *pointers[40];
    Anlos__Vec3 near = ANLOS__VEC3__INIT, far = ANLOS__VEC3__INIT;
    size_t picked[CAN_MAX_OBJECTS];

    (void)state;
    near.x = 1;
    far.x = 30;
    for (size_t i = 0; i < 40; i++) {
        anlos__detection__init(&d[i]);
        d[i].existence = 0.8;
        d[i].position_m = i < 8 ? &far : &near;
        pointers[i] = &d[i];
    }
    d[39].position_m = NULL;
    d[0].existence = 1.0;
    list.detections = pointers;
    list.n_detections = 40;
    assert_int_equal(pick_detections(&list, CAN_MAX_OBJECTS, picked), CAN_MAX_OBJECTS);
    assert_int_equal(picked[0], 0); /* the likeliest, 31 near ones */
    assert_int_equal(picked[1], 8);
    assert_int_equal(picked[31], 38);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_are_picked_in_their_order_when_they_fit),
        cmocka_unit_test(the_unlikely_ones_are_left_out_first),
        cmocka_unit_test(of_equally_likely_ones_the_far_ones_are),
        cmocka_unit_test(of_the_same_the_first_stay),
        cmocka_unit_test(what_is_no_probability_is_less_than_any),
        cmocka_unit_test(nothing_may_be_room_for_nothing),
        cmocka_unit_test(detections_are_picked_by_the_same_rule),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
