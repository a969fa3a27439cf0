/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include "hal/canbus.h"
#include "msgs/can/e2e.h"

static char *read_text(const char *path)
{
    static char text[4096];
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    size_t n = fread(text, 1, sizeof text - 1, f);
    text[n] = 0;
    fclose(f);
    return text;
}

static struct canbus *open_log(struct scratch *s, const char *options)
{
    char uri[600];
    struct canbus *b;
    struct error why = {.text = ""};
    snprintf(uri, sizeof uri, "log:%s%s", scratch_path(s, "out.candump"), options);
    if (canbus_open(&b, uri, &why))
        fail_msg("%s", why.text);
    return b;
}

/* The lines are what `candump -L` of can-utils prints for these frames. */
static void a_log_is_what_candump_writes(void **state)
{
    const struct can_frame_data classic = {
        .id = 0x404, .size = 8, .data = {0x00, 0x11, 0x22, 0x33, 0xaa, 0xbb, 0xcc, 0xff}};
    const struct can_frame_data empty = {.id = 0x7, .size = 0};
    const struct can_frame_data extended = {.id = 0x18fee900, .size = 1, .data = {0x5a}};
    const struct can_frame_data fd = {
        .id = 0x123, .size = 12, .fd = true, .data = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10}};
    struct canbus *b = open_log(*state, "");
    assert_int_equal(canbus_send(b, &classic, INT64_C(1700000000123456789)), 0);
    assert_int_equal(canbus_send(b, &empty, INT64_C(1700000001000000999)), 0);
    assert_int_equal(canbus_send(b, &extended, INT64_C(1700000002000001000)), 0);
    assert_int_equal(canbus_send(b, &fd, INT64_C(5000001000)), 0);
    assert_int_equal(canbus_flush(b), 0);
    assert_string_equal(read_text(((struct scratch *)*state)->path),
                        "(1700000000.123456) can0 404#00112233AABBCCFF\n"
                        "(1700000001.000000) can0 007#\n"
                        "(1700000002.000001) can0 18FEE900#5A\n"
                        "(0000000005.000001) can0 123##10102030405060708090A0000\n");
    canbus_close(b);
}

static void a_log_goes_on_where_whole_lines_end(void **state)
{
    const struct can_frame_data frame = {.id = 0x400, .size = 1, .data = {7}};
    struct canbus *b;

    scratch_write(*state, "out.candump", "(0000000001.000000) can0 400#01\n(00000000");
    b = open_log(*state, "?append=yes");
    assert_int_equal(canbus_send(b, &frame, 2000000000), 0);
    canbus_close(b);
    assert_string_equal(read_text(scratch_path(*state, "out.candump")),
                        "(0000000001.000000) can0 400#01\n"
                        "(0000000002.000000) can0 400#07\n");
    b = open_log(*state, "?append=no");
    canbus_close(b);
    assert_string_equal(read_text(scratch_path(*state, "out.candump")), "");
}

static void a_list_is_in_the_file_when_it_is_flushed(void **state)
{
    const struct can_frame_data frame = {.id = 1, .size = 1};
    struct canbus *b = open_log(*state, "?interface=vcan1");
    assert_int_equal(canbus_send(b, &frame, 0), 0);
    assert_int_equal(canbus_flush(b), 0);
    assert_string_equal(read_text(((struct scratch *)*state)->path),
                        "(0000000000.000000) vcan1 001#00\n");
    canbus_close(b);
}

static void an_fd_frame_gets_a_legal_size(void **state)
{
    /* What lies behind the frame's own bytes is not sent. */
    const struct can_frame_data frame = {
        .id = 1, .size = 9, .fd = true, .data = {[0] = 1, [9] = 0xee, [11] = 0xee}};
    struct canbus *b = open_log(*state, "");
    assert_int_equal(canbus_send(b, &frame, 0), 0);
    assert_int_equal(canbus_flush(b), 0);
    assert_string_equal(read_text(((struct scratch *)*state)->path),
                        "(0000000000.000000) can0 001##1010000000000000000000000\n");
    canbus_close(b);
}

static void frames_that_no_bus_can_carry_are_refused(void **state)
{
    const struct can_frame_data bad[] = {{.id = 1, .size = 9},
                                         {.id = 1, .size = 65, .fd = true},
                                         {.id = 0x20000000, .size = 1}};
    struct canbus *b = open_log(*state, "");
    for (size_t i = 0; i < 3; i++)
        assert_int_equal(canbus_send(b, &bad[i], 0), -EINVAL);
    canbus_close(b);
}

static void a_full_disk_is_reported(void **state)
{
    struct error why = {.text = ""};
    const struct can_frame_data frame = {.id = 1, .size = 1};
    struct canbus *b;
    (void)state;
    assert_int_equal(canbus_open(&b, "log:/dev/full", &why), 0);
    assert_string_equal(canbus_uri(b), "log:/dev/full");
    assert_int_equal(canbus_send(b, &frame, 0), 0);
    assert_int_equal(canbus_flush(b), -ENOSPC);
    canbus_close(b);
}

static void when_a_disk_has_room_again_the_log_goes_on_with_a_whole_line(void **state)
{
    const struct can_frame_data frame = {.id = 0x400, .size = 1, .data = {7}};
    struct rlimit limit, before;
    struct canbus *b = open_log(*state, "");

    signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before);
    limit = before;
    limit.rlim_cur = 50; /* bytes: one line of 32 and a part */
    setrlimit(RLIMIT_FSIZE, &limit);
    assert_int_equal(canbus_send(b, &frame, 1000000000), 0);
    assert_int_equal(canbus_flush(b), 0);
    assert_int_equal(canbus_send(b, &frame, 2000000000), 0);
    assert_true(canbus_flush(b) < 0);
    assert_int_equal(canbus_send(b, &frame, 3000000000), 0);
    assert_true(canbus_flush(b) < 0);
    setrlimit(RLIMIT_FSIZE, &before);
    assert_int_equal(canbus_send(b, &frame, 4000000000), 0);
    assert_int_equal(canbus_flush(b), 0);
    canbus_close(b);
    assert_string_equal(read_text(scratch_path(*state, "out.candump")),
                        "(0000000001.000000) can0 400#07\n"
                        "(0000000004.000000) can0 400#07\n");
}

static void devices_that_do_not_exist_are_named(void **state)
{
    static const struct {
        const char *uri;
        int err;
        const char *part;
    } cases[] = {
        {"can0", -ENODEV, "can0: no such kind of CAN bus; expected log:FILE"},
        {"pcan:0", -ENODEV, "pcan:0: no such kind"},
        {"log:", -EINVAL, "log:: expected the name of a file"},
        {"log:/nowhere/x", -ENOENT, "/nowhere/x cannot be written"},
        {"log:/tmp/x?bus=1", -EINVAL, "no option \"bus\"; expected interface"},
        {"log:/tmp/x?interface=a name", -EINVAL, "interface \"a name\""},
        {"sim:", -EINVAL, "expected a scene file"},
        {"sim:/nowhere.yaml?ego=away", -EINVAL, "ego"},
        {"sim:/nowhere.yaml", -ENOENT, "/nowhere.yaml"},
        {"socketcan:no_such_can", -ENODEV, "no network interface \"no_such_can\""},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {.text = ""};
        struct canbus *b;
        assert_int_equal(canbus_open(&b, cases[i].uri, &why), cases[i].err);
        assert_null(b);
        assert_contains(why.text, cases[i].part);
    }
}

static void a_log_is_not_written_through_a_link(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    struct canbus *b = NULL;
    char victim[600], planted[600], uri[700], text[16] = "";

    snprintf(victim, sizeof victim, "%s", scratch_write(s, "victim", "precious"));
    snprintf(planted, sizeof planted, "%s", scratch_path(s, "planted.candump"));
    snprintf(uri, sizeof uri, "log:%s", planted);
    for (int hard = 0; hard < 2; hard++) {
        assert_int_equal(hard ? link(victim, planted) : symlink(victim, planted), 0);
        assert_true(canbus_open(&b, uri, &why) < 0);
        assert_contains(why.text, hard ? "one file under several names" : "it is a link");
        assert_int_equal(unlink(planted), 0);
    }
    FILE *f = fopen(victim, "r");
    assert_non_null(f);
    assert_int_equal(fread(text, 1, sizeof text - 1, f), 8);
    fclose(f);
    assert_string_equal(text, "precious");
}

static void a_log_hears_nothing(void **state)
{
    const uint32_t ids[] = {0x40c};
    struct can_frame_data f;
    struct canbus *b = open_log(*state, "");

    assert_int_equal(canbus_listen(b, ids, 1), -EOPNOTSUPP);
    assert_int_equal(canbus_receive(b, &f, 0, NULL), -EAGAIN);
    assert_int_equal(canbus_fd(b), -1);
    canbus_close(b);
}

static struct canbus *open_drive(struct scratch *s, const char *options)
{
    char uri[600];
    struct canbus *b;
    struct error why = {.text = ""};

    scratch_write(
        s, "drive.yaml",
        "array: bumper\n"
        "temperature_c: 12\n"
        "wall: {normal: [0, 0, 1], distance_m: 3.8}\n"
        "mount: {origin_m: [3.6, 0, 0.4], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"
        "gate_m: [1.5, 3.9]\n"
        "drive:\n"
        "  period_s: 10\n"
        "  ego:\n"
        "    - {t_s: 2, speed_m_s: 0}\n"
        "    - {t_s: 3, speed_m_s: 2}\n"
        "    - {t_s: 4, speed_m_s: 2}\n"
        "    - {t_s: 5, speed_m_s: 0}\n"
        "    - {t_s: 6, speed_m_s: -2}\n"
        "    - {t_s: 7, speed_m_s: -2}\n"
        "    - {t_s: 8, speed_m_s: 0}\n");
    snprintf(uri, sizeof uri, "sim:%s%s", s->path, options);
    if (canbus_open(&b, uri, &why))
        fail_msg("%s", why.text);
    return b;
}

struct heard {
    unsigned ego, ambient, wrong;
    double speed_m_s, temperature_c; /* of the newest */
    bool stands;
};

/* All that comes up to a time. */
static void hear(struct canbus *b, struct can_checks *c, int64_t now_ms, struct heard *h)
{
    struct can_ego_motion ego;
    struct can_ambient air;
    struct can_frame_data f;

    while (!canbus_receive(b, &f, now_ms * 1000000, NULL)) {
        h->wrong += !e2e_is_usable(can_check(c, &f));
        if (f.id == 0x41c) {
            assert_int_equal(can_unpack_ego_motion(&f, &ego), 0);
            assert_int_equal(ego.validity, CAN_VALID);
            h->speed_m_s = ego.speed_m_s;
            h->stands = ego.standstill == CAN_STANDS;
            h->ego++;
        } else {
            assert_int_equal(f.id, 0x41d);
            assert_int_equal(can_unpack_ambient(&f, &air), 0);
            h->temperature_c = air.temperature_c;
            h->ambient++;
        }
    }
}

#define T0_MS 1700000000000LL /* a multiple of the period: world time 0 */

static void a_simulated_vehicle_tells_its_motion_and_its_air(void **state)
{
    const uint32_t ids[] = {0x41c, 0x41d, 0x41e};
    struct can_checks checks = {.base = 0x410};
    struct heard h = {0};
    struct canbus *b = open_drive(*state, "");

    assert_int_equal(canbus_listen(b, ids, 3), 0);
    assert_true(canbus_fd(b) >= 0);
    hear(b, &checks, T0_MS, &h);
    assert_int_equal(h.ego, 1);
    assert_true(h.stands);
    for (int64_t ms = 1; ms <= 3500; ms++)
        hear(b, &checks, T0_MS + ms, &h);
    assert_int_equal(h.ego, 1 + 3500 / 20);
    assert_int_equal(h.ambient, 1 + 3);
    assert_int_equal(h.wrong, 0);
    assert_true(fabs(h.speed_m_s - 2.0) <= 0.01);
    assert_false(h.stands);
    assert_true(fabs(h.temperature_c - 12.0) <= 0.25);
    hear(b, &checks, T0_MS + 4500, &h); /* late: all that was due */
    assert_int_equal(h.ego, 1 + 4500 / 20);
    assert_true(fabs(h.speed_m_s - 1.0) <= 0.01);
    canbus_close(b);
}

static void what_is_read_late_came_when_the_vehicle_told_it(void **state)
{
    const uint32_t ids[] = {0x41c, 0x41d};
    struct can_frame_data f;
    int64_t came_ns, before_ns = T0_MS * 1000000;
    struct canbus *b = open_drive(*state, "?ambient=off");

    canbus_listen(b, ids, 2);
    assert_int_equal(canbus_receive(b, &f, T0_MS * 1000000 + 5000, &came_ns), 0);
    assert_int_equal(came_ns, before_ns);
    for (int i = 0; i < 10; i++, before_ns = came_ns) {
        assert_int_equal(canbus_receive(b, &f, (T0_MS + 200) * 1000000, &came_ns), 0);
        assert_int_equal(came_ns - before_ns, 20000000);
    }
    assert_int_equal(canbus_receive(b, &f, (T0_MS + 200) * 1000000, &came_ns), -EAGAIN);
    canbus_close(b);
}

static void a_simulated_vehicle_misbehaves_when_told_to(void **state)
{
    const uint32_t ids[] = {0x41c, 0x41d};
    struct can_checks checks = {.base = 0x410};
    struct heard h = {0};
    struct canbus *b = open_drive(*state, "?ego=off");

    canbus_listen(b, ids, 2);
    hear(b, &checks, T0_MS, &h);
    assert_int_equal(h.ego, 0);
    assert_int_equal(h.ambient, 1);
    canbus_close(b);
    b = open_drive(*state, "?ego=bad&ambient=off");
    canbus_listen(b, ids, 2);
    for (int64_t ms = 0; ms < 200; ms++)
        hear(b, &checks, T0_MS + ms, &h);
    assert_int_equal(h.ego, 10);
    assert_int_equal(h.wrong, 10);
    assert_int_equal(h.ambient, 1);
    canbus_close(b);
}

/* The array is 3.6 m before the vehicle's origin, and the wall 3.8 m before the array;
 * the vehicle speeds up to 2 m/s from 2 to 3 s. */
static void a_simulated_vehicle_sees_the_wall_when_told_to(void **state)
{
    const uint32_t ids[] = {0x41c, 0x41d, 0x41e};
    struct can_checks checks = {.base = 0x410};
    struct can_frame_data f;
    struct can_wall_in wall;
    unsigned n = 0;
    struct canbus *b = open_drive(*state, "?wall=on&ego=off&ambient=off");

    canbus_listen(b, ids, 3);
    for (int64_t ms = 0; ms <= 4000; ms++)
        while (!canbus_receive(b, &f, (T0_MS + ms) * 1000000, NULL)) {
            assert_int_equal(f.id, 0x41e);
            assert_true(e2e_is_usable(can_check(&checks, &f)));
            assert_int_equal(can_unpack_wall_in(&f, &wall), 0);
            assert_int_equal(wall.validity, CAN_VALID);
            assert_int_equal(wall.id, 1);
            assert_true(fabs(wall.azimuth_rad) <= 1e-6);
            double gone_m = ms < 2000   ? 0.0
                            : ms < 3000 ? 1e-6 * (double)((ms - 2000) * (ms - 2000))
                                        : 1.0 + 2e-3 * (double)(ms - 3000);
            assert_true(fabs(wall.distance_m - (3.6 + 3.8 - gone_m)) <= 0.006);
            n++;
        }
    assert_int_equal(n, 1 + 4000 / 100);
    canbus_close(b);
}

static void what_is_sent_to_a_simulated_vehicle_is_logged(void **state)
{
    const struct can_frame_data frame = {.id = 0x400, .size = 1, .data = {7}};
    struct scratch *s = *state;
    char options[600];

    snprintf(options, sizeof options, "?log=%s", scratch_path(s, "sim.candump"));
    struct canbus *b = open_drive(s, options);
    assert_int_equal(canbus_send(b, &frame, 1000), 0);
    assert_int_equal(canbus_flush(b), 0);
    assert_string_equal(read_text(scratch_path(s, "sim.candump")),
                        "(0000000000.000001) can0 400#07\n");
    canbus_close(b);
}

/* The loopback interface always exists and never is a CAN interface. */
static void an_interface_without_can_is_refused_with_the_reason(void **state)
{
    struct error why = {.text = ""};
    struct canbus *b;
    (void)state;
    assert_true(canbus_open(&b, "socketcan:lo", &why) < 0);
    assert_null(b);
    if (!strstr(why.text, "no CAN interface"))
        assert_contains(why.text, "this kernel gives no CAN socket");
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_log_is_what_candump_writes),
        TEST(a_log_goes_on_where_whole_lines_end),
        TEST(a_list_is_in_the_file_when_it_is_flushed),
        TEST(an_fd_frame_gets_a_legal_size),
        TEST(frames_that_no_bus_can_carry_are_refused),
        TEST(a_full_disk_is_reported),
        TEST(when_a_disk_has_room_again_the_log_goes_on_with_a_whole_line),
        TEST(devices_that_do_not_exist_are_named),
        TEST(a_log_hears_nothing),
        TEST(a_simulated_vehicle_tells_its_motion_and_its_air),
        TEST(what_is_read_late_came_when_the_vehicle_told_it),
        TEST(a_simulated_vehicle_misbehaves_when_told_to),
        TEST(a_simulated_vehicle_sees_the_wall_when_told_to),
        TEST(a_log_is_not_written_through_a_link),
        TEST(what_is_sent_to_a_simulated_vehicle_is_logged),
        TEST(an_interface_without_can_is_refused_with_the_reason),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
