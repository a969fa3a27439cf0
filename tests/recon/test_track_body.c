/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/tracking/track_state.h"
#include "tests/recon/track_rig.h"

static void see(struct track_rig *r, double x, double y)
{
    track_rig_see(r, x, y, 1.0);
}

static size_t count(const struct track_rig *r)
{
    size_t n = 0;

    for (size_t i = 0; i < r->n; i++)
        n += r->reports[i].state != TRACK_DELETED;
    return n;
}

/* The bright places of a car that goes to the left, along y, 4 m/s: front, the side
 * that is heard, and back, and between which places of its middle each is heard. */
static const struct panel {
    double ahead_m, side_m, from_m, to_m;
} panels[] = {
    {2.0, 0.8, -5.0, 1.0}, {2.0, -0.1, -5.0, -1.0}, {1.2, 0.8, -3.0, 2.0},
    {0.4, 0.8, -2.5, 3.0}, {-0.6, 0.8, -2.0, 3.5},  {-1.3, 0.8, -1.5, 4.0},
    {-2.0, 0.8, 0.0, 5.0}, {-2.0, -0.1, 1.5, 5.0},
};

static double middle_m(int k)
{
    return -5.0 + 4.0 * FRAME_S * k;
}

static void pass(struct track_rig *r, int k, double x)
{
    for (size_t i = 0; i < sizeof panels / sizeof *panels; i++) {
        const struct panel *p = &panels[i];
        if (middle_m(k) >= p->from_m && middle_m(k) <= p->to_m)
            see(r, x + p->side_m, middle_m(k) + p->ahead_m);
    }
}

static void panels_of_a_car_become_one_track_with_its_size(void **state)
{
    struct track_rig *r = *state;

    for (int k = 0; middle_m(k) < 4.8; k++) {
        pass(r, k, 3.0);
        track_rig_step(r);
        if (middle_m(k) < -1.0)
            continue;
        assert_int_equal(count(r), 1);
        assert_int_equal(r->reports[0].id, 1);
        if (middle_m(k) > 0.8 && middle_m(k) < 2.0) {
            assert_near(r->reports[0].extent_m[1], 4.0, 0.3);
            assert_near(r->reports[0].extent_m[0], 1.6, 0.15); /* 0.4 of the length */
            assert_near(r->reports[0].position_m[1], middle_m(k), 0.4);
        }
    }
}

/* What is heard of it moves backward over it by 4 m in 1.5 s. */
static void what_is_heard_later_of_a_car_does_not_hold_it_up(void **state)
{
    struct track_rig *r = *state;

    for (int k = 0; middle_m(k) < 4.8; k++) {
        pass(r, k, 3.0);
        track_rig_step(r);
        if (middle_m(k) < -1.0)
            continue;
        assert_near(r->reports[0].velocity_m_s[1], 4.0, 0.5);
        assert_near(r->reports[0].velocity_m_s[0], 0.0, 0.5);
    }
}

/* 4 m long: at least 1.6 m wide, from the side at x = 3.8 that is heard on, away from
 * where it is heard. */
static void the_side_of_a_car_that_is_not_heard_is_on_its_far_side(void **state)
{
    struct track_rig *r = *state;

    r->sight[0] = -1.0;
    for (int k = 0; middle_m(k) < 1.8; k++) {
        pass(r, k, 3.0);
        track_rig_step(r);
    }
    assert_int_equal(count(r), 1);
    assert_near(r->reports[0].position_m[0], 3.8 - 0.8, 0.1);
    assert_near(r->reports[0].extent_m[0], 1.6, 0.15);
}

/* As wide as a car is, and wider. */
static void corners_of_one_front_are_one_body(void **state)
{
    struct track_rig *r = *state;

    for (int k = 0; k < 40; k++) {
        see(r, 3.0, -4.0 + 4.0 * FRAME_S * k);
        see(r, 4.2, -4.0 + 4.0 * FRAME_S * k);
        track_rig_step(r);
    }
    assert_int_equal(count(r), 1);
}

static void two_that_drive_abreast_stay_two(void **state)
{
    struct track_rig *r = *state;

    for (int k = 0; k < 40; k++) {
        see(r, 3.0, -4.0 + 4.0 * FRAME_S * k);
        see(r, 4.6, -4.0 + 4.0 * FRAME_S * k);
        track_rig_step(r);
    }
    assert_int_equal(count(r), 2);
}

static void two_who_walk_side_by_side_stay_two(void **state)
{
    struct track_rig *r = *state;

    for (int k = 0; k < 60; k++) {
        see(r, 3.0, -2.0 + 1.3 * FRAME_S * k);
        see(r, 3.8, -2.0 + 1.3 * FRAME_S * k);
        track_rig_step(r);
    }
    assert_int_equal(count(r), 2);
}

static void two_that_drive_one_after_the_other_stay_two(void **state)
{
    struct track_rig *r = *state;

    for (int k = 0; k < 60; k++) {
        see(r, 3.0, -4.0 + 4.0 * FRAME_S * k);
        see(r, 3.0, -6.0 + 4.0 * FRAME_S * k);
        track_rig_step(r);
    }
    assert_int_equal(count(r), 2);
}

static void two_that_meet_stay_two(void **state)
{
    struct track_rig *r = *state;

    for (int k = 0; k < 60; k++) {
        see(r, 3.0, -5.0 + 4.0 * FRAME_S * k);
        see(r, 3.9, 5.0 - 3.0 * FRAME_S * k);
        track_rig_step(r);
    }
    assert_int_equal(count(r), 2);
    assert_near(fabs(r->reports[0].velocity_m_s[1] - r->reports[1].velocity_m_s[1]), 7.0,
                0.3);
}

/* Both were named: the one that is given up is told so, once. */
static void the_younger_of_two_that_are_one_is_told_as_deleted(void **state)
{
    struct track_rig *r = *state;
    size_t told = 0;

    for (int k = 0; k < 60; k++) {
        double gap_m = fmax(2.0 - 0.5 * FRAME_S * k, 1.0);
        see(r, 3.0, -4.0 + 3.0 * FRAME_S * k);
        see(r, 3.0, -4.0 + 3.0 * FRAME_S * k - gap_m);
        track_rig_step(r);
        for (size_t i = 0; i < r->n; i++)
            told += r->reports[i].state == TRACK_DELETED && r->reports[i].id == 2;
    }
    assert_int_equal(told, 1);
    assert_int_equal(count(r), 1);
    assert_int_equal(r->reports[0].id, 1);
}

/* Two fast ones side by side; their velocities, each known to 0.1 m/s, differ by dv. */
static bool become_one(double dv_m_s)
{
    struct tracker *t = calloc(1, sizeof *t);

    assert_non_null(t);
    t->n = 2;
    t->stamp_ns = FRAME_NS;
    for (size_t i = 0; i < t->n; i++) {
        struct track *k = &t->tracks[i];
        k->seen_ns = k->moves_ns = t->stamp_ns;
        k->outline.fast = true;
        k->filter.state[0] = 0.5 * (double)i;
        k->filter.state[2] = 5.0 + dv_m_s * (double)i;
        for (int a = 0; a < 4; a++)
            k->filter.covariance[a][a] = 0.01;
    }
    track_body_merge(t);
    bool merged = t->tracks[1].merged;
    assert_int_equal(t->tracks[0].body.n, merged ? 2 : 0);
    free(t);
    return merged;
}

/* Of two, apart_m from each other, the first of which has a name. */
static bool is_absorbed(double apart_m, enum track_state state)
{
    struct tracker *t = calloc(1, sizeof *t);

    assert_non_null(t);
    t->cfg.join_m = 0.5;
    t->n = 2;
    t->tracks[0].id = 7;
    t->tracks[0].state = state;
    t->tracks[1].filter.state[0] = 0.6 * apart_m;
    t->tracks[1].filter.state[1] = 0.8 * apart_m;
    track_absorb(t);
    bool merged = t->tracks[1].merged;
    assert_false(t->tracks[0].merged);
    free(t);
    return merged;
}

static void what_has_no_name_yet_goes_into_what_is_seen_within_reach(void **state)
{
    (void)state;
    assert_true(is_absorbed(0.48, TRACK_MEASURED));
    assert_false(is_absorbed(0.52, TRACK_MEASURED));
    assert_false(is_absorbed(0.48, TRACK_PREDICTED));
}

/* 99 of 100 that are the same differ less: by sqrt(-2 ln 0.01) = 3.03 of sigma, 0.141. */
static void what_differs_in_its_velocity_as_noise_does_is_one(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        assert_true(become_one(sign * 3.0 * 0.1414));
        assert_false(become_one(sign * 3.07 * 0.1414));
    }
}

#define TEST(name)                                                                       \
    cmocka_unit_test_setup_teardown(name, track_rig_setup, track_rig_teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(panels_of_a_car_become_one_track_with_its_size),
        TEST(what_is_heard_later_of_a_car_does_not_hold_it_up),
        TEST(the_side_of_a_car_that_is_not_heard_is_on_its_far_side),
        TEST(corners_of_one_front_are_one_body),
        TEST(two_that_drive_abreast_stay_two),
        TEST(two_who_walk_side_by_side_stay_two),
        TEST(two_that_drive_one_after_the_other_stay_two),
        TEST(two_that_meet_stay_two),
        TEST(what_has_no_name_yet_goes_into_what_is_seen_within_reach),
        TEST(what_differs_in_its_velocity_as_noise_does_is_one),
        TEST(the_younger_of_two_that_are_one_is_told_as_deleted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
