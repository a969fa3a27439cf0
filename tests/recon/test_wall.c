/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "tests/recon/near.h"

#include "recon/walls/wall.h"
#include "tests/recon/reference.h"

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void tilt(struct wall *w, unsigned long long *seed)
{
    double length2 = 0.0;
    *w = (struct wall){.distance_m = 0.0};
    for (int a = 0; a < 3; a++) {
        w->normal[a] = 2.0 * reference_random(seed) - 1.0;
        length2 += w->normal[a] * w->normal[a];
    }
    for (int a = 0; a < 3; a++)
        w->normal[a] /= sqrt(length2);
    w->distance_m = 4.0 * reference_random(seed) - 2.0;
}

static void scatter(double p[3], unsigned long long *seed)
{
    for (int a = 0; a < 3; a++)
        p[a] = 6.0 * reference_random(seed) - 3.0;
}

static void a_point_behind_an_upright_wall_comes_out_in_front_of_it(void **state)
{
    (void)state;
    const struct wall w = {.normal = {0.0, 0.0, 1.0}, .distance_m = 2.0};
    const double p[3] = {1.0, 2.0, 5.0};
    double q[3];
    wall_mirror(&w, p, q);
    assert_near(q[0], 1.0, 1e-15);
    assert_near(q[1], 2.0, 1e-15);
    assert_near(q[2], -1.0, 1e-15);
}

static void the_wall_stands_halfway_and_square_to_the_way(void **state)
{
    (void)state;
    unsigned long long seed = 1;
    for (int n = 0; n < 20; n++) {
        struct wall w;
        double p[3], q[3], middle[3], way[3];
        tilt(&w, &seed);
        scatter(p, &seed);
        wall_mirror(&w, p, q);
        for (int a = 0; a < 3; a++) {
            middle[a] = 0.5 * (p[a] + q[a]);
            way[a] = q[a] - p[a];
        }
        assert_near(dot(w.normal, middle), w.distance_m, 1e-12);
        assert_near(fabs(dot(w.normal, way)), sqrt(dot(way, way)), 1e-12);
    }
}

static void mirrored_twice_is_back(void **state)
{
    (void)state;
    unsigned long long seed = 2;
    for (int n = 0; n < 20; n++) {
        struct wall w;
        double p[3], q[3], back[3];
        tilt(&w, &seed);
        scatter(p, &seed);
        wall_mirror(&w, p, q);
        wall_mirror(&w, q, back);
        for (int a = 0; a < 3; a++)
            assert_near(back[a], p[a], 1e-12);
    }
}

static void distances_stay(void **state)
{
    (void)state;
    unsigned long long seed = 3;
    for (int n = 0; n < 20; n++) {
        struct wall w;
        double p[3], q[3], p1[3], q1[3];
        tilt(&w, &seed);
        scatter(p, &seed);
        scatter(q, &seed);
        wall_mirror(&w, p, p1);
        wall_mirror(&w, q, q1);
        assert_near(reference_distance(p1, q1), reference_distance(p, q), 1e-12);
    }
}

static void a_point_on_the_wall_stays(void **state)
{
    (void)state;
    const struct wall w = {.normal = {0.0, 0.6, 0.8}, .distance_m = 1.0};
    const double p[3] = {-3.0, 1.0, 0.5}; /* 0.6 + 0.4 = 1 */
    double q[3];
    wall_mirror(&w, p, q);
    for (int a = 0; a < 3; a++)
        assert_near(q[a], p[a], 1e-15);
}

/* H C H' with H = 1 - 2 n n', written out. */
static void rotate(const struct wall *w, const double c[6], double out[3][3])
{
    const double full[3][3] = {
        {c[0], c[1], c[2]}, {c[1], c[3], c[4]}, {c[2], c[4], c[5]}};
    double h[3][3];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            h[a][b] = (a == b ? 1.0 : 0.0) - 2.0 * w->normal[a] * w->normal[b];
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++) {
            out[a][b] = 0.0;
            for (int q = 0; q < 9; q++)
                out[a][b] += h[a][q / 3] * full[q / 3][q % 3] * h[b][q % 3];
        }
    }
}

static const double somewhere[3] = {0.3, 0.1, 2.0};
static const double covariance[6] = {4e-4, 1e-4, -2e-4, 9e-4, 5e-5, 1e-3};

static void a_covariance_turns_with_its_point(void **state)
{
    (void)state;
    unsigned long long seed = 4;
    for (int n = 0; n < 20; n++) {
        struct wall w;
        double out[6], expected[3][3];
        tilt(&w, &seed);
        wall_mirror_covariance(&w, somewhere, covariance, out);
        rotate(&w, covariance, expected);
        for (int a = 0, q = 0; a < 3; a++)
            for (int b = a; b < 3; b++, q++)
                assert_near(out[q], expected[a][b], 1e-15);
        assert_near(out[0] + out[3] + out[5], 2.3e-3, 1e-15); /* the trace */
    }
}

static void a_wall_across_x_turns_the_signs_of_xy_and_xz(void **state)
{
    (void)state;
    const struct wall w = {.normal = {-1.0, 0.0, 0.0}, .distance_m = 0.7};
    const double expected[6] = {4e-4, -1e-4, 2e-4, 9e-4, 5e-5, 1e-3};
    double out[6];
    wall_mirror_covariance(&w, somewhere, covariance, out);
    for (int q = 0; q < 6; q++)
        assert_near(out[q], expected[q], 1e-18);
}

/* The covariance of mirrored sample points is the mirrored covariance of the points. */
static void points_and_covariance_agree(void **state)
{
    (void)state;
    unsigned long long seed = 5;
    struct wall w;
    tilt(&w, &seed);
    const double spread[4][3] = {
        {0.03, 0.01, 0.0}, {-0.02, 0.02, 0.01}, {0.0, -0.04, 0.02}, {-0.01, 0.01, -0.03}};
    const double centre[3] = {0.4, -0.2, 1.5};
    double before[6] = {0}, after[6] = {0}, mirrored[6], at[3];
    wall_mirror(&w, centre, at);
    for (int p = 0; p < 4; p++) {
        double point[3], image[3];
        for (int a = 0; a < 3; a++)
            point[a] = centre[a] + spread[p][a];
        wall_mirror(&w, point, image);
        for (int a = 0, q = 0; a < 3; a++) {
            for (int b = a; b < 3; b++, q++) {
                before[q] += spread[p][a] * spread[p][b];
                after[q] += (image[a] - at[a]) * (image[b] - at[b]);
            }
        }
    }
    wall_mirror_covariance(&w, centre, before, mirrored);
    for (int q = 0; q < 6; q++)
        assert_near(mirrored[q], after[q], 1e-14);
}

static double normal_random(unsigned long long *seed)
{
    double u = reference_random(seed), v = reference_random(seed);
    return sqrt(-2.0 * log(1.0 - u)) * cos(2.0 * M_PI * v);
}

/* The lower triangle whose product with itself is c. */
static void cholesky(const double c[6], double out[3][3])
{
    memset(out, 0, 9 * sizeof(double));
    out[0][0] = sqrt(c[0]);
    out[1][0] = c[1] / out[0][0];
    out[2][0] = c[2] / out[0][0];
    out[1][1] = sqrt(c[3] - out[1][0] * out[1][0]);
    out[2][1] = (c[4] - out[2][0] * out[1][0]) / out[1][1];
    out[2][2] = sqrt(c[5] - out[2][0] * out[2][0] - out[2][1] * out[2][1]);
}

static void draw(const double root[3][3], double out[3], unsigned long long *seed)
{
    double x[3];
    for (int a = 0; a < 3; a++)
        x[a] = normal_random(seed);
    for (int a = 0; a < 3; a++)
        out[a] = root[a][0] * x[0] + root[a][1] * x[1] + root[a][2] * x[2];
}

/* n turned about axis by an angle: Rodrigues' formula, for an axis at right angles. */
static void turn_about(const double axis[3], double angle, double n[3])
{
    const double side[3] = {axis[1] * n[2] - axis[2] * n[1],
                            axis[2] * n[0] - axis[0] * n[2],
                            axis[0] * n[1] - axis[1] * n[0]};
    double along = dot(axis, n);
    for (int a = 0; a < 3; a++)
        n[a] = cos(angle) * n[a] + sin(angle) * side[a] +
               (1.0 - cos(angle)) * along * axis[a];
}

/* 40000 walls and points at random against the propagated covariance: the scatter of a
 * variance of so many is 0.7 %. */
static void the_error_of_the_wall_is_in_the_error_of_the_object(void **state)
{
    (void)state;
    enum { DRAWS = 40000 };
    unsigned long long seed = 6;
    const struct wall w = {.normal = {0.48, 0.2, 0.854165},
                           .distance_m = 1.3,
                           .covariance = {4e-4, 1e-4, 6e-5, 9e-4, -2e-5, 4e-4}};
    const double point[3] = {0.9, 0.3, 2.8};
    double wall_root[3][3], point_root[3][3], upright[3], level[3], propagated[6];
    double mean[3] = {0}, spread[6] = {0}, expected[3];
    static double image[DRAWS][3];
    cholesky(w.covariance, wall_root);
    cholesky(covariance, point_root);
    wall_axes(&w, upright, level);
    for (int k = 0; k < DRAWS; k++) {
        double change[3], p[3], n[3];
        draw((const double(*)[3])wall_root, change, &seed);
        draw((const double(*)[3])point_root, p, &seed);
        memcpy(n, w.normal, sizeof n);
        turn_about(upright, change[0], n);
        turn_about(level, change[1], n);
        for (int a = 0; a < 3; a++)
            p[a] += point[a];
        double beyond = dot(n, p) - w.distance_m - change[2];
        for (int a = 0; a < 3; a++) {
            image[k][a] = p[a] - 2.0 * beyond * n[a];
            mean[a] += image[k][a] / DRAWS;
        }
    }
    for (int k = 0; k < DRAWS; k++)
        for (int a = 0, q = 0; a < 3; a++)
            for (int b = a; b < 3; b++, q++)
                spread[q] += (image[k][a] - mean[a]) * (image[k][b] - mean[b]) / DRAWS;
    wall_mirror_covariance(&w, point, covariance, propagated);
    wall_mirror(&w, point, expected);
    for (int a = 0; a < 3; a++) /* the second order of the turns is 4 mm */
        assert_near(mean[a], expected[a], 0.006);
    double total = propagated[0] + propagated[3] + propagated[5];
    for (int q = 0; q < 6; q++)
        assert_near(spread[q], propagated[q], 0.02 * total);
    double alone[6];
    const struct wall exact = {.normal = {0.48, 0.2, 0.854165}, .distance_m = 1.3};
    wall_mirror_covariance(&exact, point, covariance, alone);
    assert_true(total > 3.0 * (alone[0] + alone[3] + alone[5]));
}

static void the_axes_are_right_handed_and_upright_is_up(void **state)
{
    (void)state;
    unsigned long long seed = 7;
    for (int n = 0; n < 50; n++) {
        struct wall w;
        double u[3], l[3];
        tilt(&w, &seed);
        wall_axes(&w, u, l);
        assert_near(dot(u, u), 1.0, 1e-12);
        assert_near(dot(u, w.normal), 0.0, 1e-12);
        assert_near(l[1], 0.0, 1e-12); /* level */
        assert_true(u[1] > 0.0);
        assert_near(u[1] * l[2] - u[2] * l[1], w.normal[0], 1e-12);
        assert_near(u[2] * l[0] - u[0] * l[2], w.normal[1], 1e-12);
    }
}

static void a_turn_is_undone_by_the_difference(void **state)
{
    (void)state;
    unsigned long long seed = 8;
    for (int n = 0; n < 50; n++) {
        struct wall w, turned;
        double change[3], found[3];
        tilt(&w, &seed);
        for (int a = 0; a < 3; a++)
            change[a] = 2.0 * reference_random(&seed) - 1.0;
        wall_turn(&w, change, &turned);
        assert_near(dot(turned.normal, turned.normal), 1.0, 1e-12);
        assert_near(dot(turned.normal, w.normal), cos(hypot(change[0], change[1])),
                    1e-12);
        wall_difference(&w, &turned, found);
        for (int a = 0; a < 3; a++)
            assert_near(found[a], change[a], 1e-9);
    }
}

/* A point on the wall stays on it, and the error of the distance to any plane point that
 * the covariance tells is the same in both frames. */
static void a_moved_wall_is_the_same_wall(void **state)
{
    (void)state;
    const double up[3] = {0.0, 1.0, 0.0}, half = sqrt(0.5);
    const double r[3][3] = {{half, 0.0, half}, {0.0, 1.0, 0.0}, {-half, 0.0, half}};
    const double t[3] = {0.7, 0.0, -1.2};
    const struct wall w = {.normal = {0.6, 0.0, 0.8},
                           .distance_m = 2.0,
                           .covariance = {1e-3, 0.0, 2e-4, 2e-3, 0.0, 1e-3}};
    const double changes[3][3] = {{1e-5, 0, 0}, {0, 1e-5, 0}, {0, 0, 1e-5}};
    struct wall moved, back;
    wall_move(&w, up, r, t, &moved);
    double expected[6] = {0}, j[3][3];
    for (int k = 0; k < 3; k++) { /* the same change made before the move and after */
        struct wall other;
        wall_turn(&w, changes[k], &other);
        wall_move(&other, up, r, t, &other);
        double d[3];
        wall_difference(&moved, &other, d);
        for (int a = 0; a < 3; a++)
            j[a][k] = d[a] * 1e5;
    }
    const double full[3][3] = {{1e-3, 0, 2e-4}, {0, 2e-3, 0}, {2e-4, 0, 1e-3}};
    for (int a = 0, q = 0; a < 3; a++)
        for (int b = a; b < 3; b++, q++)
            for (int i = 0; i < 9; i++)
                expected[q] += j[a][i / 3] * full[i / 3][i % 3] * j[b][i % 3];
    for (int q = 0; q < 6; q++)
        assert_near(moved.covariance[q], expected[q], 1e-7);
    double on[3] = {1.2, 5.0, 1.6}, there[3];
    for (int a = 0; a < 3; a++)
        there[a] = dot(r[a], on) + t[a];
    assert_near(dot(moved.normal, there), moved.distance_m, 1e-12);
    const double inverse[3][3] = {{half, 0.0, -half}, {0.0, 1.0, 0.0}, {half, 0.0, half}};
    const double way_back[3] = {-half * (0.7 + 1.2), 0.0, -half * (0.7 - 1.2)};
    wall_move(&moved, up, inverse, way_back, &back);
    assert_near(back.distance_m, w.distance_m, 1e-12);
    for (int q = 0; q < 6; q++)
        assert_near(back.covariance[q], w.covariance[q], 1e-12);
}

/* Its mirror images have the same errors, whichever way the normal points. */
static void a_wall_is_the_same_from_both_sides(void **state)
{
    (void)state;
    const struct wall w = {.normal = {0.6, 0.48, -0.64},
                           .distance_m = -1.0,
                           .covariance = {1e-3, 3e-4, 2e-4, 2e-3, -1e-4, 1e-3}};
    struct wall other = w;
    double one[6], two[6];
    wall_face(&other);
    assert_near(other.distance_m, 1.0, 0.0);
    assert_near(other.normal[0], -0.6, 0.0);
    wall_mirror_covariance(&w, somewhere, covariance, one);
    wall_mirror_covariance(&other, somewhere, covariance, two);
    for (int q = 0; q < 6; q++)
        assert_near(two[q], one[q], 1e-15);
}

static void end_of(const struct wall *w, int k, double out[3])
{
    double upright[3], level[3];
    wall_axes(w, upright, level);
    for (int a = 0; a < 3; a++)
        out[a] = w->distance_m * w->normal[a] + w->ends_m[k] * level[a];
}

/* The ends, as places, move as every place does, also where the frame turns far or the
 * normal turns about; of the vehicle's frame up is z. */
static void the_ends_of_a_wall_move_with_it(void **state)
{
    (void)state;
    static const double up[3] = {0, 1, 0}, vehicle_up[3] = {0, 0, 1};
    static const double to_array[3][3] = {{0, -1, 0}, {0, 0, 1}, {1, 0, 0}};
    const double t[3] = {0.7, 0.3, -1.2};
    for (int step = 0; step < 24; step++) {
        double yaw = 0.26 * step, c = cos(yaw), s = sin(yaw);
        const double r[3][3] = {{c, 0, s}, {0, 1, 0}, {-s, 0, c}};
        struct wall w = {.normal = {0.6, 0, 0.8}, .distance_m = 2, .ends_m = {-1, 2.5}};
        for (int vehicle = 0; vehicle < 2; vehicle++) {
            double place[2][3], moved[2][3];
            if (vehicle)
                w.normal[1] = 0.8, w.normal[2] = 0;
            for (int k = 0; k < 2; k++) {
                double level[3] = {-0.8, 0, 0.6};
                if (vehicle) /* level = normal x upright = (.6 .8 0) x (0 0 1) */
                    level[0] = 0.8, level[1] = -0.6, level[2] = 0;
                for (int a = 0; a < 3; a++)
                    place[k][a] = 2 * w.normal[a] + w.ends_m[k] * level[a];
            }
            struct wall out;
            const double(*m)[3] = vehicle ? to_array : r;
            wall_move(&w, vehicle ? vehicle_up : up, m, t, &out);
            for (int k = 0; k < 2; k++)
                for (int a = 0; a < 3; a++)
                    moved[k][a] = dot(m[a], place[k]) + t[a];
            for (int faced = 0; faced < 2; faced++) {
                double ends[2][3];
                end_of(&out, 0, ends[0]);
                end_of(&out, 1, ends[1]);
                bool same = fabs(ends[0][0] - moved[0][0]) < 1e-9 &&
                            fabs(ends[0][2] - moved[0][2]) < 1e-9;
                assert_true(out.ends_m[0] < out.ends_m[1]);
                for (int a = 0; a < 3; a += 2) {
                    assert_near(ends[0][a], moved[same ? 0 : 1][a], 1e-12);
                    assert_near(ends[1][a], moved[same ? 1 : 0][a], 1e-12);
                }
                wall_face(&out);
                assert_true(out.distance_m >= 0);
            }
        }
    }
    struct wall endless = {.normal = {0.6, 0, 0.8}, .distance_m = 2};
    wall_move(&endless, up, to_array, t, &endless);
    endless.distance_m = -1;
    wall_face(&endless);
    assert_false(wall_ends(&endless));
}

/* A wall across the way at 2 m, its level axis is -x: from x = -1 to 0.5. */
static void how_far_beyond_an_end_is_told_along_the_wall(void **state)
{
    (void)state;
    const struct wall w = {.normal = {0, 0, 1}, .distance_m = 2, .ends_m = {-0.5, 1}};
    const struct wall endless = {.normal = {0, 0, 1}, .distance_m = 2};
    assert_near(wall_beyond_end_m(&w, (const double[3]){0.75, 3, 2}), 0.25, 1e-15);
    assert_near(wall_beyond_end_m(&w, (const double[3]){-2, 0, 2}), 1.0, 1e-15);
    assert_near(wall_beyond_end_m(&w, (const double[3]){0, 0, 2}), -0.5, 1e-15);
    assert_true(wall_beyond_end_m(&endless, (const double[3]){1e6, 0, 2}) < 0);
}

/* Two pieces of a wall at 2 m, with an opening of 2 m from x = 1 on, and one behind it at
 * 3 m: ways to images at 4 m cross the front at half of their x. */
static void a_wall_mirrors_between_its_ends_and_little_beyond(void **state)
{
    (void)state;
    const double from[3] = {0, 0, 0};
    const struct wall_gate walls[3] = {
        {1, {.normal = {0, 0, 1}, .distance_m = 2, .ends_m = {-1, 3}}, {0, 20}},
        {2, {.normal = {0, 0, 1}, .distance_m = 2, .ends_m = {-5, -3}}, {0, 20}},
        {3, {.normal = {0, 0, 1}, .distance_m = 3, .ends_m = {-4, 4}}, {0, 20}}};
    const double on_first[3] = {1.8, 0, 4}, past[3] = {2.8, 0, 4};
    const double through[3] = {4, 0, 4}, on_second[3] = {6.2, 0, 4};
    const double beyond[3] = {-8, 0, 4};
    assert_int_equal(wall_that_mirrored(walls, 2, from, on_first), 0);
    assert_int_equal(wall_that_mirrored(walls, 2, from, past), 0); /* by 0.4 m */
    assert_int_equal(wall_that_mirrored(walls, 2, from, through), 2);
    assert_int_equal(wall_that_mirrored(walls, 2, from, on_second), 1);
    assert_int_equal(wall_that_mirrored(walls, 2, from, beyond), 2);
    /* who stands in the opening's middle stands before the third one */
    assert_int_equal(wall_that_mirrored(walls, 3, from, through), 2);
    assert_int_equal(wall_that_mirrored(walls, 3, from, past), 2); /* at x = 2.1 */
    assert_int_equal(wall_that_mirrored(walls, 3, from, on_first), 0);
}

static void the_first_wall_on_the_way_mirrored_it(void **state)
{
    (void)state;
    const double from[3] = {0.0, 0.0, 0.0};
    const struct wall_gate walls[2] = {
        {1, {.normal = {0, 0, 1}, .distance_m = 3.0}, {0.0, 10.0}},
        {2, {.normal = {1, 0, 0}, .distance_m = 1.0}, {0.0, 4.0}}};
    const double ahead[3] = {0.0, 0.0, 5.0}, before[3] = {0.0, 0.0, 2.0};
    const double aside[3] = {2.0, 0.0, 3.2}, far_aside[3] = {3.0, 0.0, 4.0};
    assert_int_equal(wall_that_mirrored(walls, 2, from, ahead), 0);
    assert_int_equal(wall_that_mirrored(walls, 2, from, before), 2);
    assert_int_equal(wall_that_mirrored(walls, 2, from, aside), 1);
    assert_int_equal(wall_that_mirrored(walls, 2, from, far_aside), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_behind_an_upright_wall_comes_out_in_front_of_it),
        cmocka_unit_test(the_wall_stands_halfway_and_square_to_the_way),
        cmocka_unit_test(mirrored_twice_is_back),
        cmocka_unit_test(distances_stay),
        cmocka_unit_test(a_point_on_the_wall_stays),
        cmocka_unit_test(a_covariance_turns_with_its_point),
        cmocka_unit_test(a_wall_across_x_turns_the_signs_of_xy_and_xz),
        cmocka_unit_test(points_and_covariance_agree),
        cmocka_unit_test(the_error_of_the_wall_is_in_the_error_of_the_object),
        cmocka_unit_test(the_axes_are_right_handed_and_upright_is_up),
        cmocka_unit_test(a_turn_is_undone_by_the_difference),
        cmocka_unit_test(a_moved_wall_is_the_same_wall),
        cmocka_unit_test(a_wall_is_the_same_from_both_sides),
        cmocka_unit_test(the_ends_of_a_wall_move_with_it),
        cmocka_unit_test(how_far_beyond_an_end_is_told_along_the_wall),
        cmocka_unit_test(a_wall_mirrors_between_its_ends_and_little_beyond),
        cmocka_unit_test(the_first_wall_on_the_way_mirrored_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
