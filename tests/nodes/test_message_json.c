/* SPDX-License-Identifier: MIT */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/array.pb-c.h"
#include "msgs/detections.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/stage.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/topics.h"
#include "msgs/traces.pb-c.h"
#include "msgs/vehicle.pb-c.h"
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

/* Written as JSON and read back, it packs to the same bytes. */
static void goes_round(const ProtobufCMessage *m)
{
    struct error why = {0};
    ProtobufCMessage *back = NULL;
    json_t *j = message_json(m, true);
    size_t n = protobuf_c_message_get_packed_size(m);
    uint8_t *a = malloc(n + 1), *b = malloc(n + 1);
    assert_non_null(j);
    assert_int_equal(json_message(&back, j, m->descriptor, &why), 0);
    assert_int_equal(protobuf_c_message_get_packed_size(back), n);
    protobuf_c_message_pack(m, a);
    protobuf_c_message_pack(back, b);
    assert_memory_equal(a, b, n);
    protobuf_c_message_free_unpacked(back, NULL);
    json_decref(j);
    free(a);
    free(b);
}

static void what_was_written_reads_back_to_the_same_bytes(void **state)
{
    (void)state;
    float x[6] = {1, -2, 3.5f, 0, 5, 1.17549435e-38f};
    float complex z[2] = {3.0f + 4.0f * I, -1.0f};
    uint32_t clipped[3] = {1, 4000000000u, 3};
    struct tensor_view v, w;
    Anlos__Ping ping = ANLOS__PING__INIT;
    Anlos__Traces traces = ANLOS__TRACES__INIT;
    Anlos__StageState stage = ANLOS__STAGE_STATE__INIT;
    ping.survey_id = 18446744073709551615u;
    ping.clipped = clipped;
    ping.n_clipped = 3;
    ping.valid = 1;
    ping.samples = tensor_borrow_f32(&v, x, 2, (size_t)2, (size_t)3);
    traces.samples = tensor_borrow_c64(&w, z, 2, (size_t)1, (size_t)2);
    stage.state = ANLOS__STAGE_STATE__STATE__FAULT;
    stage.position_m = -0.125;
    stage.text = "it has \"lost\" its place";
    goes_round(&ping.base);
    goes_round(&traces.base);
    goes_round(&stage.base);
}

static void messages_inside_messages_read_back(void **state)
{
    (void)state;
    Anlos__Vec3 at = ANLOS__VEC3__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, *all[2] = {&d, &d};
    Anlos__DetectionList m = ANLOS__DETECTION_LIST__INIT;
    double covariance[6] = {1, 0, 0, 1, 0, 1};
    at.y = 0.25;
    d.position_m = &at;
    d.covariance_m2 = covariance;
    d.n_covariance_m2 = 6;
    m.detections = all;
    m.n_detections = 2;
    goes_round(&m.base);
}

static void an_empty_object_is_the_default_of_every_topic(void **state)
{
    (void)state;
    json_t *j = json_object();
    for (const struct topic *t = topics_all(); t->name; t++) {
        struct error why = {0};
        ProtobufCMessage *m = NULL;
        assert_int_equal(json_message(&m, j, t->schema, &why), 0);
        assert_int_equal(protobuf_c_message_get_packed_size(m), 0);
        goes_round(m);
        protobuf_c_message_free_unpacked(m, NULL);
    }
    json_decref(j);
}

static void null_is_nan_of_a_number(void **state)
{
    (void)state;
    struct error why = {0};
    ProtobufCMessage *m = NULL;
    json_t *j = json_loads("{\"temperature_c\": null, \"humidity\": 1}", 0, NULL);
    assert_int_equal(json_message(&m, j, &anlos__ambient__descriptor, &why), 0);
    assert_true(isnan(((Anlos__Ambient *)m)->temperature_c));
    assert_near(((Anlos__Ambient *)m)->humidity, 1.0, 0.0);
    protobuf_c_message_free_unpacked(m, NULL);
    json_decref(j);
}

static void a_place_may_be_three_numbers(void **state)
{
    (void)state;
    struct error why = {0};
    ProtobufCMessage *m = NULL;
    json_t *j =
        json_loads("{\"speakers_m\": [[1, 2, 3]], \"stage_axis\": [0, 1, 0]}", 0, NULL);
    assert_int_equal(json_message(&m, j, &anlos__survey__descriptor, &why), 0);
    const Anlos__Survey *s = (const Anlos__Survey *)m;
    assert_int_equal(s->n_speakers_m, 1);
    assert_near(s->speakers_m[0]->z, 3.0, 0.0);
    assert_near(s->stage_axis->y, 1.0, 0.0);
    protobuf_c_message_free_unpacked(m, NULL);
    json_decref(j);
}

static void what_does_not_fit_the_schema_is_named(void **state)
{
    (void)state;
    static const struct {
        const char *topic, *json, *says;
    } cases[] = {
        {"ego", "{\"sped_m_s\": 1}", "did you mean speed_m_s"},
        {"ego", "{\"xyzzy\": 1}", "it has speed_m_s, yaw_rate_rad_s, standstill, valid"},
        {"ego", "{\"speed_m_s\": \"3\"}", "speed_m_s: expected a number, not a text"},
        {"ego", "{\"valid\": 1}", "valid: expected true or false, not a whole number"},
        {"ego", "[]", "expected an object, {...}, not an array"},
        {"stage/manual", "{\"verb\": \"HALT\"}", "one of HOME, MOVE, STOP, RELEASE"},
        {"stage/manual", "{\"verb\": 7}", "one of HOME"},
        {"stage/manual", "{\"id\": -1}", "id: out of range: expected 0 to"},
        {"stage/manual", "{\"id\": \"-1\"}", "out of range"},
        {"stage/manual", "{\"id\": \"18446744073709551616\"}", "no whole number"},
        {"stage/manual", "{\"id\": 1.5}", "id: expected a whole number, not a number"},
        {"stage/command", "{\"id\": 4294967296}", "expected 0 to 4294967295"},
        {"stage/state", "{\"text\": 3}", "text: expected a text"},
        {"detections", "{\"detections\": {}}", "detections: expected an array"},
        {"detections", "{\"detections\": [{}, {\"position_m\": {\"w\": 1}}]}",
         "detections[1].position_m.w: anlos.Vec3 has no such field"},
        {"detections", "{\"detections\": [{\"position_m\": [1, 2]}]}",
         "position_m: expected three numbers"},
        {"detections", "{\"detections\": [{\"covariance_m2\": [1, true]}]}",
         "detections[0].covariance_m2[1]: expected a number, not true"},
        {"ping", "{\"samples\": {}}", "samples.type: is missing"},
        {"ping", "{\"samples\": {\"type\": \"FLOAT32\", \"shape\": [2]}}", "echo --full"},
        {"ping", "{\"samples\": {\"type\": \"FLOAT32\", \"shape\": [2], \"data\": [1]}}",
         "samples.data: 1 numbers, but the shape has 2"},
        {"ping",
         "{\"samples\": {\"type\": \"FLOAT32\", \"shape\": [1], \"data\": [1e39]}}",
         "samples.data[0]: out of range"},
        {"ping",
         "{\"samples\": {\"type\": \"FLOAT32\", \"shape\": [4294967295, 4294967295, "
         "4294967295], \"data\": []}}",
         "samples.shape: too large"},
        {"traces",
         "{\"samples\": {\"type\": \"COMPLEX64\", \"shape\": [1], "
         "\"data\": [1]}}",
         "samples.data[0]: expected [real, imaginary]"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {0};
        ProtobufCMessage *m = NULL;
        json_t *j = json_loads(cases[i].json, 0, NULL);
        assert_non_null(j);
        int err = json_message(&m, j, topics_find(cases[i].topic)->schema, &why);
        assert_int_equal(err, -EINVAL);
        if (!strstr(why.text, cases[i].says))
            fail_msg("%s: \"%s\" says not \"%s\"", cases[i].json, why.text,
                     cases[i].says);
        json_decref(j);
    }
}

static void a_path_names_one_field_or_that_of_each(void **state)
{
    (void)state;
    static const struct {
        const char *path, *is;
    } cases[] = {
        {"a", "1"},        {"b.1.x", "3"},    {"b.x", "[2,3]"},
        {"b.2.x", "null"}, {"c.d.e", "null"}, {"b.0", "{\"x\":2}"},
    };
    json_t *j =
        json_loads("{\"a\": 1, \"b\": [{\"x\": 2}, {\"x\": 3}], \"c\": null}", 0, NULL);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        json_t *one = field_path_pick(cases[i].path, j);
        char *text = json_dumps(one, JSON_COMPACT | JSON_ENCODE_ANY);
        assert_string_equal(text, cases[i].is);
        free(text);
        json_decref(one);
    }
    json_decref(j);
}

static void a_path_is_checked_by_the_schema(void **state)
{
    (void)state;
    const ProtobufCMessageDescriptor *d = &anlos__detection_list__descriptor;
    struct error why = {0};
    assert_int_equal(field_path_check("detections", d, &why), 0);
    assert_int_equal(field_path_check("detections.0.position_m.x", d, &why), 0);
    assert_int_equal(field_path_check("detections.existence", d, &why), 0);
    assert_int_equal(field_path_check("samples.max", &anlos__ping__descriptor, &why), 0);
    assert_int_equal(field_path_check("detections.existance", d, &why), -EINVAL);
    assert_non_null(strstr(why.text, "did you mean existence"));
    assert_int_equal(field_path_check("scan.0", d, &why), -EINVAL);
    assert_int_equal(field_path_check("detections..x", d, &why), -EINVAL);
    assert_int_equal(field_path_check("", d, &why), -EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_field_is_written_under_its_own_name),
        cmocka_unit_test(long_numbers_are_strings_and_nan_is_null),
        cmocka_unit_test(tensors_are_summarised),
        cmocka_unit_test(full_tensors_hold_every_number),
        cmocka_unit_test(messages_inside_messages_are_written),
        cmocka_unit_test(what_was_written_reads_back_to_the_same_bytes),
        cmocka_unit_test(messages_inside_messages_read_back),
        cmocka_unit_test(an_empty_object_is_the_default_of_every_topic),
        cmocka_unit_test(null_is_nan_of_a_number),
        cmocka_unit_test(a_place_may_be_three_numbers),
        cmocka_unit_test(what_does_not_fit_the_schema_is_named),
        cmocka_unit_test(a_path_names_one_field_or_that_of_each),
        cmocka_unit_test(a_path_is_checked_by_the_schema),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
