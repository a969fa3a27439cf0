/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "dsp/channels.h"

enum { MOST = 16 };

static void assert_found(size_t n_speakers, size_t n_microphones, unsigned speakers,
                         unsigned microphones, double common_rad, double scatter_rad)
{
    double complex peaks[MOST * MOST] = {0};
    bool s[MOST], m[MOST];
    for (size_t j = 0; j < n_speakers; j++)
        for (size_t i = 0; i < n_microphones; i++) {
            bool inverted = (speakers >> j & 1) != (microphones >> i & 1);
            double phase = common_rad + scatter_rad * sin((double)(7 * j + 13 * i));
            peaks[j * n_microphones + i] = (inverted ? -1.0 : 1.0) *
                                           (0.1 + 0.01 * (double)j) * cexp(I * phase);
        }
    assert_int_equal(polarity_find(n_speakers, n_microphones, peaks, s, m), 0);
    for (size_t j = 0; j < n_speakers; j++)
        assert_int_equal(s[j], speakers >> j & 1);
    for (size_t i = 0; i < n_microphones; i++)
        assert_int_equal(m[i], microphones >> i & 1);
}

static void inverted_channels_are_those_unlike_most(void **state)
{
    (void)state;
    assert_found(16, 16, 0, 0, 0.0, 0.0);
    assert_found(16, 16, 1u << 3, 0, 0.0, 0.0);
    assert_found(16, 16, 0, 1u << 15, 0.0, 0.0);
    assert_found(16, 16, 0x0124, 0x8001, 0.0, 0.0);
    assert_found(4, 8, 0x1, 0x70, 0.0, 0.0);
}

static void a_phase_that_all_have_and_scatter_do_not_matter(void **state)
{
    (void)state;
    for (double common = -3.0; common <= 3.0; common += 0.5)
        assert_found(8, 8, 0x21, 0x06, common, 0.6);
}

static void what_was_not_heard_says_nothing(void **state)
{
    double complex peaks[3 * 3] = {1, -1, 1, 0, 0, 0, 1, -1, 1};
    bool s[3], m[3];
    (void)state;
    assert_int_equal(polarity_find(3, 3, peaks, s, m), 0);
    assert_true(!s[0] && !s[1] && !s[2]);
    assert_true(!m[0] && m[1] && !m[2]);
    peaks[0] = peaks[1] = peaks[2] = 0; /* a start without any phase */
    assert_int_equal(polarity_find(3, 3, peaks, s, m), 0);
    assert_true(!s[0] && !s[1] && !s[2]);
    assert_true(!m[0] && m[1] && !m[2]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(inverted_channels_are_those_unlike_most),
        cmocka_unit_test(a_phase_that_all_have_and_scatter_do_not_matter),
        cmocka_unit_test(what_was_not_heard_says_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
