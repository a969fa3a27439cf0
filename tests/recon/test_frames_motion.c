/* SPDX-License-Identifier: MIT */
/* A vehicle that drives: what recon/static_array/frames shows of recordings that take no
 * step of standing still while sound is under way. */
#include "tests/recon/near.h"

#include <stdlib.h>

#include "tests/recon/bumper.h"

enum { PINGS = 8, SIDE = 41 };

static double db(double ratio)
{
    return 10.0 * log10(ratio);
}

/* The image of pings 0..7 around where the point is at the newest of them; its peak. */
static float image_peak(struct bumper *b, bool compensated, double off_m[3],
                        struct frames_made *made)
{
    static float image[SIDE * SIDE];
    double at[3], peak[3];
    bumper_point(b, PINGS - 1, at);
    bumper_look_at(b, at, SIDE, 0.01);
    bumper_start(b);
    struct frames *f = bumper_frames(b);
    bumper_add(b, f, PINGS);
    frames_image(f, compensated ? &b->motion : NULL, image, made);
    float level = bumper_peak(b, image, peak);
    for (int a = 0; a < 3; a++)
        off_m[a] = peak[a] - at[a];
    frames_destroy(f);
    bumper_stop(b);
    return level;
}

static float standing_peak(void)
{
    struct bumper b;
    struct frames_made made;
    double off_m[3];
    bumper_default(&b);
    float level = image_peak(&b, false, off_m, &made);
    assert_near(off_m[0], 0.0, 1e-3);
    assert_near(off_m[2], 0.0, 1e-3);
    return level;
}

static void expect_sharp(struct bumper *b, double within_m)
{
    struct frames_made made;
    double off_m[3];
    float standing = standing_peak();
    float moving = image_peak(b, true, off_m, &made);
    assert_int_equal(made.unknown, 0);
    assert_near(db(moving / standing), 0.0, 1.0);
    assert_near(off_m[0], 0.0, within_m);
    assert_near(off_m[2], 0.0, within_m);
}

static void expect_smeared(struct bumper *b)
{
    struct frames_made made;
    double off_m[3];
    float standing = standing_peak();
    float moving = image_peak(b, false, off_m, &made);
    assert_below(db(moving / standing), -3.0);
}

static void a_vehicle_at_2_m_s_sees_a_standing_point_sharp(void **state)
{
    (void)state;
    struct bumper b;
    bumper_default(&b);
    b.world.speed_m_s = 2.0;
    bumper_drive(&b);
    expect_sharp(&b, 1e-3);
    expect_smeared(&b);
}

static void a_vehicle_that_turns_does_too(void **state)
{
    (void)state;
    struct bumper b;
    bumper_default(&b);
    b.world.speed_m_s = 1.0;
    b.world.yaw_rate_rad_s = 0.4;
    bumper_drive(&b);
    expect_sharp(&b, 1e-3);
    expect_smeared(&b);
}

static void down_chirps_between_up_chirps_fit_in(void **state)
{
    (void)state;
    struct bumper b;
    bumper_default(&b);
    b.world.speed_m_s = 2.0;
    b.alternates = true;
    bumper_drive(&b);
    expect_sharp(&b, 1e-3);
}

static void a_point_whose_velocity_is_known_is_sharp_and_where_it_is(void **state)
{
    (void)state;
    struct bumper b;
    bumper_default(&b);
    b.world.velocity_m_s[0] = -0.8;
    b.world.velocity_m_s[1] = 1.2;
    b.motion.velocity_m_s[0] = 1.2; /* the array's x is the vehicle's y */
    b.motion.velocity_m_s[2] = -0.8;
    expect_sharp(&b, 1e-3);
    expect_smeared(&b);
}

static void both_may_move(void **state)
{
    (void)state;
    struct bumper b;
    bumper_default(&b);
    b.world.velocity_m_s[1] = 1.5;
    b.motion.velocity_m_s[0] = 1.5;
    b.world.speed_m_s = 1.5;
    bumper_drive(&b);
    expect_sharp(&b, 1e-3);
}

static void a_path_that_ends_is_said(void **state)
{
    (void)state;
    struct bumper b;
    struct frames_made made;
    double off_m[3];
    bumper_default(&b);
    b.world.speed_m_s = 2.0;
    b.motion.path = &b.path; /* empty */
    image_peak(&b, true, off_m, &made);
    assert_int_equal(made.unknown, PINGS);
    assert_int_equal(made.pings, PINGS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_vehicle_at_2_m_s_sees_a_standing_point_sharp),
        cmocka_unit_test(a_vehicle_that_turns_does_too),
        cmocka_unit_test(down_chirps_between_up_chirps_fit_in),
        cmocka_unit_test(a_point_whose_velocity_is_known_is_sharp_and_where_it_is),
        cmocka_unit_test(both_may_move),
        cmocka_unit_test(a_path_that_ends_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
