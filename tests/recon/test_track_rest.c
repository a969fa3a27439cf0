/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <string.h>

#include "recon/tracking/track_rest.h"
#include "tests/recon/dice.h"

#define SIGMA_M   0.05
#define STEP_S    0.2
#define PING_S    0.024
#define FOREVER_S 1e9
#define SHARE     0.12 /* of an image of 8 pings, that is new */

/* A vehicle that speeds up to 2 m/s in a gentle bend; its array looks ahead. */
static void drive(int k, struct track_rest_look *look)
{
    double t = STEP_S * k, yaw = 0.3 * t, way = fmin(t * t, 2.0 * t - 1.0);

    *look = (struct track_rest_look){
        .array_m = {20.0 + way * cos(0.5 * yaw), -7.0 + way * sin(0.5 * yaw)},
        .axis = {-sin(yaw), cos(yaw)},
        .sigma_m = SIGMA_M};
}

/* step_s after the one before. */
static void add(struct track_rest *r, const struct track_rest_look *look, double share,
                double step_s, double memory_s)
{
    track_rest_add(r, look, share, r->newest_ns + llround(1e9 * step_s), memory_s);
}

static void hear(const double p_m[3], struct track_rest_look *look)
{
    double x = p_m[0] - look->array_m[0], y = p_m[1] - look->array_m[1];

    look->along_m = x * look->axis[0] + y * look->axis[1];
    look->range_m = sqrt(x * x + y * y + p_m[2] * p_m[2]);
}

/* Somewhere around the array's first place: before or behind it, over or under it. */
static void throw_point(unsigned long long *seed, double p_m[3])
{
    p_m[0] = 20.0 + 3.0 * dice_normal(seed);
    p_m[1] = -7.0 + 3.0 * dice_normal(seed);
    p_m[2] = 1.0 + 2.0 * dice_normal(seed);
}

static void anything_at_rest_anywhere_is_believed_to_rest(void **state)
{
    unsigned long long seed = 3;

    (void)state;
    for (int trial = 0; trial < 300; trial++) {
        struct track_rest r = {.looks = 0.0};
        struct track_rest_look look;
        double p_m[3];
        throw_point(&seed, p_m);
        for (int k = 0; k < 15; k++) {
            drive(k, &look);
            hear(p_m, &look);
            if (look.range_m < 1.0)
                break;
            if (k > 8)
                assert_true(track_rest_distance2(&r, &look) < 0.1);
            add(&r, &look, 1.0, STEP_S, FOREVER_S);
            assert_true(track_rest_misfit(&r) < 0.01);
        }
    }
}

static void noise_alone_is_no_motion(void **state)
{
    unsigned long long seed = 4;

    (void)state;
    for (int trial = 0; trial < 300; trial++) {
        struct track_rest r = {.looks = 0.0};
        struct track_rest_look look;
        const double p_m[3] = {23.0, -6.0, 2.0};
        for (int k = 0; k < 15; k++) {
            drive(k, &look);
            hear(p_m, &look);
            look.along_m += SIGMA_M * dice_normal(&seed);
            look.range_m += SIGMA_M * dice_normal(&seed);
            add(&r, &look, 1.0, STEP_S, STEP_S / -log(0.9));
            assert_true(track_rest_misfit(&r) < 1.0);
        }
    }
}

/* n looks at something that goes along a standing array at v leave the squares of its
 * distances from its mean place, v^2 dt^2 n (n^2 - 1) / 12; f = 2 n - 2. */
static void what_moves_leaves_squares(void **state)
{
    struct track_rest r = {.looks = 0.0};
    struct track_rest_look look = {
        .axis = {0.0, 1.0}, .range_m = 3.0, .sigma_m = SIGMA_M};
    const double x = 18.0, v = 0.4;

    (void)state;
    for (int n = 1; n <= 6; n++) {
        look.along_m = v * STEP_S * n;
        add(&r, &look, 1.0, STEP_S, FOREVER_S);
        double left_m2 = v * v * STEP_S * STEP_S * n * (n * n - 1) / 12.0, f = 2 * n - 2;
        assert_near(track_rest_misfit(&r),
                    left_m2 / (SIGMA_M * SIGMA_M) / (f + 2.0 * sqrt(f * x) + 2.0 * x),
                    1e-4);
    }
}

/* The mean of n looks is wrong by sigma / sqrt(n), the next by sigma. */
static void how_far_a_look_is_off_counts_both_errors(void **state)
{
    struct track_rest r = {.looks = 0.0};
    struct track_rest_look look = {
        .axis = {0.0, 1.0}, .along_m = 1.0, .range_m = 3.0, .sigma_m = SIGMA_M};

    (void)state;
    for (int n = 0; n < 4; n++)
        add(&r, &look, 1.0, STEP_S, FOREVER_S);
    look.along_m += 0.3;
    assert_near(track_rest_distance2(&r, &look),
                0.3 * 0.3 / (SIGMA_M * SIGMA_M * (1.0 + 0.25)), 1e-3);
}

/* A thing at rest is seen, and then another one beside it; or a walker, ping after ping.
 */
static void a_jump_is_told_from_a_walk(void **state)
{
    struct track_rest rests = {.looks = 0.0}, walks = {.looks = 0.0};
    struct track_rest_look look = {
        .axis = {0.0, 1.0}, .range_m = 3.0, .sigma_m = SIGMA_M};

    (void)state;
    for (int n = 0; n < 30; n++) {
        look.along_m = 1.2 * 0.024 * n;
        assert_false(track_rest_jumps(&walks, &look));
        add(&walks, &look, SHARE, PING_S, FOREVER_S);
        look.along_m = 1.0;
        assert_false(track_rest_jumps(&rests, &look));
        add(&rests, &look, SHARE, PING_S, FOREVER_S);
    }
    assert_true(track_rest_misfit(&walks) > 1.0);
    look.along_m = 1.4;
    assert_true(track_rest_jumps(&rests, &look));
}

/* Neighbours that are heard in turn fit no rest well; a third one is a jump all the same,
 * unless a walk explains them as well. */
static void a_jump_is_told_where_neighbours_are_heard_in_turn(void **state)
{
    struct track_rest rests = {.looks = 0.0};
    struct track_rest_look look;
    const double near_m[2][3] = {{23.0, -6.0, 2.0}, {23.2, -6.0, 2.0}};
    const double third_m[3] = {24.3, -6.0, 2.0};

    (void)state;
    for (int k = 0; k < 8; k++) {
        drive(k, &look);
        hear(near_m[k % 2], &look);
        if (k < 7)
            assert_false(track_rest_jumps(&rests, &look));
        add(&rests, &look, 1.0, STEP_S, FOREVER_S);
    }
    double misfit = track_rest_misfit(&rests);
    assert_true(misfit > TRACK_REST_MISFIT && misfit < 5.0 * TRACK_REST_MISFIT);
    drive(8, &look);
    hear(near_m[0], &look);
    assert_false(track_rest_jumps(&rests, &look));
    hear(third_m, &look);
    assert_true(track_rest_jumps(&rests, &look));
}

/* Motion along the array explains all of those squares: it is believed from 20 on, and
 * from 5 looks on. */
static void steady_motion_is_believed_once_it_explains_enough(void **state)
{
    const double speeds_m_s[] = {0.1, 0.2, 0.4, 3.0};

    (void)state;
    for (size_t i = 0; i < sizeof speeds_m_s / sizeof *speeds_m_s; i++) {
        struct track_rest r = {.looks = 0.0};
        struct track_rest_look look = {
            .axis = {0.0, 1.0}, .range_m = 3.0, .sigma_m = SIGMA_M};
        double step = speeds_m_s[i] * STEP_S / SIGMA_M;
        for (int n = 1; n <= 12; n++) {
            double gain = step * step * n * (n * n - 1) / 12.0;
            look.along_m = SIGMA_M * step * n;
            add(&r, &look, 1.0, STEP_S, FOREVER_S);
            assert_true(fabs(gain - 20.0) > 0.01);
            assert_int_equal(track_rest_moves(&r, false, false), n >= 5 && gain > 20.0);
        }
    }
}

/* Chi-squared of four degrees of freedom is over 20 in 1 of 2000 cases.  Where noise is
 * twice what it is taken for, ten times what one of 15 looks leaves counts: that is an F
 * of 4 and 23 degrees of freedom over 10 / 15 * 23 / 4 = 3.8, as in 1.6 of 100 cases. */
static void noise_is_no_steady_motion(void **state)
{
    enum { TRIALS = 3000 };
    const double p_m[3] = {23.0, -6.0, 2.0};
    unsigned long long seed = 6;
    int moves[2] = {0, 0};

    (void)state;
    for (int trial = 0; trial < 2 * TRIALS; trial++) {
        struct track_rest r = {.looks = 0.0};
        double noise_m = SIGMA_M * (1.0 + trial % 2);
        for (int k = 0; k < 15; k++) {
            struct track_rest_look look;
            drive(k, &look);
            hear(p_m, &look);
            look.along_m += noise_m * dice_normal(&seed);
            look.range_m += noise_m * dice_normal(&seed);
            add(&r, &look, 1.0, STEP_S, FOREVER_S);
        }
        moves[trial % 2] += track_rest_moves(&r, false, false);
    }
    assert_true(moves[0] < 8);
    assert_true(moves[1] < 75);
}

/* Whatever keeps its velocity is explained without a rest, also where it passes close by;
 * from an array that swings about, at uneven intervals, so that nothing else explains it.
 */
static void what_keeps_its_velocity_is_seen_to_move(void **state)
{
    unsigned long long seed = 9;

    (void)state;
    for (int trial = 0; trial < 300; trial++) {
        struct track_rest r = {.looks = 0.0};
        double p_m[3], angle = 2.0 * M_PI * reference_random(&seed), t = 0.0;
        double gain, left;
        throw_point(&seed, p_m);
        for (int k = 0; k < 20; k++) {
            double step_s = STEP_S * (0.5 + reference_random(&seed));
            struct track_rest_look look;
            drive(k, &look);
            t += step_s;
            look.array_m[0] = 20.0 + 2.0 * sin(1.7 * t);
            look.array_m[1] = -7.0 + 1.5 * cos(2.3 * t);
            p_m[0] += 3.0 * step_s * cos(angle);
            p_m[1] += 3.0 * step_s * sin(angle);
            hear(p_m, &look);
            add(&r, &look, 1.0, step_s, FOREVER_S);
        }
        track_rest_motion(&r, &gain, &left);
        assert_true(gain > 1000.0);
        assert_below(left, 1.0); /* what is known beforehand */
        assert_true(track_rest_moves(&r, false, false));
    }
}

/* From a vehicle that drives, within a second: at a walker's pace, anywhere and in any
 * direction, also in those that look like rest at another height. */
static void what_walks_is_seen_to_move(void **state)
{
    enum { TRIALS = 300, LOOKS = 40 };
    unsigned long long seed = 7;
    int moves = 0;

    (void)state;
    for (int trial = 0; trial < TRIALS; trial++) {
        struct track_rest r = {.looks = 0.0};
        double p_m[3], angle = 2.0 * M_PI * reference_random(&seed);
        throw_point(&seed, p_m);
        p_m[0] += 4.0;
        for (int k = 0; k < LOOKS; k++) {
            struct track_rest_look look;
            const double at_m[3] = {p_m[0] + 1.2 * PING_S * k * cos(angle),
                                    p_m[1] + 1.2 * PING_S * k * sin(angle), p_m[2]};
            drive(0, &look);
            look.array_m[0] += 2.0 * PING_S * k;
            hear(at_m, &look);
            look.along_m += 0.01 * dice_normal(&seed);
            look.range_m += 0.01 * dice_normal(&seed);
            add(&r, &look, SHARE, PING_S, FOREVER_S);
        }
        moves += track_rest_moves(&r, false, false);
    }
    assert_true(moves > 3 * TRIALS / 4);
}

/* At one place along the array, one behind the other within a metre: no rest explains
 * them, and no motion. */
static void what_is_heard_in_turn_does_not_move(void **state)
{
    enum { TRIALS = 300, LOOKS = 40 };
    unsigned long long seed = 8;
    int moves = 0, rests = 0;

    (void)state;
    for (int trial = 0; trial < TRIALS; trial++) {
        struct track_rest r = {.looks = 0.0};
        double away_m[4];
        for (int i = 0; i < 4; i++)
            away_m[i] = 2.0 + reference_random(&seed);
        for (int k = 0; k < LOOKS; k++) {
            struct track_rest_look look;
            const double at_m[3] = {20.0 + away_m[(int)(4.0 * reference_random(&seed))],
                                    -6.0, 0.5};
            drive(0, &look);
            look.array_m[0] += 2.0 * PING_S * k;
            hear(at_m, &look);
            add(&r, &look, SHARE, PING_S, FOREVER_S);
        }
        moves += track_rest_moves(&r, false, false);
        rests += track_rest_misfit(&r) < 1.0;
    }
    assert_true(rests < TRIALS / 2);
    assert_true(moves < TRIALS / 100);
}

/* A kilometre with it, and then it stands while the array goes on. */
static void a_long_way_makes_no_motion(void **state)
{
    struct track_rest r = {.looks = 0.0};
    struct track_rest_look look;
    double p_m[3] = {26.0, -6.0, 2.0};

    (void)state;
    drive(0, &look);
    for (int k = 0; k < 5000; k++) {
        look.array_m[0] += 0.2;
        p_m[0] += 0.2;
        hear(p_m, &look);
        add(&r, &look, SHARE, PING_S, 1.5);
    }
    for (int k = 0; k < 2000; k++) {
        look.array_m[0] += 0.002;
        hear(p_m, &look);
        add(&r, &look, SHARE, PING_S, 1.5);
        if (k > 1000)
            assert_false(track_rest_moves(&r, false, false));
    }
    assert_true(track_rest_misfit(&r) < 0.01);
}

/* Two minutes of looks, of which the newest second and a half count. */
static void a_long_time_makes_no_motion(void **state)
{
    const double p_m[3] = {23.0, -6.0, 2.0};
    struct track_rest r = {.looks = 0.0};
    struct track_rest_look look;

    (void)state;
    for (int k = 0; k < 5000; k++) {
        drive(0, &look);
        look.array_m[0] += sin(PING_S * k);
        hear(p_m, &look);
        add(&r, &look, SHARE, PING_S, 1.5);
        assert_true(track_rest_misfit(&r) < 0.01);
        assert_false(track_rest_moves(&r, false, false));
    }
    for (int k = 0; k < 100; k++) {
        const double at_m[3] = {p_m[0], p_m[1] + 1.2 * PING_S * k, p_m[2]};
        hear(at_m, &look);
        add(&r, &look, SHARE, PING_S, 1.5);
    }
    assert_true(track_rest_moves(&r, false, false));
}

static void what_is_old_fades(void **state)
{
    struct track_rest r = {.looks = 0.0}, fresh = {.looks = 0.0};
    struct track_rest_look look = {
        .axis = {0.0, 1.0}, .range_m = 3.0, .sigma_m = SIGMA_M};

    (void)state;
    for (int n = 0; n < 4; n++) {
        look.along_m = 0.5 * n;
        add(&r, &look, 1.0, STEP_S, FOREVER_S);
    }
    assert_true(track_rest_misfit(&r) > 1.0);
    for (int n = 0; n < 6; n++) {
        look.along_m = 7.0 + 0.02 * n;
        add(&r, &look, 1.0, STEP_S, n ? FOREVER_S : 0.01);
        add(&fresh, &look, 1.0, STEP_S, FOREVER_S);
    }
    assert_near(r.looks, 6.0, 1e-6);
    assert_near(track_rest_misfit(&r), track_rest_misfit(&fresh), 1e-4);
}

/* Six looks of an array at rest at what goes along it: with S = sum of (t - mean)^2 /
 * sigma^2, which is 1 / variance of the velocity, motion explains v^2 S^2 / (S + 1 /
 * 10^2) where it is known beforehand that v is 0 with a sigma of 10 m/s. */
static double gain_of(double v_m_s, double sigma_v_m_s)
{
    struct track_rest r = {.looks = 0.0};
    const double sum_s2 = 17.5 * STEP_S * STEP_S;
    struct track_rest_look look = {
        .axis = {0.0, 1.0}, .range_m = 3.0, .sigma_m = sigma_v_m_s * sqrt(sum_s2)};
    double gain, left;

    for (int n = 0; n < 6; n++) {
        look.along_m = v_m_s * STEP_S * (n - 5); /* and is at the array's middle last */
        add(&r, &look, 1.0, STEP_S, FOREVER_S);
    }
    track_rest_motion(&r, &gain, &left);
    assert_int_equal(track_rest_moves(&r, false, false), gain > 20.0);
    return gain;
}

/* Of six looks that go on evenly, of which four are off by so many sigma, each way, so
 * that neither a place nor a velocity takes it from them. */
static bool moves_with(double off, bool phases_agree)
{
    const int off_course[6] = {1, -1, 0, 0, -1, 1};
    struct track_rest r = {.looks = 0.0};
    struct track_rest_look look = {
        .axis = {0.0, 1.0}, .range_m = 3.0, .sigma_m = SIGMA_M};
    double step = sqrt(30.0 / 17.5), gain, left;

    for (int n = 0; n < 6; n++) {
        look.along_m = SIGMA_M * (step * (n - 5) + off * off_course[n]);
        add(&r, &look, 1.0, STEP_S, FOREVER_S);
    }
    track_rest_motion(&r, &gain, &left);
    assert_near(gain, 30.0, 0.3);
    assert_near(left, 4.0 * off * off, 0.1);
    return track_rest_moves(&r, false, phases_agree);
}

/* What motion leaves of a look counts 15 times, or 4. */
static void what_motion_leaves_counts_less_where_phases_agree(void **state)
{
    (void)state;
    assert_true(moves_with(1.7, false));
    assert_false(moves_with(1.8, false));
    assert_true(moves_with(3.3, true));
    assert_false(moves_with(3.4, true));
}

/* Both lie six sigma and more from rest. */
static void a_speed_that_nothing_has_is_not_taken_for_motion(void **state)
{
    (void)state;
    assert_near(gain_of(60.0, 10.0), 36.0 / 2.0, 0.1);
    assert_near(gain_of(6.0, 1.0), 36.0 / 1.01, 0.1);
    assert_near(gain_of(16.0, 10.0 / 3.0), 23.04 / (1.0 + 1.0 / 9.0), 0.1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(anything_at_rest_anywhere_is_believed_to_rest),
        cmocka_unit_test(noise_alone_is_no_motion),
        cmocka_unit_test(what_moves_leaves_squares),
        cmocka_unit_test(how_far_a_look_is_off_counts_both_errors),
        cmocka_unit_test(a_jump_is_told_from_a_walk),
        cmocka_unit_test(a_jump_is_told_where_neighbours_are_heard_in_turn),
        cmocka_unit_test(steady_motion_is_believed_once_it_explains_enough),
        cmocka_unit_test(noise_is_no_steady_motion),
        cmocka_unit_test(what_keeps_its_velocity_is_seen_to_move),
        cmocka_unit_test(what_walks_is_seen_to_move),
        cmocka_unit_test(what_is_heard_in_turn_does_not_move),
        cmocka_unit_test(a_long_way_makes_no_motion),
        cmocka_unit_test(a_long_time_makes_no_motion),
        cmocka_unit_test(what_is_old_fades),
        cmocka_unit_test(what_motion_leaves_counts_less_where_phases_agree),
        cmocka_unit_test(a_speed_that_nothing_has_is_not_taken_for_motion),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
