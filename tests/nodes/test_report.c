/* SPDX-License-Identifier: MIT */
#include "tests/hal/scratch.h"

#include <cairo.h>
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include "nodes/report/report.h"
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
    assert_int_equal(report_detections(r, &m, 1), 0);
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

/* One track, in the vehicle frame. */
static void tell_track(struct report *r, uint32_t id, double x, double y, double vy,
                       Anlos__Measurement measurement, int64_t at_ns)
{
    double velocity[2] = {0.0, vy};
    Anlos__Vec3 p = ANLOS__VEC3__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, *one = &d;
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;

    p.x = x;
    p.y = y;
    d.id = id;
    d.position_m = &p;
    d.measurement = measurement;
    d.velocity_m_s = velocity;
    d.n_velocity_m_s = 2;
    d.shape = ANLOS__SHAPE__EXTENDED;
    d.existence = 0.9;
    list.detections = &one;
    list.n_detections = 1;
    list.tracked = list.in_vehicle_frame = true;
    assert_int_equal(report_detections(r, &list, at_ns), 0);
}

/* Number 7 goes 2 m to the left in 2 s, and is predicted in the last quarter; the same
 * number 30 s later is another one's. */
static void each_track_of_a_drive_has_its_line(void **state)
{
    struct report r;

    (void)state;
    report_init(&r);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__RUNNING, 1 * S);
    json_t *before = report_json(&r);
    assert_null(json_object_get(before, "drive")); /* no tracks so far */
    json_decref(before);
    for (int i = 0; i <= 20; i++)
        tell_track(&r, 7, 5.0, -1.0 + 0.1 * i, 1.0,
                   i > 15 ? ANLOS__MEASUREMENT__PREDICTED : ANLOS__MEASUREMENT__MEASURED,
                   10 * S + i * S / 10);
    tell_track(&r, 7, 5.0, 0.0, 1.0, ANLOS__MEASUREMENT__DELETED, 13 * S);
    tell_track(&r, 7, 6.0, 0.0, 3.0, ANLOS__MEASUREMENT__NEW, 42 * S);
    json_t *o = report_json(&r), *drive = json_object_get(o, "drive");
    assert_near(json_number_value(json_object_get(drive, "seconds")), 32.0, 1e-9);
    const json_t *tracks = json_object_get(drive, "tracks");
    assert_int_equal(json_array_size(tracks), 2);
    const json_t *k = json_array_get(tracks, 0);
    assert_int_equal(json_integer_value(json_object_get(k, "id")), 7);
    assert_string_equal(json_string_value(json_object_get(k, "class")), "extended");
    assert_near(json_number_value(json_object_get(k, "first_s")), 0.0, 1e-9);
    assert_near(json_number_value(json_object_get(k, "last_s")), 2.0, 1e-9);
    assert_near(json_number_value(json_array_get(json_object_get(k, "from_m"), 1)), -1.0,
                1e-9);
    assert_near(json_number_value(json_array_get(json_object_get(k, "to_m"), 1)), 1.0,
                1e-9);
    assert_near(json_number_value(json_object_get(k, "mean_speed_m_s")), 1.0, 1e-9);
    assert_int_equal(json_integer_value(json_object_get(k, "lists")), 21);
    assert_int_equal(json_integer_value(json_object_get(k, "lists_measured")), 16);
    k = json_array_get(tracks, 1);
    assert_near(json_number_value(json_object_get(k, "first_s")), 32.0, 1e-9);
    json_decref(o);
    report_clear(&r);
}

/* The middle, across, of what is drawn in the colour of a track; NaN: nothing is. */
static double middle_of_colour(const char *path, int red, int green, int blue)
{
    cairo_surface_t *image = cairo_image_surface_create_from_png(path);
    double sum = 0.0;
    long n = 0;

    assert_int_equal(cairo_surface_status(image), CAIRO_STATUS_SUCCESS);
    int w = cairo_image_surface_get_width(image);
    for (int y = 0; y < cairo_image_surface_get_height(image); y++) {
        const uint8_t *row = cairo_image_surface_get_data(image) +
                             (size_t)y * (size_t)cairo_image_surface_get_stride(image);
        for (int x = 0; x < w * 3 / 4; x++) { /* beside the names */
            if (abs(row[4 * x] - blue) + abs(row[4 * x + 1] - green) +
                    abs(row[4 * x + 2] - red) >
                6)
                continue;
            sum += x;
            n++;
        }
    }
    cairo_surface_destroy(image);
    return n > 20 ? sum / (double)n / w : NAN;
}

/* Seen from above, left is left; tracks 0 and 1 modulo 6 are orange and green. */
static void the_plan_shows_the_tracks_of_a_drive(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    struct scene scene;
    struct report r;

    assert_int_equal(scene_open(&scene, SOURCE_DIR "/tests/nodes/point.yaml"), 0);
    report_init(&r);
    assert_int_equal(report_survey(&r, scene.survey), 0);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__RUNNING, 1 * S);
    for (int i = 0; i <= 20; i++) {
        tell_track(&r, 6, 5.0, 2.0 + 0.01 * i, 0.1, ANLOS__MEASUREMENT__MEASURED,
                   10 * S + i * S / 10);
        tell_track(&r, 7, 5.0, -2.0 + 0.01 * i, 0.1, ANLOS__MEASUREMENT__MEASURED,
                   10 * S + i * S / 10);
    }
    if (report_write(&r, s->folder, &why))
        fail_msg("%s", why.text);
    double left = middle_of_colour(scratch_path(s, "plan.png"), 194, 77, 0);
    double right = middle_of_colour(s->path, 0, 107, 77);
    assert_true(left < 0.4 && right > 0.4);
    assert_true(right - left > 0.2);
    report_clear(&r);
    scene_close(&scene);
    /* A scan into the same folder has none. */
    report_init(&r);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__FAILED, 2 * S);
    assert_int_equal(report_write(&r, s->folder, &why), 0);
    assert_int_not_equal(access(scratch_path(s, "plan.png"), F_OK), 0);
    report_clear(&r);
}

/* Of a plan's width, where its plot ends; and in the plot the last pixel of a colour. */
#define PLOT_ENDS (838.0 / 1048.0)

static double end_of_colour(const char *path, int red, int green, int blue)
{
    cairo_surface_t *image = cairo_image_surface_create_from_png(path);
    int last = -1;

    assert_int_equal(cairo_surface_status(image), CAIRO_STATUS_SUCCESS);
    int w = cairo_image_surface_get_width(image);
    for (int y = 0; y < cairo_image_surface_get_height(image); y++) {
        const uint8_t *row = cairo_image_surface_get_data(image) +
                             (size_t)y * (size_t)cairo_image_surface_get_stride(image);
        for (int x = 0; x < (int)(w * PLOT_ENDS); x++)
            if (abs(row[4 * x] - blue) + abs(row[4 * x + 1] - green) +
                        abs(row[4 * x + 2] - red) <=
                    6 &&
                x > last)
                last = x;
    }
    cairo_surface_destroy(image);
    return (double)last / w;
}

/* At 8 m/s to the right, of a plan that would be a few metres wide. */
static void the_arrow_of_a_track_that_leaves_is_on_the_plan(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    struct scene scene;
    struct report r;

    assert_int_equal(scene_open(&scene, SOURCE_DIR "/tests/nodes/point.yaml"), 0);
    report_init(&r);
    assert_int_equal(report_survey(&r, scene.survey), 0);
    for (int i = 0; i <= 4; i++)
        tell_track(&r, 7, 5.0, -2.0, -8.0, ANLOS__MEASUREMENT__MEASURED,
                   10 * S + i * S / 10);
    if (logbook_picture(&r.logbook, s->folder, NULL, &why))
        fail_msg("%s", why.text);
    double tip = end_of_colour(scratch_path(s, "plan.png"), 0, 107, 77);
    assert_true(tip > 0.6 && tip < PLOT_ENDS - 0.01);
    report_clear(&r);
    scene_close(&scene);
}

static void a_failed_scan_leaves_a_report_and_nothing_else(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
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

static void stopped_before_the_scan_said_anything_it_was_waiting(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    struct report r;
    json_error_t error;

    report_init(&r);
    assert_int_equal(report_write(&r, s->folder, &why), 0);
    json_t *o = json_load_file(scratch_path(s, "report.json"), 0, &error);
    assert_string_equal(json_string_value(json_object_get(o, "state")), "waiting");
    json_decref(o);
    report_clear(&r);
}

/* Files of this process end after so many bytes, as on a full disk. */
static void limit_files(rlim_t bytes)
{
    struct rlimit limit;

    getrlimit(RLIMIT_FSIZE, &limit);
    limit.rlim_cur = bytes < limit.rlim_max ? bytes : limit.rlim_max;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
}

static void a_picture_that_cannot_be_written_takes_nothing_with_it(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    struct report r;

    scratch_write(s, "projection_xz.png", "old");
    report_init(&r);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__DONE, 2 * S);
    tell_volume(&r, false, 1, 2);
    tell_detections(&r, false);
    signal(SIGXFSZ, SIG_IGN);
    limit_files(1000);
    int err = report_write(&r, s->folder, &why);
    limit_files(RLIM_INFINITY);
    assert_int_equal(err, -EFBIG);
    assert_contains(why.text,
                    ": projection_xy.png, projection_xz.png, projection_yz.png: ");
    assert_int_equal(access(scratch_path(s, "report.json"), R_OK), 0);
    assert_int_equal(access(scratch_path(s, "detections.json"), R_OK), 0);
    assert_int_equal(access(scratch_path(s, "volume.nrrd"), R_OK), 0);
    assert_int_not_equal(access(scratch_path(s, "projection_xz.png"), F_OK), 0);
    report_clear(&r);
}

static void without_its_report_nothing_of_an_earlier_scan_is_touched(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    struct report r;

    scratch_write(s, "report.json", "old");
    scratch_write(s, "detections.json", "old");
    report_init(&r);
    tell_status(&r, ANLOS__SCAN_STATUS__STATE__FAILED, 2 * S);
    signal(SIGXFSZ, SIG_IGN);
    limit_files(100);
    int err = report_write(&r, s->folder, &why);
    limit_files(RLIM_INFINITY);
    assert_int_equal(err, -EFBIG);
    assert_contains(why.text, "report.json");
    assert_int_equal(access(scratch_path(s, "detections.json"), R_OK), 0);
    report_clear(&r);
}

/* An array that stands has no end of its own. */
static void what_still_ran_is_reported_as_stopped(void **state)
{
    Anlos__ScanStatus status = ANLOS__SCAN_STATUS__INIT;
    struct report r;

    (void)state;
    report_init(&r);
    status.state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    status.pings_done = 1232;
    assert_int_equal(report_status(&r, &status, 1 * S), 0);
    json_t *o = report_json(&r), *pings = json_object_get(o, "pings");
    assert_string_equal(json_string_value(json_object_get(o, "state")), "stopped");
    assert_int_equal(json_integer_value(json_object_get(pings, "done")), 1232);
    assert_true(json_is_null(json_object_get(pings, "expected")));
    json_decref(o);
    report_clear(&r);
}

static void a_folder_that_cannot_be_is_complained_about(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
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
        cmocka_unit_test(each_track_of_a_drive_has_its_line),
        TEST(the_plan_shows_the_tracks_of_a_drive),
        TEST(the_arrow_of_a_track_that_leaves_is_on_the_plan),
        cmocka_unit_test(what_still_ran_is_reported_as_stopped),
        TEST(stopped_before_the_scan_said_anything_it_was_waiting),
        TEST(a_picture_that_cannot_be_written_takes_nothing_with_it),
        TEST(without_its_report_nothing_of_an_earlier_scan_is_touched),
        TEST(a_failed_scan_leaves_a_report_and_nothing_else),
        TEST(a_folder_that_cannot_be_is_complained_about),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
