#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/can/frames.h"

struct field { /* as the DBC says */
    unsigned start, length;
    char sign;
    double factor, offset, min, max;
};

static struct field find_field(const char *message, const char *signal)
{
    char line[2000], name[64], current[64] = "";
    struct field f;
    unsigned order;
    FILE *dbc = fopen(SOURCE_DIR "/msgs/can/anlos.dbc", "r");
    assert_non_null(dbc);
    bool found = false;
    while (!found && fgets(line, sizeof line, dbc)) {
        sscanf(line, "BO_ %*u %63[^:]", current);
        found = strcmp(current, message) == 0 &&
                sscanf(line, " SG_ %63s : %u|%u@%u%c (%lf,%lf) [%lf|%lf]", name, &f.start,
                       &f.length, &order, &f.sign, &f.factor, &f.offset, &f.min,
                       &f.max) == 9 &&
                strcmp(name, signal) == 0;
    }
    fclose(dbc);
    if (!found)
        fail_msg("%s.%s is not in the DBC", message, signal);
    assert_int_equal(order, 1); /* Intel */
    return f;
}

/* The frame as one 64-bit number, shifted: not how the code under test does it. */
static int64_t raw(const struct can_frame_data *frame, const char *message,
                   const char *signal)
{
    struct field f = find_field(message, signal);
    uint64_t word = 0;
    for (int i = 7; i >= 0; i--)
        word = word << 8 | frame->data[i];
    word = word << (64 - f.start - f.length) >> (64 - f.length);
    if (f.sign == '-' && word >> (f.length - 1))
        return (int64_t)word - (INT64_C(1) << f.length);
    return (int64_t)word;
}

static double physical(const struct can_frame_data *frame, const char *message,
                       const char *signal)
{
    struct field f = find_field(message, signal);
    return (double)raw(frame, message, signal) * f.factor + f.offset;
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
                               .width_m = 1.8};
}

static void a_status_is_read_back(void **state)
{
    (void)state;
    const struct can_status s = {.state = CAN_BLOCKED,
                                 .source = CAN_SIMULATION,
                                 .faults = 0xa5c3,
                                 .temperature_c = -12.5,
                                 .sound_speed_m_s = 324.1};
    struct can_frame_data f;
    memset(&f, 0xff, sizeof f);
    can_pack_status(&f, 0x400, &s);
    assert_frame(&f, 0x400);
    assert_int_equal(raw(&f, "Status", "State"), 5);
    assert_int_equal(raw(&f, "Status", "Source"), 2);
    assert_int_equal(raw(&f, "Status", "Faults"), 0xa5c3);
    assert_near(&f, "Status", "Temperature", -12.5);
    assert_near(&f, "Status", "SoundSpeed", 324.1);
}

static void a_list_header_is_read_back(void **state)
{
    (void)state;
    const struct can_list_header h = {.number = 32,
                                      .counter = 0x1abc,
                                      .latency_ms = 58.4,
                                      .cycle_ms = 32003,
                                      .truncated = true};
    struct can_frame_data f;
    can_pack_list_header(&f, 0x410, &h);
    assert_frame(&f, 0x412);
    assert_int_equal(raw(&f, "ListHeader", "Number"), 32);
    assert_int_equal(raw(&f, "ListHeader", "Counter"), 0xabc);
    assert_near(&f, "ListHeader", "Latency", 58.4);
    assert_near(&f, "ListHeader", "Cycle", 32003);
    assert_int_equal(raw(&f, "ListHeader", "Truncated"), 1);
    assert_int_equal(raw(&f, "ListHeader", "InterfaceVersion"), 1);
    assert_int_equal(raw(&f, "ListHeader", "TimeSync"), 0);
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
    assert_int_equal(raw(&f, "ObjectDynamics", "Class"), 0);
    assert_int_equal(raw(&f, "ObjectDynamics", "DynamicProperty"), 0);

    can_pack_object_quality(&f, 0x400, &o);
    assert_frame(&f, 0x406);
    assert_int_equal(raw(&f, "ObjectQuality", "Id"), 200);
    assert_int_equal(raw(&f, "ObjectQuality", "Counter"), 9);
    assert_near(&f, "ObjectQuality", "Correlation", -0.6);
    assert_int_equal(raw(&f, "ObjectQuality", "SigmaV"), 31);
    assert_near(&f, "ObjectQuality", "Length", 4.5);
    assert_near(&f, "ObjectQuality", "Width", 1.8);
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
                struct field s = find_field(message, signals[i].signal);
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
    assert_int_equal(raw(&f, "ObjectQuality", "Length"), 63);
    assert_int_equal(raw(&f, "ObjectQuality", "Width"), 31);

    const struct can_status s = {.temperature_c = NAN, .sound_speed_m_s = NAN};
    can_pack_status(&f, 0x400, &s);
    assert_int_equal(raw(&f, "Status", "Temperature"), 255);
    assert_int_equal(raw(&f, "Status", "SoundSpeed"), 1023);

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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_status_is_read_back),
        cmocka_unit_test(a_list_header_is_read_back),
        cmocka_unit_test(a_time_is_read_back),
        cmocka_unit_test(a_time_out_of_range_is_clamped),
        cmocka_unit_test(an_object_is_read_back),
        cmocka_unit_test(every_position_is_within_half_a_step),
        cmocka_unit_test(a_sigma_is_never_said_better_than_it_is),
        cmocka_unit_test(values_out_of_range_are_clamped_to_it),
        cmocka_unit_test(what_is_not_known_is_sent_as_not_available),
        cmocka_unit_test(a_header_out_of_range_is_clamped),
        cmocka_unit_test(a_state_that_does_not_exist_is_not_available),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
