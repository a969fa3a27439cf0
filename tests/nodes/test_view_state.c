/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include <stdio.h>
#include <string.h>

#include "msgs/detections.pb-c.h"
#include "msgs/health.pb-c.h"
#include "msgs/log.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/volume.pb-c.h"
#include "nodes/view/view.h"
#include "tests/nodes/near.h"

#define MS 1000000LL
#define S  1000000000LL

static struct view *open_view(void)
{
    struct view *v;
    assert_int_equal(view_create(&v, "/run/somewhere", false), 0);
    return v;
}

static void tell(struct view *v, const struct topic *topic, const void *content,
                 int64_t epoch_ns, int64_t now_ns)
{
    const struct view_message m = {.topic = topic,
                                   .from = "somebody",
                                   .content = content,
                                   .capture_ns = 5,
                                   .publish_ns = now_ns,
                                   .epoch_ns = epoch_ns};
    view_take(v, &m, now_ns);
}

/* The newest frame of a type that the reader has not seen, its images in *images; NULL:
 * there is none.  The board never blocks here: a beat is always behind what is looked
 * for. */
static json_t *read_on(struct view *v, struct board_reader *r, const char *type,
                       uint8_t *images)
{
    json_t *found = NULL;

    for (bool ended = false; !ended;) {
        struct frame *f = board_next(view_board(v), r);
        size_t size, length, head = 0;
        bool binary;
        const uint8_t *data = frame_data(f, &size, &binary);
        if (binary) {
            length = (size_t)data[0] | (size_t)data[1] << 8 | (size_t)data[2] << 16;
            head = 4;
        } else {
            length = size;
        }
        json_t *o = json_loadb((const char *)data + head, length, 0, NULL);
        const char *name = json_string_value(json_object_get(o, "type"));
        ended = !strcmp(name, "time");
        if (!strcmp(name, type)) {
            json_decref(found);
            found = json_incref(o);
            if (images)
                memcpy(images, data + head + length, size - head - length);
        }
        json_decref(o);
        frame_drop(f);
    }
    return found;
}

static const char *text(const json_t *o, const char *key)
{
    return json_string_value(json_object_get(o, key));
}

static json_int_t number(const json_t *o, const char *key)
{
    return json_integer_value(json_object_get(o, key));
}

static void frames_come_at_most_ten_times_a_second(void **state)
{
    struct view *v = open_view();
    struct board_reader r = {0};
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;

    (void)state;
    s.state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    s.pass = ANLOS__PASS__BACKGROUND;
    s.pings_expected = 100;
    s.text = (char *)"as it goes";
    view_tick(v, 10 * S);
    json_decref(read_on(v, &r, "hello", NULL));
    for (int i = 0; i < 50; i++) { /* in 100 ms */
        s.pings_done = (uint32_t)i;
        tell(v, topic_scan_status(), &s, 1, 10 * S + i * 2 * MS);
        assert_in_range(view_tick(v, 10 * S + i * 2 * MS), 1, 101);
    }
    view_tick(v, 10 * S + 150 * MS);
    uint64_t before = board_skipped(view_board(v));
    view_beat(v, 11 * S);
    json_t *o = read_on(v, &r, "scan", NULL);
    assert_int_equal(number(o, "done"), 49);
    assert_string_equal(text(o, "state"), "running");
    assert_string_equal(text(o, "pass"), "background");
    assert_int_equal(board_skipped(view_board(v)), before); /* there was one alone */
    json_decref(o);
    board_close(view_board(v), &r);
    view_destroy(v);
}

static void a_reader_that_is_slow_gets_the_newest_and_the_rest_is_counted(void **state)
{
    struct view *v = open_view();
    struct board_reader slow = {0}, late = {0};
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;

    (void)state;
    s.text = (char *)"";
    for (int i = 1; i <= 5; i++) {
        s.pings_done = (uint32_t)i;
        tell(v, topic_scan_status(), &s, 1, i * S);
        view_tick(v, i * S);
        if (i == 1)
            json_decref(read_on(v, &slow, "scan", NULL));
    }
    json_t *o = read_on(v, &slow, "scan", NULL);
    assert_int_equal(number(o, "done"), 5);
    json_decref(o);
    assert_int_equal(board_skipped(view_board(v)), 6); /* 3 of the scan, 3 beats */
    o = read_on(v, &late, "scan", NULL); /* what came before it missed nothing of */
    assert_int_equal(number(o, "done"), 5);
    json_decref(o);
    assert_int_equal(board_skipped(view_board(v)), 6);
    board_close(view_board(v), &slow);
    assert_null(board_next(view_board(v), &slow));
    board_close(view_board(v), &late);
    view_destroy(v);
}

static void tell_health(struct view *v, const char *node, double up_s, double cpu_s,
                        int64_t epoch_ns, int64_t now_ns)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__TopicCount in = ANLOS__TOPIC_COUNT__INIT, out = ANLOS__TOPIC_COUNT__INIT;
    Anlos__TopicCount *counts[2] = {&in, &out};

    in.topic = out.topic = (char *)"ping";
    in.gaps = 2;
    in.dropped = 3;
    out.published = true;
    out.dropped = 100; /* not what this node lost */
    h.node = (char *)node;
    h.text = (char *)"ready";
    h.state = ANLOS__HEALTH__STATE__READY;
    h.uptime_s = up_s;
    h.cpu_s = cpu_s;
    h.topics = counts;
    h.n_topics = 2;
    tell(v, topic_health(), &h, epoch_ns, now_ns);
}

static void plots_over_time_come_once_a_second_and_roll_on(void **state)
{
    struct view *v = open_view();
    struct board_reader r = {0};
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    double last_s = 1.0;

    (void)state;
    view_tick(v, 10 * S);
    assert_null(read_on(v, &r, "history", NULL));
    tell(v, topic_detections(), &list, 1, 10 * S + 100 * MS);
    for (int i = 0; i < 3; i++) { /* it is a second older each time */
        for (int k = 1; k <= 10; k++)
            view_tick(v, (11 + i) * S + 1 + k * 100 * MS);
        json_t *o = read_on(v, &r, "history", NULL);
        assert_non_null(o);
        const json_t *objects = json_object_get(o, "objects");
        size_t at = json_array_size(objects);
        while (at && json_is_null(json_array_get(objects, at - 1)))
            at--;
        double s = json_real_value(json_object_get(o, "from_s")) +
                   (double)at * json_real_value(json_object_get(o, "step_s"));
        assert_true(s < last_s && s > -4.5);
        last_s = s - 0.6;
        json_decref(o);
    }
    board_close(view_board(v), &r);
    view_destroy(v);
}

static void a_node_that_says_nothing_more_is_silent(void **state)
{
    struct view *v = open_view();
    struct board_reader r = {0};

    (void)state;
    tell_health(v, "track", 10.0, 1.0, 7, 100 * S);
    tell_health(v, "array", 10.0, 1.0, 7, 100 * S);
    tell_health(v, "array", 12.0, 1.5, 7, 102 * S);
    tell_health(v, "array", 99.0, 0.0, 6, 102 * S); /* late, of the process before */
    view_tick(v, 102 * S);
    json_t *o = read_on(v, &r, "nodes", NULL), *list = json_object_get(o, "nodes");
    const json_t *array = json_array_get(list, 0), *track = json_array_get(list, 1);
    assert_string_equal(text(array, "node"), "array"); /* the way the data goes */
    assert_string_equal(text(track, "node"), "track");
    assert_near(json_real_value(json_object_get(array, "cpu")), 0.25, 1e-6);
    assert_near(json_real_value(json_object_get(track, "cpu")), 0.1, 1e-6);
    assert_int_equal(number(array, "lost"), 5);
    assert_string_equal(text(track, "state"), "ready");
    json_decref(o);
    view_tick(v, 104 * S);
    o = read_on(v, &r, "nodes", NULL);
    list = json_object_get(o, "nodes");
    assert_string_equal(text(json_array_get(list, 0), "state"), "ready");
    assert_string_equal(text(json_array_get(list, 1), "state"), "silent");
    assert_int_equal(number(json_array_get(list, 1), "age_ms"), 4000);
    json_decref(o);
    board_close(view_board(v), &r);
    view_destroy(v);
}

static void the_log_keeps_its_newest_lines(void **state)
{
    struct view *v = open_view();
    struct board_reader r = {0};
    Anlos__Log l = ANLOS__LOG__INIT;
    char line[32];

    (void)state;
    l.node = (char *)"dsp";
    l.level = ANLOS__LOG__LEVEL__WARNING;
    l.text = line;
    for (int i = 0; i < 250; i++) {
        snprintf(line, sizeof line, "line %d", i);
        l.stamp_ns = 1795000000123LL * MS + i * MS;
        tell(v, topic_log(), &l, 1, 5 * S);
    }
    view_tick(v, 5 * S);
    json_t *o = read_on(v, &r, "log", NULL), *lines = json_object_get(o, "lines");
    assert_int_equal(json_array_size(lines), 100);
    assert_string_equal(text(json_array_get(lines, 99), "text"), "line 249");
    assert_string_equal(text(json_array_get(lines, 0), "text"), "line 150");
    assert_string_equal(text(json_array_get(lines, 0), "level"), "warning");
    assert_int_equal(number(json_array_get(lines, 99), "ms"), 1795000000372LL);
    json_decref(o);
    board_close(view_board(v), &r);
    view_destroy(v);
}

static void tell_volume(struct view *v, uint32_t pings, float first, int64_t now_ns)
{
    float x[2 * 3 * 4] = {[23] = 1.0f};
    struct tensor_view view;
    Anlos__Vec3 origin = ANLOS__VEC3__INIT, step = ANLOS__VEC3__INIT;
    Anlos__Volume m = ANLOS__VOLUME__INIT;

    x[0] = first;
    origin.z = 2.0;
    step.x = step.y = step.z = 0.1;
    m.origin_m = &origin;
    m.step_m = &step;
    m.intensity = tensor_borrow_f32(&view, x, 3, (size_t)2, (size_t)3, (size_t)4);
    m.method = (char *)"fast";
    m.pings_used = pings;
    m.pings_expected = 24;
    m.source = ANLOS__SOURCE__SIMULATION;
    tell(v, topic_volume(), &m, 1, now_ns);
}

static void an_image_is_made_once_and_sliced_when_asked(void **state)
{
    struct view *v = open_view();
    struct board_reader r = {0};
    uint8_t images[12 + 8 + 6];
    size_t size;
    bool binary;

    (void)state;
    assert_null(view_slice(v, 0));
    tell_volume(v, 12, 0.1f, 1 * S); /* -10 dB at the first voxel */
    tell_volume(v, 12, 0.1f, 2 * S); /* repeated for those who missed it */
    view_tick(v, 2 * S);
    json_t *o = read_on(v, &r, "volume", images);
    assert_int_equal(board_skipped(view_board(v)), 0);
    assert_int_equal(number(o, "id"), 1);
    assert_int_equal(json_integer_value(json_array_get(json_object_get(o, "n"), 2)), 2);
    assert_string_equal(text(o, "source"), "simulation");
    assert_int_equal(images[0], 215);          /* xy, first row */
    assert_int_equal(images[11], 255);         /* its last */
    assert_int_equal(images[12 + 0], 215);     /* xz */
    assert_int_equal(images[12 + 8 + 5], 255); /* yz */
    json_decref(o);
    struct frame *f = view_slice(v, 0);
    const uint8_t *data = frame_data(f, &size, &binary);
    assert_true(binary);
    assert_int_equal(data[size - 12], 215);
    assert_int_equal(data[size - 1], 0);
    frame_drop(f);
    assert_null(view_slice(v, 2));
    tell_volume(v, 24, 0.0f, 3 * S);
    view_tick(v, 3 * S);
    o = read_on(v, &r, "volume", images);
    assert_int_equal(number(o, "id"), 2);
    assert_int_equal(images[0], 0);
    json_decref(o);
    board_close(view_board(v), &r);
    view_destroy(v);
}

static void another_place_of_a_bag_begins_with_nothing(void **state)
{
    struct view *v = open_view();
    struct board_reader r = {0};
    static const char *const types[] = {"scene", "scan",    "stage",  "nodes",
                                        "walls", "objects", "levels", "volume"};
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;

    (void)state;
    tell_volume(v, 24, 0.0f, 1 * S);
    tell(v, topic_detections(), &list, 1, 1 * S);
    tell_health(v, "array", 1.0, 0.1, 1, 1 * S);
    view_reset(v);
    view_flush(v, 5 * S);
    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        struct board_reader fresh = {0};
        json_t *o = read_on(v, &fresh, types[i], NULL);
        assert_true(json_is_true(json_object_get(o, "none")));
        json_decref(o);
        board_close(view_board(v), &fresh);
    }
    tell_volume(v, 24, 0.0f, 1 * S); /* the image is still there, and is shown again */
    view_flush(v, 6 * S);
    json_t *o = read_on(v, &r, "volume", (uint8_t[26]){0});
    assert_int_equal(number(o, "id"), 1);
    json_decref(o);
    board_close(view_board(v), &r);
    view_destroy(v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_come_at_most_ten_times_a_second),
        cmocka_unit_test(a_reader_that_is_slow_gets_the_newest_and_the_rest_is_counted),
        cmocka_unit_test(plots_over_time_come_once_a_second_and_roll_on),
        cmocka_unit_test(a_node_that_says_nothing_more_is_silent),
        cmocka_unit_test(the_log_keeps_its_newest_lines),
        cmocka_unit_test(an_image_is_made_once_and_sliced_when_asked),
        cmocka_unit_test(another_place_of_a_bag_begins_with_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
