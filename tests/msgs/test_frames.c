/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dbc.h"
#include "msgs/can/frames.h"

static struct dbc_signal find_field(const char *message, const char *signal)
{
    struct dbc_signal s;

    if (!dbc_signal(message, signal, 0, &s))
        fail_msg("%s.%s is not in the DBC", message, signal);
    return s;
}

static int64_t raw(const struct can_frame_data *frame, const char *message,
                   const char *signal)
{
    struct dbc_signal s = find_field(message, signal);
    return dbc_raw(&s, frame);
}

static double physical(const struct can_frame_data *frame, const char *message,
                       const char *signal)
{
    struct dbc_signal s = find_field(message, signal);
    return dbc_physical(&s, frame);
}

static void assert_near(const struct can_frame_data *frame, const char *message,
                        const char *signal, double expected)
{
    double half_step = find_field(message, signal).factor / 2;
    double value = physical(frame, message, signal);
    if (!(fabs(value - expected) <= half_step * (1 + 1e-6)))
        fail_msg("%s.%s is %g, expected %g", message, signal, value, expected);
}

static void assert_frame(const struct can_frame_data *frame, uint32_t id)
{
    assert_int_equal(frame->id, id);
    assert_int_equal(frame->size, 8);
    assert_false(frame->fd);
    assert_int_equal(frame->data[0], 0); /* for the end-to-end protection */
    assert_int_equal(frame->data[1], 0);
}

static struct can_object example(void)
{
    return (struct can_object){.id = 200,
                               .counter = 9,
                               .position_m = {12.34, -5.68, 1.25},
                               .measurement = CAN_PREDICTED,
                               .existence = 0.87,
                               .velocity_m_s = {-1.35, 2.5},
                               .sigma_m = {0.03, 0.25},
                               .correlation = -0.6,
                               .length_m = 4.5,
                               .width_m = 1.8,
                               .class = CAN_EXTENDED,
                               .motion = CAN_MOVING,
                               .sigma_v_m_s = 0.41,
                               .covariance_m2 = {1e-3, -2e-4, 3e-5, 4e-3, 5e-5, 0.25},
                               .height_m = 1.65,
                               .class_probability = 0.9,
                               .age_s = 12.3,
                               .unseen_s = 0.25,
                               .wall = 2,
                               .behind_no_wall = true,
                               .in_free_view = false,
                               .course_rad = -123.2 * acos(-1) / 180,
                               .sigma_course_rad = 6.3 * acos(-1) / 180,
                               .sigma_velocity_m_s = {0.32, 1.2},
                               .velocity_correlation = -0.6};
}

static void a_status_is_read_back(void **state)
{
    (void)state;
    const struct can_status s = {.state = CAN_BLOCKED,
                                 .source = CAN_SIMULATION,
                                 .faults = 0xa5c3,
                                 .temperature_c = -12.5,
                                 .sound_speed_m_s = 324.1,
                                 .range_m = 3.4};
    struct can_frame_data f;
    memset(&f, 0xff, sizeof f);
    can_pack_status(&f, 0x400, &s);
    assert_frame(&f, 0x400);
    assert_int_equal(raw(&f, "Status", "State"), 5);
    assert_int_equal(raw(&f, "Status", "Source"), 2);
    assert_int_equal(raw(&f, "Status", "Faults"), 0xa5c3);
    assert_near(&f, "Status", "Temperature", -12.5);
    assert_near(&f, "Status", "SoundSpeed", 324.1);
    assert_near(&f, "Status", "Range", 3.4);
}

static void a_list_header_is_read_back(void **state)
{
    (void)state;
    const struct can_list_header h = {.number = 32,
                                      .counter = 0x1abc,
                                      .latency_ms = 58.4,
                                      .cycle_ms = 32003,
                                      .truncated = true,
                                      .time_sync = CAN_SYNCHRONISED};
    struct can_frame_data f;
    can_pack_list_header(&f, 0x410, &h);
    assert_frame(&f, 0x412);
    assert_int_equal(raw(&f, "ListHeader", "Number"), 32);
    assert_int_equal(raw(&f, "ListHeader", "Counter"), 0xabc);
    assert_near(&f, "ListHeader", "Latency", 58.4);
    assert_near(&f, "ListHeader", "Cycle", 32003);
    assert_int_equal(raw(&f, "ListHeader", "Truncated"), 1);
    assert_int_equal(raw(&f, "ListHeader", "InterfaceVersion"), 2);
    assert_int_equal(raw(&f, "ListHeader", "TimeSync"), 1);
}

static void a_time_is_read_back(void **state)
{
    (void)state;
    struct can_frame_data f;
    can_pack_time(&f, 0x400, INT64_C(1764000000250000000));
    assert_frame(&f, 0x403);
    assert_int_equal(raw(&f, "Time", "Seconds"), 1764000000);
    assert_int_equal(raw(&f, "Time", "Fraction"), 16384); /* a quarter of 2^16 */
    can_pack_time(&f, 0x400, 1999999999);
    assert_int_equal(raw(&f, "Time", "Seconds"), 1);
    assert_int_equal(raw(&f, "Time", "Fraction"), 65535);
}

static void a_time_out_of_range_is_clamped(void **state)
{
    (void)state;
    struct can_frame_data f;
    can_pack_time(&f, 0x400, -1);
    assert_int_equal(raw(&f, "Time", "Seconds"), 0);
    assert_int_equal(raw(&f, "Time", "Fraction"), 0);
    can_pack_time(&f, 0x400, INT64_MAX);
    assert_int_equal(raw(&f, "Time", "Seconds"), UINT32_MAX);
}

static void an_object_is_read_back(void **state)
{
    (void)state;
    struct can_object o = example();
    struct can_frame_data f;
    can_pack_object_state(&f, 0x400, &o);
    assert_frame(&f, 0x404);
    assert_int_equal(raw(&f, "ObjectState", "Id"), 200);
    assert_int_equal(raw(&f, "ObjectState", "Counter"), 9);
    assert_int_equal(raw(&f, "ObjectState", "Measurement"), 2);
    assert_near(&f, "ObjectState", "X", 12.34);
    assert_near(&f, "ObjectState", "Y", -5.68);
    assert_near(&f, "ObjectState", "Z", 1.25);

    can_pack_object_dynamics(&f, 0x400, &o);
    assert_frame(&f, 0x405);
    assert_int_equal(raw(&f, "ObjectDynamics", "Id"), 200);
    assert_int_equal(raw(&f, "ObjectDynamics", "Counter"), 9);
    assert_near(&f, "ObjectDynamics", "Vx", -1.35);
    assert_near(&f, "ObjectDynamics", "Vy", 2.5);
    assert_near(&f, "ObjectDynamics", "Existence", 87);
    assert_int_equal(raw(&f, "ObjectDynamics", "Class"), 3);
    assert_int_equal(raw(&f, "ObjectDynamics", "DynamicProperty"), 2);

    can_pack_object_quality(&f, 0x400, &o);
    assert_frame(&f, 0x406);
    assert_int_equal(raw(&f, "ObjectQuality", "Id"), 200);
    assert_int_equal(raw(&f, "ObjectQuality", "Counter"), 9);
    assert_near(&f, "ObjectQuality", "Correlation", -0.6);
    assert_int_equal(raw(&f, "ObjectQuality", "SigmaV"), 5);
    assert_near(&f, "ObjectQuality", "Length", 4.5);
    assert_near(&f, "ObjectQuality", "Width", 1.8);
}

/* On paper: 200 | 9 << 8 | (-123 & 511) << 12 | 7 << 21 | 7 << 27 | 24 << 34 |
 * (-15 & 63) << 41, from the third byte on. */
static void a_motion_has_the_bytes_of_the_layout(void **state)
{
    static const uint8_t bytes[8] = {0, 0, 0xC8, 0x59, 0xF8, 0x38, 0x60, 0x62};
    static const uint8_t unknown[8] = {0, 0, 0xC8, 0x09, 0xF0, 0xFF, 0xFF, 0x41};
    struct can_object o = example(), back = {.age_s = -1};
    struct can_frame_data f;

    (void)state;
    can_pack_object_motion(&f, 0x400, &o);
    assert_frame(&f, 0x407);
    assert_memory_equal(f.data, bytes, 8);
    assert_near(&f, "ObjectMotion", "Course", -123);
    assert_int_equal(can_unpack_object_motion(&f, &back), 0);
    assert_int_equal(back.id, 200);
    assert_int_equal(back.counter, 9);
    assert_true(fabs(back.sigma_course_rad - 7 * acos(-1) / 180) < 1e-9);
    assert_true(fabs(back.sigma_velocity_m_s[0] - 0.35) < 1e-9);
    assert_true(fabs(back.sigma_velocity_m_s[1] - 1.2) < 1e-9);
    assert_true(fabs(back.velocity_correlation + 0.6) < 1e-9);
    assert_true(back.age_s == -1); /* what a frame does not carry is let alone */
    o.course_rad = o.sigma_course_rad = o.velocity_correlation = NAN;
    o.sigma_velocity_m_s[0] = o.sigma_velocity_m_s[1] = NAN;
    can_pack_object_motion(&f, 0x400, &o);
    assert_memory_equal(f.data, unknown, 8);
    assert_int_equal(can_unpack_object_motion(&f, &back), 0);
    assert_true(isnan(back.course_rad) && isnan(back.sigma_course_rad) &&
                isnan(back.sigma_velocity_m_s[1]) && isnan(back.velocity_correlation));
}

static void every_position_is_within_half_a_step(void **state)
{
    (void)state;
    struct can_frame_data f;
    struct can_object o = example();
    for (double x = -40; x <= 40; x += 0.7331) {
        o.position_m[0] = 2 * x;
        o.position_m[1] = x;
        o.position_m[2] = x / 4;
        can_pack_object_state(&f, 0x400, &o);
        assert_near(&f, "ObjectState", "X", 2 * x);
        assert_near(&f, "ObjectState", "Y", x);
        assert_near(&f, "ObjectState", "Z", x / 4);
    }
}

static void a_sigma_is_never_said_better_than_it_is(void **state)
{
    (void)state;
    struct can_frame_data f;
    struct can_object o = example();
    for (double sigma = 0; sigma <= 2.5; sigma += 0.00317) {
        o.sigma_m[0] = sigma;
        o.sigma_m[1] = sigma / 2;
        can_pack_object_quality(&f, 0x400, &o);
        double x = physical(&f, "ObjectQuality", "SigmaX");
        double y = physical(&f, "ObjectQuality", "SigmaY");
        assert_true(x >= sigma - 1e-6 && x < sigma + 0.02 + 1e-6);
        assert_true(y >= sigma / 2 - 1e-6 && y < sigma / 2 + 0.02 + 1e-6);
    }
    o.sigma_m[0] = 0.06; /* a step exactly, but for its rounding */
    can_pack_object_quality(&f, 0x400, &o);
    assert_int_equal(raw(&f, "ObjectQuality", "SigmaX"), 3);
}

/* Too large or too small by far, infinite: the ends of the range in the DBC. */
static void values_out_of_range_are_clamped_to_it(void **state)
{
    (void)state;
    static const struct {
        const char *message, *signal;
    } signals[] = {
        {"ObjectState", "X"},
        {"ObjectState", "Y"},
        {"ObjectState", "Z"},
        {"ObjectDynamics", "Vx"},
        {"ObjectDynamics", "Vy"},
        {"ObjectDynamics", "Existence"},
        {"ObjectQuality", "SigmaX"},
        {"ObjectQuality", "SigmaY"},
        {"ObjectQuality", "Correlation"},
        {"ObjectQuality", "Length"},
        {"ObjectQuality", "Width"},
    };
    static const double far[] = {1e3, 1e300, INFINITY};
    for (int sign = -1; sign <= 1; sign += 2) {
        for (size_t k = 0; k < sizeof far / sizeof *far; k++) {
            double x = sign * far[k];
            struct can_object o = {.position_m = {x, x, x},
                                   .existence = x,
                                   .velocity_m_s = {x, x},
                                   .sigma_m = {x, x},
                                   .correlation = x,
                                   .length_m = x,
                                   .width_m = x};
            struct can_frame_data f[3];
            can_pack_object_state(&f[0], 0x400, &o);
            can_pack_object_dynamics(&f[1], 0x400, &o);
            can_pack_object_quality(&f[2], 0x400, &o);
            for (size_t i = 0; i < sizeof signals / sizeof *signals; i++) {
                const char *message = signals[i].message;
                struct dbc_signal s = find_field(message, signals[i].signal);
                int at = strcmp(message, "ObjectState") == 0      ? 0
                         : strcmp(message, "ObjectDynamics") == 0 ? 1
                                                                  : 2;
                assert_near(&f[at], message, signals[i].signal, sign < 0 ? s.min : s.max);
            }
        }
    }
}

static void what_is_not_known_is_sent_as_not_available(void **state)
{
    (void)state;
    struct can_object o = example();
    o.position_m[0] = o.position_m[1] = o.position_m[2] = NAN;
    o.velocity_m_s[0] = o.velocity_m_s[1] = o.existence = NAN;
    o.sigma_m[0] = o.sigma_m[1] = o.correlation = o.length_m = o.width_m = NAN;
    o.sigma_v_m_s = NAN;
    struct can_frame_data f;
    can_pack_object_state(&f, 0x400, &o);
    assert_int_equal(raw(&f, "ObjectState", "X"), -4096);
    assert_int_equal(raw(&f, "ObjectState", "Y"), -2048);
    assert_int_equal(raw(&f, "ObjectState", "Z"), -256);
    assert_int_equal(raw(&f, "ObjectState", "Id"), 200);
    can_pack_object_dynamics(&f, 0x400, &o);
    assert_int_equal(raw(&f, "ObjectDynamics", "Vx"), -1024);
    assert_int_equal(raw(&f, "ObjectDynamics", "Vy"), -1024);
    assert_int_equal(raw(&f, "ObjectDynamics", "Existence"), 127);
    can_pack_object_quality(&f, 0x400, &o);
    assert_int_equal(raw(&f, "ObjectQuality", "SigmaX"), 127);
    assert_int_equal(raw(&f, "ObjectQuality", "SigmaY"), 127);
    assert_int_equal(raw(&f, "ObjectQuality", "Correlation"), -32);
    assert_int_equal(raw(&f, "ObjectQuality", "SigmaV"), 31);
    assert_int_equal(raw(&f, "ObjectQuality", "Length"), 63);
    assert_int_equal(raw(&f, "ObjectQuality", "Width"), 31);

    const struct can_status s = {
        .temperature_c = NAN, .sound_speed_m_s = NAN, .range_m = NAN};
    can_pack_status(&f, 0x400, &s);
    assert_int_equal(raw(&f, "Status", "Temperature"), 255);
    assert_int_equal(raw(&f, "Status", "SoundSpeed"), 1023);
    assert_int_equal(raw(&f, "Status", "Range"), 0); /* as old senders leave it */

    const struct can_list_header h = {.latency_ms = NAN, .cycle_ms = NAN};
    can_pack_list_header(&f, 0x400, &h);
    assert_int_equal(raw(&f, "ListHeader", "Latency"), 4095);
    assert_int_equal(raw(&f, "ListHeader", "Cycle"), 4095);
    assert_int_equal(raw(&f, "ListHeader", "Number"), 0);
}

static void a_header_out_of_range_is_clamped(void **state)
{
    (void)state;
    const struct can_list_header h = {
        .number = 200, .latency_ms = 60000, .cycle_ms = INFINITY};
    struct can_frame_data f;
    can_pack_list_header(&f, 0x400, &h);
    assert_int_equal(raw(&f, "ListHeader", "Number"), CAN_MAX_OBJECTS);
    assert_int_equal(raw(&f, "ListHeader", "Latency"), 4094);
    assert_int_equal(raw(&f, "ListHeader", "Cycle"), 4094);
}

static void a_state_that_does_not_exist_is_not_available(void **state)
{
    (void)state;
    const struct can_status s = {.state = (enum can_state)12,
                                 .source = (enum can_source)3};
    struct can_frame_data f;
    can_pack_status(&f, 0x400, &s);
    assert_int_equal(raw(&f, "Status", "State"), 7);
    assert_int_equal(raw(&f, "Status", "Source"), 3);
}

static void a_diagnosis_is_read_back(void **state)
{
    (void)state;
    const struct can_diagnosis d = {.cpu = 0.37,
                                    .snr_db = 21.6,
                                    .dropped = 1030,
                                    .version_major = 1,
                                    .version_minor = 22,
                                    .version_patch = 31,
                                    .trouble = 1 + CAN_FAULT_CLOCK_JUMP,
                                    .trouble_present = true,
                                    .trouble_count = 200};
    struct can_frame_data f;
    can_pack_diagnosis(&f, 0x400, &d);
    assert_frame(&f, 0x401);
    assert_int_equal(raw(&f, "Diagnosis", "Cpu"), 37);
    assert_near(&f, "Diagnosis", "SignalToNoise", 21.6);
    assert_int_equal(raw(&f, "Diagnosis", "DroppedPings"), 6); /* of 1030 */
    assert_int_equal(raw(&f, "Diagnosis", "VersionMajor"), 1);
    assert_int_equal(raw(&f, "Diagnosis", "VersionMinor"), 22);
    assert_int_equal(raw(&f, "Diagnosis", "VersionPatch"), 31);
    assert_int_equal(raw(&f, "Diagnosis", "TroubleCode"), 7);
    assert_int_equal(raw(&f, "Diagnosis", "TroublePresent"), 1);
    assert_int_equal(raw(&f, "Diagnosis", "TroubleCount"), 15);
}

static void an_fd_object_is_read_back(void **state)
{
    (void)state;
    struct can_object o = example();
    struct can_frame_data f;
    o.counter = 0x7abc;
    can_pack_object_fd(&f, 0x420, &o);
    assert_int_equal(f.id, 0x428);
    assert_int_equal(f.size, 64);
    assert_true(f.fd);
    assert_int_equal(f.data[0] | f.data[1] | f.data[2], 0);
    assert_int_equal(raw(&f, "ObjectFD", "Id"), 200);
    assert_int_equal(raw(&f, "ObjectFD", "Counter"), 0xabc);
    assert_int_equal(raw(&f, "ObjectFD", "Measurement"), 2);
    assert_int_equal(raw(&f, "ObjectFD", "BehindNoWall"), 1);
    assert_int_equal(raw(&f, "ObjectFD", "InFreeView"), 0);
    assert_int_equal(raw(&f, "ObjectFD", "Class"), 3);
    assert_int_equal(raw(&f, "ObjectFD", "DynamicProperty"), 2);
    assert_int_equal(raw(&f, "ObjectFD", "WallId"), 2);
    static const struct {
        const char *name;
        double value;
    } values[] = {
        {"ClassProbability", 90}, {"Existence", 87}, {"Length", 4.5}, {"Width", 1.8},
        {"Height", 1.65},         {"Unseen", 0.25},  {"Age", 12.3}};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++)
        assert_near(&f, "ObjectFD", values[i].name, values[i].value);
    assert_int_equal(raw(&f, "ObjectFD", "SigmaV"), 41);
    static const char *const floats[] = {"X",
                                         "Y",
                                         "Z",
                                         "Vx",
                                         "Vy",
                                         "CovarianceXX",
                                         "CovarianceXY",
                                         "CovarianceXZ",
                                         "CovarianceYY",
                                         "CovarianceYZ",
                                         "CovarianceZZ"};
    const double expected[] = {12.34, -5.68, 1.25, -1.35, 2.5, 1e-3,
                               -2e-4, 3e-5,  4e-3, 5e-5,  0.25};
    for (size_t i = 0; i < 11; i++)
        if (physical(&f, "ObjectFD", floats[i]) != (double)(float)expected[i])
            fail_msg("%s is %g", floats[i], physical(&f, "ObjectFD", floats[i]));
}

static void an_fd_object_knows_what_it_does_not_know(void **state)
{
    (void)state;
    struct can_object o = example();
    struct can_frame_data f;
    o.position_m[1] = o.covariance_m2[5] = o.height_m = o.age_s = NAN;
    o.position_m[0] = INFINITY;
    o.position_m[2] = -1e300;
    can_pack_object_fd(&f, 0x400, &o);
    assert_true(isnan(physical(&f, "ObjectFD", "Y")));
    assert_true(isnan(physical(&f, "ObjectFD", "CovarianceZZ")));
    assert_true(physical(&f, "ObjectFD", "X") == 1000);
    assert_true(physical(&f, "ObjectFD", "Z") == -1000);
    assert_int_equal(raw(&f, "ObjectFD", "Height"), 4095);
    assert_int_equal(raw(&f, "ObjectFD", "Age"), 65535);
    assert_int_equal(raw(&f, "ObjectFD", "WallId"), 2);
}

static void what_the_vehicle_says_is_read_back(void **state)
{
    (void)state;
    struct can_frame_data f;
    const double degree = acos(-1) / 180;
    const struct can_ego_motion e = {.speed_m_s = -2.36,
                                     .yaw_rate_rad_s = 12.34 * degree,
                                     .standstill = CAN_STANDS,
                                     .validity = CAN_VALID};
    can_pack_ego_motion(&f, 0x400, &e);
    assert_frame(&f, 0x40c);
    assert_int_equal(raw(&f, "EgoMotion", "Speed"), -236);
    assert_int_equal(raw(&f, "EgoMotion", "YawRate"), 1234);
    assert_int_equal(raw(&f, "EgoMotion", "Standstill"), 1);
    assert_int_equal(raw(&f, "EgoMotion", "Validity"), 1);

    const struct can_ambient a = {.temperature_c = -7.3, .humidity = 0.555};
    can_pack_ambient(&f, 0x400, &a);
    assert_frame(&f, 0x40d);
    assert_near(&f, "Ambient", "Temperature", -7.3);
    assert_int_equal(raw(&f, "Ambient", "Humidity"), 111);

    const struct can_wall_in w = {.id = 5,
                                  .validity = CAN_VALID,
                                  .azimuth_rad = -90.5 * degree,
                                  .distance_m = 7.77,
                                  .sigma_azimuth_rad = 0.42 * degree,
                                  .sigma_distance_m = 0.031};
    can_pack_wall_in(&f, 0x400, &w);
    assert_frame(&f, 0x40e);
    assert_int_equal(raw(&f, "WallIn", "Azimuth"), -9050);
    assert_int_equal(raw(&f, "WallIn", "Distance"), 777);
    assert_int_equal(raw(&f, "WallIn", "SigmaAzimuth"), 5);
    assert_int_equal(raw(&f, "WallIn", "SigmaDistance"), 4);
    assert_int_equal(raw(&f, "WallIn", "WallId"), 5);
    assert_int_equal(raw(&f, "WallIn", "Validity"), 1);

    const struct can_wall_ends_in ends = {
        .id = 5, .validity = CAN_VALID, .from_m = -3.15, .to_m = 0.6};
    can_pack_wall_ends_in(&f, 0x400, &ends);
    assert_frame(&f, 0x40b);
    assert_int_equal(raw(&f, "WallEndsIn", "From"), -63);
    assert_int_equal(raw(&f, "WallEndsIn", "To"), 12);
    assert_int_equal(raw(&f, "WallEndsIn", "WallId"), 5);
    assert_int_equal(raw(&f, "WallEndsIn", "Validity"), 1);
}

/* Bytes by hand: 0x0102 * 0.01 m/s, -0x0102 * 0.01 deg/s, standing, valid. */
static void the_vehicles_frames_are_unpacked_from_their_bytes(void **state)
{
    (void)state;
    const double degree = acos(-1) / 180;
    struct can_frame_data f = {.size = 8, .data = {0, 0, 0x02, 0x01, 0xfe, 0xfe, 0x05}};
    struct can_ego_motion e;
    assert_int_equal(can_unpack_ego_motion(&f, &e), 0);
    assert_true(fabs(e.speed_m_s - 2.58) < 1e-9);
    assert_true(fabs(e.yaw_rate_rad_s + 2.58 * degree) < 1e-9);
    assert_int_equal(e.standstill, CAN_STANDS);
    assert_int_equal(e.validity, CAN_VALID);

    f = (struct can_frame_data){.size = 8, .data = {0, 0, 0, 0x80, 0, 0x80, 0x0a}};
    assert_int_equal(can_unpack_ego_motion(&f, &e), 0);
    assert_true(isnan(e.speed_m_s) && isnan(e.yaw_rate_rad_s));
    assert_int_equal(e.standstill, CAN_STANDSTILL_UNKNOWN); /* 2 is no choice */
    assert_int_equal(e.validity, CAN_VALIDITY_UNKNOWN);

    /* 600 * 0.1 - 40 degC, 100 * 0.5 % */
    f = (struct can_frame_data){.size = 8, .data = {0, 0, 0x58, 0x22, 0x03}};
    struct can_ambient a;
    assert_int_equal(can_unpack_ambient(&f, &a), 0);
    assert_true(fabs(a.temperature_c - 20) < 1e-9);
    assert_true(fabs(a.humidity - 0.5) < 1e-9);

    /* -9000 * 0.01 deg, 0x123 * 0.01 m, 10 * 0.1 deg, 20 * 0.01 m, wall 3, valid */
    f = (struct can_frame_data){.size = 8,
                                .data = {0, 0, 0xd8, 0xdc, 0x23, 0xa1, 0xa0, 0x4c}};
    struct can_wall_in w;
    assert_int_equal(can_unpack_wall_in(&f, &w), 0);
    assert_true(fabs(w.azimuth_rad + 90 * degree) < 1e-9);
    assert_true(fabs(w.distance_m - 2.91) < 1e-9);
    assert_true(fabs(w.sigma_azimuth_rad - degree) < 1e-9);
    assert_true(fabs(w.sigma_distance_m - 0.2) < 1e-9);
    assert_int_equal(w.id, 3);
    assert_int_equal(w.validity, CAN_VALID);
}

/* -100 * 0.05 m = 0xf9c, 60 * 0.05 m = 0x03c, wall 3, valid; then -2048, not available.
 */
static void the_ends_of_walls_are_unpacked_from_their_bytes(void **state)
{
    (void)state;
    struct can_frame_data f = {.size = 8, .data = {0, 0, 0x9c, 0xcf, 0x03, 0, 0, 0x4c}};
    struct can_wall_ends_in e;
    assert_int_equal(can_unpack_wall_ends_in(&f, &e), 0);
    assert_true(fabs(e.from_m + 5.0) < 1e-9 && fabs(e.to_m - 3.0) < 1e-9);
    assert_int_equal(e.id, 3);
    assert_int_equal(e.validity, CAN_VALID);
    f = (struct can_frame_data){.size = 8, .data = {0, 0, 0x00, 0x08, 0x80, 0, 0, 0xcc}};
    assert_int_equal(can_unpack_wall_ends_in(&f, &e), 0);
    assert_true(isnan(e.from_m) && isnan(e.to_m));
    assert_int_equal(e.validity, CAN_VALIDITY_UNKNOWN);
}

/* Raw values beside those of the DBC's ranges, that are not NotAvailable. */
static void what_the_vehicle_says_out_of_range_is_not_available(void **state)
{
    struct can_frame_data f = {.size = 8};
    struct can_ambient a;
    struct can_wall_in w;

    (void)state;
    for (unsigned t = 1249; t <= 2047; t++) {
        unsigned humidity = t % 256;
        f.data[2] = (uint8_t)t;
        f.data[3] = (uint8_t)(t >> 8 | humidity << 3);
        f.data[4] = (uint8_t)(humidity >> 5);
        assert_int_equal(can_unpack_ambient(&f, &a), 0);
        assert_int_equal(isnan(a.temperature_c), t > 1250);
        assert_int_equal(isnan(a.humidity), humidity > 200);
    }
    for (int azimuth = -18001; azimuth <= 18001; azimuth++) {
        f.data[2] = (uint8_t)azimuth;
        f.data[3] = (uint8_t)((unsigned)azimuth >> 8);
        assert_int_equal(can_unpack_wall_in(&f, &w), 0);
        assert_int_equal(isnan(w.azimuth_rad), abs(azimuth) > 18000);
    }
}

static void frames_of_another_size_or_kind_are_refused(void **state)
{
    (void)state;
    struct can_ego_motion e;
    struct can_object o;
    int64_t stamp_ns;
    struct can_frame_data f = {.size = 7};
    assert_int_equal(can_unpack_ego_motion(&f, &e), -EINVAL);
    assert_int_equal(can_unpack_time(&f, &stamp_ns), -EINVAL);
    f.size = 8;
    f.fd = true;
    assert_int_equal(can_unpack_ego_motion(&f, &e), -EINVAL);
    f.size = 64;
    f.fd = false;
    assert_int_equal(can_unpack_object_fd(&f, &o), -EINVAL);
    f.fd = true;
    assert_int_equal(can_unpack_object_fd(&f, &o), 0);
}

static void an_object_goes_there_and_back(void **state)
{
    (void)state;
    const struct can_object o = example();
    struct can_object classic = {.age_s = -1}, fd = {.sigma_m = {-1, -1}};
    struct can_frame_data f;
    can_pack_object_state(&f, 0x400, &o);
    assert_int_equal(can_unpack_object_state(&f, &classic), 0);
    can_pack_object_dynamics(&f, 0x400, &o);
    assert_int_equal(can_unpack_object_dynamics(&f, &classic), 0);
    can_pack_object_quality(&f, 0x400, &o);
    assert_int_equal(can_unpack_object_quality(&f, &classic), 0);
    can_pack_object_fd(&f, 0x400, &o);
    assert_int_equal(can_unpack_object_fd(&f, &fd), 0);
    assert_true(fabs(classic.position_m[1] - fd.position_m[1]) <= 0.01 + 1e-6);
    assert_true(fabs(classic.existence - 0.87) < 1e-9);
    assert_true(fabs(fd.existence - 0.87) < 1e-9);
    assert_true(fabs(fd.class_probability - 0.9) < 1e-9);
    assert_int_equal(classic.class, CAN_EXTENDED);
    assert_int_equal(fd.motion, CAN_MOVING);
    assert_true(fd.behind_no_wall && !fd.in_free_view);
    assert_true(classic.age_s == -1); /* what a frame does not carry is let alone */
    assert_true(fd.sigma_m[0] == -1);
}

static void a_list_header_goes_there_and_back(void **state)
{
    (void)state;
    const struct can_list_header h = {.number = 7,
                                      .counter = 300,
                                      .latency_ms = 41,
                                      .cycle_ms = NAN,
                                      .time_sync = CAN_SYNC_UNKNOWN};
    struct can_list_header back;
    struct can_frame_data f;
    int64_t stamp_ns;
    can_pack_list_header(&f, 0x400, &h);
    assert_int_equal(can_unpack_list_header(&f, &back), 0);
    assert_int_equal(back.number, 7);
    assert_int_equal(back.counter, 300);
    assert_true(back.latency_ms == 41 && isnan(back.cycle_ms) && !back.truncated);
    assert_int_equal(back.time_sync, CAN_SYNC_UNKNOWN);
    assert_int_equal(back.version, CAN_INTERFACE_VERSION);
    can_pack_time(&f, 0x400, INT64_C(1764000000250000000));
    assert_int_equal(can_unpack_time(&f, &stamp_ns), 0);
    assert_true(stamp_ns == INT64_C(1764000000250000000));
}

static void status_and_diagnosis_go_there_and_back(void **state)
{
    (void)state;
    struct can_frame_data f;
    struct can_status s;
    struct can_diagnosis d;
    can_pack_status(&f, 0x400,
                    &(struct can_status){.state = CAN_STANDBY,
                                         .source = CAN_SOURCE_UNKNOWN,
                                         .faults = 1 << CAN_FAULT_WALL_LOST,
                                         .temperature_c = NAN,
                                         .sound_speed_m_s = 343,
                                         .range_m = 0.0});
    assert_int_equal(can_unpack_status(&f, &s), 0);
    assert_int_equal(s.state, CAN_STANDBY);
    assert_int_equal(s.source, CAN_SOURCE_UNKNOWN);
    assert_int_equal(s.faults, 32);
    assert_true(isnan(s.temperature_c) && fabs(s.sound_speed_m_s - 343) < 1e-9);
    assert_true(fabs(s.range_m) < 1e-9);
    can_pack_diagnosis(&f, 0x400,
                       &(struct can_diagnosis){.cpu = NAN, .snr_db = -3, .trouble = 12});
    assert_int_equal(can_unpack_diagnosis(&f, &d), 0);
    assert_true(isnan(d.cpu) && fabs(d.snr_db + 3) < 1e-9);
    assert_int_equal(d.trouble, 1 + CAN_FAULT_LISTS_DROPPED);
    assert_false(d.trouble_present);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_status_is_read_back),
        cmocka_unit_test(a_list_header_is_read_back),
        cmocka_unit_test(a_time_is_read_back),
        cmocka_unit_test(a_time_out_of_range_is_clamped),
        cmocka_unit_test(an_object_is_read_back),
        cmocka_unit_test(a_motion_has_the_bytes_of_the_layout),
        cmocka_unit_test(every_position_is_within_half_a_step),
        cmocka_unit_test(a_sigma_is_never_said_better_than_it_is),
        cmocka_unit_test(values_out_of_range_are_clamped_to_it),
        cmocka_unit_test(what_is_not_known_is_sent_as_not_available),
        cmocka_unit_test(a_header_out_of_range_is_clamped),
        cmocka_unit_test(a_state_that_does_not_exist_is_not_available),
        cmocka_unit_test(a_diagnosis_is_read_back),
        cmocka_unit_test(an_fd_object_is_read_back),
        cmocka_unit_test(an_fd_object_knows_what_it_does_not_know),
        cmocka_unit_test(what_the_vehicle_says_is_read_back),
        cmocka_unit_test(the_vehicles_frames_are_unpacked_from_their_bytes),
        cmocka_unit_test(the_ends_of_walls_are_unpacked_from_their_bytes),
        cmocka_unit_test(what_the_vehicle_says_out_of_range_is_not_available),
        cmocka_unit_test(frames_of_another_size_or_kind_are_refused),
        cmocka_unit_test(an_object_goes_there_and_back),
        cmocka_unit_test(a_list_header_goes_there_and_back),
        cmocka_unit_test(status_and_diagnosis_go_there_and_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
