/* SPDX-License-Identifier: MIT */
/* What becomes of a track when mirrors change.  By hand: the plane n . p = d takes p to
 * p - 2 (n . p - d) n. */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/tracking/track_state.h"

#define HALF_ROOT 0.70710678118654752

struct probe {
    size_t answer;
    double *asked_m;
};

struct rig {
    struct tracker t;
    struct track_scan scan;
    struct probe probe;
    double asked_m[3];
    struct track_report reports[TRACKS_MAX];
};

static const double spread[4][4] = {{1.0, 0.1, 0.2, 0.3},
                                    {0.1, 4.0, 0.4, 0.5},
                                    {0.2, 0.4, 9.0, 0.6},
                                    {0.3, 0.5, 0.6, 16.0}};

static size_t stands(const void *context, const double imaged_m[3])
{
    const struct probe *p = context;

    memcpy(p->asked_m, imaged_m, 3 * sizeof *imaged_m);
    return p->answer;
}

static struct track_mirror mirror(uint32_t id, double nx, double ny, double distance_m)
{
    return (struct track_mirror){
        .id = id, .normal = {nx, ny, 0.0}, .distance_m = distance_m};
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r)
        return -1;
    track_config_default(&r->t.cfg); /* wanders by 5 cm, joins within 0.5 m */
    r->probe.asked_m = r->asked_m;
    r->scan.context = &r->probe;
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    free(*state);
    return 0;
}

static struct track *start(struct rig *r, struct track_mirror by, double x_m, double y_m)
{
    struct track *k = &r->t.tracks[r->t.n++];

    *k = (struct track){.mirror = by, .placed = by.id != 0, .extent_m = {0.2, 0.6, 1.0}};
    k->filter.state[0] = x_m;
    k->filter.state[1] = y_m;
    k->filter.state[2] = 1.2;
    k->filter.state[3] = -0.4;
    k->filter.height_m = 0.5;
    memcpy(k->filter.covariance, spread, sizeof spread);
    k->steady = k->filter;
    return k;
}

static void know(struct rig *r, struct track_mirror m)
{
    r->scan.mirrors[r->scan.n_mirrors++] = m;
}

static void expect_state(const struct track_filter *f, double x, double y, double vx,
                         double vy)
{
    const double expected[4] = {x, y, vx, vy};

    for (int i = 0; i < 4; i++)
        assert_near(f->state[i], expected[i], 1e-9);
    assert_near(f->height_m, 0.5, 1e-9);
}

/* That of `spread` with its axes in another order and turned over; more on x. */
static void expect_spread(const struct track *k, const int order[4], const int sign[4],
                          double more_m2)
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            double c = sign[i] * sign[j] * spread[order[i]][order[j]] +
                       (i == 0 && j == 0 ? more_m2 : 0.0);
            assert_near(k->filter.covariance[i][j], c, 1e-9);
            assert_near(k->steady.covariance[i][j], c, 1e-9);
        }
}

static const int straight[4] = {0, 1, 2, 3}, swapped[4] = {1, 0, 3, 2};
static const int as_it_was[4] = {1, 1, 1, 1}, ahead_behind[4] = {-1, 1, -1, 1};

/* -- points -----------------------------------------------------------------------------
 */

static void a_point_goes_as_far_behind_a_plane_as_it_was_before_it(void **state)
{
    const struct track_mirror slanted = mirror(1, 0.6, 0.8, 2.0), none = {.id = 0};
    const struct track_mirror leaning = {
        .id = 1, .normal = {0.0, 0.6, 0.8}, .distance_m = 1.0};
    double p[3] = {1.0, 2.0, 3.0}, q[3] = {1.0, 1.0, 1.0};

    (void)state;
    track_mirror_point(&slanted, p, p); /* 0.2 m behind it; in place */
    assert_near(p[0], 0.76, 1e-12);
    assert_near(p[1], 1.68, 1e-12);
    assert_near(p[2], 3.0, 1e-12);
    track_mirror_point(&slanted, p, p);
    assert_near(p[0], 1.0, 1e-12);
    assert_near(p[1], 2.0, 1e-12);
    track_mirror_point(&leaning, q, q); /* 0.4 m behind it */
    assert_near(q[0], 1.0, 1e-12);
    assert_near(q[1], 0.52, 1e-12);
    assert_near(q[2], 0.36, 1e-12);
    track_mirror_point(&none, p, q);
    assert_near(q[0], 1.0, 1e-12);
}

static void the_middle_of_a_thing_is_five_centimetres_from_a_wall(void **state)
{
    const struct track_mirror m = mirror(7, 1.0, 0.0, 5.0), none = {.id = 0};
    const struct track_mirror leaning = {
        .id = 1, .normal = {0.0, 0.6, 0.8}, .distance_m = 1.0};

    (void)state;
    assert_near(track_mirror_beyond_m(&m, (double[3]){4.9, 3.0, 1.0}), -0.05, 1e-12);
    assert_near(track_mirror_beyond_m(&m, (double[3]){5.0, 3.0, 1.0}), 0.05, 1e-12);
    assert_near(track_mirror_beyond_m(&leaning, (double[3]){9.0, 1.0, 1.0}), 0.45, 1e-12);
    assert_true(track_mirror_beyond_m(&none, (double[3]){9.0, 0.0, 0.0}) == -INFINITY);
}

/* -- mirrors that go and come -----------------------------------------------------------
 */

/* The plane x = 5. */
static void what_loses_its_mirror_lives_on_where_it_is_imaged(void **state)
{
    struct rig *r = *state;
    struct track *k = start(r, mirror(7, 1.0, 0.0, 5.0), 3.0, 1.0);
    static const double heard[2] = {0.1, 0.2}, part[2] = {0.5, -0.6},
                        sight[2] = {0.6, 0.8};

    memcpy(k->outline.heard_m, heard, sizeof heard);
    memcpy(k->outline.middle_m, heard, sizeof heard);
    k->outline.low_m[1] = -0.2;
    k->outline.high_m[1] = 0.5;
    k->body.n = 1;
    memcpy(k->body.parts[0].offset_m, part, sizeof part);
    memcpy(k->body.sight, sight, sizeof sight);
    k->id = 9;
    k->waited = 0.7;
    track_mirror_follow(&r->t, &r->scan);
    expect_state(&k->filter, 7.0, 1.0, -1.2, -0.4);
    expect_state(&k->steady, 7.0, 1.0, -1.2, -0.4);
    expect_spread(k, straight, ahead_behind, 0.0);
    assert_near(k->outline.heard_m[0], -0.1, 1e-12);
    assert_near(k->outline.heard_m[1], 0.2, 1e-12);
    assert_near(k->outline.middle_m[0], -0.1, 1e-12);
    assert_near(k->outline.low_m[1], -0.5, 1e-12); /* left of its way stays left */
    assert_near(k->outline.high_m[1], 0.2, 1e-12);
    assert_near(k->body.parts[0].offset_m[0], -0.5, 1e-12);
    assert_near(k->body.parts[0].offset_m[1], -0.6, 1e-12);
    assert_near(k->body.sight[0], -0.6, 1e-12);
    assert_near(k->extent_m[0], 0.2, 1e-12);
    assert_int_equal(k->id, 9);
    assert_int_equal(k->mirror.id, 0);
    assert_false(k->placed);
    assert_near(k->waited, 0.0, 0.0); /* there is none that could show it */
    assert_int_equal(r->t.counts.jumped, 0);
}

/* x + y = 4 takes (x, y) to (4 - y, 4 - x). */
static void at_a_slanted_mirror_the_axes_change_places(void **state)
{
    struct rig *r = *state;
    struct track *k =
        start(r, mirror(7, HALF_ROOT, HALF_ROOT, 4.0 * HALF_ROOT), 1.0, 2.0);

    track_mirror_follow(&r->t, &r->scan);
    expect_state(&k->filter, 2.0, 3.0, 0.4, -1.2);
    expect_spread(k, swapped, (const int[4]){-1, -1, -1, -1}, 0.0);
    assert_near(k->extent_m[0], 0.6, 1e-9);
    assert_near(k->extent_m[1], 0.2, 1e-9);
}

/* Of a vehicle that has turned by 45 degrees the same wall is straight ahead. */
static void an_extent_is_along_the_vehicle(void **state)
{
    struct rig *r = *state;
    struct track *k =
        start(r, mirror(7, HALF_ROOT, HALF_ROOT, 4.0 * HALF_ROOT), 1.0, 2.0);

    r->t.pose.dyaw = atan2(1.0, 1.0);
    track_mirror_follow(&r->t, &r->scan);
    assert_near(k->extent_m[0], 0.2, 1e-9);
    assert_near(k->extent_m[1], 0.6, 1e-9);
}

/* x = 5 goes; y = 4 stands before (7, 1).  Two mirrors turn by 180 degrees. */
static void another_mirror_that_stands_before_the_image_takes_over(void **state)
{
    struct rig *r = *state;
    struct track *k = start(r, mirror(7, 1.0, 0.0, 5.0), 3.0, 1.0);

    know(r, mirror(9, 0.0, 1.0, 4.0));
    r->scan.stands_before = stands;
    k->outline.low_m[1] = -0.2;
    k->outline.high_m[1] = 0.5;
    k->waited = 0.7;
    track_mirror_follow(&r->t, &r->scan);
    assert_near(r->asked_m[0], 7.0, 1e-9);
    assert_near(r->asked_m[1], 1.0, 1e-9);
    assert_near(r->asked_m[2], 0.5, 1e-9);
    expect_state(&k->filter, 7.0, 7.0, -1.2, 0.4);
    expect_spread(k, straight, as_it_was, 0.0); /* 7.2 m away: nothing is near to both */
    assert_near(k->outline.low_m[1], -0.2, 1e-12);
    assert_int_equal(k->mirror.id, 9);
    assert_false(k->placed);
    assert_near(k->waited, 0.7, 0.0);
    assert_int_equal(r->t.counts.jumped, 1);
}

static void one_that_stands_elsewhere_does_not(void **state)
{
    struct rig *r = *state;
    struct track *k = start(r, mirror(7, 1.0, 0.0, 5.0), 3.0, 1.0);

    know(r, mirror(9, 0.0, 1.0, 4.0));
    r->scan.stands_before = stands;
    r->probe.answer = r->scan.n_mirrors;
    track_mirror_follow(&r->t, &r->scan);
    expect_state(&k->filter, 7.0, 1.0, -1.2, -0.4);
    assert_int_equal(k->mirror.id, 0);
}

/* Of the planes x = -2 and y = 4 the second. */
static size_t stands_before_3_7(const void *context, const double imaged_m[3])
{
    (void)context;
    return hypot(imaged_m[0] - 3.0, imaged_m[1] - 7.0) < 1e-9 ? 1 : 2;
}

/* x = 5 goes, and before (7, 1) stands nothing; but by way of y = 4 it is seen at (3, 7).
 */
static void what_another_mirror_shows_there_stays_there(void **state)
{
    struct rig *r = *state;
    struct track *k = start(r, mirror(7, 1.0, 0.0, 5.0), 3.0, 1.0);

    know(r, mirror(8, 1.0, 0.0, -2.0));
    know(r, mirror(9, 0.0, 1.0, 4.0));
    r->scan.stands_before = stands_before_3_7;
    track_mirror_follow(&r->t, &r->scan);
    expect_state(&k->filter, 3.0, 1.0, 1.2, -0.4);
    assert_int_equal(k->mirror.id, 9);
    assert_near(k->mirror.distance_m, 4.0, 1e-12);
    assert_false(k->placed); /* until it is measured there */
    assert_int_equal(r->t.counts.jumped, 0);
}

/* A vehicle at (2, 1) that looks along y; 3 m ahead of it is y = 4 over ground. */
static void mirrors_are_the_vehicles_and_tracks_the_grounds(void **state)
{
    struct rig *r = *state;
    struct track *k = start(r, (struct track_mirror){.id = 0}, 1.0, 6.0);

    r->t.pose = (struct ego_step){2.0, 1.0, 2.0 * atan2(1.0, 1.0)};
    know(r, mirror(7, 1.0, 0.0, 3.0));
    r->scan.stands_before = stands;
    track_mirror_follow(&r->t, &r->scan);
    assert_near(r->asked_m[0], 5.0, 1e-9);
    assert_near(r->asked_m[1], 1.0, 1e-9);
    expect_state(&k->filter, 1.0, 2.0, 1.2, 0.4);
    assert_near(k->mirror.normal[0], 0.0, 1e-12);
    assert_near(k->mirror.normal[1], 1.0, 1e-12);
    assert_near(k->mirror.distance_m, 4.0, 1e-12);
    assert_false(k->placed); /* until it is measured there */
    assert_int_equal(r->t.counts.jumped, 0);
    k->id = 1;
    assert_int_equal(tracker_report(&r->t, r->reports), 1);
    assert_near(r->reports[0].mirror.normal[0], 1.0, 1e-12);
    assert_near(r->reports[0].mirror.distance_m, 3.0, 1e-12);
}

/* -- mirrors that move ------------------------------------------------------------------
 */

/* x = 5 moves by so much, what it mirrors by twice that.  Three sigma of both estimates:
 * 3 sqrt(2) 2 x 2 cm = 17 cm; of a turn, 3 x 2 x 0.02 hypot(2.24 m, 2.03 m) = 36 cm, the
 * distances of (3, 1) and of (3.46, 1) from (5, 0) and (5.23, 0). */
static void beyond_three_sigma_of_the_mirrors_a_track_has_jumped(void **state)
{
    static const struct {
        double sigma_m, sigma_rad, by_m;
        bool jumps;
    } cases[] = {{0.0, 0.0, 0.024, false}, {0.0, 0.0, 0.026, true},
                 {0.02, 0.0, 0.08, false}, {0.02, 0.0, 0.09, true},
                 {0.0, 0.02, 0.15, false}, {0.0, 0.02, 0.23, true}};

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct track_mirror m = mirror(7, 1.0, 0.0, 5.0);
        double way_m = 2.0 * cases[i].by_m;
        assert_int_equal(setup(state), 0);
        struct rig *r = *state;
        m.sigma_m = cases[i].sigma_m;
        m.sigma_rad = cases[i].sigma_rad;
        struct track *k = start(r, m, 3.0, 1.0);
        m.distance_m += cases[i].by_m;
        know(r, m);
        track_mirror_follow(&r->t, &r->scan);
        expect_state(&k->filter, 3.0 + way_m, 1.0, 1.2, -0.4);
        expect_spread(k, straight, as_it_was, cases[i].jumps ? way_m * way_m : 0.0);
        assert_int_equal(k->placed, !cases[i].jumps);
        assert_int_equal(r->t.counts.jumped, cases[i].jumps);
        teardown(state);
    }
}

/* (1.5, 2) is 2.5 m before 0.6 x + 0.8 y = 5, the foot of its perpendicular 2.2 m beside
 * that of the array's: three sigma of both estimates are 6 x 0.02 hypot(2.5, 2.2, 2.22,
 * 2.2), 55 cm. */
static void a_turn_of_a_slanted_mirror_is_about_the_array(void **state)
{
    static const struct {
        double by_m;
        bool jumps;
    } cases[] = {{0.27, false}, {0.28, true}};

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct track_mirror m = mirror(7, 0.6, 0.8, 5.0);
        assert_int_equal(setup(state), 0);
        struct rig *r = *state;
        m.sigma_rad = 0.02;
        struct track *k = start(r, m, 1.5, 2.0);
        m.distance_m += cases[i].by_m;
        know(r, m);
        r->scan.array = (struct track_array){.at_m = {2.0, -1.0}, .axis = {0.0, 1.0}};
        track_mirror_follow(&r->t, &r->scan);
        expect_state(&k->filter, 1.5 + 1.2 * cases[i].by_m, 2.0 + 1.6 * cases[i].by_m,
                     1.2, -0.4);
        assert_int_equal(k->placed, !cases[i].jumps);
        teardown(state);
    }
}

static void what_jumps_by_a_metre_is_not_near_to_both(void **state)
{
    struct rig *r = *state;
    struct track *k = start(r, mirror(7, 1.0, 0.0, 5.0), 3.0, 1.0);

    know(r, mirror(7, 1.0, 0.0, 5.6));
    track_mirror_follow(&r->t, &r->scan);
    expect_state(&k->filter, 4.2, 1.0, 1.2, -0.4);
    expect_spread(k, straight, as_it_was, 0.0);
    assert_false(k->placed);
    assert_int_equal(r->t.counts.jumped, 1);
}

static void what_is_measured_by_a_mirror_has_a_place(void **state)
{
    struct rig *r = *state;
    struct track *k = start(r, (struct track_mirror){.id = 0}, 1.0, 2.0);

    r->t.pose = (struct ego_step){2.0, 1.0, 2.0 * atan2(1.0, 1.0)};
    know(r, mirror(7, 1.0, 0.0, 3.0));
    track_mirror_measured(&r->t, &r->scan, k, 7);
    assert_true(k->placed);
    assert_int_equal(k->mirror.id, 7);
    assert_near(k->mirror.normal[1], 1.0, 1e-12);
    assert_near(k->mirror.distance_m, 4.0, 1e-12);
    r->scan.mirrors[r->scan.n_mirrors] = mirror(8, 1.0, 0.0, 3.0);
    track_mirror_measured(&r->t, &r->scan, k, 8); /* known once, not any more */
    assert_false(k->placed);
    assert_int_equal(k->mirror.id, 0);
    track_mirror_measured(&r->t, &r->scan, k, 7);
    track_mirror_measured(&r->t, &r->scan, k, 0);
    assert_false(k->placed);
}

/* -- one thing that two mirrors show ----------------------------------------------------
 */

struct double_case {
    unsigned id[2];
    int64_t first_ns[2];
    uint32_t mirror[2];
    bool placed[2], merged[2];
    double apart_m;
};

static void of_one_thing_that_two_mirrors_show_the_older_stays(void **state)
{
    static const struct double_case cases[] = {
        {{5, 6}, {10, 20}, {7, 9}, {true, false}, {false, true}, 0.3},
        {{5, 6}, {10, 20}, {7, 9}, {true, true}, {false, false}, 0.3},
        {{5, 6}, {10, 20}, {7, 9}, {false, true}, {false, false}, 0.3}, /* may be shown */
        {{5, 6}, {10, 20}, {7, 7}, {true, false}, {false, false}, 0.3},
        {{5, 6}, {10, 20}, {7, 0}, {true, false}, {false, false}, 0.3},
        {{5, 6}, {10, 20}, {7, 9}, {true, false}, {false, false}, 0.6},
        {{5, 6}, {10, 10}, {7, 9}, {false, false}, {true, false}, 0.3}, /* not both */
        {{0, 6}, {10, 20}, {7, 9}, {false, false}, {true, false}, 0.3},
        {{5, 0}, {20, 10}, {7, 9}, {false, false}, {false, true}, 0.3}};

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct double_case *c = &cases[i];
        assert_int_equal(setup(state), 0);
        struct rig *r = *state;
        know(r, mirror(7, 1.0, 0.0, 5.0));
        know(r, mirror(9, 0.0, 1.0, 4.0));
        for (int q = 0; q < 2; q++) {
            struct track_mirror by = c->mirror[q] == 7   ? r->scan.mirrors[0]
                                     : c->mirror[q] == 9 ? r->scan.mirrors[1]
                                                         : (struct track_mirror){.id = 0};
            struct track *k = start(r, by, 3.0 + q * c->apart_m, 1.0);
            k->id = c->id[q];
            k->first_ns = c->first_ns[q];
            k->placed = c->placed[q];
        }
        track_mirror_follow(&r->t, &r->scan);
        for (int q = 0; q < 2; q++)
            if (r->t.tracks[q].merged != c->merged[q])
                fail_msg("case %zu: track %d is merged: %d", i, q, !c->merged[q]);
        teardown(state);
    }
}

/* -- what ends, and what is reported ----------------------------------------------------
 */

static void what_is_measured_beyond_is_reported_before_it(void **state)
{
    struct rig *r = *state;
    struct track *k = start(r, mirror(7, 1.0, 0.0, 5.0), 5.2, 1.0);

    k->id = 1;
    k->state = TRACK_MEASURED;
    assert_int_equal(tracker_report(&r->t, r->reports), 1);
    assert_near(r->reports[0].position_m[0], 4.95, 1e-9);
    assert_near(r->reports[0].position_m[1], 1.0, 1e-9);
    assert_near(r->reports[0].heard_m[0], 5.2, 1e-9);
}

/* Nothing is heard of it in so many images, of which each is half a look, 0.1 s apart. */
static enum track_state unheard(struct track_mirror by, double x_m, size_t n_mirrors,
                                int images, bool fast)
{
    struct track_config cfg;
    struct tracker *t = NULL;
    struct track_scan scan = {.stamp_ns = 1000000000,
                              .fresh = 0.5,
                              .clutter_m2 = 0.01,
                              .ego_known = true,
                              .n_mirrors = n_mirrors,
                              .mirrors = {mirror(7, 1.0, 0.0, 5.0)}};

    track_config_default(&cfg);
    assert_int_equal(tracker_create(&t, &cfg), 0);
    t->began = true;
    t->stamp_ns = scan.stamp_ns;
    t->n = 1;
    struct track *k = &t->tracks[0];
    k->mirror = by;
    k->placed = by.id != 0;
    k->id = 1;
    t->ids.taken[1] = true;
    k->life.existence = 0.9;
    k->life.confirmed = true;
    k->seen_ns = k->moves_ns = scan.stamp_ns;
    k->filter.state[0] = x_m;
    k->outline.fast = fast;
    for (int i = 0; i < 4; i++)
        k->filter.covariance[i][i] = 0.01;
    k->steady = k->filter;
    for (int i = 0; i < images; i++) {
        scan.stamp_ns += 100000000;
        assert_int_equal(tracker_step(t, &scan), 0);
    }
    assert_int_equal(t->n, 1);
    enum track_state state = t->tracks[0].state;
    tracker_destroy(t);
    return state;
}

static void what_coasts_ends_at_its_mirror(void **state)
{
    const struct track_mirror wall = mirror(7, 1.0, 0.0, 5.0);

    (void)state;
    assert_int_equal(unheard(wall, 4.94, 1, 1, false), TRACK_PREDICTED);
    assert_int_equal(unheard(wall, 4.96, 1, 1, false), TRACK_DELETED);
}

/* 0.1 m is one sigma then. */
static void what_is_fast_ends_where_it_is_surely_past_it(void **state)
{
    const struct track_mirror wall = mirror(7, 1.0, 0.0, 5.0);

    (void)state;
    assert_int_equal(unheard(wall, 5.13, 1, 1, true), TRACK_PREDICTED);
    assert_int_equal(unheard(wall, 5.18, 1, 1, true), TRACK_DELETED);
}

/* After 0.75 looks. */
static void what_no_mirror_shows_ends_where_there_are_mirrors(void **state)
{
    const struct track_mirror none = {.id = 0};

    (void)state;
    assert_int_equal(unheard(none, 7.0, 1, 1, false), TRACK_PREDICTED);
    assert_int_equal(unheard(none, 7.0, 1, 2, false), TRACK_DELETED);
    assert_int_equal(unheard(none, 7.0, 0, 2, false), TRACK_PREDICTED);
}

/* Where what stands is heard, 2 of 3 looks are 3 of 5, and one look stays one. */
static void what_stands_asks_for_one_look_more(void **state)
{
    static const struct {
        unsigned hits, of, hits_then, of_then;
    } cases[] = {{2, 3, 3, 5}, {3, 5, 4, 7}, {1, 1, 1, 1}};
    struct track_scan scan = {.fresh = 1.0, .clutter_m2 = 0.01, .ego_known = true};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct track_config cfg;
        struct tracker *t = NULL;
        track_config_default(&cfg);
        cfg.life.confirm_hits = cases[i].hits;
        cfg.life.confirm_of = cases[i].of;
        assert_int_equal(tracker_create(&t, &cfg), 0);
        for (int standing = 2; standing >= 0; standing--) { /* is, was, is long gone */
            scan.standing_left = standing == 2;
            scan.settling = standing == 1;
            scan.stamp_ns += 100000000;
            assert_int_equal(tracker_step(t, &scan), 0);
            assert_int_equal(t->life.confirm_hits,
                             standing ? cases[i].hits_then : cases[i].hits);
            assert_int_equal(t->life.confirm_of,
                             standing ? cases[i].of_then : cases[i].of);
        }
        tracker_destroy(t);
    }
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_goes_as_far_behind_a_plane_as_it_was_before_it),
        cmocka_unit_test(the_middle_of_a_thing_is_five_centimetres_from_a_wall),
        TEST(what_loses_its_mirror_lives_on_where_it_is_imaged),
        TEST(at_a_slanted_mirror_the_axes_change_places),
        TEST(an_extent_is_along_the_vehicle),
        TEST(another_mirror_that_stands_before_the_image_takes_over),
        TEST(one_that_stands_elsewhere_does_not),
        TEST(what_another_mirror_shows_there_stays_there),
        TEST(mirrors_are_the_vehicles_and_tracks_the_grounds),
        cmocka_unit_test(beyond_three_sigma_of_the_mirrors_a_track_has_jumped),
        cmocka_unit_test(a_turn_of_a_slanted_mirror_is_about_the_array),
        TEST(what_jumps_by_a_metre_is_not_near_to_both),
        TEST(what_is_measured_by_a_mirror_has_a_place),
        cmocka_unit_test(of_one_thing_that_two_mirrors_show_the_older_stays),
        TEST(what_stands_asks_for_one_look_more),
        TEST(what_is_measured_beyond_is_reported_before_it),
        cmocka_unit_test(what_coasts_ends_at_its_mirror),
        cmocka_unit_test(what_is_fast_ends_where_it_is_surely_past_it),
        cmocka_unit_test(what_no_mirror_shows_ends_where_there_are_mirrors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
