/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "hal/alsa/sample_format.h"

/* Values and their bytes on a little-endian machine, by hand. */
static void codes_are_those_of_the_formats(void **state)
{
    static const struct {
        enum sample_format format;
        float value;
        unsigned char bytes[4];
    } cases[] = {
        {SAMPLE_FORMAT_S16, 0.5f, {0x00, 0x40}},
        {SAMPLE_FORMAT_S16, -1.0f, {0x00, 0x80}},
        {SAMPLE_FORMAT_S16, 1.0f, {0xff, 0x7f}},
        {SAMPLE_FORMAT_S16, 2.6f / 32768, {0x03, 0x00}},
        {SAMPLE_FORMAT_S16, -1.0f / 32768, {0xff, 0xff}},
        {SAMPLE_FORMAT_S24_3, 0.5f, {0x00, 0x00, 0x40}},
        {SAMPLE_FORMAT_S24_3, -1.0f / 8388608, {0xff, 0xff, 0xff}},
        {SAMPLE_FORMAT_S24_3, 1.0f, {0xff, 0xff, 0x7f}},
        {SAMPLE_FORMAT_S24, -1.0f, {0x00, 0x00, 0x80, 0xff}},
        {SAMPLE_FORMAT_S24, 3.0f / 8388608, {0x03, 0x00, 0x00, 0x00}},
        {SAMPLE_FORMAT_S32, 0.5f, {0x00, 0x00, 0x00, 0x40}},
        {SAMPLE_FORMAT_S32, 1.0f, {0xff, 0xff, 0xff, 0x7f}},
        {SAMPLE_FORMAT_S32, -1.0f, {0x00, 0x00, 0x00, 0x80}},
        {SAMPLE_FORMAT_FLOAT, 0.5f, {0x00, 0x00, 0x00, 0x3f}},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        unsigned char out[8];
        memset(out, 0x55, sizeof out);
        size_t n = sample_format_bytes(cases[i].format);
        sample_format_write(cases[i].format, &cases[i].value, 1, 1, out, n);
        assert_memory_equal(out, cases[i].bytes, n);
        assert_int_equal(out[n], 0x55);
    }
}

/* Codes of up to 24 bits are exact in a float. */
static void what_is_read_is_what_was_written(void **state)
{
    static const float x[] = {0, 0.5f, -0.5f, 0.25f, -0.999969482421875f, 0.125f};
    (void)state;
    for (int f = 0; f < SAMPLE_FORMATS; f++) {
        unsigned char out[6 * 12];
        float back[6];
        sample_format_write((enum sample_format)f, x, 6, 1, out, 12);
        sample_format_read((enum sample_format)f, out, 12, 6, back);
        assert_memory_equal(back, x, sizeof x);
    }
}

static void channels_between_are_left_alone(void **state)
{
    static const float x[] = {0.5f, -0.5f};
    (void)state;
    for (int f = 0; f < SAMPLE_FORMATS; f++) {
        unsigned char out[2 * 12];
        size_t bytes = sample_format_bytes((enum sample_format)f);
        memset(out, 0x55, sizeof out);
        sample_format_write((enum sample_format)f, x, 2, 1, out, 12);
        for (size_t i = bytes; i < 24; i++)
            if (i < 12 || i >= 12 + bytes)
                assert_int_equal(out[i], 0x55);
    }
}

static void gains_apply_and_what_is_too_loud_stays_at_full_scale(void **state)
{
    static const float x[] = {0.5f, 1.0f};
    static const unsigned char expected[] = {0x00, 0xe0, 0x00, 0xc0};
    static const unsigned char loud[] = {0xff, 0x7f, 0xff, 0x7f};
    unsigned char out[4];
    float single[2];
    (void)state;
    sample_format_write(SAMPLE_FORMAT_S16, x, 2, -0.5f, out, 2);
    assert_memory_equal(out, expected, 4);
    sample_format_write(SAMPLE_FORMAT_S16, x, 2, 4, out, 2);
    assert_memory_equal(out, loud, 4);
    sample_format_write(SAMPLE_FORMAT_FLOAT, x, 2, -4, single, 4);
    assert_true(single[0] == -1 && single[1] == -1);
}

static void the_fourth_byte_of_S24_is_not_looked_at(void **state)
{
    static const unsigned char in[] = {0x00, 0x00, 0x40, 0xaa, 0xff, 0xff, 0xff, 0x00};
    float x[2];
    (void)state;
    sample_format_read(SAMPLE_FORMAT_S24, in, 4, 2, x);
    assert_true(x[0] == 0.5f && x[1] == -1.0f / 8388608);
}

static void floats_that_are_not_finite_come_as_they_are(void **state)
{
    float in[] = {NAN, INFINITY}, x[2];
    (void)state;
    sample_format_read(SAMPLE_FORMAT_FLOAT, in, 4, 2, x);
    assert_true(isnan(x[0]) && isinf(x[1]));
}

static void formats_have_the_names_of_a_rig_file(void **state)
{
    static const char *const names[SAMPLE_FORMATS] = {"S32", "S24", "S24_3", "float",
                                                      "S16"};
    (void)state;
    for (int i = 0; i < SAMPLE_FORMATS; i++)
        assert_string_equal(sample_format_name((enum sample_format)i), names[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(codes_are_those_of_the_formats),
        cmocka_unit_test(what_is_read_is_what_was_written),
        cmocka_unit_test(channels_between_are_left_alone),
        cmocka_unit_test(gains_apply_and_what_is_too_loud_stays_at_full_scale),
        cmocka_unit_test(the_fourth_byte_of_S24_is_not_looked_at),
        cmocka_unit_test(floats_that_are_not_finite_come_as_they_are),
        cmocka_unit_test(formats_have_the_names_of_a_rig_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
