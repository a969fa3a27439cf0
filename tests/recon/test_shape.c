/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdbool.h>

#include "recon/detection/shape.h"

static const double width_m[3] = {0.10, 0.10, 0.02};

enum { N = 60 };

/* A segment of some length about 0, seen at x with a Gaussian of width 2.3548. */
static double blurred(double x, double length)
{
    double half = 0.5 * length;

    return length > 0.0 ? erf((x + half) / M_SQRT2) - erf((x - half) / M_SQRT2)
                        : exp(-0.5 * x * x);
}

/* A box, or a segment along x that is turned towards z, in Gaussian blur. */
static double amplitude(const double at_m[3], const double size_m[3], double turn)
{
    double x[3], length[3], along = 0.0, out = 1.0;

    for (int a = 0; a < 3; a++) {
        x[a] = at_m[a] * 2.3548 / width_m[a];
        length[a] = size_m[a] * 2.3548 / width_m[a];
    }
    if (turn > 0.0) {
        const double u[3] = {length[0] * cos(turn), 0.0,
                             size_m[0] * sin(turn) * 2.3548 / width_m[2]};
        length[0] = sqrt(u[0] * u[0] + u[2] * u[2]);
        along = (x[0] * u[0] + x[2] * u[2]) / length[0];
        x[2] = (x[2] * u[0] - x[0] * u[2]) / length[0];
        x[0] = along;
    }
    for (int a = 0; a < 3; a++)
        out *= blurred(x[a], length[a]);
    return out;
}

static void place(int v, bool flat, const double span_m[3], double at_m[3])
{
    const int i[3] = {v % N, flat ? N / 2 : v / N % N, v / (flat ? N : N * N)};

    for (int a = 0; a < 3; a++)
        at_m[a] = (i[a] - N / 2) * span_m[a] / N;
}

/* The variance of what is within 6 dB of the brightest; flat: without y. */
static void look(const double size_m[3], double turn, bool flat, double out[6])
{
    const int n = flat ? N * N : N * N * N;
    const double none[3] = {0.0, 0.0, 0.0};
    double span_m[3], sum = 0.0, first[3] = {0}, second[6] = {0};
    double peak = pow(amplitude(none, size_m, turn), 2.0);

    for (int a = 0; a < 3; a++)
        span_m[a] = 2.5 * width_m[a] + 1.5 * size_m[a] + 1.5 * turn * size_m[0];
    for (int v = 0; v < n; v++) {
        double at_m[3];
        place(v, flat, span_m, at_m);
        double power = pow(amplitude(at_m, size_m, turn), 2.0);
        if (power < peak / 4.0)
            continue;
        sum += power;
        for (int a = 0, e = 0; a < 3; a++) {
            first[a] += power * at_m[a];
            for (int b = a; b < 3; b++)
                second[e++] += power * at_m[a] * at_m[b];
        }
    }
    for (int a = 0, e = 0; a < 3; a++)
        for (int b = a; b < 3; b++, e++)
            out[e] = second[e] / sum - first[a] / sum * (first[b] / sum);
}

static struct shape_guess guess(double x, double y, double z, double turn, bool flat)
{
    const double size_m[3] = {x, y, z};
    double variance[6];

    look(size_m, turn, flat, variance);
    return shape_guess(variance, width_m);
}

static void assert_shape(struct shape_guess g, enum shape shape, double at_least)
{
    assert_int_equal(g.shape, shape);
    assert_true(g.probability >= at_least && g.probability <= 1.0);
}

static void a_point_is_a_point(void **state)
{
    (void)state;
    assert_shape(guess(0, 0, 0, 0, true), SHAPE_POINT, 0.9);
    assert_shape(guess(0, 0, 0, 0, false), SHAPE_POINT, 0.9);
}

static void a_wide_thin_thing_is_a_plate(void **state)
{
    (void)state;
    assert_shape(guess(0.35, 0, 0, 0.0, true), SHAPE_PLATE, 0.8);
    assert_shape(guess(0.35, 0, 0, 0.1, true), SHAPE_PLATE, 0.8);
    assert_shape(guess(0.35, 0.35, 0, 0.0, false), SHAPE_PLATE, 0.8);
}

static void a_thing_that_is_wide_and_deep_is_extended(void **state)
{
    (void)state;
    assert_shape(guess(0.35, 0, 0.1, 0.0, true), SHAPE_EXTENDED, 0.8);
    assert_shape(guess(0.35, 0.35, 0.1, 0.0, false), SHAPE_EXTENDED, 0.8);
}

/* Called the one or the other where it is about as long as a point is wide. */
static void between_them_it_changes_over_once(void **state)
{
    (void)state;
    double before = 1.0;

    for (double length_m = 0.0; length_m < 0.3; length_m += 0.02) {
        struct shape_guess g = guess(length_m, 0, 0, 0.0, true);
        double point = g.shape == SHAPE_POINT ? g.probability : 1.0 - g.probability;
        assert_true(point <= before + 1e-6);
        assert_true(length_m > 0.5 * width_m[0] || point > 0.5);
        assert_true(length_m < 2.0 * width_m[0] || point < 0.5);
        before = point;
    }
}

static void without_a_resolution_nothing_is_said(void **state)
{
    (void)state;
    const double variance[6] = {0.01, 0, 0, 0.0, 0, 0.0004};
    const double along_x[3] = {0.1, INFINITY, 0.0};

    assert_int_equal(shape_guess(variance, along_x).shape, SHAPE_UNKNOWN);
    assert_true(shape_guess(variance, along_x).probability == 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_is_a_point),
        cmocka_unit_test(a_wide_thin_thing_is_a_plate),
        cmocka_unit_test(a_thing_that_is_wide_and_deep_is_extended),
        cmocka_unit_test(between_them_it_changes_over_once),
        cmocka_unit_test(without_a_resolution_nothing_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
