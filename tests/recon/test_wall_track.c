/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include "recon/walls/wall_track.h"

static const struct wall_motion still = {
    .dt_s = 0.5, .r = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, .known = true};

static struct wall at(double azimuth, double distance_m)
{
    return (struct wall){.normal = {sin(azimuth), 0.0, cos(azimuth)},
                         .distance_m = distance_m,
                         .covariance = {1e-4, 0.0, 0.0, 1e-3, 0.0, 1e-4}};
}

static void a_wall_seen_twice_is_sure_and_keeps_its_id(void **state)
{
    (void)state;
    struct wall_track_config cfg;
    struct wall_tracks t = {.n = 0};
    wall_track_default(&cfg);
    for (int k = 0; k < 10; k++) {
        struct wall w = at(0.1 + 0.003 * (k % 2), 1.5 + 0.003 * (k % 3));
        wall_tracks_predict(&t, &cfg, &still);
        wall_tracks_update(&t, &cfg, &w, 1);
        assert_int_equal(t.n, 1);
        assert_int_equal(t.list[0].id, 1);
        assert_int_equal(t.list[0].confirmed, k >= 1);
    }
    assert_near(t.list[0].wall.distance_m, 1.503, 0.004);
    assert_true(t.list[0].existence > 0.99);
}

/* The errors of estimates are not independent: ten of them are as good as one. */
static void estimates_do_not_become_surer_than_one(void **state)
{
    (void)state;
    struct wall_track_config cfg;
    struct wall_tracks t = {.n = 0};
    const struct wall w = at(0.0, 2.0);
    wall_track_default(&cfg);
    for (int k = 0; k < 20; k++) {
        wall_tracks_predict(&t, &cfg, &still);
        wall_tracks_update(&t, &cfg, &w, 1);
    }
    assert_true(t.list[0].wall.covariance[0] > 0.95e-4);
    assert_true(t.list[0].wall.covariance[3] > 0.95e-3);
    assert_true(t.list[0].wall.covariance[5] > 0.95e-4);
    assert_true(t.list[0].wall.covariance[5] < 1.2e-4);
}

/* For covariances that are multiples of each other the intersection is in closed form: of
 * c and 3 c the first weighs 3/4, and 1 / (3/4 + 1/12) = 1.2. */
static void an_intersection_lies_between_its_parts(void **state)
{
    (void)state;
    const double a[6] = {1.0, 0.2, 0.1, 2.0, -0.3, 1.5};
    double b[6], out[6], gain[3][3];
    for (int q = 0; q < 6; q++)
        b[q] = 3.0 * a[q];
    wall_intersect(a, b, out, gain);
    for (int q = 0; q < 6; q++)
        assert_near(out[q], 1.2 * a[q], 1e-6);
    for (int q = 0; q < 9; q++)
        assert_near(gain[q / 3][q % 3], q / 3 == q % 3 ? 0.1 : 0.0, 1e-6);
}

static void a_wall_comes_nearer_when_the_array_does(void **state)
{
    (void)state;
    struct wall_track_config cfg;
    struct wall_tracks t = {.n = 0};
    struct wall_motion ahead = still;
    struct wall w = at(0.0, 2.0);
    wall_track_default(&cfg);
    wall_tracks_update(&t, &cfg, &w, 1);
    ahead.t[2] = -0.2; /* points come nearer by 0.2 m */
    ahead.way_m = 0.2;
    for (int k = 0; k < 3; k++)
        wall_tracks_predict(&t, &cfg, &ahead);
    assert_near(t.list[0].wall.distance_m, 1.4, 1e-12);
    assert_near(t.list[0].unseen_s, 1.5, 1e-12);
    assert_true(t.list[0].wall.covariance[5] > 1e-4 + 3 * 0.006 * 0.006);
}

static void what_is_not_seen_any_more_is_lost_and_counted(void **state)
{
    (void)state;
    struct wall_track_config cfg;
    struct wall_tracks t = {.n = 0};
    const struct wall w = at(0.0, 2.0);
    int rounds = 0;
    wall_track_default(&cfg);
    wall_tracks_update(&t, &cfg, &w, 1);
    wall_tracks_update(&t, &cfg, &w, 1);
    for (; t.n && rounds < 100; rounds++) {
        double before = t.list[0].existence;
        wall_tracks_predict(&t, &cfg, &still);
        wall_tracks_update(&t, &cfg, NULL, 0);
        assert_true(!t.n || t.list[0].existence < before);
    }
    assert_in_range(rounds, 2, 7);
    assert_int_equal(t.n_lost, 1);
    assert_int_equal(t.lost_id, 1);
    wall_tracks_update(&t, &cfg, &w, 1);
    assert_int_equal(t.list[0].id, 2); /* an id is not used again */
}

static void without_ego_motion_a_wall_is_soon_unknown(void **state)
{
    (void)state;
    struct wall_track_config cfg;
    struct wall_tracks t = {.n = 0};
    struct wall_motion blind = still;
    const struct wall w = at(0.0, 2.0);
    blind.known = false;
    wall_track_default(&cfg);
    wall_tracks_put(&t, 9, &w);
    wall_tracks_predict(&t, &cfg, &blind);
    assert_int_equal(t.n, 0);
    assert_int_equal(t.lost_id, 9);
}

static void two_walls_stay_apart_and_one_that_jumped_is_taken_anew(void **state)
{
    (void)state;
    struct wall_track_config cfg;
    struct wall_tracks t = {.n = 0};
    const struct wall both[2] = {at(0.0, 2.0), at(1.0, 2.0)};
    const struct wall turned[2] = {at(1.0, 2.0), at(0.0, 2.0)};
    struct wall jumped = at(0.0, 2.2);
    wall_track_default(&cfg);
    wall_tracks_update(&t, &cfg, both, 2);
    wall_tracks_update(&t, &cfg, turned, 2);
    assert_int_equal(t.n, 2);
    assert_near(t.list[0].wall.normal[2], 1.0, 1e-9);
    wall_tracks_update(&t, &cfg, &jumped, 1);
    assert_int_equal(t.n, 2);
    assert_near(t.list[0].wall.distance_m, 2.2, 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_wall_seen_twice_is_sure_and_keeps_its_id),
        cmocka_unit_test(estimates_do_not_become_surer_than_one),
        cmocka_unit_test(an_intersection_lies_between_its_parts),
        cmocka_unit_test(a_wall_comes_nearer_when_the_array_does),
        cmocka_unit_test(what_is_not_seen_any_more_is_lost_and_counted),
        cmocka_unit_test(without_ego_motion_a_wall_is_soon_unknown),
        cmocka_unit_test(two_walls_stay_apart_and_one_that_jumped_is_taken_anew),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
