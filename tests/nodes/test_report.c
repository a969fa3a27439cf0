#include "tests/hal/scratch.h"

#include <jansson.h>
#include <math.h>
#include <unistd.h>

#include "nodes/report/report.h"
#include "nodes/report/report_json.h"
#include "tests/nodes/near.h"
#include "tests/nodes/scene.h"

#define S 1000000000LL

static void tell_status(struct report *r, Anlos__ScanStatus__State state, int64_t now_ns)
{
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;

    s.state = state;
    s.scan = 1;
    s.pings_expected = 48;
    s.pings_done = 47;
    s.pings_retaken = 3;
    s.pings_lost = 1;
    s.text = (char *)"as it went";
    assert_int_equal(report_status(r, &s, now_ns), 0);
}

static void tell_volume(struct report *r, bool preview, int64_t capture_ns,
                        int64_t publish_ns)
{
    static const float intensity[2 * 3 * 4] = {[7] = 1.0f};
    struct tensor_view view;
    Anlos__Vec3 v = ANLOS__VEC3__INIT;
    Anlos__Volume m = ANLOS__VOLUME__INIT;

    v.x = v.y = v.z = 0.1;
    m.scan = 1;
    m.preview = preview;
    m.origin_m = &v;
    m.step_m = &v;
    m.intensity = tensor_borrow_f32(&view, intensity, 3, (size_t)2, (size_t)3, (size_t)4);
    m.method = (char *)"fast";
    m.pings_used = 23;
    m.pings_expected = 24;
    m.imaging_s = 0.004;
    assert_int_equal(report_volume(r, &m, capture_ns, publish_ns), 0);
}

static void tell_detections(struct report *r, bool preview)
{
    Anlos__DetectionList m = ANLOS__DETECTION_LIST__INIT;

    m.scan = 1;
    m.preview = preview;
    assert_int_equal(report_detections(r, &m), 0);
}

static void tell_health(struct report *r, const char *node, int64_t epoch_ns,
                        uint64_t gaps, uint64_t dropped)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__TopicCount c = ANLOS__TOPIC_COUNT__INIT, *list = &c;
    Anlos__DeviceCount d = ANLOS__DEVICE_COUNT__INIT, *device = &d;

    c.topic = (char *)"ping";
    c.gaps = gaps;
    c.dropped = dropped;
    h.node = (char *)node;
    h.text = (char *)"ready";
    h.topics = &list;
    h.n_topics = 1;
    h.refused = 1;
    d.name = (char *)"overruns";
    d.value = gaps + 10;
    h.device = &device;
    h.n_device = 1;
    assert_int_equal(report_health(r, &h, epoch_ns), 0);
}

static void it_is_complete_with_the_end_the_volume_and_the_detections(void **state)
{
    struct report r;

    (void)state;
    report_init(&r);
    assert_false(report_is_complete(&r, 0));
    tell_volume(&r, false, 1, 2);
    tell_detections(&r, false);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__RUNNING, 1 * S);
    assert_false(report_is_complete(&r, 1 * S));
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__DONE, 2 * S);
    assert_true(report_is_complete(&r, 2 * S));
    report_clear(&r);
}

static void previews_do_not_count(void **state)
{
    struct report r;

    (void)state;
    report_init(&r);
    tell_volume(&r, true, 1, 2);
    tell_detections(&r, true);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__DONE, 2 * S);
    assert_false(report_is_complete(&r, 100 * S));
    tell_volume(&r, false, 1, 2);
    assert_false(report_is_complete(&r, 100 * S));
    tell_detections(&r, false);
    assert_true(report_is_complete(&r, 100 * S));
    report_clear(&r);
}

static void a_failed_scan_is_waited_for_only_so_long(void **state)
{
    struct report r;

    (void)state;
    report_init(&r);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__FAILED, 2 * S);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__FAILED, 4 * S); /* repeated */
    assert_false(report_is_complete(&r, 6 * S));
    assert_true(report_is_complete(&r, 8 * S));
    report_clear(&r);
}

static double number(const json_t *o, const char *a, const char *b)
{
    const json_t *x = json_object_get(json_object_get(o, a), b);

    assert_true(json_is_number(x));
    return json_number_value(x);
}

static void the_report_says_how_it_went(void **state)
{
    struct report r;

    (void)state;
    report_init(&r);
    r.ping_s = 0.05;
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__RUNNING, 1 * S);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__DONE, 11 * S);
    tell_volume(&r, false, 10 * S, 10 * S + 75000000);
    tell_volume(&r, false, 10 * S, 12 * S); /* repeated */
    tell_health(&r, "dsp", 5, 2, 3);
    tell_health(&r, "recon", 5, 0, 1);
    tell_health(&r, "dsp", 6, 4, 0); /* restarted */
    tell_health(&r, "dsp", 5, 9, 9); /* late, of the process before */
    json_t *o = report_json(&r);
    assert_string_equal(json_string_value(json_object_get(o, "state")), "done");
    assert_string_equal(json_string_value(json_object_get(o, "method")), "fast");
    assert_near(number(o, "pings", "expected"), 48, 0);
    assert_near(number(o, "pings", "lost"), 1, 0);
    assert_near(number(o, "pings", "retaken"), 3, 0);
    assert_near(number(o, "pings", "imaged"), 23, 0);
    assert_near(number(o, "times", "scan_s"), 10.0, 1e-9);
    assert_near(number(o, "times", "last_ping_to_volume_s"), 0.025, 1e-9);
    assert_near(number(o, "messages_lost", "gaps"), 4, 0);
    assert_near(number(o, "messages_lost", "dropped"), 1, 0);
    assert_near(number(o, "messages_lost", "refused"), 2, 0);
    const json_t *dsp = json_array_get(json_object_get(o, "nodes"), 0);
    assert_string_equal(json_string_value(json_object_get(dsp, "node")), "dsp");
    assert_int_equal(json_integer_value(json_object_get(dsp, "restarts")), 1);
    const json_t *device = json_object_get(dsp, "device");
    assert_int_equal(json_integer_value(json_object_get(device, "overruns")), 14);
    json_decref(o);
    report_clear(&r);
}

/* Of a host that has measured another one's clock. */
static void tell_host(struct report *r, const char *host, const char *other,
                      double ahead_s)
{
    Anlos__HostStatus m = ANLOS__HOST_STATUS__INIT;
    Anlos__HostSight sight = ANLOS__HOST_SIGHT__INIT, *list = &sight;

    sight.host = (char *)other;
    sight.clock_ahead_s = ahead_s;
    sight.round_trip_s = 0.04;
    sight.silences = 2;
    m.host = (char *)host;
    m.sights = &list;
    m.n_sights = 1;
    assert_int_equal(report_hosts_take(&r->hosts, &m), 0);
}

static void the_difference_of_two_hosts_clocks_is_told_and_taken_out(void **state)
{
    struct hosts map = {.n = 2,
                        .list = {{.name = "vehicle", .n_nodes = 1, .nodes = {"array"}},
                                 {.name = "computer", .n_nodes = 1, .nodes = {"recon"}}}};
    struct report r;

    (void)state;
    report_init(&r);
    r.map = &map;
    r.ping_s = 0.05;
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__DONE, 11 * S);
    /* Stamped 3 s before the sound was taken, by a clock that is 3.1 s behind. */
    tell_volume(&r, false, 10 * S, 7 * S);
    tell_host(&r, "vehicle", "computer", -3.0);
    tell_host(&r, "vehicle", "computer", -3.1);
    json_t *o = report_json(&r);
    assert_near(number(o, "times", "last_ping_to_volume_s"), 0.05, 1e-9);
    const json_t *hosts = json_object_get(o, "hosts"), *sight = json_array_get(hosts, 0);
    assert_int_equal(json_array_size(hosts), 1);
    assert_string_equal(json_string_value(json_object_get(sight, "host")), "computer");
    assert_string_equal(json_string_value(json_object_get(sight, "seen_by")), "vehicle");
    assert_near(json_number_value(json_object_get(sight, "clock_ahead_s")), -3.1, 1e-9);
    assert_int_equal(json_integer_value(json_object_get(sight, "silences")), 2);
    json_decref(o);
    tell_host(&r, "computer", "vehicle", 3.12); /* either one's word will do */
    o = report_json(&r);
    assert_near(number(o, "times", "last_ping_to_volume_s"), 0.05, 0.021);
    assert_int_equal(json_array_size(json_object_get(o, "hosts")), 2);
    json_decref(o);
    report_clear(&r);
}

static void the_length_of_a_ping_comes_from_the_survey(void **state)
{
    struct report r;
    struct scene scene;

    (void)state;
    assert_int_equal(scene_open(&scene, SOURCE_DIR "/tests/nodes/point.yaml"), 0);
    report_init(&r);
    assert_true(isnan(r.ping_s));
    assert_int_equal(report_survey(&r, scene.survey), 0);
    /* A slot of 1500 samples at 48 kHz and, at most, another one of tail. */
    assert_true(r.ping_s >= 1500 / 48e3 && r.ping_s <= 3000 / 48e3);
    report_clear(&r);
    scene_close(&scene);
}

static void a_failed_scan_leaves_a_report_and_nothing_else(void **state)
{
    struct scratch *s = *state;
    struct complaint why = {""};
    struct report r;

    /* Of a scan before, and of somebody else. */
    scratch_write(s, "volume.nrrd", "old");
    scratch_write(s, "projection_xz.png", "old");
    scratch_write(s, "detections.json", "old");
    scratch_write(s, "notes.txt", "mine");
    report_init(&r);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__FAILED, 2 * S);
    if (report_write(&r, s->folder, &why))
        fail_msg("%s", why.text);
    assert_int_equal(access(scratch_path(s, "report.json"), R_OK), 0);
    assert_int_not_equal(access(scratch_path(s, "volume.nrrd"), F_OK), 0);
    assert_int_not_equal(access(scratch_path(s, "projection_xz.png"), F_OK), 0);
    assert_int_not_equal(access(scratch_path(s, "detections.json"), F_OK), 0);
    assert_int_equal(access(scratch_path(s, "notes.txt"), R_OK), 0);
    report_clear(&r);
}

static void a_folder_that_cannot_be_is_complained_about(void **state)
{
    struct scratch *s = *state;
    struct complaint why = {""};
    struct report r;
    char path[600];

    scratch_write(s, "file", "x");
    snprintf(path, sizeof path, "%s/file/out", s->folder);
    report_init(&r);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__FAILED, 2 * S);
    assert_true(report_write(&r, path, &why) < 0);
    assert_contains(why.text, "file");
    report_clear(&r);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_is_complete_with_the_end_the_volume_and_the_detections),
        cmocka_unit_test(previews_do_not_count),
        cmocka_unit_test(a_failed_scan_is_waited_for_only_so_long),
        cmocka_unit_test(the_report_says_how_it_went),
        cmocka_unit_test(the_difference_of_two_hosts_clocks_is_told_and_taken_out),
        cmocka_unit_test(the_length_of_a_ping_comes_from_the_survey),
        TEST(a_failed_scan_leaves_a_report_and_nothing_else),
        TEST(a_folder_that_cannot_be_is_complained_about),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
