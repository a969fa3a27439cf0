/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include <math.h>

#include "nodes/view/history.h"
#include "tests/nodes/near.h"

#define MS 1000000LL
#define S  1000000000LL
#define T0 (1795000000LL * S)

/* A list with objects of these levels, sent so long after its sound. */
static void take(struct history *h, int64_t at_ns, int64_t latency_ms, size_t n,
                 const double *levels_db)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    Anlos__Detection detections[4], *pointers[4];

    for (size_t i = 0; i < n; i++) {
        anlos__detection__init(&detections[i]);
        detections[i].level_db = levels_db[i];
        pointers[i] = &detections[i];
    }
    list.n_detections = n;
    list.detections = pointers;
    history_take(h, &list, at_ns - latency_ms * MS, at_ns, at_ns);
}

/* Of a curve; NaN: null. */
static double value(const json_t *o, const char *curve, size_t i)
{
    const json_t *v = json_array_get(json_object_get(o, curve), i);

    assert_non_null(v);
    return json_is_null(v) ? NAN : json_number_value(v);
}

static double number(const json_t *o, const char *key)
{
    return json_number_value(json_object_get(o, key));
}

static void a_point_is_the_largest_of_its_step(void **state)
{
    struct history h;

    (void)state;
    history_span(&h, T0, T0 + 480 * S - 480);
    take(&h, T0 + 10 * S, 40, 2, (const double[]){12.04, 31.26});
    take(&h, T0 + 10 * S + 300 * MS, 90, 1, (const double[]){20.0});
    take(&h, T0 + 10 * S + 600 * MS, 60, 0, NULL);
    take(&h, T0 + 12 * S, 55, 0, NULL);
    json_t *o = history_json(&h, 0);
    assert_near(number(o, "from_s"), 0.0, 1e-9);
    assert_near(number(o, "step_s"), 1.0, 1e-6);
    assert_int_equal(json_array_size(json_object_get(o, "objects")), HISTORY_POINTS);
    assert_near(value(o, "snr_db", 10), 31.3, 1e-9);
    assert_near(value(o, "latency_ms", 10), 90, 1e-9);
    assert_near(value(o, "objects", 10), 2, 0);
    assert_true(isnan(value(o, "snr_db", 11)) && isnan(value(o, "latency_ms", 11)) &&
                isnan(value(o, "objects", 11))); /* nothing came */
    assert_true(isnan(value(o, "snr_db", 12)));  /* nothing is there */
    assert_near(value(o, "latency_ms", 12), 55, 1e-9);
    assert_near(value(o, "objects", 12), 0, 0);
    json_decref(o);
}

static void a_running_system_shows_its_last_minutes(void **state)
{
    struct history h;

    (void)state;
    history_roll(&h, 250 * MS);
    assert_null(history_json(&h, T0));
    for (int64_t i = 0; i < 1000; i++) /* each with its number as its latency */
        take(&h, T0 + i * 250 * MS, i, 0, NULL);
    int64_t now_ns = T0 + 999 * 250 * MS + 10 * MS;
    json_t *o = history_json(&h, now_ns);
    double from_s = number(o, "from_s");
    assert_true(from_s > -120.01 && from_s <= -119.7);
    for (size_t i = 0; i < HISTORY_POINTS; i++)
        assert_near(value(o, "latency_ms", i), 520.0 + (double)i, 1e-9);
    json_decref(o);
    o = history_json(&h, now_ns + 60 * S); /* half of it is silence */
    assert_near(value(o, "latency_ms", 0), 760, 1e-9);
    assert_near(value(o, "latency_ms", 239), 999, 1e-9);
    assert_true(isnan(value(o, "objects", 240)));
    json_decref(o);
    assert_null(history_json(&h, now_ns + 1000 * S));
    take(&h, T0, 1, 0, NULL); /* of long ago: it takes nobody's place */
    o = history_json(&h, now_ns);
    assert_near(value(o, "latency_ms", 0), 520, 1e-9);
    json_decref(o);
}

static void a_latency_is_of_live_sound_and_one_clock(void **state)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    struct history h;

    (void)state;
    history_span(&h, T0, T0 + 480 * S - 480);
    take(&h, T0 + S, -5, 0, NULL);
    take(&h, T0 + 2 * S, 4000 * 1000, 0, NULL);
    history_take(&h, &list, 0, T0 + 3 * S, T0 + 3 * S);
    list.source = ANLOS__SOURCE__REPLAY;
    history_take(&h, &list, T0 + 4 * S - 50 * MS, T0 + 4 * S, T0 + 4 * S);
    list.source = ANLOS__SOURCE__SIMULATION;
    history_take(&h, &list, T0 + 5 * S - 50 * MS, T0 + 5 * S, T0 + 5 * S);
    json_t *o = history_json(&h, 0);
    for (size_t i = 1; i <= 5; i++) {
        assert_near(value(o, "objects", i), 0, 0);
        assert_true(isnan(value(o, "latency_ms", i)) == (i < 5));
    }
    assert_near(value(o, "latency_ms", 5), 50, 1e-9);
    json_decref(o);
}

/* What is predicted keeps the level that it was heard with last: it says nothing of now.
 */
static void only_what_was_heard_has_a_signal_and_what_is_gone_does_not_count(void **state)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    Anlos__Detection all[4], *pointers[4];
    static const Anlos__Measurement how[4] = {
        ANLOS__MEASUREMENT__MEASURED, ANLOS__MEASUREMENT__NEW,
        ANLOS__MEASUREMENT__PREDICTED, ANLOS__MEASUREMENT__DELETED};
    struct history h;

    (void)state;
    for (size_t i = 0; i < 4; i++) {
        anlos__detection__init(&all[i]);
        all[i].level_db = 20.0 + (double)i;
        all[i].measurement = how[i];
        pointers[i] = &all[i];
    }
    list.detections = pointers;
    list.n_detections = 4;
    history_span(&h, T0, T0 + S);
    history_take(&h, &list, T0, T0, T0);
    json_t *o = history_json(&h, 0);
    assert_near(value(o, "snr_db", 0), 21, 1e-9);
    assert_near(value(o, "objects", 0), 3, 0);
    json_decref(o);
}

static void what_is_outside_of_a_recording_is_left_out(void **state)
{
    struct history h;

    (void)state;
    history_span(&h, T0, T0 + S);
    take(&h, T0 - S, 0, 0, NULL);
    take(&h, T0 + 2 * S, 0, 0, NULL);
    assert_null(history_json(&h, 0));
    take(&h, T0, 0, 0, NULL); /* the first and the last are inside */
    take(&h, T0 + S, 0, 0, NULL);
    json_t *o = history_json(&h, 0);
    assert_near(value(o, "objects", 0), 0, 0);
    assert_near(value(o, "objects", HISTORY_POINTS - 1), 0, 0);
    json_decref(o);
    history_span(&h, T0, T0); /* of no length at all */
    take(&h, T0, 0, 0, NULL);
    json_decref(history_json(&h, 0));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_is_the_largest_of_its_step),
        cmocka_unit_test(a_running_system_shows_its_last_minutes),
        cmocka_unit_test(a_latency_is_of_live_sound_and_one_clock),
        cmocka_unit_test(
            only_what_was_heard_has_a_signal_and_what_is_gone_does_not_count),
        cmocka_unit_test(what_is_outside_of_a_recording_is_left_out),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
