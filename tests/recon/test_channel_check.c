/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "recon/frontend/channel_check.h"

enum { MICS = 4, FRAMES = 1003 };

struct fixture {
    float x[MICS][FRAMES];
    uint32_t clipped[MICS], not_finite[MICS];
    bool masked[MICS];
};

static struct fixture sound(void)
{
    struct fixture f = {0};
    for (int i = 0; i < MICS; i++)
        for (int k = 0; k < FRAMES; k++)
            f.x[i][k] = 0.1f * sinf(0.05f * (float)(k + 7 * i));
    return f;
}

static struct channel_summary check(struct fixture *f, size_t microphone)
{
    struct channel_check *c;
    struct channel_summary s;
    assert_int_equal(channel_check_create(&c, MICS, 2), 0);
    channel_check_position(c, 1, FRAMES, &f->x[0][0], f->clipped, f->not_finite,
                           f->masked);
    channel_check_summary(c, microphone, &s);
    channel_check_destroy(c);
    return s;
}

static void expect_masked(const struct fixture *f, int which)
{
    for (int i = 0; i < MICS; i++)
        assert_int_equal(f->masked[i], i == which);
}

static void healthy_channels_are_kept(void **state)
{
    (void)state;
    struct fixture f = sound();
    struct channel_summary s = check(&f, 0);
    expect_masked(&f, -1);
    assert_int_equal(s.silent + s.damaged + s.clipped, 0);
}

static void a_channel_of_zeros_is_silent(void **state)
{
    (void)state;
    struct fixture f = sound();
    memset(f.x[2], 0, sizeof f.x[2]);
    assert_int_equal(check(&f, 2).silent, 1);
    expect_masked(&f, 2);
}

static void an_offset_is_not_sound(void **state)
{
    (void)state;
    struct fixture f = sound();
    for (int k = 0; k < FRAMES; k++)
        f.x[1][k] = 0.7f;
    assert_int_equal(check(&f, 1).silent, 1);
    expect_masked(&f, 1);
}

static void silence_begins_60_db_below_the_median(void **state)
{
    (void)state;
    struct fixture f = sound(), g = sound();
    for (int k = 0; k < FRAMES; k++) {
        f.x[3][k] *= 1.3e-3f; /* -57.7 dB */
        g.x[3][k] *= 0.7e-3f; /* -63.1 dB */
    }
    assert_int_equal(check(&f, 3).silent, 0);
    expect_masked(&f, -1);
    assert_int_equal(check(&g, 3).silent, 1);
    expect_masked(&g, 3);
}

static void all_silent_means_all_masked(void **state)
{
    (void)state;
    struct fixture f = {0};
    check(&f, 0);
    for (int i = 0; i < MICS; i++)
        assert_true(f.masked[i]);
}

static void one_sample_that_is_not_finite_masks(void **state)
{
    (void)state;
    struct fixture f = sound();
    f.not_finite[0] = 1;
    struct channel_summary s = check(&f, 0);
    assert_int_equal(s.damaged, 1);
    assert_int_equal(s.not_finite_samples, 1);
    expect_masked(&f, 0);
}

/* Even where nobody counted; and a silent one is still found beside it. */
static void a_channel_that_holds_no_numbers_masks_itself_alone(void **state)
{
    (void)state;
    static const float bad[3] = {NAN, INFINITY, 1e30f};
    for (int q = 0; q < 3; q++) {
        struct fixture f = sound();
        f.x[1][500] = bad[q];
        assert_int_equal(check(&f, 1).damaged, 1);
        expect_masked(&f, 1);
        f = sound();
        f.x[2][500] = bad[q];
        memset(f.x[0], 0, sizeof f.x[0]);
        assert_int_equal(check(&f, 0).silent, 1);
        for (int i = 0; i < MICS; i++)
            assert_int_equal(f.masked[i], i == 0 || i == 2);
    }
}

static void gains_of_twelve_decades_do_not_matter(void **state)
{
    (void)state;
    static const float gains[4] = {1e-12f, 1e-6f, 1e6f, 1e12f};
    for (int q = 0; q < 4; q++) {
        struct fixture f = sound();
        for (int k = 0; k < FRAMES; k++) {
            for (int i = 0; i < MICS; i++)
                f.x[i][k] *= gains[q];
            f.x[3][k] *= 0.7e-3f;
        }
        check(&f, 0);
        expect_masked(&f, 3);
    }
}

static void clipping_is_counted_and_masks_above_one_percent(void **state)
{
    (void)state;
    struct fixture f = sound(), g = sound();
    f.clipped[1] = 10; /* of 1003: just below */
    g.clipped[1] = 11;
    struct channel_summary s = check(&f, 1);
    assert_int_equal(s.clipped, 0);
    assert_int_equal(s.clipped_samples, 10);
    expect_masked(&f, -1);
    assert_int_equal(check(&g, 1).clipped, 1);
    expect_masked(&g, 1);
}

static void what_was_masked_before_stays_masked(void **state)
{
    (void)state;
    struct fixture f = sound();
    f.masked[2] = true;
    check(&f, 2);
    expect_masked(&f, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(healthy_channels_are_kept),
        cmocka_unit_test(a_channel_of_zeros_is_silent),
        cmocka_unit_test(an_offset_is_not_sound),
        cmocka_unit_test(silence_begins_60_db_below_the_median),
        cmocka_unit_test(all_silent_means_all_masked),
        cmocka_unit_test(one_sample_that_is_not_finite_masks),
        cmocka_unit_test(a_channel_that_holds_no_numbers_masks_itself_alone),
        cmocka_unit_test(gains_of_twelve_decades_do_not_matter),
        cmocka_unit_test(clipping_is_counted_and_masks_above_one_percent),
        cmocka_unit_test(what_was_masked_before_stays_masked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
