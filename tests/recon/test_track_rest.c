#include "tests/recon/near.h"

#include <string.h>

#include "recon/track_rest.h"
#include "tests/recon/dice.h"

#define SIGMA_M 0.05
#define STEP_S  0.2

/* A vehicle that speeds up to 2 m/s in a gentle bend; its array looks ahead. */
static void drive(int k, struct track_rest_look *look)
{
    double t = STEP_S * k, yaw = 0.3 * t, way = fmin(t * t, 2.0 * t - 1.0);

    *look = (struct track_rest_look){
        .array_m = {20.0 + way * cos(0.5 * yaw), -7.0 + way * sin(0.5 * yaw)},
        .axis = {-sin(yaw), cos(yaw)},
        .sigma_m = SIGMA_M};
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
            track_rest_add(&r, &look, 1.0, 1.0);
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
            track_rest_add(&r, &look, 1.0, 0.9);
            assert_true(track_rest_misfit(&r) < 1.0);
        }
    }
}

/* n looks at something that goes along a standing array at v leave the squares of its
 * distances from its mean place, v^2 dt^2 n (n^2 - 1) / 12; f = 2 n - 2. */
static void what_moves_is_told_by_the_squares_it_leaves(void **state)
{
    struct track_rest r = {.looks = 0.0};
    struct track_rest_look look = {
        .axis = {0.0, 1.0}, .range_m = 3.0, .sigma_m = SIGMA_M};
    const double x = 18.0, v = 0.4;

    (void)state;
    for (int n = 1; n <= 6; n++) {
        look.along_m = v * STEP_S * n;
        track_rest_add(&r, &look, 1.0, 1.0);
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
        track_rest_add(&r, &look, 1.0, 1.0);
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
        track_rest_add(&walks, &look, 0.12, 1.0);
        look.along_m = 1.0;
        assert_false(track_rest_jumps(&rests, &look));
        track_rest_add(&rests, &look, 0.12, 1.0);
    }
    assert_true(track_rest_misfit(&walks) > 1.0);
    look.along_m = 1.4;
    assert_true(track_rest_jumps(&rests, &look));
}

/* 0.3 m farther along and 0.8 m farther away, of which half counts: 0.5 m.  Then the
 * array has gone 0.6 m ahead, which may be why, and 0.3 m along, which is. */
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
        track_rest_add(&rests, &look, 1.0, 1.0);
    }
    double misfit = track_rest_misfit(&rests);
    assert_true(misfit > TRACK_REST_MISFIT && misfit < 5.0 * TRACK_REST_MISFIT);
    drive(8, &look);
    hear(near_m[0], &look);
    assert_false(track_rest_jumps(&rests, &look));
    hear(third_m, &look);
    assert_true(track_rest_jumps(&rests, &look));
}

static void a_step_is_what_the_arrays_own_way_does_not_account_for(void **state)
{
    struct track_rest r = {.looks = 0.0};
    struct track_rest_look look = {
        .axis = {0.0, 1.0}, .along_m = 1.0, .range_m = 3.0, .sigma_m = SIGMA_M};

    (void)state;
    assert_near(track_rest_step_m(&r, &look), 0.0, 1e-12);
    track_rest_add(&r, &look, 0.1, 1.0);
    look.along_m += 0.3;
    look.range_m += 0.8;
    assert_near(track_rest_step_m(&r, &look), 0.5, 1e-12);
    look.array_m[0] = 0.6;
    assert_near(track_rest_step_m(&r, &look), hypot(0.3, 0.1), 1e-12);
    look.array_m[1] = -0.3;
    assert_near(track_rest_step_m(&r, &look), 0.5 * (0.8 - hypot(0.6, 0.3)), 1e-12);
    track_rest_add(&r, &look, 0.1, 1.0);
    assert_near(track_rest_step_m(&r, &look), 0.0, 1e-12);
}

/* Over ground it is as far along, and its distance changes by no more than the array
 * goes. */
static void what_rests_makes_no_step(void **state)
{
    unsigned long long seed = 5;

    (void)state;
    for (int trial = 0; trial < 300; trial++) {
        struct track_rest_look was = {.axis = {0.6, 0.8}, .sigma_m = SIGMA_M}, is = was;
        struct track_rest r = {.looks = 0.0};
        double p_m[3];
        throw_point(&seed, p_m);
        is.array_m[0] = 0.1 * dice_normal(&seed);
        is.array_m[1] = 0.1 * dice_normal(&seed);
        hear(p_m, &was);
        hear(p_m, &is);
        track_rest_add(&r, &was, 1.0, 1.0);
        assert_near(track_rest_step_m(&r, &is), 0.0, 1e-9);
    }
}

static void what_is_old_fades(void **state)
{
    struct track_rest r = {.looks = 0.0}, fresh = {.looks = 0.0};
    struct track_rest_look look = {
        .axis = {0.0, 1.0}, .range_m = 3.0, .sigma_m = SIGMA_M};

    (void)state;
    for (int n = 0; n < 4; n++) {
        look.along_m = 0.5 * n;
        track_rest_add(&r, &look, 1.0, 1.0);
    }
    assert_true(track_rest_misfit(&r) > 1.0);
    for (int n = 0; n < 6; n++) {
        look.along_m = 7.0 + 0.02 * n;
        track_rest_add(&r, &look, 1.0, n ? 1.0 : 1e-9);
        track_rest_add(&fresh, &look, 1.0, 1.0);
    }
    assert_near(r.looks, 6.0, 1e-6);
    assert_near(track_rest_misfit(&r), track_rest_misfit(&fresh), 1e-4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(anything_at_rest_anywhere_is_believed_to_rest),
        cmocka_unit_test(noise_alone_is_no_motion),
        cmocka_unit_test(what_moves_is_told_by_the_squares_it_leaves),
        cmocka_unit_test(how_far_a_look_is_off_counts_both_errors),
        cmocka_unit_test(a_jump_is_told_from_a_walk),
        cmocka_unit_test(a_jump_is_told_where_neighbours_are_heard_in_turn),
        cmocka_unit_test(a_step_is_what_the_arrays_own_way_does_not_account_for),
        cmocka_unit_test(what_rests_makes_no_step),
        cmocka_unit_test(what_is_old_fades),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
