/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/geometry.h"
#include "tests/recon/reference.h"

struct elements {
    double speakers_m[3][3], microphones_m[5][3], positions_m[4];
};

static void scatter_elements(struct elements *e, struct geometry *g)
{
    unsigned long long seed = 7;
    double *all = (double *)e;
    for (size_t q = 0; q < sizeof *e / sizeof *all; q++)
        all[q] = 2.0 * reference_random(&seed) - 1.0;
    *g = (struct geometry){
        .sound_speed_m_s = 343.0,
        .n_speakers = 3,
        .n_microphones = 5,
        .n_positions = 4,
        .speakers_m = (const double(*)[3])e->speakers_m,
        .microphones_m = (const double(*)[3])e->microphones_m,
        .stage_axis = {0.6, 0.0, -0.8},
        .stage_positions_m = e->positions_m,
    };
}

static void elements_ride_along_the_stage_axis(void **state)
{
    (void)state;
    struct elements e;
    struct geometry g;
    scatter_elements(&e, &g);
    for (size_t k = 0; k < 4; k++) {
        double s[3], m[3];
        geometry_speaker(&g, k, 2, s);
        geometry_microphone(&g, k, 0, 4, m);
        double d = e.positions_m[k];
        const double by[3] = {0.6 * d, 0.0, -0.8 * d};
        for (int a = 0; a < 3; a++) {
            assert_near(s[a], e.speakers_m[2][a] + by[a], 1e-15);
            assert_near(m[a], e.microphones_m[4][a] + by[a], 1e-15);
        }
    }
}

static void traces_count_microphones_then_speakers_then_positions(void **state)
{
    (void)state;
    struct elements e;
    struct geometry g;
    size_t trace = 0;
    scatter_elements(&e, &g);
    for (size_t k = 0; k < 4; k++) {
        for (size_t i = 0; i < 3; i++) {
            for (size_t j = 0; j < 5; j++, trace++) {
                double s[3], m[3];
                const double by[3] = {0.6 * e.positions_m[k], 0.0,
                                      -0.8 * e.positions_m[k]};
                geometry_pair(&g, trace, s, m);
                for (int a = 0; a < 3; a++) {
                    assert_near(s[a], e.speakers_m[i][a] + by[a], 1e-15);
                    assert_near(m[a], e.microphones_m[j][a] + by[a], 1e-15);
                }
            }
        }
    }
}

static void the_aperture_is_that_of_all_midpoints(void **state)
{
    (void)state;
    struct elements e;
    struct geometry g;
    scatter_elements(&e, &g);
    double min[3], max[3];
    geometry_aperture(&g, min, max);
    for (int a = 0; a < 3; a++) {
        double low = INFINITY, high = -INFINITY;
        for (size_t q = 0; q < 3 * 5 * 4; q++) {
            double middle = 0.5 * (e.speakers_m[q / 20][a] + e.microphones_m[q % 5][a]) +
                            g.stage_axis[a] * e.positions_m[q / 5 % 4];
            low = fmin(low, middle);
            high = fmax(high, middle);
        }
        assert_near(min[a], low, 1e-12);
        assert_near(max[a], high, 1e-12);
    }
}

static void one_pair_has_an_aperture_of_a_point(void **state)
{
    (void)state;
    struct elements e;
    struct geometry g;
    scatter_elements(&e, &g);
    g.n_speakers = g.n_microphones = g.n_positions = 1;
    double min[3], max[3];
    geometry_aperture(&g, min, max);
    for (int a = 0; a < 3; a++) {
        double middle = 0.5 * (e.speakers_m[0][a] + e.microphones_m[0][a]) +
                        g.stage_axis[a] * e.positions_m[0];
        assert_near(min[a], middle, 1e-15);
        assert_near(max[a], middle, 1e-15);
    }
}

static void a_copy_lives_without_its_original(void **state)
{
    (void)state;
    struct elements e, kept;
    struct geometry g, copy;
    scatter_elements(&e, &g);
    kept = e;
    assert_int_equal(geometry_copy(&copy, &g), 0);
    memset(&e, 0, sizeof e);
    memset(&g, 0, sizeof g);
    assert_int_equal(copy.n_speakers, 3);
    assert_int_equal(copy.n_microphones, 5);
    assert_int_equal(copy.n_positions, 4);
    assert_near(copy.sound_speed_m_s, 343.0, 0.0);
    assert_near(copy.stage_axis[2], -0.8, 0.0);
    assert_memory_equal(copy.speakers_m, kept.speakers_m, sizeof kept.speakers_m);
    assert_memory_equal(copy.microphones_m, kept.microphones_m,
                        sizeof kept.microphones_m);
    assert_memory_equal(copy.stage_positions_m, kept.positions_m,
                        sizeof kept.positions_m);
    geometry_clear(&copy);
}

static void clearing_twice_is_harmless(void **state)
{
    (void)state;
    struct elements e;
    struct geometry g, copy;
    scatter_elements(&e, &g);
    assert_int_equal(geometry_copy(&copy, &g), 0);
    geometry_clear(&copy);
    assert_null(copy.speakers_m);
    assert_null(copy.microphones_m);
    assert_null(copy.stage_positions_m);
    assert_int_equal(copy.n_speakers, 0);
    geometry_clear(&copy);
}

static void a_geometry_without_elements_can_be_copied(void **state)
{
    (void)state;
    struct geometry nothing = {.sound_speed_m_s = 343.0}, copy;
    assert_int_equal(geometry_copy(&copy, &nothing), 0);
    assert_int_equal(copy.n_speakers, 0);
    geometry_clear(&copy);
}

static void steps_that_go_into_the_stages_are_counted(void **state)
{
    (void)state;
    double positions_m[5] = {0.1, 0.13, 0.16, 0.19, 0.22};
    struct geometry g = {.n_positions = 5,
                         .stage_axis = {1.0, 0.0, 0.0},
                         .stage_positions_m = positions_m};
    assert_int_equal(geometry_stage_stride(&g, 0.03), 1);
    assert_int_equal(geometry_stage_stride(&g, 0.01), 3);
    assert_int_equal(geometry_stage_stride(&g, 0.02), 0); /* 1.5 of them */
    assert_int_equal(geometry_stage_stride(&g, 0.1), 0);
    positions_m[2] += 0.0005; /* an uneven stage */
    assert_int_equal(geometry_stage_stride(&g, 0.01), 0);
    positions_m[2] -= 0.0005;
    g.n_positions = 1;
    assert_int_equal(geometry_stage_stride(&g, 0.01), 0);
    g.n_positions = 5;
    g.stage_axis[0] = 0.0;
    g.stage_axis[1] = 1.0;
    assert_int_equal(geometry_stage_stride(&g, 0.01), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(elements_ride_along_the_stage_axis),
        cmocka_unit_test(traces_count_microphones_then_speakers_then_positions),
        cmocka_unit_test(the_aperture_is_that_of_all_midpoints),
        cmocka_unit_test(one_pair_has_an_aperture_of_a_point),
        cmocka_unit_test(a_copy_lives_without_its_original),
        cmocka_unit_test(clearing_twice_is_harmless),
        cmocka_unit_test(a_geometry_without_elements_can_be_copied),
        cmocka_unit_test(steps_that_go_into_the_stages_are_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
