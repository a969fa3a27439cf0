/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/tracking/track_state.h"
#include "tests/recon/track_rig.h"

#define FLANK_M 3.0 /* in front of the array, which is at the origin */

static void hear(struct track_rig *r, double x, double y, double power)
{
    r->sight[0] = x / hypot(x, y);
    r->sight[1] = y / hypot(x, y);
    track_rig_see(r, x, y, power);
}

/* A smooth body from rear to front along y, its middle at y: it is heard where it is
 * nearest to the array. */
static void hear_nearest(struct track_rig *r, double y, double half_m)
{
    hear(r, FLANK_M, y + fmin(fmax(-y, -half_m), half_m), 1.0);
}

/* Of a box, seen along its flank, at a slant and across it: the corner that is nearer,
 * and the middle of the side that faces the array. */
static void the_spot_is_where_the_body_faces_the_array(void **state)
{
    const double u[2] = {0.0, 1.0};
    double ahead[2], aside[2], behind[2], slant[2];

    (void)state;
    for (int as = 0; as < TRACK_PASSING; as++) {
        double half_m = as == TRACK_AS_CAR ? 1.9 : 0.4;
        track_passing_spot(as, 4.0, u, (double[]){0.0, 1.0}, ahead);
        track_passing_spot(as, 4.0, u, (double[]){0.0, -1.0}, behind);
        track_passing_spot(as, 4.0, u, (double[]){1.0, 0.0}, aside);
        track_passing_spot(as, 4.0, u, (double[]){0.8, 0.6}, slant);
        assert_near(ahead[1], -half_m, 0.05 * half_m); /* it goes away: its rear */
        assert_near(behind[1], half_m, 0.05 * half_m);
        assert_near(ahead[0], 0.0, 1e-12);
        assert_near(aside[1], 0.0, 1e-12);
        assert_near(slant[1], -half_m, 0.1 * half_m);
        assert_true(aside[0] < 0.0 && slant[0] < 0.0); /* nearer than the middle */
    }
}

/* Somebody who runs is as short as one who walks. */
static void a_runner_is_heard_in_his_middle(void **state)
{
    double spot[2];

    (void)state;
    track_passing_spot(TRACK_AS_BICYCLE, 2.2, (double[]){0.0, 1.0}, (double[]){0.6, 0.8},
                       spot);
    assert_near(spot[1], 0.0, 1e-12);
}

/* 0.8 m of him; heard from front to rear, which in 2 s makes him 0.4 m/s slower. */
static void a_cyclist_is_told_as_fast_as_he_is_and_in_his_middle(void **state)
{
    struct track_rig *r = *state;
    double error2 = 0.0, dv2 = 0.0;
    int n = 0;

    for (double y = -4.0; y < 4.0; y += 4.0 * FRAME_S) {
        hear_nearest(r, y, 0.4);
        track_rig_step(r);
        if (y < -2.0)
            continue;
        assert_int_equal(r->n, 1);
        error2 += pow(r->reports[0].position_m[1] - y, 2.0);
        dv2 += pow(r->reports[0].velocity_m_s[1] - 4.0, 2.0);
        n++;
    }
    assert_true(sqrt(error2 / n) < 0.12);
    assert_true(sqrt(dv2 / n) < 0.25);
}

/* He runs at 2.8 m/s, and stops within a third of a second. */
static void who_stops_after_a_run_is_told_where_he_is(void **state)
{
    struct track_rig *r = *state;
    double y = -4.0, speed_m_s = 2.8;

    for (int k = 0; k < 60; k++) {
        hear_nearest(r, y, 0.1);
        track_rig_step(r);
        if (y > -1.0)
            speed_m_s = fmax(speed_m_s - 8.4 * FRAME_S, 0.0);
        y += speed_m_s * FRAME_S;
    }
    assert_int_equal(r->n, 1);
    assert_near(r->reports[0].position_m[1], y, 0.2);
    assert_near(r->reports[0].velocity_m_s[1], 0.0, 0.4);
}

/* Of a car both front corners are heard as it comes, by which it is wider than bicycles;
 * then its flank, and its rear as it goes. */
static void a_car_is_told_as_fast_as_it_is_and_in_its_middle(void **state)
{
    struct track_rig *r = *state;
    double error2 = 0.0, dv2 = 0.0;
    int n = 0;

    for (double y = -6.0; y < 5.0; y += 5.0 * FRAME_S) {
        hear_nearest(r, y, 1.9);
        if (y < -2.5)
            hear(r, FLANK_M + 0.9, y + 2.0, 0.3);
        track_rig_step(r);
        if (y < -3.0)
            continue;
        assert_int_equal(r->n, 1);
        error2 += pow(r->reports[0].position_m[1] - y, 2.0) +
                  pow(r->reports[0].position_m[0] - FLANK_M - 0.85, 2.0);
        dv2 += pow(r->reports[0].velocity_m_s[1] - 5.0, 2.0);
        n++;
    }
    assert_true(sqrt(error2 / n) < 0.8); /* 1.5 m and 2.7 m/s by what is heard */
    assert_true(sqrt(dv2 / n) < 0.5);
}

/* Of which one corner is heard, by the strongest of its spots, and never its width: that
 * runs along its flank as it goes by, and no bicycle has anything so far before its
 * middle and then so far behind it. */
static void a_car_is_known_by_the_spot_that_runs_along_it(void **state)
{
    struct track_rig *r = *state;

    for (double y = -6.0; y < 3.0; y += 5.0 * FRAME_S) {
        hear_nearest(r, y, 1.9);
        track_rig_step(r);
        if (y < 1.0)
            continue;
        assert_int_equal(r->n, 1);
        assert_true(r->reports[0].extent_m[0] > 1.5);
        assert_near(r->reports[0].position_m[0], FLANK_M + 0.85, 0.4);
        assert_near(r->reports[0].position_m[1], y, 1.2);
    }
}

/* What is heard of him is a third of a meter before his middle or behind it, in turn: as
 * one in two is of what is stated of a bicycle.  A car's is stated to wander farther, so
 * that all of it is nearer to that. */
static void a_cyclist_who_is_heard_as_one_is_no_car(void **state)
{
    struct track_rig *r = *state;
    int k = 0;

    for (double y = -5.0; y < 0.0; y += 3.0 * FRAME_S, k++) {
        hear(r, FLANK_M, y + (k / 4 % 2 ? 0.35 : -0.35), 1.0);
        track_rig_step(r);
        if (y < -4.0)
            continue;
        assert_int_equal(r->n, 1);
        assert_true(r->reports[0].extent_m[0] < 1.5);
        assert_near(r->reports[0].position_m[1], y, 0.6);
    }
}

/* As wide as a car, by what he carries; but nothing runs along him. */
static void a_cyclist_with_a_ladder_is_known_as_one_when_he_has_passed(void **state)
{
    struct track_rig *r = *state;
    bool wide = false;

    for (double y = -4.0; y < 4.0; y += 4.0 * FRAME_S) {
        hear_nearest(r, y, 0.4);
        if (y < 0.0)
            hear(r, FLANK_M + 0.8, y, 0.3);
        track_rig_step(r);
        wide |= r->n && y < -1.0 && r->reports[0].extent_m[0] > 1.5;
        if (y < 2.0)
            continue;
        assert_int_equal(r->n, 1);
        assert_true(r->reports[0].extent_m[0] < 1.5);
        assert_near(r->reports[0].position_m[1], y, 0.4);
        assert_near(r->reports[0].velocity_m_s[1], 4.0, 0.6);
    }
    assert_true(wide);
}

/* What is left of him in front of the edge is 13 dB fainter, and stays. */
static void who_rides_behind_an_edge_has_gone_on(void **state)
{
    struct track_rig *r = *state;
    double y = -3.0;

    for (; y < 1.0; y += 3.0 * FRAME_S) {
        hear_nearest(r, y, 0.1);
        track_rig_step(r);
    }
    for (int k = 0; k < 3; k++, y += 3.0 * FRAME_S)
        track_rig_step(r);
    for (int k = 0; k < 4; k++, y += 3.0 * FRAME_S) {
        hear(r, FLANK_M, 0.9, 0.05);
        track_rig_step(r);
        assert_int_equal(r->n, 1);
        assert_near(r->reports[0].position_m[1], y, 0.5);
        assert_near(r->reports[0].velocity_m_s[1], 3.0, 0.7);
    }
}

/* Of the four pings of an image, 0.05 s apart, the newer ones have it at first; after two
 * tenths of a second all have. */
static void what_comes_out_is_as_fast_from_the_beginning(void **state)
{
    struct track_rig *r = *state;

    r->scan.span_s = 3.0 * FRAME_S;
    track_rig_step(r); /* it is not there yet */
    for (int k = 0; k < 8; k++) {
        double seen_s = fmin(k * FRAME_S, r->scan.span_s);
        hear(r, FLANK_M, -3.0 + 4.0 * (k * FRAME_S - 0.5 * seen_s), 1.0);
        r->detections[0].lag_s = -0.5 * r->scan.span_s;
        track_rig_step(r);
    }
    assert_int_equal(r->n, 1);
    assert_near(r->reports[0].velocity_m_s[1], 4.0, 0.8);
}

static bool shows_up_to_2_m(const void *context, const double p_m[3])
{
    (void)context;
    return p_m[1] <= 2.0;
}

/* A cyclist's sidelobes are heard there for 0.6 s, as he goes on at 4 m/s. */
static void what_is_heard_at_the_border_of_the_image_has_gone_on(void **state)
{
    struct track_rig *r = *state;
    double y = -3.0;

    r->scan.shows = shows_up_to_2_m;
    for (; y < 4.4; y += 4.0 * FRAME_S) {
        hear(r, FLANK_M, fmin(y + fmin(fmax(-y, -0.4), 0.4), 1.9), 1.0);
        track_rig_step(r);
    }
    assert_int_equal(r->n, 1);
    assert_near(r->reports[0].position_m[1], y, 0.6);
    assert_near(r->reports[0].velocity_m_s[1], 4.0, 0.5);
}

/* But who walks may have stopped there. */
static void a_walker_who_is_heard_at_the_border_is_there(void **state)
{
    struct track_rig *r = *state;

    r->scan.shows = shows_up_to_2_m;
    for (double y = -1.0; y < 4.0; y += 1.2 * FRAME_S) {
        hear(r, FLANK_M, fmin(y, 1.9), 1.0);
        track_rig_step(r);
    }
    assert_int_equal(r->n, 1);
    assert_near(r->reports[0].position_m[1], 1.9, 0.3);
    assert_near(r->reports[0].velocity_m_s[1], 0.0, 0.3);
}

/* Beside a cyclist and far from him; half a second after it was heard last. */
static void what_began_beside_something_fast_is_rather_gone_than_hidden(void **state)
{
    struct track_rig *r = *state;
    double existence[2] = {0.0};

    for (double y = -4.0; y < 4.0; y += 4.0 * FRAME_S) {
        hear_nearest(r, y, 0.4);
        for (int far = 0; far < 2; far++)
            if (y > -2.0 && y < 2.0)
                hear(r, FLANK_M + 3.0 + 5.0 * far, 0.25 * y, 1.0);
        track_rig_step(r);
    }
    for (size_t i = 0; i < r->n; i++)
        if (r->reports[i].position_m[0] > FLANK_M + 2.0)
            existence[r->reports[i].position_m[0] > FLANK_M + 6.0] =
                r->reports[i].existence;
    assert_true(existence[1] > 0.9);
    assert_true(existence[0] < 0.75);
}

/* As it is told first, beside a cyclist and far from him: a car's rear goes as its front
 * does. */
static void what_begins_beside_something_fast_goes_like_that(void **state)
{
    struct track_rig *r = *state;
    double first_m_s[2] = {-1.0, -1.0};

    for (double y = -4.0; y < 1.0; y += 4.0 * FRAME_S) {
        hear_nearest(r, y, 0.4);
        for (int far = 0; far < 2 && y > 0.0; far++) {
            hear(r, FLANK_M + 3.0 + 5.0 * far, y, 1.0);
            r->detections[r->scan.n - 1].proven = 0.98;
        }
        track_rig_step(r);
        for (size_t i = 0; i < r->n; i++) {
            const struct track_report *one = &r->reports[i];
            double *first = &first_m_s[one->position_m[0] > FLANK_M + 6.0];
            if (one->position_m[0] > FLANK_M + 2.0 && *first < 0.0)
                *first = one->velocity_m_s[1];
        }
    }
    assert_near(first_m_s[0], 3.5, 0.3); /* as fast as what is heard of him */
    assert_near(first_m_s[1], 0.0, 0.3);
}

/* Its front corner, as it comes; in images with what stands a car has to be known. */
static void a_spot_of_a_car_is_looked_for(void **state)
{
    struct tracker *t = calloc(1, sizeof *t);
    struct track *k = calloc(1, sizeof *k);
    struct track_rig *r = *state;

    assert_true(t && k);
    hear(r, FLANK_M, -3.0, 1.0);
    track_place(t, &r->scan, 1.0);
    struct track_filter *f = &k->passing.as[TRACK_AS_CAR];
    f->state[0] = FLANK_M + 0.85;
    f->state[1] = -4.9;
    f->state[3] = k->filter.state[3] = 4.0;
    for (int a = 0; a < 4; a++)
        f->covariance[a][a] = 0.01;
    f->height_m = 0.5;
    f->height_m2 = 0.25;
    assert_true(isinf(track_passing_match(t, k, &r->scan, 0, 1.0).distance2));
    k->passing.begun = true;
    assert_true(track_passing_match(t, k, &r->scan, 0, 1.0).distance2 < 4.0);
    r->scan.standing_left = true;
    assert_true(isinf(track_passing_match(t, k, &r->scan, 0, 1.0).distance2));
    k->outline.car = true;
    assert_true(track_passing_match(t, k, &r->scan, 0, 1.0).distance2 < 4.0);
    free(k);
    free(t);
}

/* A front corner fits the car; but where what stands is in the image too, the spot may be
 * of that. */
static void what_stands_tells_of_no_car(void **state)
{
    struct tracker *t = calloc(1, sizeof *t);
    struct track_rig *r = *state;

    assert_non_null(t);
    t->cfg.gate2 = 13.8;
    hear(r, FLANK_M, -3.0, 1.0);
    track_place(t, &r->scan, 1.0);
    for (int standing = 0; standing < 2; standing++) {
        struct track k = {.passing.begun = true, .outline.fast = true};
        k.filter.state[3] = 4.0;
        memcpy(k.body.sight, r->sight, sizeof k.body.sight);
        for (int as = 0; as < TRACK_PASSING; as++) {
            k.passing.as[as] = (struct track_filter){
                .state = {FLANK_M + 0.85, -4.9, 0.0, 4.0},
                .height_m = 0.5,
                .height_m2 = 0.25,
            };
            for (int a = 0; a < 4; a++)
                k.passing.as[as].covariance[a][a] = 0.01;
        }
        r->scan.standing_left = standing;
        track_passing_update(t, &r->scan, &k, 1.0, 1.0);
        assert_int_equal(track_passing_fits_car(&k), !standing);
        assert_true(!standing || k.passing.fits_car == 0.0);
    }
    free(t);
}

#define TEST(name)                                                                       \
    cmocka_unit_test_setup_teardown(name, track_rig_setup, track_rig_teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_spot_is_where_the_body_faces_the_array),
        cmocka_unit_test(a_runner_is_heard_in_his_middle),
        TEST(a_car_is_known_by_the_spot_that_runs_along_it),
        TEST(a_cyclist_who_is_heard_as_one_is_no_car),
        TEST(a_cyclist_with_a_ladder_is_known_as_one_when_he_has_passed),
        TEST(who_rides_behind_an_edge_has_gone_on),
        TEST(what_comes_out_is_as_fast_from_the_beginning),
        TEST(what_is_heard_at_the_border_of_the_image_has_gone_on),
        TEST(a_walker_who_is_heard_at_the_border_is_there),
        TEST(what_began_beside_something_fast_is_rather_gone_than_hidden),
        TEST(what_begins_beside_something_fast_goes_like_that),
        TEST(a_spot_of_a_car_is_looked_for),
        TEST(what_stands_tells_of_no_car),
        TEST(a_cyclist_is_told_as_fast_as_he_is_and_in_his_middle),
        TEST(who_stops_after_a_run_is_told_where_he_is),
        TEST(a_car_is_told_as_fast_as_it_is_and_in_its_middle),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
