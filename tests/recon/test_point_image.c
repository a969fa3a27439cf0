/* SPDX-License-Identifier: MIT */
/* The image of a point that a survey promises, against a sum over all pairs and
 * frequencies in double precision. */
#include "tests/recon/near.h"

#include <complex.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/pool.h"
#include "recon/planning/point_image.h"
#include "tests/recon/planned.h"

#define LINES 40

static struct point_image image_of(const struct survey *s, const double at_m[3])
{
    struct point_image p;
    struct error why = {""};
    struct pool *pool;
    assert_int_equal(pool_create(&pool, 2), 0);
    if (point_image(&p, s, at_m, pool, &why))
        fail_msg("%s", why.text);
    pool_destroy(pool);
    return p;
}

static double distance(const double a[3], double x_m, const double b[3])
{
    return sqrt(pow(a[0] + x_m - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

/* |sum| at a place of the echoes of a point, with the weight of recon/coherent/fk.h on
 * frequencies and each midpoint once: pairs of one sum of y share one. */
static double amplitude(const struct survey *s, const double point_m[3],
                        const double at_m[3])
{
    double complex sum = 0.0;
    for (size_t k = 0; k < s->n_positions; k++)
        for (size_t j = 0; j < s->n_speakers; j++)
            for (size_t i = 0; i < s->n_microphones; i++) {
                double x_m = s->stage_positions_m[k], share = 0.0;
                double way = distance(s->speakers_m[j], x_m, point_m) +
                             distance(s->microphones_m[i], x_m, point_m) -
                             distance(s->speakers_m[j], x_m, at_m) -
                             distance(s->microphones_m[i], x_m, at_m);
                for (size_t q = 0; q < s->n_speakers * s->n_microphones; q++)
                    share += q / s->n_microphones + q % s->n_microphones == i + j;
                for (int q = 0; q < LINES; q++) {
                    double part = (q + 0.5) / LINES, hz = 2000 + 18000 * part;
                    sum += sqrt(hz) * (0.5 - 0.5 * cos(2 * M_PI * part)) / share *
                           cexp(2 * M_PI * I * hz * way / s->sound_speed_m_s);
                }
            }
    return cabs(sum);
}

static void a_point_is_as_wide_as_the_sum_over_all_pairs(void **state)
{
    (void)state;
    struct survey s = planned_survey();
    const double at_m[3] = {0.2, 0.3, 1.4};
    struct point_image p = image_of(&s, at_m);
    double whole = amplitude(&s, at_m, at_m);
    for (int a = 0; a < 3; a++) {
        double beside_m[3] = {at_m[0], at_m[1], at_m[2]};
        assert_below(fabs(p.beside_m[a]), 1.5e-3);
        beside_m[a] += 0.5 * p.width_m[a];
        assert_near(20 * log10(amplitude(&s, at_m, beside_m) / whole), -6.0, 1.5);
    }
}

/* Positions 9 cm apart, waves of 2.7 cm: the next lobe is as bright where half of that
 * turns an angle, smeared by the band. */
static void sidelobes_are_those_of_the_sum_over_all_pairs(void **state)
{
    (void)state;
    struct survey s = planned_survey();
    const double at_m[3] = {0.1, 0.3, 1.4};
    double all_db = image_of(&s, at_m).sidelobe_db;
    survey_spread_positions(&s, 4);
    struct point_image p = image_of(&s, at_m);
    double whole = amplitude(&s, at_m, at_m), lobe = 0.0;
    for (int x = 0; x < 45; x++)
        for (int z = -8; z <= 8; z++) {
            double there_m[3] = {-0.5 + 0.03 * x, 0.3, 1.4 + 0.0075 * z};
            if (fabs(there_m[0] - at_m[0]) > POINT_LOBE * p.width_m[0])
                lobe = fmax(lobe, amplitude(&s, at_m, there_m));
        }
    assert_near(p.sidelobe_db, 20 * log10(whole / lobe), 1.0);
    assert_below(p.sidelobe_db, all_db - 6);
}

/* A stage that goes on at 12 cm/s: two slots of 62.5 ms a round. */
static void a_stage_that_goes_on_leaves_it_where_it_is(void **state)
{
    (void)state;
    struct survey s = planned_survey();
    const double at_m[3] = {0.25, 0.25, 1.25}; /* about the middle of the gate */
    struct point_image rests = image_of(&s, at_m), goes;
    s.continuous = s.chirp_alternates = true;
    s.together = 2;
    assert_near(survey_speed_m_s(&s), 0.12, 1e-9);
    goes = image_of(&s, at_m);
    for (int a = 0; a < 3; a++) {
        assert_near(goes.beside_m[a], rests.beside_m[a], 1e-3);
        assert_near(goes.width_m[a] / rests.width_m[a], 1.0, 0.06);
    }
    assert_near(goes.traces / rests.traces, 1.0, 1e-6);
}

/* Of 8 x 4 pairs on 11 midpoints 4 have one, two, three pairs, and 5 have four. */
static void noise_is_that_of_pairs_that_share_midpoints(void **state)
{
    (void)state;
    struct survey s = planned_survey();
    double squares = 2 * (1.0 + 1.0 / 2 + 1.0 / 3) + 5 * (1.0 / 4);
    struct point_image p = image_of(&s, (double[3]){0.2, 0.3, 1.4});
    assert_near(p.traces, 12 * 11.0 * 11.0 / squares, 1e-3);
}

static void what_is_not_before_the_array_is_refused(void **state)
{
    (void)state;
    static const double wrong_m[][3] = {{0.2, 0.3, 0.1}, {3.0, 0.3, 1.4}, {0.2, 0.3, 6}};
    struct survey s = planned_survey();
    struct point_image p;
    struct error why;
    struct pool *pool;
    assert_int_equal(pool_create(&pool, 1), 0);
    s.has_volume = true;
    memcpy(s.volume_m, (double[3][3]){{-0.5, 1, 0.02}, {-0.5, 1, 0.02}, {0.5, 2, 0.01}},
           sizeof s.volume_m);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(point_image(&p, &s, wrong_m[i], pool, &why), -EINVAL);
        assert_true(strstr(why.text, "point at") || strstr(why.text, "gate"));
    }
    pool_destroy(pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_is_as_wide_as_the_sum_over_all_pairs),
        cmocka_unit_test(sidelobes_are_those_of_the_sum_over_all_pairs),
        cmocka_unit_test(a_stage_that_goes_on_leaves_it_where_it_is),
        cmocka_unit_test(noise_is_that_of_pairs_that_share_midpoints),
        cmocka_unit_test(what_is_not_before_the_array_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
