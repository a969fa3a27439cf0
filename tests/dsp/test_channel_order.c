/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "dsp/channels.h"
#include "tests/dsp/near.h"

enum { N = 6 };
#define TOLERANCE_S 30e-6

/* Two upright rows 8 cm apart, elements every 10 cm. */
static double expected_s(size_t j, size_t i)
{
    return hypot(0.08, 0.1 * ((double)j - (double)i)) / 340.0;
}

static void find(const size_t *wired, double heard[N][N], struct channel_place *out)
{
    double expected[N][N];
    for (size_t j = 0; j < N; j++)
        for (size_t i = 0; i < N; i++) {
            expected[j][i] = expected_s(j, i);
            heard[j][i] = expected_s(wired[j], i) + 5e-6 * sin((double)(3 * j + 5 * i));
        }
    assert_int_equal(channel_order_find(N, N, heard[0], expected[0], TOLERANCE_S, out),
                     0);
}

static void channels_in_their_places_stay(void **state)
{
    static const size_t wired[N] = {0, 1, 2, 3, 4, 5};
    double heard[N][N];
    struct channel_place out[N];
    (void)state;
    find(wired, heard, out);
    for (size_t j = 0; j < N; j++) {
        assert_int_equal(out[j].answers_as, j);
        assert_true(out[j].own_s < 5.1e-6);
    }
}

static void swapped_channels_are_named(void **state)
{
    static const size_t wired[N] = {0, 4, 2, 5, 1, 3};
    double heard[N][N];
    struct channel_place out[N];
    (void)state;
    find(wired, heard, out);
    for (size_t j = 0; j < N; j++)
        assert_int_equal(out[j].answers_as, wired[j]);
    assert_true(out[1].own_s > 100e-6 && out[1].other_s < 5.1e-6);
}

/* Two of the others are swapped or dead: their entries are wrong in every row. */
static void wrong_channels_of_the_other_kind_do_not_matter(void **state)
{
    double expected[N][N], heard[N][N];
    struct channel_place out[N];
    (void)state;
    for (size_t j = 0; j < N; j++)
        for (size_t i = 0; i < N; i++) {
            expected[j][i] = expected_s(j, i);
            heard[j][i] = i == 2   ? NAN
                          : i == 0 ? expected_s(j, 5)
                                   : expected_s(j == 1   ? 3
                                                : j == 3 ? 1
                                                         : j,
                                                i);
        }
    assert_int_equal(channel_order_find(N, N, heard[0], expected[0], TOLERANCE_S, out),
                     0);
    for (size_t j = 0; j < N; j++)
        assert_int_equal(out[j].answers_as, j == 1 ? 3 : j == 3 ? 1 : j);
}

static void a_channel_that_is_hardly_heard_stays_and_says_so(void **state)
{
    double expected[N][N], heard[N][N];
    struct channel_place out[N];
    (void)state;
    for (size_t j = 0; j < N; j++)
        for (size_t i = 0; i < N; i++) {
            expected[j][i] = expected_s(j, i);
            heard[j][i] = j == 2 && i > 1 ? NAN : expected_s(j, i);
        }
    assert_int_equal(channel_order_find(N, N, heard[0], expected[0], TOLERANCE_S, out),
                     0);
    assert_int_equal(out[2].answers_as, 2);
    assert_true(isnan(out[2].own_s));
    assert_near(out[3].own_s, 0.0, 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(channels_in_their_places_stay),
        cmocka_unit_test(swapped_channels_are_named),
        cmocka_unit_test(wrong_channels_of_the_other_kind_do_not_matter),
        cmocka_unit_test(a_channel_that_is_hardly_heard_stays_and_says_so),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
