/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <string.h>

#include "recon/tracking/track_state.h"
#include "tests/recon/reference.h"

#define YAW_RAD 0.5 /* of the vehicle over ground */

static void set_speed(struct track *k, double speed_m_s)
{
    k->filter.state[2] = -speed_m_s * sin(YAW_RAD);
    k->filter.state[3] = speed_m_s * cos(YAW_RAD);
}

/* Heard at one place, across the vehicle's way to the left: over ground that is turned.
 */
static void start(struct track *k, double speed_m_s, double length_m)
{
    *k = (struct track){.extent_m = {0.2, length_m, 1.0}};
    set_speed(k, speed_m_s);
    k->filter.covariance[2][2] = k->filter.covariance[3][3] = 0.25;
}

/* Until its middle has come to where it belongs. */
static void settle(struct track *k)
{
    for (int n = 0; n < 100; n++)
        track_outline_update(k, YAW_RAD);
}

/* How far behind the place where it is heard its middle is. */
static double behind_m(const struct track *k)
{
    double u[2], in[2];

    track_outline_heading(&k->filter, u);
    track_outline_turn_in(u, k->outline.middle_m, in);
    assert_near(in[1], 0.0, 1e-12);
    assert_near(hypot(k->outline.heard_m[0], k->outline.heard_m[1]), 0.0, 1e-12);
    return -in[0];
}

static double told_m(const struct track *k, int axis)
{
    double size_m[2];

    track_outline_size(k, YAW_RAD, size_m);
    return size_m[axis];
}

static void what_comes_out_fast_is_behind_its_front(void **state)
{
    struct track k;

    (void)state;
    start(&k, 3.0, 0.3);
    settle(&k);
    assert_near(behind_m(&k), 0.5 * (1.0 - 0.3), 1e-9);
    assert_near(told_m(&k, 0), 0.2, 1e-9);
    assert_near(told_m(&k, 1), 1.0, 1e-9);
}

static void what_was_heard_whole_is_where_it_is_heard(void **state)
{
    struct track k;

    (void)state;
    start(&k, 3.0, 1.4);
    settle(&k);
    assert_near(behind_m(&k), 0.0, 1e-9);
    k.extent_m[1] = 0.3;
    settle(&k);
    assert_near(behind_m(&k), 0.0, 1e-9);
    assert_near(told_m(&k, 1), 0.3, 1e-9);
}

/* Once 0.9 m of it were heard at once. */
static void what_is_not_heard_is_what_never_was(void **state)
{
    struct track k;

    (void)state;
    start(&k, 3.0, 0.9);
    settle(&k);
    k.extent_m[1] = 0.3;
    settle(&k);
    assert_near(behind_m(&k), 0.05, 1e-9);
    assert_near(told_m(&k, 1), 0.4, 1e-9);
}

/* A walker, and what may be one. */
static void what_walks_is_where_it_is_heard(void **state)
{
    struct track k;

    (void)state;
    start(&k, 1.9, 0.3);
    settle(&k);
    assert_near(behind_m(&k), 0.0, 1e-12);
    assert_near(told_m(&k, 1), 0.3, 1e-12);
    start(&k, 2.4, 0.3); /* known to 0.5 m/s */
    settle(&k);
    assert_near(behind_m(&k), 0.0, 1e-12);
    start(&k, 2.6, 0.3);
    settle(&k);
    assert_near(behind_m(&k), 0.35, 1e-9);
}

/* A cyclist who rolls at about the speed of a walker, and then stops. */
static void what_slows_down_does_not_jump(void **state)
{
    double was_m = 0.35;
    struct track k;

    (void)state;
    start(&k, 3.0, 0.3);
    settle(&k);
    track_outline_predict(&k, 0.5);
    for (int n = 0; n < 20; n++) {
        set_speed(&k, n % 2 ? 2.1 : 1.8);
        track_outline_update(&k, YAW_RAD);
        assert_near(behind_m(&k), 0.35, 1e-9);
    }
    for (double speed_m_s = 1.8; speed_m_s > 0.1; speed_m_s -= 0.1) {
        set_speed(&k, speed_m_s);
        track_outline_predict(&k, 0.05); /* 2 m/s2 */
        track_outline_update(&k, YAW_RAD);
        assert_near(behind_m(&k), was_m, 0.12);
        was_m = behind_m(&k);
    }
    assert_near(was_m, 0.0, 0.01);
}

/* Parts along 3 m of the way to the left, from where they are heard on its right; another
 * one was seen too shortly. */
static void set_parts(struct track *k, double length_m)
{
    const double u[2] = {-sin(YAW_RAD), cos(YAW_RAD)}, left[2] = {-u[1], u[0]};

    start(k, 4.0, 0.3);
    k->body.n = 3;
    for (int i = 0; i < 3; i++) {
        const double along_m[3] = {0.0, length_m, 10.0};
        k->body.parts[i].looks = i < 2 ? 1.0 : 0.4;
        for (int a = 0; a < 2; a++)
            k->body.parts[i].offset_m[a] = along_m[i] * u[a];
    }
    memcpy(k->body.sight, left, sizeof left);
    settle(k);
}

static void in_its_frame(const struct track *k, const double ground[2], double out[2])
{
    double u[2];

    track_outline_heading(&k->filter, u);
    track_outline_turn_in(u, ground, out);
}

/* Cars are 1.7 m wide. */
static void the_far_side_of_a_car_is_where_no_sound_comes_from(void **state)
{
    struct track k;
    double in[2];

    (void)state;
    set_parts(&k, 3.0);
    in_its_frame(&k, k.outline.middle_m, in);
    assert_near(in[0], 1.5, 1e-9);
    assert_near(in[1], 0.5 * 1.7, 1e-9);
    in_its_frame(&k, k.outline.heard_m, in);
    assert_near(in[0], 1.5, 1e-9);
    assert_near(in[1], 0.0, 1e-9);
    assert_near(told_m(&k, 0), 1.7, 1e-9);
    assert_near(told_m(&k, 1), 3.0, 1e-9);
}

static void a_bicycle_has_no_far_side(void **state)
{
    struct track k;
    double in[2];

    (void)state;
    set_parts(&k, 1.85);
    in_its_frame(&k, k.outline.middle_m, in);
    assert_near(in[1], 0.09, 1e-9); /* but a front */
    set_parts(&k, 1.95);
    in_its_frame(&k, k.outline.middle_m, in);
    assert_near(in[1], 0.5 * 1.7, 1e-9);
}

/* Heard 0.8 m long, and once the spot has told the one from the other. */
static void spots_tell_a_car_from_a_bicycle_but_not_one_of_3_m(void **state)
{
    struct track k;

    (void)state;
    start(&k, 4.0, 0.8);
    settle(&k);
    assert_false(k.outline.car);
    k.passing.fits_car = 0.8; /* not enough */
    settle(&k);
    assert_false(k.outline.car);
    k.passing.fits_car = 1.2;
    settle(&k);
    assert_true(k.outline.car);
    k.passing.fits_car = 0.0; /* neither fits: it stays what it is */
    settle(&k);
    assert_true(k.outline.car);
    k.passing.fits_car = -1.0;
    settle(&k);
    assert_false(k.outline.car);
    start(&k, 4.0, 3.2);
    k.passing.fits_car = -1.0;
    settle(&k);
    assert_true(k.outline.car);
}

/* A smooth flank is heard as one thin place, longer than bicycles and their smear; later
 * only where it mirrors. */
static void a_flank_is_the_side_of_a_car(void **state)
{
    const double left[2] = {-cos(YAW_RAD), -sin(YAW_RAD)};
    double in[2], c[2][2] = {{0.0}};
    struct track k;

    (void)state;
    start(&k, 4.0, 2.4);
    k.extent_m[0] = 0.1;
    memcpy(k.body.sight, left, sizeof left);
    settle(&k);
    in_its_frame(&k, k.outline.middle_m, in);
    assert_near(in[0], 0.0, 1e-9);
    assert_near(in[1], 0.5 * (1.7 - 0.1), 1e-9);
    assert_near(told_m(&k, 0), 1.7, 1e-9);
    assert_near(told_m(&k, 1), 2.4, 1e-9);
    track_outline_uncertain(&k, c); /* cars are 4.2 m long */
    double turn = 0.5 / 4.0;        /* rad, of its velocity */
    double along_m2 = 1.8 * 1.8 / 6.0 + 0.05 * 2.4 * 0.05 * 2.4 +
                      turn * 0.5 * (1.7 - 0.1) * turn * 0.5 * (1.7 - 0.1);
    assert_near(c[0][0] + c[1][1], along_m2 + 0.05 * 1.7 * 0.05 * 1.7, 1e-12);
    k.extent_m[1] = 0.5;
    set_speed(&k, 0.5);
    settle(&k);
    in_its_frame(&k, k.outline.middle_m, in);
    assert_near(in[1], 0.5 * (1.7 - 0.1), 1e-9);
}

static double quadratic(const double (*c)[2], const double v[2])
{
    return v[0] * (c[0][0] * v[0] + c[0][1] * v[1]) +
           v[1] * (c[1][0] * v[0] + c[1][1] * v[1]);
}

/* The covariance holds those that are seen through, too; and of what is fast and may be a
 * bicycle or, as likely, the corner of a car, the middle of that: beyond it and, for its
 * front, which it is twice as often as its rear, behind. */
static void a_middle_is_behind_the_front_that_is_heard(void **state)
{
    const double sight[2] = {0.6, -0.8};
    double c[2][2] = {{0.0}}, across[2] = {0.8, 0.6}, own_m2 = 0.0, along_m2 = 0.0;
    struct track k;

    (void)state;
    start(&k, 1.2, 0.2);
    memcpy(k.body.sight, sight, sizeof sight);
    settle(&k);
    assert_near(k.outline.middle_m[0], 0.09 * 0.6, 1e-9);
    assert_near(k.outline.middle_m[1], -0.09 * 0.8, 1e-9);
    assert_near(hypot(k.outline.heard_m[0], k.outline.heard_m[1]), 0.0, 1e-12);
    track_outline_uncertain(&k, c);
    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 2; b++) {
            own_m2 += across[a] * c[a][b] * across[b];
            along_m2 += sight[a] * c[a][b] * sight[b];
        }
    assert_near(along_m2 - own_m2, 0.06 * 0.06, 1e-9); /* 0.2 m x 0.2 m */
    start(&k, 4.0, 1.5);
    settle(&k);
    double before_m2 = 0.0, after_m2 = 0.0;
    for (int seen = 0; seen < 2; seen++) {
        double u[2][2] = {{0.0}};
        memcpy(k.body.sight, seen ? sight : (double[2]){0.0, 0.0}, sizeof sight);
        track_outline_uncertain(&k, u);
        *(seen ? &after_m2 : &before_m2) = u[0][0] + u[1][1];
    }
    double beyond_m = 0.5 * 1.7 - 0.09, along_m = 0.5 * (4.2 - 1.5);
    double to_way = sight[0] * -sin(YAW_RAD) + sight[1] * cos(YAW_RAD);
    double both_m2 = 2.0 * beyond_m * along_m * to_way;
    assert_near(after_m2 - before_m2,
                0.06 * 0.06 + 0.5 * (beyond_m * beyond_m - both_m2 / 3.0), 1e-9);
}

/* Its corner: of a person no image is longer than 0.9 m. */
static void what_is_longer_than_a_person_may_be_a_car(void **state)
{
    const double sight[2] = {-cos(YAW_RAD), -sin(YAW_RAD)};
    double beyond_m = 0.5 * 1.7 - 0.09;

    (void)state;
    for (int longer = 0; longer < 2; longer++) {
        double c[2][2] = {{0.0}};
        struct track k;
        start(&k, 1.2, longer ? 1.0 : 0.8);
        memcpy(k.body.sight, sight, sizeof sight);
        settle(&k);
        track_outline_predict(&k, 1.0);
        assert_true(track_outline_may_walk(&k) == !longer);
        track_outline_uncertain(&k, c);
        double depth_m2 = quadratic(c, sight) - 0.05 * 0.2 * 0.05 * 0.2;
        assert_near(depth_m2,
                    longer ? 0.06 * 0.06 + 0.5 * beyond_m * beyond_m : 0.03 * 0.03, 1e-9);
    }
}

/* The length that is not heard is anywhere, as evenly as can be: its square over 12; and
 * a twentieth of what is heard. */
static void the_length_that_is_not_heard_is_uncertain(void **state)
{
    double c[2][2] = {{0.01, 0.0}, {0.0, 0.01}};
    struct track k;

    (void)state;
    start(&k, 3.0, 0.4);
    settle(&k);
    track_outline_uncertain(&k, c);
    double along_m2 = 0.01 + 0.6 * 0.6 / 12.0 + 0.05 * 0.4 * 0.05 * 0.4 +
                      0.5 * 1.6 * 1.6; /* or it is an end of a car of 4.2 m */
    double across_m2 = 0.01 + 0.05 * 0.2 * 0.05 * 0.2;
    double cs = cos(YAW_RAD), sn = sin(YAW_RAD);
    assert_near(c[0][0], along_m2 * sn * sn + across_m2 * cs * cs, 1e-12);
    assert_near(c[1][1], along_m2 * cs * cs + across_m2 * sn * sn, 1e-12);
    assert_near(c[0][1], (across_m2 - along_m2) * sn * cs, 1e-12);
    assert_near(c[1][0], c[0][1], 1e-15);
}

/* Half a second after 4 m/s, known to 0.5, a bicycle that brakes with 3 m/s2 goes 2. */
static void what_is_left_behind_is_a_glint_on_a_car(void **state)
{
    const double left[2] = {-cos(YAW_RAD), -sin(YAW_RAD)};
    double in[2], v[2][2] = {{0.0}}, c[2][2] = {{0.0}};
    struct track k;

    (void)state;
    start(&k, 4.0, 0.5);
    memcpy(k.body.sight, left, sizeof left);
    settle(&k);
    track_outline_uncertain_velocity(&k, v);
    assert_near(v[0][0] + v[1][1], 0.0, 1e-15);
    track_outline_predict(&k, 0.5);
    set_speed(&k, 2.05);
    settle(&k);
    in_its_frame(&k, k.outline.middle_m, in);
    assert_near(in[1], 0.09, 1e-9);
    set_speed(&k, 1.95);
    settle(&k);
    in_its_frame(&k, k.outline.middle_m, in); /* or the last that is heard of a bicycle */
    assert_near(in[1], 0.09, 1e-9);
    track_outline_uncertain(&k, c);
    double beyond_m2 = quadratic(c, left), own_m = 0.05 * 0.2;
    assert_near(beyond_m2, 0.76 * 0.76 + 0.06 * 0.06 + own_m * own_m, 1e-9);
    /* it goes 3.5 m/s at least, if that is a glint: as likely as not, along its way */
    track_outline_uncertain_velocity(&k, v);
    double more_m_s = 3.5 - 1.95;
    assert_near(v[0][0] + v[1][1], 0.5 * more_m_s * more_m_s, 1e-9);
    assert_near(v[0][0] * v[1][1] - v[0][1] * v[1][0], 0.0, 1e-9);
    set_speed(&k, 0.3);
    settle(&k);
    memset(c, 0, sizeof c);
    track_outline_uncertain(&k, c); /* where on the flank it is, is not known */
    assert_true(c[0][0] + c[1][1] > 3.7 * 3.7 / 6.0);
}

/* A car that crosses; its front corner is heard until its flank mirrors, there the glint
 * stays, then its rear.  What is told of where it is, from the first second on which it
 * is taken for a car, is as sure as it says: the mean of many squared errors is that many
 * variances. */
static void the_place_on_a_flank_is_as_sure_as_it_says(void **state)
{
    enum { RUNS = 4000 };
    const double left[2] = {-cos(YAW_RAD), -sin(YAW_RAD)}, heard_m = 0.5;
    const double u[2] = {-sin(YAW_RAD), cos(YAW_RAD)};
    unsigned long long seed = 7;
    double sum = 0.0;
    struct track k;

    (void)state;
    start(&k, 4.0, heard_m);
    memcpy(k.body.sight, left, sizeof left);
    settle(&k);
    track_outline_predict(&k, 0.5);
    set_speed(&k, 1.0);
    settle(&k);
    for (int run = 0; run < RUNS; run++) {
        double c[2][2] = {{0.0}}, half_m = 0.5 * (4.2 - heard_m), own_m = 0.05 * heard_m;
        double place = reference_random(&seed); /* an end, or between them */
        double off_m = reference_random(&seed) < 0.5 ? half_m * (place < 0.5 ? -1.0 : 1.0)
                                                     : half_m * (2.0 * place - 1.0);
        track_outline_uncertain(&k, c);
        sum += off_m * off_m / (quadratic(c, u) - own_m * own_m);
    }
    /* of e^2 over its mean: 1, with a variance of 0.6 / (2/3)^2 - 1 */
    assert_near(sum / RUNS, 1.0, 4.0 * sqrt(0.35 / RUNS));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_comes_out_fast_is_behind_its_front),
        cmocka_unit_test(what_was_heard_whole_is_where_it_is_heard),
        cmocka_unit_test(what_is_not_heard_is_what_never_was),
        cmocka_unit_test(what_walks_is_where_it_is_heard),
        cmocka_unit_test(what_slows_down_does_not_jump),
        cmocka_unit_test(the_far_side_of_a_car_is_where_no_sound_comes_from),
        cmocka_unit_test(a_bicycle_has_no_far_side),
        cmocka_unit_test(spots_tell_a_car_from_a_bicycle_but_not_one_of_3_m),
        cmocka_unit_test(a_flank_is_the_side_of_a_car),
        cmocka_unit_test(a_middle_is_behind_the_front_that_is_heard),
        cmocka_unit_test(what_is_longer_than_a_person_may_be_a_car),
        cmocka_unit_test(the_length_that_is_not_heard_is_uncertain),
        cmocka_unit_test(what_is_left_behind_is_a_glint_on_a_car),
        cmocka_unit_test(the_place_on_a_flank_is_as_sure_as_it_says),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
