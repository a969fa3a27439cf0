/* SPDX-License-Identifier: MIT */
/* Two walls that meet, z = 2 and 0.6 x + 0.8 z = 2, by hand: the plane n . p = d takes p
 * to p - 2 (n . p - d) n.  Who stands at (-1.5, 0, 1) is imaged at (-1.5, 0, 3), 3.354 m
 * away, and at (1.02, 0, 4.36), 4.478 m away: across at 3.916 m. */
#include "tests/recon/near.h"

#include "recon/tracking/several_ways.h"

#define AHEAD  7 /* ids */
#define ASIDE  9
#define HALF_M 0.5
#define DB     20.0
#define GATE_M 6.0
#define NOBODY SEVERAL_WAYS_NOBODY

static const struct walls none = {.n = 0};
static double microphones_m[2][3] = {{-HALF_M, 0, 0}, {HALF_M, 0, 0}};
static const struct survey survey = {.microphones_m = microphones_m,
                                     .n_microphones = 2,
                                     .has_gate = true,
                                     .gate_m = {0, GATE_M}};
static const struct grid grid = {
    .origin_m = {-4, 0, 0.5}, .step_m = {0.5, 1, 0.5}, .n = {17, 1, 12}};
static const double far_from_aside_m[3] = {-1.5, 0, 1};
static const double across_ahead_m[3] = {-1.7513, 0, 3.5025};
static const double across_aside_m[3] = {0.892, 0, 3.813};

struct rig {
    struct walls walls;
    struct sight sight;
    struct several_ways known;
};

static void begin(struct rig *r, size_t n_walls, double gate_m)
{
    *r = (struct rig){
        .walls = {
            .n = n_walls,
            .list = {{AHEAD, {.normal = {0, 0, 1}, .distance_m = 2}, {0, gate_m}},
                     {ASIDE, {.normal = {0.6, 0, 0.8}, .distance_m = 2}, {0, gate_m}}}}};
    sight_init(&r->sight, &survey, &r->walls, &none, &grid);
    several_ways_init(&r->known, &r->sight, &survey);
}

static void begin_with(struct rig *r, const double at_m[3], uint32_t wall)
{
    begin(r, 2, GATE_M);
    assert_non_null(several_ways_know(&r->known, at_m, wall, DB));
}

static uint32_t shown(const struct rig *r, double x_m, double z_m, uint32_t wall)
{
    const double virtual_m[3] = {x_m, 0, z_m};

    return several_ways_show(&r->known, virtual_m, wall, DB);
}

static void what_nobody_known_makes_is_shown_by_the_wall_before_it(void **state)
{
    struct rig r;

    (void)state;
    begin(&r, 2, GATE_M);
    assert_int_equal(shown(&r, -1.5, 3, AHEAD), AHEAD);
    begin_with(&r, far_from_aside_m, AHEAD);
    assert_int_equal(shown(&r, 0, 3, AHEAD), AHEAD);
    assert_int_equal(shown(&r, 1.6, 2.2, ASIDE), ASIDE);
    assert_int_equal(shown(&r, 0, 3, 0), 0); /* no wall is before it */
}

static void one_wall_shows_everybody_once(void **state)
{
    struct rig r;

    (void)state;
    begin(&r, 1, GATE_M);
    assert_non_null(several_ways_know(&r.known, far_from_aside_m, AHEAD, DB));
    assert_int_equal(shown(&r, -1.5, 3, AHEAD), AHEAD);
    assert_int_equal(shown(&r, across_ahead_m[0], across_ahead_m[2], AHEAD), AHEAD);
}

static void both_walls_show_one_who_is_known_by_either(void **state)
{
    struct rig r;

    (void)state;
    for (int by = 0; by < 2; by++) {
        begin_with(&r, far_from_aside_m, by ? ASIDE : AHEAD);
        assert_int_equal(shown(&r, -1.4, 3, AHEAD), AHEAD);
        assert_int_equal(shown(&r, 1.1, 4.4, ASIDE), ASIDE);
    }
}

/* As it is seen past the edge at which they meet. */
static void an_image_is_of_the_wall_that_shows_one_who_is_known(void **state)
{
    struct rig r;

    (void)state;
    begin_with(&r, far_from_aside_m, AHEAD);
    assert_int_equal(shown(&r, -1.4, 3, ASIDE), AHEAD);
    assert_int_equal(shown(&r, 1.1, 4.4, AHEAD), ASIDE);
}

static void out_by_one_wall_and_back_by_another_is_nobody(void **state)
{
    struct rig r;

    (void)state;
    begin_with(&r, far_from_aside_m, AHEAD);
    assert_int_equal(shown(&r, across_ahead_m[0], across_ahead_m[2], AHEAD), NOBODY);
    assert_int_equal(shown(&r, across_aside_m[0], across_aside_m[2], ASIDE), NOBODY);
    /* 0.5 m (1/2 |-1.5 / 3.354 - 1.02 / 4.478|) = 0.17 m more, by where the speaker is */
    assert_int_equal(shown(&r, 1.12 * across_ahead_m[0], 1.12 * across_ahead_m[2], AHEAD),
                     NOBODY);
    assert_int_equal(shown(&r, 1.15 * across_ahead_m[0], 1.15 * across_ahead_m[2], AHEAD),
                     AHEAD);
}

/* It lies between both images in loudness. */
static void what_is_far_louder_is_no_echo_of_one_who_is_known(void **state)
{
    struct rig r;

    (void)state;
    begin_with(&r, far_from_aside_m, AHEAD);
    assert_int_equal(several_ways_show(&r.known, across_ahead_m, AHEAD, DB + 5.0),
                     NOBODY);
    assert_int_equal(several_ways_show(&r.known, across_ahead_m, AHEAD, DB + 7.0), AHEAD);
}

/* (0, 0, 1) is imaged 3 and 3.256 m away: its echoes across run into both images, and
 * what is there tells by the wall that it is known by only. */
static void as_far_by_both_walls_one_of_them_tells(void **state)
{
    const double middle_m[3] = {0, 0, 1};
    struct rig r;

    (void)state;
    begin_with(&r, middle_m, AHEAD);
    assert_int_equal(shown(&r, 0, 3, AHEAD), AHEAD);
    assert_int_equal(shown(&r, 1.44, 2.92, ASIDE), NOBODY);
    begin_with(&r, middle_m, ASIDE);
    assert_int_equal(shown(&r, 0, 3, AHEAD), NOBODY);
    assert_int_equal(shown(&r, 1.44, 2.92, ASIDE), ASIDE);
}

/* Mirrored at z = 2, the echo across is at (-1.7513, 0, 0.4975). */
static void an_echo_across_is_nobody_to_know(void **state)
{
    const double ghost_m[3] = {-1.7513, 0, 0.4975}, another_m[3] = {0.5, 0, 0.5};
    struct rig r;

    (void)state;
    begin_with(&r, far_from_aside_m, AHEAD);
    assert_null(several_ways_know(&r.known, ghost_m, AHEAD, DB));
    assert_int_equal(r.known.n, 1);
    assert_non_null(several_ways_know(&r.known, another_m, AHEAD, DB));
    assert_null(several_ways_know(&r.known, another_m, AHEAD + 1, DB)); /* no wall */
    assert_int_equal(r.known.n, 2);
}

/* All is heard to 0.6 m beyond the gate, 4.2 m: 0.28 m before the image aside. */
static void where_the_image_ends_nobody_is_whom_it_has_lost(void **state)
{
    struct survey nearer = survey;
    const double end_m = 4.2 / 4.4777;
    struct rig r;

    (void)state;
    nearer.gate_m[1] = 3.6;
    begin(&r, 2, 3.6);
    several_ways_init(&r.known, &r.sight, &nearer);
    assert_non_null(several_ways_know(&r.known, far_from_aside_m, AHEAD, DB));
    assert_int_equal(shown(&r, end_m * 1.02, end_m * 4.36, ASIDE), NOBODY);
    assert_int_equal(shown(&r, -1.5, 3, AHEAD), AHEAD);
}

/* What one wall is looked at for the other is not: it is nobody known. */
static void a_wall_shows_what_is_in_its_gate(void **state)
{
    struct rig r;

    (void)state;
    begin(&r, 2, GATE_M);
    r.walls.list[1].gate_m[1] = 4.0;
    assert_non_null(several_ways_know(&r.known, far_from_aside_m, AHEAD, DB));
    assert_int_equal(shown(&r, 1.02, 4.36, AHEAD), AHEAD);
    assert_int_equal(shown(&r, across_ahead_m[0], across_ahead_m[2], AHEAD), AHEAD);
    begin(&r, 2, GATE_M);
    r.walls.list[1].gate_m[0] = 4.6;
    assert_non_null(several_ways_know(&r.known, far_from_aside_m, AHEAD, DB));
    assert_int_equal(shown(&r, across_ahead_m[0], across_ahead_m[2], AHEAD), AHEAD);
}

static void all_images_of_one_who_is_known(void **state)
{
    const struct track_mirror own = {.id = AHEAD, .normal = {0, 0, 1}, .distance_m = 2},
                              lost = {.id = 3, .normal = {0, 0, 1}, .distance_m = 2.5};
    double at_m[8][3];
    struct rig r;

    (void)state;
    begin(&r, 2, GATE_M);
    assert_int_equal(several_ways_images(&r.known, far_from_aside_m, &own, at_m, 8), 4);
    const double expected[4][2] = {{-1.5, 3},
                                   {across_ahead_m[0], across_ahead_m[2]},
                                   {across_aside_m[0], across_aside_m[2]},
                                   {1.02, 4.36}};
    for (int i = 0; i < 4; i++) {
        assert_near(at_m[i][0], expected[i][0], 1e-3);
        assert_near(at_m[i][2], expected[i][1], 1e-3);
    }
    assert_int_equal(several_ways_images(&r.known, far_from_aside_m, &own, at_m, 2), 2);
    assert_int_equal(several_ways_images(&r.known, far_from_aside_m, &own, at_m, 0), 0);
    begin(&r, 0, GATE_M); /* by a wall that is known no more */
    assert_int_equal(several_ways_images(&r.known, far_from_aside_m, &lost, at_m, 8), 1);
    assert_near(at_m[0][2], 4.0, 1e-9);
}

/* Who stands behind a wall, or whose way to it passes its end or goes through the other
 * by more than the half metre that an array looks past an edge. */
static void what_a_wall_does_not_show_makes_no_echo_across(void **state)
{
    const double past_m[3] = {1.6, 0, 0.5}; /* ahead at (1.6, 0, 3.5), by (0.91, 0, 2) */
    const double at_m[3] = {1.4, 0, 0.95}; /* ahead at (1.4, 0, 3.05), by (0.918, 0, 2) */
    double images_m[8][3];
    const struct track_mirror own = {
        .id = ASIDE, .normal = {0.6, 0, 0.8}, .distance_m = 2};
    struct rig r;

    (void)state;
    begin(&r, 2, GATE_M);
    assert_int_equal(several_ways_images(&r.known, past_m, &own, images_m, 8), 4);
    r.walls.list[0].plane.ends_m[0] = -0.3; /* along -x: x from -2 to 0.3 */
    r.walls.list[0].plane.ends_m[1] = 2.0;
    assert_int_equal(several_ways_images(&r.known, past_m, &own, images_m, 8), 1);
    begin(&r, 2, GATE_M);
    r.walls.list[1].plane.distance_m = 1.70; /* that is 0.45 m behind it, */
    assert_int_equal(several_ways_images(&r.known, at_m, &own, images_m, 8), 4);
    r.walls.list[1].plane.distance_m = 1.62; /* and now 0.53 m */
    assert_int_equal(several_ways_images(&r.known, at_m, &own, images_m, 8), 1);
}

/* Who stands at (-1.5, 0, 1) is 1.803 m away: straight there and back by the wall ahead,
 * 2.578 m toward his image. */
static const double straight_ahead_m[3] = {-1.1531, 0, 2.3063};

static void straight_there_and_back_by_a_wall_is_nobody(void **state)
{
    struct rig r;

    (void)state;
    begin(&r, 1, GATE_M);
    assert_non_null(several_ways_know(&r.known, far_from_aside_m, AHEAD, DB));
    assert_int_equal(shown(&r, straight_ahead_m[0], straight_ahead_m[2], AHEAD), NOBODY);
    /* 0.35 m, and 0.5 m (1/2 |-1.5 / 1.803 + 1.5 / 3.354|) = 0.096 m by the speaker */
    assert_int_equal(
        shown(&r, 0.83 * straight_ahead_m[0], 0.83 * straight_ahead_m[2], AHEAD), NOBODY);
    assert_int_equal(
        shown(&r, 0.82 * straight_ahead_m[0], 0.82 * straight_ahead_m[2], AHEAD), AHEAD);
}

/* By 20 lg (3.354 / 1.803) = 5.4 dB for the shorter way, and by 12. */
static void an_echo_that_goes_out_straight_may_be_louder(void **state)
{
    struct rig r;

    (void)state;
    begin(&r, 1, GATE_M);
    assert_non_null(several_ways_know(&r.known, far_from_aside_m, AHEAD, DB));
    assert_int_equal(several_ways_show(&r.known, straight_ahead_m, AHEAD, DB + 17.3),
                     NOBODY);
    assert_int_equal(several_ways_show(&r.known, straight_ahead_m, AHEAD, DB + 17.5),
                     AHEAD);
}

static void who_is_known_stays_so_where_another_one_makes_an_echo(void **state)
{
    const double there_m[3] = {straight_ahead_m[0], 0, 4 - straight_ahead_m[2]};
    struct rig r;

    (void)state;
    begin(&r, 1, GATE_M);
    assert_non_null(several_ways_know(&r.known, far_from_aside_m, AHEAD, DB));
    assert_non_null(several_ways_know(&r.known, there_m, AHEAD, DB));
    assert_int_equal(shown(&r, straight_ahead_m[0], straight_ahead_m[2], AHEAD), AHEAD);
}

static void by_such_an_echo_he_is_seen(void **state)
{
    const double another_m[3] = {1.5, 0, 0.8};
    struct rig r;

    (void)state;
    begin(&r, 1, GATE_M);
    struct several_ways_body *his =
        several_ways_know(&r.known, far_from_aside_m, AHEAD, DB);
    assert_non_null(his);
    his->track = 5;
    assert_non_null(several_ways_know(&r.known, another_m, AHEAD, DB));
    double far_m = 0.0;
    const struct several_ways_body *who =
        several_ways_see(&r.known, straight_ahead_m, DB, &far_m);
    assert_non_null(who);
    assert_int_equal(who->track, 5);
    assert_near(far_m, 1.8028, 1e-3);
    assert_null(several_ways_see(&r.known, across_ahead_m, DB, &far_m));
    begin(&r, 1, 3.0); /* less far than his image is */
    assert_non_null(several_ways_know(&r.known, far_from_aside_m, AHEAD, DB));
    assert_null(several_ways_see(&r.known, straight_ahead_m, DB, &far_m));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_nobody_known_makes_is_shown_by_the_wall_before_it),
        cmocka_unit_test(one_wall_shows_everybody_once),
        cmocka_unit_test(both_walls_show_one_who_is_known_by_either),
        cmocka_unit_test(an_image_is_of_the_wall_that_shows_one_who_is_known),
        cmocka_unit_test(out_by_one_wall_and_back_by_another_is_nobody),
        cmocka_unit_test(what_is_far_louder_is_no_echo_of_one_who_is_known),
        cmocka_unit_test(as_far_by_both_walls_one_of_them_tells),
        cmocka_unit_test(an_echo_across_is_nobody_to_know),
        cmocka_unit_test(where_the_image_ends_nobody_is_whom_it_has_lost),
        cmocka_unit_test(a_wall_shows_what_is_in_its_gate),
        cmocka_unit_test(all_images_of_one_who_is_known),
        cmocka_unit_test(what_a_wall_does_not_show_makes_no_echo_across),
        cmocka_unit_test(straight_there_and_back_by_a_wall_is_nobody),
        cmocka_unit_test(an_echo_that_goes_out_straight_may_be_louder),
        cmocka_unit_test(who_is_known_stays_so_where_another_one_makes_an_echo),
        cmocka_unit_test(by_such_an_echo_he_is_seen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
