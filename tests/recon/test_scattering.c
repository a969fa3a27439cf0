/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/planning/scattering.h"
#include "tests/recon/reference.h"

#define NX 32
#define NY 31
#define NR 300

static const struct scattering_config lattice = {NX, NY,  1.0 / 31, 1.0 / 30,
                                                 NR, 1.8, 0.005};

/* Adds an echo of a range to one measurement: as wide as a chirp's. */
static void add_echo(float *trace, double range_m, double level)
{
    for (size_t n = 0; n < NR; n++) {
        double u = (lattice.range_m + lattice.range_step_m * (double)n - range_m) / 0.007;
        trace[n] += (float)(level * exp(-u * u));
    }
}

static double x_of(size_t x)
{
    return (double)x / 31.0 - 0.5;
}

static double y_of(size_t y)
{
    return (double)y / 30.0 - 0.5;
}

static void add_point(float *power, double x_m, double y_m, double z_m, double level)
{
    for (size_t y = 0; y < NY; y++)
        for (size_t x = 0; x < NX; x++)
            add_echo(power + (y * NX + x) * NR,
                     sqrt(pow(x_of(x) - x_m, 2.0) + pow(y_of(y) - y_m, 2.0) + z_m * z_m),
                     level);
}

/* A mirror z = distance - x tan(tilt), of infinite extent: range is the distance to it.
 */
static void add_mirror(float *power, double distance_m, double tilt)
{
    for (size_t y = 0; y < NY; y++)
        for (size_t x = 0; x < NX; x++)
            add_echo(power + (y * NX + x) * NR, (distance_m - x_of(x) * sin(tilt)), 1.0);
}

static void measure(const float *power, struct scattering *out)
{
    static float scratch[2 * NX * NY];
    scattering_measure(&lattice, power, scratch, out);
}

static float *silence(void)
{
    float *power = calloc(NX * NY * NR, sizeof *power);
    assert_non_null(power);
    return power;
}

static void a_point_bends_by_one(void **state)
{
    (void)state;
    static const double places[3][3] = {{0, 0, 2.0}, {0.3, -0.2, 2.6}, {-0.4, 0.4, 3.0}};
    for (int q = 0; q < 3; q++) {
        float *power = silence();
        struct scattering s;
        add_point(power, places[q][0], places[q][1], places[q][2], 1.0);
        measure(power, &s);
        /* Seen at a slant the hyperbola is flatter: cos^2 of the angle in its plane. */
        assert_near(s.bend, 0.97, 0.04);
        assert_near(s.share, 1.0, 0.01);
        free(power);
    }
}

static void the_stronger_of_two_points_counts_for_more(void **state)
{
    (void)state;
    float *power = silence();
    struct scattering s;
    add_point(power, -0.3, 0.0, 2.0, 1.0);
    add_point(power, 0.3, 0.1, 2.6, 0.1);
    measure(power, &s);
    assert_near(s.bend, 0.97, 0.04);
    free(power);
}

static void a_mirror_does_not_bend_but_shifts_with_its_tilt(void **state)
{
    (void)state;
    static const double tilts[3] = {0.0, 0.07, -0.2};
    for (int q = 0; q < 3; q++) {
        float *power = silence();
        struct scattering s;
        add_mirror(power, 2.4, tilts[q]);
        measure(power, &s);
        assert_near(s.bend, 0.0, 0.03);
        assert_near(s.shift_m, 2.4 * fabs(sin(tilts[q])), 0.01);
        free(power);
    }
}

static void gain_does_not_matter(void **state)
{
    (void)state;
    float *power = silence();
    struct scattering one, scaled;
    add_point(power, 0.1, 0.1, 2.2, 1.0);
    measure(power, &one);
    for (int q = -1; q <= 1; q += 2) {
        float gain = q < 0 ? 1e-24f : 1e24f;
        float *other = silence();
        for (size_t n = 0; n < NX * NY * NR; n++)
            other[n] = gain * power[n];
        measure(other, &scaled);
        assert_near(scaled.bend, one.bend, 1e-3);
        free(other);
    }
    free(power);
}

static void silence_and_bad_numbers_have_no_surface(void **state)
{
    (void)state;
    static const float bad[3] = {0.0f, NAN, INFINITY};
    for (int q = 0; q < 3; q++) {
        float *power = silence();
        struct scattering s;
        for (size_t n = 0; n < NX * NY * NR; n++)
            power[n] = bad[q];
        measure(power, &s);
        assert_near(s.share, 0.0, 0.0);
        assert_near(s.bend, 0.0, 0.0);
        free(power);
    }
}

/* Ranges that jump by more than the resolution from place to place. */
static void what_is_rough_has_no_surface(void **state)
{
    (void)state;
    unsigned long long seed = 3;
    float *power = silence();
    struct scattering s;
    for (size_t q = 0; q < NX * NY; q++)
        add_echo(power + q * NR, 2.0 + 0.06 * reference_random(&seed), 1.0);
    measure(power, &s);
    assert_below(s.share, 0.01);
    free(power);
}

static void one_line_of_measurements_is_enough(void **state)
{
    (void)state;
    static float power[NX * NR], scratch[2 * NX];
    struct scattering_config cfg = lattice;
    struct scattering s;
    cfg.ny = 1;
    memset(power, 0, sizeof power);
    for (size_t x = 0; x < NX; x++)
        add_echo(power + x * NR, hypot(x_of(x), 2.2), 1.0);
    scattering_measure(&cfg, power, scratch, &s);
    assert_near(s.bend, 0.98, 0.04);
    cfg.nx = 2;
    scattering_measure(&cfg, power, scratch, &s);
    assert_near(s.share, 0.0, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_bends_by_one),
        cmocka_unit_test(the_stronger_of_two_points_counts_for_more),
        cmocka_unit_test(a_mirror_does_not_bend_but_shifts_with_its_tilt),
        cmocka_unit_test(gain_does_not_matter),
        cmocka_unit_test(silence_and_bad_numbers_have_no_surface),
        cmocka_unit_test(what_is_rough_has_no_surface),
        cmocka_unit_test(one_line_of_measurements_is_enough),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
