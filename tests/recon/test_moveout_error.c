/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/fold.h"
#include "recon/planning/moveout_error.h"
#include "tests/recon/rig.h"

static void measure(const struct rig *r, const double at_m[3], double centre_hz,
                    double shift_m[3], double *rest)
{
    float *weight;
    assert_int_equal(fold_weights(&r->geometry, &weight), 0);
    moveout_error(&r->geometry, weight, at_m, centre_hz, shift_m, rest);
    free(weight);
}

static void what_is_straight_ahead_is_not_shifted_sideways(void **state)
{
    (void)state;
    struct rig r;
    double shift_m[3], rest, low[3], high[3];
    rig_default(&r);
    geometry_aperture(&r.geometry, low, high);
    const double at_m[3] = {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 1.5};
    measure(&r, at_m, 11000.0, shift_m, &rest);
    assert_near(shift_m[0], 0.0, 1e-6);
    assert_near(shift_m[1], 0.0, 1e-6);
}

static void co_located_pairs_need_no_moveout(void **state)
{
    (void)state;
    struct rig r;
    double shift_m[3], rest;
    rig_default(&r);
    r.geometry.n_speakers = r.geometry.n_microphones = 1;
    memcpy(r.microphones_m[0], r.speakers_m[0], sizeof r.speakers_m[0]);
    measure(&r, (const double[3]){0.2, 0.3, 0.6}, 11000.0, shift_m, &rest);
    for (int a = 0; a < 3; a++)
        assert_near(shift_m[a], 0.0, 1e-9);
    assert_near(rest, 0.0, 1e-6);
}

/* h^2 sin(a)^2 / r of path for one pair, where h is small against r. */
static void a_lone_pair_leaves_what_the_series_says(void **state)
{
    (void)state;
    struct rig r;
    double shift_m[3], rest;
    rig_default(&r);
    r.geometry.n_speakers = r.geometry.n_microphones = r.geometry.n_positions = 1;
    const double speaker[3] = {0.0, -0.1, 0.0}, microphone[3] = {0.0, 0.1, 0.0};
    memcpy(r.speakers_m[0], speaker, sizeof speaker);
    memcpy(r.microphones_m[0], microphone, sizeof microphone);
    r.positions_m[0] = 0.0;
    const double at_m[3] = {0.0, 1.0, 1.0};
    measure(&r, at_m, 11000.0, shift_m, &rest);
    double path = 0.1 * 0.1 * 0.5 / sqrt(2.0);
    /* The place takes all of it up along the line of sight: half a path is a range. */
    double along = (shift_m[1] + shift_m[2]) * M_SQRT1_2;
    assert_near(fabs(along) / (0.5 * path), 1.0, 0.05);
    assert_near(rest, 0.0, 1e-3);
}

/* What migration of moved echoes shows at a place: each midpoint's mean over its pairs, a
 * Hann-windowed band. */
static double migrated(const struct rig *r, const double point[3], const double at[3])
{
    double complex sum = 0.0;
    for (size_t k = 0; k < 8; k++) {
        for (size_t q = 0; q < 16; q++) {
            double s[3], m[3], middle[3];
            geometry_speaker(&r->geometry, k, q / 4, s);
            geometry_microphone(&r->geometry, k, 0, q % 4, m);
            for (int a = 0; a < 3; a++)
                middle[a] = 0.5 * (s[a] + m[a]);
            double path = reference_distance(point, s) + reference_distance(point, m);
            double offset = reference_distance(s, m);
            double rest = sqrt(path * path - offset * offset) -
                          2.0 * reference_distance(at, middle);
            double fold = 0.0;
            for (size_t p = 0; p < 16; p++)
                fold += fabs(r->speakers_m[p / 4][1] + r->microphones_m[p % 4][1] -
                             2.0 * middle[1]) < 1e-6;
            for (int f = 1; f < 36; f++) {
                double hz = r->band_hz[0] + f / 36.0 * (r->band_hz[1] - r->band_hz[0]);
                double weight = (0.5 - 0.5 * cos(2.0 * M_PI * f / 36.0)) / fold;
                sum += weight *
                       cexp(2.0 * M_PI * I * hz * rest / r->geometry.sound_speed_m_s);
            }
        }
    }
    return cabs(sum);
}

static void images_are_shifted_as_predicted(void **state)
{
    (void)state;
    struct rig r;
    const double point[3] = {0.05, 0.25, 0.75};
    double shift_m[3], rest, best = 0.0, found_m[2] = {0.0, 0.0};
    rig_default(&r);
    double centre_hz = 0.5 * (r.band_hz[0] + r.band_hz[1]);
    measure(&r, point, centre_hz, shift_m, &rest);
    for (int y = -12; y <= 12; y++) {
        for (int z = -6; z <= 6; z++) {
            const double at[3] = {point[0] + shift_m[0], point[1] + 2e-4 * y,
                                  point[2] + 2e-4 * z};
            double here = migrated(&r, point, at);
            if (here <= best)
                continue;
            best = here;
            found_m[0] = 2e-4 * y;
            found_m[1] = 2e-4 * z;
        }
    }
    assert_true(fabs(found_m[0]) > 0.001); /* else nothing is shown */
    assert_near(shift_m[1], found_m[0], 3e-4);
    assert_near(shift_m[2], found_m[1], 3e-4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_straight_ahead_is_not_shifted_sideways),
        cmocka_unit_test(co_located_pairs_need_no_moveout),
        cmocka_unit_test(a_lone_pair_leaves_what_the_series_says),
        cmocka_unit_test(images_are_shifted_as_predicted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
