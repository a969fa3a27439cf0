/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "recon/detection/plane.h"
#include "tests/recon/dice.h"
#include "tests/recon/rig.h"

#define DEGREE (M_PI / 180.0)

enum { NX = 12, NY = 10 };

/* Speaker and microphone 3 cm apart, carried over 1.1 x 0.9 m: each ping has its own
 * places.  2 to 6 kHz, ranges 0.7 to 2.5 m. */
struct scene {
    double pings_m[NX * NY][2][3];
    struct geometry geometry;
    struct trace_set set;
    float complex *traces;
    bool heard[NX * NY];
    double normal[3], distance_m;
};

static const double band_hz[2] = {2000.0, 6000.0};

static void open_scene(struct scene *s, size_t ny)
{
    for (size_t q = 0; q < NX * ny; q++) {
        double x = 0.1 * ((double)(q % NX) - 5.5), y = 0.1 * ((double)(q / NX) - 4.5);
        for (int e = 0; e < 2; e++) {
            s->pings_m[q][e][0] = x + 0.03 * e;
            s->pings_m[q][e][1] = ny > 1 ? y : 0.0;
            s->pings_m[q][e][2] = 0.0;
        }
        s->heard[q] = true;
    }
    s->geometry = (struct geometry){.sound_speed_m_s = 343.0,
                                    .n_speakers = 1,
                                    .n_microphones = 1,
                                    .n_positions = NX * ny,
                                    .pings_m = (const double(*)[2][3])s->pings_m};
    s->set = (struct trace_set){
        .geometry = &s->geometry,
        .format = {.t0_s = 1.4 / 343.0, .rate_hz = 12000.0, .carrier_hz = 4000.0},
        .band_hz = {band_hz[0], band_hz[1]},
        .heard = s->heard};
    s->set.format.n_samples = (size_t)(3.6 / 343.0 * 12000.0);
    s->traces = calloc(NX * ny * s->set.format.n_samples, sizeof *s->traces);
    assert_non_null(s->traces);
    s->set.traces = s->traces;
}

static void close_scene(struct scene *s)
{
    free(s->traces);
}

/* One arrival in a trace, in double precision. */
static void add_echo(struct scene *s, size_t q, double path_m, double gain)
{
    const struct trace_format *f = &s->set.format;

    for (size_t n = 0; n < f->n_samples; n++) {
        double t = f->t0_s + (double)n / f->rate_hz;
        double complex e = reference_echo(band_hz, f->carrier_hz, path_m / 343.0, t);
        s->traces[q * f->n_samples + n] += (float complex)(gain * e);
    }
}

/* From the speaker to the mirror image of the microphone. */
static double mirrored_path_m(const struct scene *s, size_t q)
{
    double image[3], off_m = -s->distance_m;

    for (int a = 0; a < 3; a++)
        off_m += s->normal[a] * s->pings_m[q][1][a];
    for (int a = 0; a < 3; a++)
        image[a] = s->pings_m[q][1][a] - 2.0 * off_m * s->normal[a];
    return reference_distance(s->pings_m[q][0], image);
}

static void set_plate(struct scene *s, double distance_m, double x_rad, double y_rad)
{
    double length = sqrt(1.0 + tan(x_rad) * tan(x_rad) + tan(y_rad) * tan(y_rad));

    s->normal[0] = tan(x_rad) / length;
    s->normal[1] = tan(y_rad) / length;
    s->normal[2] = 1.0 / length;
    s->distance_m = distance_m;
}

static void hear_plate(struct scene *s, double noise)
{
    unsigned long long seed = 5;
    size_t n = s->geometry.n_positions * s->set.format.n_samples;

    for (size_t q = 0; q < s->geometry.n_positions; q++)
        add_echo(s, q, mirrored_path_m(s, q), 1.0);
    for (size_t i = 0; i < n; i++) {
        double re = dice_normal(&seed), im = dice_normal(&seed);
        s->traces[i] += (float)noise * ((float)re + (float)im * I);
    }
}

static double distance_of(const struct plane *p)
{
    double sum = 0.0;

    for (int a = 0; a < 3; a++)
        sum += p->normal[a] * p->object.position_m[a];
    return sum;
}

static void expect_plate(const struct scene *s, const struct plane *p, double error_m)
{
    assert_true(fabs(distance_of(p) - s->distance_m) < error_m);
    for (int a = 0; a < 2; a++)
        assert_true(fabs(asin(p->normal[a]) - asin(s->normal[a])) < 0.1 * DEGREE);
}

/* Noise of 1/100 moves a peak of 4 kHz bandwidth by some 0.1 mm, of 120 by a tenth. */
static void a_plate_is_one_plane_where_it_stands(void **state)
{
    (void)state;
    static const double tilts[3][2] = {{0.17, -0.08}, {3.0, -2.0}, {0.0, 0.0}};
    struct plane plane;
    struct scene s;

    for (int i = 0; i < 3; i++) {
        open_scene(&s, NY);
        set_plate(&s, 1.26, tilts[i][0] * DEGREE, tilts[i][1] * DEGREE);
        hear_plate(&s, 0.01);
        assert_int_equal(plane_fit(&plane, &s.set, false), 0);
        expect_plate(&s, &plane, 1e-3);
        assert_int_equal(plane.object.shape.shape, SHAPE_PLATE);
        assert_true(plane.object.existence > 0.9);
        /* what mirrors is as large as the aperture: 1.1 x 0.9 m */
        assert_true(fabs(plane.object.extent_m[0] - 1.1) < 0.02);
        assert_true(fabs(plane.object.extent_m[1] - 0.9) < 0.02);
        close_scene(&s);
    }
}

/* Its errors: the speed of sound's 0.1 % across, anywhere along. */
static void a_plane_is_known_across_and_not_along(void **state)
{
    (void)state;
    struct plane plane;
    struct scene s;

    open_scene(&s, NY);
    set_plate(&s, 1.26, 0.0, 0.0);
    hear_plate(&s, 0.01);
    assert_int_equal(plane_fit(&plane, &s.set, false), 0);
    assert_true(fabs(sqrt(plane.object.covariance_m2[5]) - 1.26e-3) < 1e-4);
    assert_true(fabs(sqrt(plane.object.covariance_m2[0]) - 1.1 / sqrt(12.0)) < 0.01);
    assert_true(fabs(sqrt(plane.object.covariance_m2[3]) - 0.9 / sqrt(12.0)) < 0.01);
    close_scene(&s);
}

static void a_point_bends_too_much_for_a_plane(void **state)
{
    (void)state;
    const double at_m[3] = {0.1, 0.05, 1.26};
    struct plane plane;
    struct scene s;

    open_scene(&s, NY);
    for (size_t q = 0; q < s.geometry.n_positions; q++)
        add_echo(&s, q,
                 reference_distance(s.pings_m[q][0], at_m) +
                     reference_distance(s.pings_m[q][1], at_m),
                 1.0);
    assert_int_equal(plane_fit(&plane, &s.set, false), -ERANGE);
    close_scene(&s);
}

/* Half of the aperture looks past its end. */
static void a_plate_that_ends_in_view_is_left_to_its_image(void **state)
{
    (void)state;
    struct plane plane;
    struct scene s;

    open_scene(&s, NY);
    set_plate(&s, 1.26, 0.0, 0.0);
    for (size_t q = 0; q < s.geometry.n_positions; q++)
        add_echo(&s, q, mirrored_path_m(&s, q), q % NX < 6 ? 1.0 : 0.1);
    assert_int_equal(plane_fit(&plane, &s.set, false), -ERANGE);
    close_scene(&s);
}

static void noise_and_a_line_show_no_plane(void **state)
{
    (void)state;
    struct plane plane;
    struct scene s;

    open_scene(&s, NY);
    set_plate(&s, 9.0, 0.0, 0.0); /* beyond what was recorded */
    hear_plate(&s, 1.0);
    assert_int_equal(plane_fit(&plane, &s.set, false), -ERANGE);
    close_scene(&s);
    open_scene(&s, 1);
    set_plate(&s, 1.26, 0.0, 0.0);
    hear_plate(&s, 0.01);
    assert_int_equal(plane_fit(&plane, &s.set, false), -ERANGE);
    close_scene(&s);
}

/* Of the plane -30 dB are left; a point 0.4 m before it keeps its echo. */
static void what_stands_before_a_plane_is_not_muted_with_it(void **state)
{
    (void)state;
    struct plane plane;
    struct scene s;
    double left = 0.0, whole = 0.0;

    open_scene(&s, NY);
    set_plate(&s, 1.6, 0.0, 0.0);
    hear_plate(&s, 0.0);
    assert_int_equal(plane_fit(&plane, &s.set, false), 0);
    size_t n = s.geometry.n_positions * s.set.format.n_samples;
    for (size_t i = 0; i < n; i++)
        whole += creal(s.traces[i] * conj(s.traces[i]));
    plane_mute(&plane, &s.set, s.traces);
    for (size_t i = 0; i < n; i++)
        left += creal(s.traces[i] * conj(s.traces[i]));
    assert_true(left < 1e-3 * whole);
    double before = left;
    for (size_t q = 0; q < s.geometry.n_positions; q++)
        add_echo(&s, q, 1.8, 0.3);
    plane_mute(&plane, &s.set, s.traces);
    left = 0.0;
    for (size_t i = 0; i < n; i++)
        left += creal(s.traces[i] * conj(s.traces[i]));
    assert_true(left - before > 0.95 * 0.09 * whole);
    close_scene(&s);
}

/* A tone burst of 0.5 ms with an even top: it arrives when it has risen, half a pulse
 * before its middle; a sample is 14 mm of range. */
static void a_burst_arrives_when_it_rises(void **state)
{
    (void)state;
    struct plane plane;
    struct scene s;

    open_scene(&s, NY);
    set_plate(&s, 1.26, 0.0, 0.0);
    for (size_t q = 0; q < s.geometry.n_positions; q++)
        for (size_t n = 0; n < s.set.format.n_samples; n++) {
            double t = s.set.format.t0_s + (double)n / s.set.format.rate_hz -
                       mirrored_path_m(&s, q) / 343.0;
            s.traces[q * s.set.format.n_samples + n] =
                (float)(0.5 * (erf(t / 6e-5) - erf((t - 5e-4) / 6e-5)));
        }
    assert_int_equal(plane_fit(&plane, &s.set, true), 0);
    expect_plate(&s, &plane, 3e-3);
    assert_true(fabs(plane.pulse_s - 5e-4) < 5e-5);
    plane_mute(&plane, &s.set, s.traces);
    for (size_t i = 0; i < s.geometry.n_positions * s.set.format.n_samples; i++)
        assert_true(cabsf(s.traces[i]) < 0.01f);
    close_scene(&s);
}

static void behind_and_beside_are_told_apart(void **state)
{
    (void)state;
    struct plane plane;
    struct scene s;

    open_scene(&s, NY);
    set_plate(&s, 1.26, 0.0, 0.0);
    hear_plate(&s, 0.0);
    assert_int_equal(plane_fit(&plane, &s.set, false), 0);
    assert_true(fabs(plane_behind_m(&plane, (const double[3]){0.3, 0.1, 1.5}) - 0.24) <
                1e-3);
    assert_true(plane_covers(&plane, (const double[3]){0.3, 0.1, 1.5}));
    assert_false(plane_covers(&plane, (const double[3]){0.8, 0.1, 1.5}));
    close_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plate_is_one_plane_where_it_stands),
        cmocka_unit_test(a_plane_is_known_across_and_not_along),
        cmocka_unit_test(a_point_bends_too_much_for_a_plane),
        cmocka_unit_test(a_plate_that_ends_in_view_is_left_to_its_image),
        cmocka_unit_test(noise_and_a_line_show_no_plane),
        cmocka_unit_test(what_stands_before_a_plane_is_not_muted_with_it),
        cmocka_unit_test(a_burst_arrives_when_it_rises),
        cmocka_unit_test(behind_and_beside_are_told_apart),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
