/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/fold.h"
#include "recon/planning/probe.h"
#include "tests/recon/rig.h"

/* Pairs of all of 9 places 1 m along y, at 9 places 1 m along x, around the origin. */
static void lay_out(struct rig *r)
{
    rig_default(r);
    r->geometry.n_speakers = r->geometry.n_microphones = 9;
    r->geometry.n_positions = 9;
    for (int i = 0; i < 9; i++) {
        memset(r->speakers_m[i], 0, sizeof r->speakers_m[i]);
        r->speakers_m[i][1] = i / 8.0 - 0.5;
        memcpy(r->microphones_m[i], r->speakers_m[i], sizeof r->speakers_m[i]);
        r->positions_m[i] = i / 8.0 - 0.5;
    }
}

static void measure(const struct rig *r, const double at_m[3], double tilt[2])
{
    float *weight;
    assert_int_equal(fold_weights(&r->geometry, &weight), 0);
    psf_tilt(&r->geometry, weight, r->band_hz, at_m, tilt);
    free(weight);
}

/* The image of a point, summed pair by pair and frequency by frequency; each midpoint
 * counts once. */
static double intensity(const struct rig *r, const double at_m[3],
                        const double voxel_m[3])
{
    const struct geometry *g = &r->geometry;
    double complex sum = 0.0;
    for (size_t k = 0; k < g->n_positions; k++)
        for (size_t q = 0; q < g->n_speakers * g->n_microphones; q++) {
            double s[3], m[3];
            geometry_speaker(g, k, q / g->n_microphones, s);
            geometry_microphone(g, k, 0, q % g->n_microphones, m);
            double late_m = geometry_distance(at_m, s) + geometry_distance(at_m, m) -
                            geometry_distance(voxel_m, s) - geometry_distance(voxel_m, m);
            double fold = 9.0 - fabs((double)(q / 9 + q % 9) - 8.0);
            for (int f = 1; f < 24; f++) {
                double hz = r->band_hz[0] + (r->band_hz[1] - r->band_hz[0]) * f / 24.0;
                double turns = hz * late_m / g->sound_speed_m_s;
                sum += (0.5 - 0.5 * cos(2.0 * M_PI * f / 24.0)) *
                       cexp(2.0 * M_PI * I * turns) / fold;
            }
        }
    return creal(sum * conj(sum));
}

/* Where along an axis a plane dz behind the point is brightest: a parabola through three
 * logarithms 4 mm apart, around a first guess. */
static double brightest(const struct rig *r, const double at_m[3], double dz_m, int axis,
                        double guess_m)
{
    double level[3], step_m = 0.004;
    for (int i = 0; i < 3; i++) {
        double voxel_m[3] = {at_m[0], at_m[1], at_m[2] + dz_m};
        voxel_m[axis] += guess_m + step_m * (i - 1);
        level[i] = log(intensity(r, at_m, voxel_m));
    }
    return guess_m +
           step_m * 0.5 * (level[0] - level[2]) / (level[0] - 2.0 * level[1] + level[2]);
}

static void a_point_straight_ahead_does_not_lean(void **state)
{
    static const double ahead_m[3] = {0.0, 0.0, 2.0};
    struct rig r;
    double tilt[2];
    (void)state;
    lay_out(&r);
    measure(&r, ahead_m, tilt);
    assert_near(tilt[0], 0.0, 1e-9);
    assert_near(tilt[1], 0.0, 1e-9);
}

/* Along x alone, as y is level there. */
static void planes_beside_a_point_have_their_maximum_beside_it(void **state)
{
    static const double aside_m[3] = {0.4, 0.0, 2.0};
    struct rig r;
    double tilt[2], dz_m = 0.003;
    (void)state;
    lay_out(&r);
    measure(&r, aside_m, tilt);
    double shift_m = brightest(&r, aside_m, dz_m, 0, tilt[0] * dz_m);
    assert_true(fabs(shift_m) > 3e-4);
    assert_near(tilt[0] * dz_m, shift_m, 0.1 * fabs(shift_m));
    assert_near(tilt[1], 0.0, 1e-9);
}

/* Midpoints are a square, but for their pitch. */
static void both_axes_lean_alike_where_the_array_is_alike(void **state)
{
    static const double aside_m[3] = {0.3, -0.3, 2.0};
    struct rig r;
    double tilt[2];
    (void)state;
    lay_out(&r);
    measure(&r, aside_m, tilt);
    assert_true(tilt[0] < -0.1);
    assert_near(tilt[0], -tilt[1], 0.2 * fabs(tilt[0]));
}

static void an_axis_without_extent_does_not_lean(void **state)
{
    static const double aside_m[3] = {0.4, 0.0, 2.0};
    struct rig r;
    double tilt[2];
    (void)state;
    lay_out(&r);
    r.geometry.n_speakers = r.geometry.n_microphones = 1;
    r.speakers_m[0][1] = r.microphones_m[0][1] = 0.0;
    measure(&r, aside_m, tilt);
    assert_true(tilt[0] < -0.1);
    assert_near(tilt[1], 0.0, 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_straight_ahead_does_not_lean),
        cmocka_unit_test(planes_beside_a_point_have_their_maximum_beside_it),
        cmocka_unit_test(both_axes_lean_alike_where_the_array_is_alike),
        cmocka_unit_test(an_axis_without_extent_does_not_lean),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
