/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "nodes/rt/trails.h"
#include "tests/nodes/near.h"

#define MS 1000000LL
#define S  1000000000LL

static int set_up(void **state)
{
    struct trails *t = malloc(sizeof *t);

    *state = t;
    if (t)
        trails_init(t, 2 * S, 100 * MS);
    return t ? 0 : -1;
}

static int tear_down(void **state)
{
    free(*state);
    return 0;
}

/* One track, in a list of tracks of the vehicle frame. */
static void tell(struct trails *t, uint32_t id, double x, double y,
                 Anlos__Measurement measurement, int64_t at_ns)
{
    Anlos__Vec3 p = ANLOS__VEC3__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, *one = &d;
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;

    p.x = x;
    p.y = y;
    d.id = id;
    d.position_m = &p;
    d.measurement = measurement;
    list.detections = &one;
    list.n_detections = 1;
    list.tracked = list.in_vehicle_frame = true;
    trails_take(t, &list, at_ns);
}

static void tell_ego(struct trails *t, double speed_m_s, double yaw_rad_s, int64_t at_ns)
{
    Anlos__EgoMotion m = ANLOS__EGO_MOTION__INIT;

    m.speed_m_s = speed_m_s;
    m.yaw_rate_rad_s = yaw_rad_s;
    m.valid = true;
    trails_ego(t, &m, at_ns);
}

static void a_trail_ends_where_the_track_is_and_forgets_what_is_old(void **state)
{
    struct trails *t = *state;

    for (int i = 0; i <= 500; i++) /* 5 s of a list every 10 ms */
        tell(t, 4, 0.01 * i, 1.0, ANLOS__MEASUREMENT__MEASURED, S + i * 10 * MS);
    const struct trail *k = trails_find(t, 4);
    assert_non_null(k);
    assert_in_range(k->n, 20, 22); /* 2 s, a point each 100 ms */
    assert_near(k->points[k->n - 1].at_m[0], 5.0, 1e-12);
    assert_near(k->points[0].at_m[0], 3.0, 0.11);
    for (size_t i = 1; i < k->n; i++)
        assert_true(k->points[i].stamp_ns > k->points[i - 1].stamp_ns);
    tell(t, 5, 0.0, 0.0, ANLOS__MEASUREMENT__NEW, 9 * S);
    assert_null(trails_find(t, 4));
    assert_non_null(trails_find(t, 5));
}

/* Ahead 2 m in a second, then a quarter turn to the left on the spot: what stood at
 * (5, 1) ahead is at (3, 1), and then at (1, -3). */
static void what_the_vehicle_went_is_taken_out(void **state)
{
    struct trails *t = *state;

    for (int i = 0; i <= 100; i++)
        tell_ego(t, i < 50 ? 2.0 : 0.0, i < 50 ? 0.0 : M_PI_2, S + i * 20 * MS);
    tell(t, 1, 5.0, 1.0, ANLOS__MEASUREMENT__MEASURED, S);
    tell(t, 1, 3.0, 1.0, ANLOS__MEASUREMENT__MEASURED, 2 * S);
    const struct trail *k = trails_find(t, 1);
    assert_near(k->points[0].at_m[0], 3.0, 0.06); /* motion is known each 20 ms */
    assert_near(k->points[0].at_m[1], 1.0, 0.06);
    assert_near(t->own.points[0].at_m[0], -2.0, 0.06);
    tell(t, 1, 1.0, -3.0, ANLOS__MEASUREMENT__PREDICTED, 3 * S);
    k = trails_find(t, 1);
    assert_int_equal(k->n, 3);
    assert_near(k->points[0].at_m[0], 1.0, 0.12);
    assert_near(k->points[0].at_m[1], -3.0, 0.12);
    assert_true(k->points[1].measured);
    assert_false(k->points[2].measured);
}

static void without_motion_the_vehicle_counts_as_standing(void **state)
{
    struct trails *t = *state;

    tell_ego(t, 2.0, 0.0, S);
    tell(t, 1, 5.0, 1.0, ANLOS__MEASUREMENT__MEASURED, 3 * S);
    tell(t, 1, 5.1, 1.0, ANLOS__MEASUREMENT__MEASURED, 4 * S);
    assert_near(trails_find(t, 1)->points[0].at_m[0], 5.0, 1e-12);
}

static void another_run_begins_anew(void **state)
{
    struct trails *t = *state;

    tell_ego(t, 2.0, 0.0, 90 * S);
    tell(t, 1, 5.0, 1.0, ANLOS__MEASUREMENT__MEASURED, 90 * S);
    tell(t, 2, 5.0, 1.0, ANLOS__MEASUREMENT__MEASURED, 10 * S);
    assert_null(trails_find(t, 1));
    assert_int_equal(trails_find(t, 2)->n, 1);
    tell_ego(t, 0.0, 0.0, 10 * S);
    assert_int_equal(t->ego.n, 1);
    tell(t, 3, 5.0, 1.0, ANLOS__MEASUREMENT__MEASURED, INT64_MIN); /* no stamp */
    assert_null(trails_find(t, 3));
}

static void more_tracks_than_there_is_room_for_push_out_the_oldest(void **state)
{
    struct trails *t = *state;

    for (uint32_t id = 1; id <= TRAILS_MAX + 3; id++)
        tell(t, id, 1.0, 1.0, ANLOS__MEASUREMENT__MEASURED, S + id * MS);
    for (uint32_t id = 1; id <= TRAILS_MAX + 3; id++)
        assert_int_equal(trails_find(t, id) != NULL, id > 3);
}

/* Of no use in a trail: without an id, without a place, deleted, and of untracked lists.
 */
static void only_tracks_have_trails(void **state)
{
    struct trails *t = *state;
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;

    tell(t, 0, 1.0, 1.0, ANLOS__MEASUREMENT__MEASURED, S);
    tell(t, 1, NAN, 1.0, ANLOS__MEASUREMENT__MEASURED, S);
    tell(t, 2, 1.0, 1.0, ANLOS__MEASUREMENT__DELETED, S);
    for (size_t i = 0; i < TRAILS_MAX; i++)
        assert_int_equal(t->list[i].n, 0);
    trails_take(t, &list, 9 * S);
    assert_int_equal(t->frame_ns, S);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_trail_ends_where_the_track_is_and_forgets_what_is_old),
        TEST(what_the_vehicle_went_is_taken_out),
        TEST(without_motion_the_vehicle_counts_as_standing),
        TEST(another_run_begins_anew),
        TEST(more_tracks_than_there_is_room_for_push_out_the_oldest),
        TEST(only_tracks_have_trails),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
