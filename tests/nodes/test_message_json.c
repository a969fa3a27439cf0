/* SPDX-License-Identifier: MIT */
#include <complex.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/array.pb-c.h"
#include "msgs/detections.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/traces.pb-c.h"
#include "nodes/anlos/topic/message_json.h"
#include "tests/nodes/near.h"

static void every_field_is_written_under_its_own_name(void **state)
{
    (void)state;
    Anlos__ScanStatus m = ANLOS__SCAN_STATUS__INIT;
    m.state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    m.pings_done = 7;
    m.time_left_s = 1.5;
    m.text = "waits for \"dsp\"";
    json_t *j = message_json(&m.base, false);
    assert_int_equal(json_object_size(j), anlos__scan_status__descriptor.n_fields);
    assert_string_equal(json_string_value(json_object_get(j, "state")), "RUNNING");
    assert_string_equal(json_string_value(json_object_get(j, "pass")), "SCENE");
    assert_int_equal(json_integer_value(json_object_get(j, "pings_done")), 7);
    assert_near(json_real_value(json_object_get(j, "time_left_s")), 1.5, 0.0);
    assert_string_equal(json_string_value(json_object_get(j, "text")), m.text);
    json_decref(j);
}

static void long_numbers_are_strings_and_nan_is_null(void **state)
{
    (void)state;
    Anlos__Ping m = ANLOS__PING__INIT;
    uint32_t clipped[3] = {1, 4000000000u, 3};
    m.survey_id = 18446744073709551615u;
    m.temperature_c = NAN;
    m.clipped = clipped;
    m.n_clipped = 3;
    m.valid = 1;
    json_t *j = message_json(&m.base, false);
    assert_string_equal(json_string_value(json_object_get(j, "survey_id")),
                        "18446744073709551615");
    assert_true(json_is_null(json_object_get(j, "temperature_c")));
    assert_true(json_is_null(json_object_get(j, "samples")));
    assert_true(json_is_true(json_object_get(j, "valid")));
    const json_t *c = json_object_get(j, "clipped");
    assert_int_equal(json_array_size(c), 3);
    assert_int_equal(json_integer_value(json_array_get(c, 1)), 4000000000u);
    json_decref(j);
}

static void tensors_are_summarised(void **state)
{
    (void)state;
    float x[6] = {1, -2, 3, 0, 5, 4};
    struct tensor_view v;
    Anlos__Ping m = ANLOS__PING__INIT;
    m.samples = tensor_borrow_f32(&v, x, 2, (size_t)2, (size_t)3);
    json_t *j = message_json(&m.base, false), *t = json_object_get(j, "samples");
    assert_string_equal(json_string_value(json_object_get(t, "type")), "FLOAT32");
    assert_int_equal(json_integer_value(json_array_get(json_object_get(t, "shape"), 1)),
                     3);
    assert_near(json_real_value(json_object_get(t, "min")), -2.0, 0.0);
    assert_near(json_real_value(json_object_get(t, "max")), 5.0, 0.0);
    assert_null(json_object_get(t, "data"));
    json_decref(j);
}

static void full_tensors_hold_every_number(void **state)
{
    (void)state;
    float complex x[2] = {3.0f + 4.0f * I, -1.0f};
    struct tensor_view v;
    Anlos__Traces m = ANLOS__TRACES__INIT;
    m.samples = tensor_borrow_c64(&v, x, 2, (size_t)1, (size_t)2);
    json_t *j = message_json(&m.base, true), *t = json_object_get(j, "samples");
    const json_t *data = json_object_get(t, "data");
    assert_near(json_real_value(json_object_get(t, "min")), 1.0, 1e-6);
    assert_near(json_real_value(json_object_get(t, "max")), 5.0, 1e-6);
    assert_int_equal(json_array_size(data), 2);
    assert_near(json_real_value(json_array_get(json_array_get(data, 0), 1)), 4.0, 0.0);
    json_decref(j);
}

static void messages_inside_messages_are_written(void **state)
{
    (void)state;
    Anlos__Vec3 at = ANLOS__VEC3__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, *all[2] = {&d, &d};
    Anlos__DetectionList m = ANLOS__DETECTION_LIST__INIT;
    at.y = 0.25;
    d.position_m = &at;
    m.detections = all;
    m.n_detections = 2;
    json_t *j = message_json(&m.base, false), *list = json_object_get(j, "detections");
    assert_int_equal(json_array_size(list), 2);
    const json_t *p = json_object_get(json_array_get(list, 1), "position_m");
    assert_near(json_real_value(json_object_get(p, "y")), 0.25, 0.0);
    json_decref(j);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_field_is_written_under_its_own_name),
        cmocka_unit_test(long_numbers_are_strings_and_nan_is_null),
        cmocka_unit_test(tensors_are_summarised),
        cmocka_unit_test(full_tensors_hold_every_number),
        cmocka_unit_test(messages_inside_messages_are_written),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
