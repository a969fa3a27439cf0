/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "tests/recon/near.h"

#include "recon/walls/field_of_view.h"
#include "tests/recon/reference.h"

/* Without a mount the corners are x, z of the array's plane. */
static const struct survey unmounted = {.has_mount = false};

/* x -2 to 2, z 0.5 to 6. */
static const struct grid box = {
    .origin_m = {-2, 0, 0.5}, .step_m = {0.5, 1, 0.5}, .n = {9, 1, 12}};

static struct wall_gate wall_at(uint32_t id, double nx, double nz, double distance_m,
                                double from_m, double to_m)
{
    return (struct wall_gate){.id = id,
                              .plane = {.normal = {nx, 0, nz},
                                        .distance_m = distance_m,
                                        .ends_m = {from_m, to_m}},
                              .gate_m = {0, 100}};
}

static struct field_of_view find(const struct wall_gate *walls, size_t n)
{
    struct field_of_view v;
    field_of_view_find(&v, &unmounted, walls, n, n, &box, INFINITY);
    return v;
}

/* Positive: counterclockwise. */
static double area_m2(const struct view_area *a)
{
    double sum = 0.0;
    for (size_t i = 0; i < a->n; i++) {
        const double *p = a->corners_m[i], *q = a->corners_m[(i + 1) % a->n];
        sum += p[0] * q[1] - p[1] * q[0];
    }
    return 0.5 * sum;
}

static void assert_area(const struct field_of_view *v, size_t i, uint32_t wall, double m2)
{
    assert_true(i < v->n);
    assert_int_equal(v->areas[i].wall, wall);
    assert_near(area_m2(&v->areas[i]), m2, 1e-6);
}

static bool has_corner(const struct view_area *a, double x, double y)
{
    for (size_t i = 0; i < a->n; i++)
        if (hypot(a->corners_m[i][0] - x, a->corners_m[i][1] - y) < 1e-6)
            return true;
    return false;
}

/* What is behind it in the image, 4 by 4 m, lies before it. */
static void an_endless_wall_shows_all_that_is_imaged_behind_it(void **state)
{
    (void)state;
    const struct wall_gate w = wall_at(7, 0, 1, 2, 0, 0);
    const struct field_of_view v = find(&w, 1);
    assert_int_equal(v.n, 1);
    assert_area(&v, 0, 7, 16.0);
    assert_int_equal(v.areas[0].n, 4);
    assert_true(has_corner(&v.areas[0], -2, -2) && has_corner(&v.areas[0], 2, 2));
}

/* From x = -1 to 1 at z = 2: |x| < z / 2 behind it, so 2 m to 4 m wide at z = 2 to 4, and
 * 4 m to z = 6.  Half a metre past the ends nothing is sure; from there on, |x| > 3/4 z,
 * what is seen is there: the integral of 2 - 3/4 z from 0.5 to 8/3. */
static void past_the_ends_of_a_wall_the_view_is_direct(void **state)
{
    (void)state;
    const struct wall_gate w = wall_at(7, 0, 1, 2, -1, 1);
    const struct field_of_view v = find(&w, 1);
    const double aside_m2 = 2 * (8.0 / 3 - 0.5) - 0.375 * (64.0 / 9 - 0.25);
    assert_int_equal(v.n, 3);
    assert_area(&v, 0, 0, aside_m2);
    assert_area(&v, 1, 7, 6.0 + 8.0);
    assert_area(&v, 2, 0, aside_m2);
    assert_true(has_corner(&v.areas[1], 1, 2) && has_corner(&v.areas[1], 2, 0));
    assert_true(has_corner(&v.areas[1], 2, -2));
}

/* An opening from x = -1 to 1 between two pieces at z = 2.  Beside it each shows what is
 * imaged at z/2 < x < 2 from z = 2 on, a triangle of 1 by 2 m; through the middle half,
 * |x| < z / 4, one looks directly. */
static void an_opening_is_looked_through(void **state)
{
    (void)state;
    const struct wall_gate w[2] = {wall_at(1, 0, 1, 2, -20, -1),
                                   wall_at(2, 0, 1, 2, 1, 20)};
    const struct field_of_view v = find(w, 2);
    assert_int_equal(v.n, 3);
    assert_area(&v, 0, 2, 1.0); /* level is -x: the second is at x < 0 */
    assert_area(&v, 1, 0, (36 - 0.25) / 4);
    assert_area(&v, 2, 1, 1.0);
}

/* z = 2 and x = 1.5, which meet at (1.5, 2), in an image to x = 4.  By way of the first
 * what is imaged at x = -2 to 1.5: farther right its sound would have to come through the
 * second.  By way of that what is imaged at x = 1.5 to 4, before the first. */
static void in_a_corner_each_wall_ends_the_view_by_the_other(void **state)
{
    (void)state;
    const struct grid wide = {
        .origin_m = {-2, 0, 0.5}, .step_m = {0.5, 1, 0.5}, .n = {13, 1, 12}};
    const struct wall_gate w[2] = {wall_at(1, 0, 1, 2, 0, 0),
                                   wall_at(2, 1, 0, 1.5, 0, 0)};
    struct field_of_view v;
    field_of_view_find(&v, &unmounted, w, 2, 2, &wide, INFINITY);
    assert_int_equal(v.n, 2);
    assert_area(&v, 0, 1, 3.5 * 4);
    assert_area(&v, 1, 2, 2.5 * 1.5);
    /* one that is lost shows nothing any more, and still stands in the way */
    field_of_view_find(&v, &unmounted, w, 2, 1, &wide, INFINITY);
    assert_int_equal(v.n, 1);
    assert_area(&v, 0, 1, 3.5 * 4);
}

static void without_a_wall_or_with_one_behind_the_image_is_what_is_seen(void **state)
{
    (void)state;
    const struct wall_gate behind = wall_at(3, 0, 1, -2, 0, 0);
    struct field_of_view v = find(NULL, 0);
    assert_int_equal(v.n, 1);
    assert_area(&v, 0, 0, 4 * 5.5);
    v = find(&behind, 1);
    assert_int_equal(v.n, 1);
    assert_area(&v, 0, 0, 4 * 5.5);
}

/* A wall that ends, before an endless one: what passes the first is shown by the second,
 * and its way back must not cross the first. */
static void
what_a_wall_shows_is_cut_where_another_one_stands_in_the_way_back(void **state)
{
    (void)state;
    const struct wall_gate w[2] = {wall_at(1, 0, 1, 3, 0, 0),
                                   wall_at(2, 0, 1, 2, -5, 0)}; /* x = 0 to 5 */
    const struct field_of_view v = find(w, 2);
    /* x < 0: imaged behind z = 3.  On the way back nothing is left of z = 2 there. */
    assert_int_equal(v.n, 2);
    assert_area(&v, 0, 1, 2.0 * 3.0);
    assert_area(&v, 1, 2, 2.0 * 4.0);
}

/* 4 m wide, from the wall at 2 m to a circle of 5 m: by chords a little less. */
static void a_gate_bounds_the_view_by_chords(void **state)
{
    (void)state;
    struct wall_gate w = wall_at(7, 0, 1, 2, 0, 0);
    const double exact_m2 = 2 * (sqrt(21.0) + 12.5 * asin(0.4)) - 8.0;
    struct field_of_view v;
    for (int k = 0; k < 2; k++) {
        w.gate_m[1] = k ? 100.0 : 5.0;
        field_of_view_find(&v, &unmounted, &w, 1, 1, &box, k ? 5.0 : INFINITY);
        assert_int_equal(v.n, 1);
        double m2 = area_m2(&v.areas[0]);
        assert_true(m2 <= exact_m2 && m2 > 0.95 * exact_m2);
        for (size_t i = 0; i < v.areas[0].n; i++) /* their images: 4 m off in z */
            assert_true(hypot(v.areas[0].corners_m[i][0],
                              4.0 - v.areas[0].corners_m[i][1]) < 5.0 + 1e-9);
    }
}

/* On the right, looking ahead: x of the array is to the left, z forward. */
static void on_a_mount_the_corners_are_the_vehicle_s(void **state)
{
    (void)state;
    const struct survey s = {.has_mount = true,
                             .mount_origin_m = {3.6, 0.2, 0.5},
                             .mount_x_axis = {0, 1, 0},
                             .mount_y_axis = {0, 0, 1}};
    const struct wall_gate w = wall_at(7, 0, 1, 2, 0, 0);
    struct field_of_view v;
    field_of_view_find(&v, &s, &w, 1, 1, &box, INFINITY);
    assert_area(&v, 0, 7, 16.0);
    assert_true(has_corner(&v.areas[0], 3.6 + 2, 0.2 + 2));
    assert_true(has_corner(&v.areas[0], 3.6 - 2, 0.2 - 2));
}

/* -- straight geometry, for any walls --------------------------------------------------
 */

struct segment {
    double a[2], b[2];
};

/* Upright walls of normals in the plane, lengthened by so much. */
static struct segment segment_of(const struct wall_gate *w, double more_m)
{
    const double *n = w->plane.normal;
    double from_m = w->plane.ends_m[0], to_m = w->plane.ends_m[1];
    if (from_m == 0 && to_m == 0) {
        from_m = -1e4;
        to_m = 1e4;
    }
    from_m -= more_m;
    to_m += more_m;
    /* level = normal x y: (-nz, nx) */
    return (struct segment){{w->plane.distance_m * n[0] - from_m * n[2],
                             w->plane.distance_m * n[2] + from_m * n[0]},
                            {w->plane.distance_m * n[0] - to_m * n[2],
                             w->plane.distance_m * n[2] + to_m * n[0]}};
}

static double side(const double a[2], const double b[2], const double p[2])
{
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
}

static bool meet(const double p[2], const double q[2], const struct segment *s)
{
    return side(s->a, s->b, p) * side(s->a, s->b, q) < 0 &&
           side(p, q, s->a) * side(p, q, s->b) < 0;
}

static bool in_box(const double p[2])
{
    return p[0] >= -2 && p[0] <= 2 && p[1] >= 0.5 && p[1] <= 6;
}

static bool seen_by(const struct wall_gate *walls, size_t n, size_t i, const double q[2])
{
    const double array[2] = {0, 0}, *normal = walls[i].plane.normal;
    double beyond = normal[0] * q[0] + normal[2] * q[1] - walls[i].plane.distance_m;
    double image[2] = {q[0] - 2 * beyond * normal[0], q[1] - 2 * beyond * normal[2]};
    double range = hypot(image[0], image[1]);
    struct segment own = segment_of(&walls[i], 0);
    if (!in_box(image) || range < walls[i].gate_m[0] || range > walls[i].gate_m[1] ||
        !meet(array, image, &own))
        return false;
    double d = walls[i].plane.distance_m;
    double s = d / (normal[0] * image[0] + normal[2] * image[1]);
    double struck[2] = {s * image[0], s * image[1]};
    for (size_t j = 0; j < n; j++) {
        struct segment other = segment_of(&walls[j], 0);
        if (j != i && (meet(array, struck, &other) || meet(struck, q, &other)))
            return false;
    }
    return true;
}

static bool seen_directly(const struct wall_gate *walls, size_t n, const double q[2])
{
    const double array[2] = {0, 0};
    for (size_t j = 0; j < n; j++) {
        /* whatever is imaged in this direction, however far */
        const double far[2] = {1e3 * q[0], 1e3 * q[1]};
        struct segment other = segment_of(&walls[j], WALL_END_MARGIN_M);
        if (meet(array, far, &other))
            return false;
    }
    return in_box(q);
}

static bool is_inside(const struct view_area *a, const double q[2])
{
    for (size_t i = 0; i < a->n; i++)
        if (side(a->corners_m[i], a->corners_m[(i + 1) % a->n], q) < 0)
            return false;
    return true;
}

static bool is_in_area_of(const struct field_of_view *v, uint32_t wall, const double q[2])
{
    for (size_t k = 0; k < v->n; k++)
        if (v->areas[k].wall == wall && is_inside(&v->areas[k], q))
            return true;
    return false;
}

static void draw_walls(struct wall_gate *walls, size_t n, unsigned long long *seed)
{
    for (size_t i = 0; i < n; i++) {
        double angle = 6.2 * reference_random(seed);
        double from_m = 4 * reference_random(seed) - 3;
        bool ends = reference_random(seed) < 0.7;
        walls[i] = wall_at((uint32_t)i + 1, sin(angle), cos(angle),
                           0.7 + 2.5 * reference_random(seed), ends ? from_m : 0,
                           ends ? from_m + 0.5 + 3 * reference_random(seed) : 0);
        walls[i].gate_m[0] = reference_random(seed);
        walls[i].gate_m[1] = 3 + 5 * reference_random(seed);
    }
}

/* What is claimed is seen, whatever walls there are, and most of what is seen is claimed:
 * of random clutter of walls nine tenths, where chords, straight cuts and corners that
 * are left out cost most. */
static void what_is_in_view_is_seen_and_most_that_is_seen_is_in_view(void **state)
{
    (void)state;
    unsigned long long seed = 21;
    size_t n_seen = 0, n_claimed = 0, wrong = 0;
    for (int scene = 0; scene < 400; scene++) {
        struct wall_gate walls[4];
        size_t n = 1 + (size_t)scene % 4;
        draw_walls(walls, n, &seed);
        const struct field_of_view v = find(walls, n);
        for (size_t k = 0; k < v.n; k++)
            assert_true(v.areas[k].n >= 3 && v.areas[k].n <= VIEW_CORNERS &&
                        area_m2(&v.areas[k]) > 0);
        for (int k = 0; k < 400; k++) {
            const double q[2] = {14 * reference_random(&seed) - 7,
                                 14 * reference_random(&seed) - 7};
            for (uint32_t id = 0; id <= n; id++) {
                bool seen = id ? seen_by(walls, n, id - 1, q)
                               : seen_directly(walls, n, q);
                bool claimed = is_in_area_of(&v, id, q);
                n_seen += seen;
                n_claimed += claimed;
                wrong += claimed && !seen;
            }
        }
    }
    assert_int_equal(wrong, 0);
    assert_true(n_seen > 10000);
    if (!(10 * n_claimed > 9 * n_seen))
        fail_msg("%zu of %zu are claimed", n_claimed, n_seen);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_endless_wall_shows_all_that_is_imaged_behind_it),
        cmocka_unit_test(past_the_ends_of_a_wall_the_view_is_direct),
        cmocka_unit_test(an_opening_is_looked_through),
        cmocka_unit_test(in_a_corner_each_wall_ends_the_view_by_the_other),
        cmocka_unit_test(without_a_wall_or_with_one_behind_the_image_is_what_is_seen),
        cmocka_unit_test(
            what_a_wall_shows_is_cut_where_another_one_stands_in_the_way_back),
        cmocka_unit_test(a_gate_bounds_the_view_by_chords),
        cmocka_unit_test(on_a_mount_the_corners_are_the_vehicle_s),
        cmocka_unit_test(what_is_in_view_is_seen_and_most_that_is_seen_is_in_view),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
