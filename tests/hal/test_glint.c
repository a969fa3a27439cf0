/* SPDX-License-Identifier: MIT */
/* Where a smooth body is heard, against the geometry of balls and plates, and the path by
 * which sound takes the shortest way. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "hal/room/figure.h"
#include "hal/room/glint.h"
#include "hal/room/scene.h"

static struct glint_part whole(double a, double b, double c)
{
    return (struct glint_part){.half_axes = {{a, 0, 0}, {0, b, 0}, {0, 0, c}},
                               .from = {-1, -1, -1},
                               .to = {1, 1, 1}};
}

static double distance_m(const double a[3], const double b[3])
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

/* A ball is heard a radius before its middle, as a mirror of its radius. */
static void a_ball_is_heard_by_its_front(void **state)
{
    (void)state;
    const struct glint_part ball = whole(0.3, 0.3, 0.3);
    const double centre[3] = {1, 2, 5}, element[3] = {1, 2, 1};
    double at[3], length_m;
    assert_true(glint_find(&ball, centre, element, element, at, &length_m));
    assert_true(fabs(at[0] - 1) < 1e-9 && fabs(at[1] - 2) < 1e-9);
    assert_true(fabs(at[2] - 4.7) < 1e-9);
    assert_true(fabs(length_m - 1 / (2 / 3.7 + 2 / 0.3)) < 1e-9);
}

/* From far away what is left are the radii of curvature: b c / 2 a, seen along a. */
static void an_ellipsoid_is_as_strong_as_it_is_flat(void **state)
{
    (void)state;
    const struct glint_part egg = whole(0.1, 0.2, 0.3);
    const double centre[3] = {0, 0, 0}, far[3] = {1e5, 0, 0};
    double at[3], length_m;
    assert_true(glint_find(&egg, centre, far, far, at, &length_m));
    assert_true(fabs(at[0] - 0.1) < 1e-9);
    assert_true(fabs(length_m - 0.2 * 0.3 / (2 * 0.1)) < 1e-5);
}

/* A plate whose bulge is nothing mirrors: its image is as far behind it. */
static void what_is_flat_is_a_mirror(void **state)
{
    (void)state;
    struct glint_part plate = whole(1e-6, 30, 30);
    const double centre[3] = {0, 0, 0}, a[3] = {2, 0.3, 0}, b[3] = {3, -0.5, 0};
    double at[3], length_m;
    assert_true(glint_find(&plate, centre, a, b, at, &length_m));
    /* The line from a to b's image at x = -3 meets x = 0 two fifths of the way on. */
    assert_true(fabs(at[0]) < 1e-5 && fabs(at[1] - (0.3 - 0.8 * 2 / 5)) < 1e-3);
    double r = distance_m(at, a), s = distance_m(at, b);
    assert_true(fabs(length_m - r * s / (r + s)) < 1e-3);
    plate.from[1] = -0.0005; /* 15 mm of it to either side: the place is at -20 mm */
    plate.to[1] = 0.0005;
    assert_true(fabs(at[1] + 0.02) < 1e-3);
    assert_false(glint_find(&plate, centre, a, b, at, &length_m));
}

static const struct glint_part askew = {
    .half_axes = {{0.1, 0.05, 0}, {-0.1, 0.2, 0}, {0, 0, 1.5}},
    .from = {-1, -1, -1},
    .to = {1, 1, 1}};
static const double askew_centre[3] = {0.2, 0.1, 3};

/* A place of it, by longitude and latitude of the ball that it is stretched from. */
static void askew_place(double longitude, double latitude, double out[3])
{
    const double ball[3] = {cos(longitude) * cos(latitude),
                            sin(longitude) * cos(latitude), sin(latitude)};
    memcpy(out, askew_centre, sizeof askew_centre);
    for (int k = 0; k < 9; k++)
        out[k % 3] += ball[k / 3] * askew.half_axes[k / 3][k % 3];
}

/* Fermat: no other place of the body that both see is on a shorter way. */
static void the_way_by_the_glint_is_the_shortest(void **state)
{
    (void)state;
    const double a[3] = {1.2, 0.4, 0.1}, b[3] = {0.3, -0.9, 0};
    double at[3], length_m;
    assert_true(glint_find(&askew, askew_centre, a, b, at, &length_m));
    double least_m = distance_m(a, at) + distance_m(at, b);
    for (int i = 0; i < 400; i++)
        for (int j = 0; j < 200; j++) {
            double q[3];
            askew_place(M_PI * i / 200, M_PI * (j / 200.0 - 0.5), q);
            assert_true(distance_m(a, q) + distance_m(q, b) > least_m - 1e-4);
        }
}

/* What the integral of exp(ik way) over the surface is around where the way is shortest
 * (stationary phase): cos / sqrt(det H), H the second derivatives of the way along the
 * surface, by differences of half a milliradian. */
static double stationary_m(const double a[3], const double b[3], const double at[3])
{
    double ball[3] = {0, 0, 0}, way_m[3][3], p[3][3][3], h = 5e-4, first[3] = {0, 0, 0};
    for (int k = 0; k < 9; k++) {
        const double *axis = askew.half_axes[k / 3];
        ball[k / 3] += (at[k % 3] - askew_centre[k % 3]) * axis[k % 3] /
                       (axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    }
    for (int i = 0; i < 9; i++) {
        double *q = p[i / 3][i % 3];
        askew_place(atan2(ball[1], ball[0]) + (i / 3 - 1) * h,
                    asin(ball[2]) + (i % 3 - 1) * h, q);
        way_m[i / 3][i % 3] = distance_m(a, q) + distance_m(q, b);
    }
    double uu = way_m[2][1] - 2 * way_m[1][1] + way_m[0][1];
    double vv = way_m[1][2] - 2 * way_m[1][1] + way_m[1][0];
    double uv = (way_m[2][2] - way_m[2][0] - way_m[0][2] + way_m[0][0]) / 4;
    for (int k = 0; k < 3; k++) { /* of the surface itself */
        double u = (p[2][1][k] - p[0][1][k]) / 2, v = (p[1][2][k] - p[1][0][k]) / 2;
        first[0] += u * u;
        first[1] += v * v;
        first[2] += u * v;
    }
    double in_m = distance_m(a, at), out_m = distance_m(at, b), both = 0;
    for (int k = 0; k < 3; k++) /* unit vectors: the sum is 2 cos long */
        both += pow((a[k] - at[k]) / in_m + (b[k] - at[k]) / out_m, 2);
    return sqrt(both) / 2 *
           sqrt((first[0] * first[1] - first[2] * first[2]) / (uu * vv - uv * uv));
}

/* Heard where it came from, and 27 degrees to the side of that, and the other way about:
 * there the curvatures are those of small angles, which the sides take a thousandth off.
 */
static void it_is_as_strong_as_its_surface_is_curved(void **state)
{
    static const double places[4][3] = {
        {1.2, 0.4, 0.1}, {0.3, -0.9, 0}, {-2, 1, 2}, {0.5, 3, 4.4}};
    double at[3], length_m;
    (void)state;
    for (int i = 0; i < 4; i++) {
        assert_true(
            glint_find(&askew, askew_centre, places[i], places[i], at, &length_m));
        assert_true(fabs(length_m / stationary_m(places[i], places[i], at) - 1) < 1e-4);
    }
    for (int i = 0; i < 2; i++) {
        const double *a = places[i], *b = places[!i];
        assert_true(glint_find(&askew, askew_centre, a, b, at, &length_m));
        assert_true(fabs(length_m / stationary_m(a, b, at) - 1) < 2e-3);
    }
}

static void what_is_behind_a_part_is_hidden(void **state)
{
    (void)state;
    const struct glint_part ball = whole(0.3, 0.3, 0.3);
    const double centre[3] = {0, 0, 2}, here[3] = {0, 0, 0};
    const double behind[3] = {0, 0.1, 3}, beside[3] = {0, 0.5, 3},
                 before[3] = {0, 0, 1.6};
    assert_true(glint_hides(&ball, centre, here, behind));
    assert_false(glint_hides(&ball, centre, here, beside));
    assert_false(glint_hides(&ball, centre, here, before));
}

/* The incoherent sum of what a body shows to an array at 4 m, over all headings, is as
 * strong as the body is said to be, within 3 dB; and all of it is its near side. */
static void a_body_shows_its_near_side(void **state)
{
    static const struct {
        int kind;
        double length_m, half_m; /* of its outline, along the way that is looked */
    } bodies[] = {{SCENE_PERSON, 0.14, 0.15}, {SCENE_CYCLIST, 0.2, 0.25}};
    (void)state;
    for (size_t i = 0; i < sizeof bodies / sizeof *bodies; i++) {
        size_t n = figure_size(bodies[i].kind, true);
        double power = 0;
        assert_true(n <= FIGURE_MAX);
        for (int turn = 0; turn < 32; turn++) {
            struct scatter_piece pieces[FIGURE_MAX];
            struct glint_part parts[FIGURE_MAX];
            double angle = 2 * M_PI * turn / 32;
            const struct figure_pose pose = {.heading = {cos(angle), 0, sin(angle)},
                                             .up = {0, 1, 0},
                                             .walked_m = 0.05 * turn};
            const double element[3] = {0, -0.47, -4};
            figure_set_opaque(bodies[i].kind, &pose, bodies[i].length_m, pieces, parts);
            double nearest = 0;
            for (size_t k = 0; k < n; k++) {
                double at[3], length_m = 1;
                memcpy(at, pieces[k].in, sizeof at);
                if (glint_is_part(&parts[k]) &&
                    !glint_find(&parts[k], pieces[k].in, element, element, at, &length_m))
                    continue;
                bool hidden = false;
                for (size_t j = 0; j < n && glint_is_part(&parts[k]); j++)
                    hidden |= j != k && glint_is_whole(&parts[j]) &&
                              glint_hides(&parts[j], pieces[j].in, at, element);
                if (hidden)
                    continue;
                power += pow(length_m * pieces[k].weight, 2) / 32;
                nearest = fmin(nearest, at[2]);
            }
            assert_true(nearest < -0.08);
        }
        double db = 10 * log10(power / pow(bodies[i].length_m, 2));
        if (fabs(db) > 3)
            fail_msg("%s: %.1f dB", scene_kind_name(bodies[i].kind), db);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_ball_is_heard_by_its_front),
        cmocka_unit_test(an_ellipsoid_is_as_strong_as_it_is_flat),
        cmocka_unit_test(what_is_flat_is_a_mirror),
        cmocka_unit_test(the_way_by_the_glint_is_the_shortest),
        cmocka_unit_test(it_is_as_strong_as_its_surface_is_curved),
        cmocka_unit_test(what_is_behind_a_part_is_hidden),
        cmocka_unit_test(a_body_shows_its_near_side),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
