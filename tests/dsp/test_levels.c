/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>

#include "dsp/channels.h"
#include "tests/dsp/near.h"

enum { NS = 5, NM = 4 };

static const double speaker_db[NS] = {1.0, -2.0, 0.5, 0.0, 0.5}; /* sum 0 */
static const double microphone_db[NM] = {3.0, -3.0, 1.5, -1.5};  /* sum 0 */

static void levels(double out[NS][NM], double mean_db)
{
    for (size_t j = 0; j < NS; j++)
        for (size_t i = 0; i < NM; i++)
            out[j][i] = mean_db + speaker_db[j] + microphone_db[i];
}

static void gains_add_up_to_the_levels(void **state)
{
    double l[NS][NM], s[NS], m[NM];
    struct levels out;
    (void)state;
    levels(l, -40.0);
    assert_int_equal(levels_fit(&out, NS, NM, l[0], s, m), 0);
    assert_near(out.mean_db, -40.0, 1e-9);
    assert_near(out.residual_db, 0.0, 1e-9);
    assert_int_equal(out.n_used, NS * NM);
    for (size_t j = 0; j < NS; j++)
        assert_near(s[j], speaker_db[j], 1e-9);
    for (size_t i = 0; i < NM; i++)
        assert_near(m[i], microphone_db[i], 1e-9);
}

static void pairs_that_were_not_heard_are_not_needed(void **state)
{
    double l[NS][NM], s[NS], m[NM];
    struct levels out;
    (void)state;
    levels(l, 6.0);
    l[0][1] = l[3][3] = l[4][0] = NAN;
    assert_int_equal(levels_fit(&out, NS, NM, l[0], s, m), 0);
    assert_int_equal(out.n_used, NS * NM - 3);
    for (size_t j = 0; j < NS; j++)
        assert_near(s[j], speaker_db[j], 1e-9);
    for (size_t i = 0; i < NM; i++)
        assert_near(m[i], microphone_db[i], 1e-9);
}

static void a_channel_that_nothing_tells_of_is_unknown(void **state)
{
    double l[NS][NM], s[NS], m[NM];
    struct levels out;
    (void)state;
    levels(l, 0.0);
    for (size_t j = 0; j < NS; j++)
        l[j][2] = NAN;
    assert_int_equal(levels_fit(&out, NS, NM, l[0], s, m), 0);
    assert_true(isnan(m[2]));
    assert_int_equal(out.n_microphones_unknown, 1);
    assert_int_equal(out.n_speakers_unknown, 0);
    /* relative to the mean of the other three, -0.5 dB */
    assert_near(m[0], 3.5, 1e-9);
    assert_near(out.mean_db, -0.5, 1e-9);
    for (size_t j = 0; j < NS; j++)
        for (size_t i = 0; i < NM; i++)
            l[j][i] = NAN;
    assert_int_equal(levels_fit(&out, NS, NM, l[0], s, m), -ENODATA);
}

static void a_pair_that_heard_something_else_is_left_out(void **state)
{
    enum { N = 12 };
    double l[N][N], s[N], m[N];
    struct levels out;
    (void)state;
    for (size_t j = 0; j < N; j++)
        for (size_t i = 0; i < N; i++)
            l[j][i] = -30.0 + 0.1 * sin((double)(5 * j + 11 * i));
    l[3][7] = -10.0;
    assert_int_equal(levels_fit(&out, N, N, l[0], s, m), 0);
    assert_true(out.n_used < N * N);
    assert_true(out.residual_db < 0.1);
    assert_near(s[3], 0.0, 0.1);
    assert_near(m[7], 0.0, 0.1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gains_add_up_to_the_levels),
        cmocka_unit_test(pairs_that_were_not_heard_are_not_needed),
        cmocka_unit_test(a_channel_that_nothing_tells_of_is_unknown),
        cmocka_unit_test(a_pair_that_heard_something_else_is_left_out),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
