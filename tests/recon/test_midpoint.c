/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <string.h>

#include "recon/coherent/midpoint.h"
#include "tests/recon/rig.h"

static struct midpoints *sort(const struct geometry *g)
{
    struct midpoints *m = NULL;
    const char *why = "";
    int err = midpoints_create(&m, g, &why);
    if (err)
        fail_msg("midpoints_create: %s (%s)", strerror(-err), why);
    return m;
}

static void expect_refused(const struct geometry *g)
{
    struct midpoints *m = NULL;
    const char *why = NULL;
    assert_int_equal(midpoints_create(&m, g, &why), -ENOTSUP);
    assert_null(m);
    assert_non_null(why);
    assert_true(strlen(why) > 5);
}

static void expect_rising(const double *lines, size_t n)
{
    for (size_t q = 1; q < n; q++)
        assert_true(lines[q] > lines[q - 1]);
}

/* Every pair of every position is on the lines where its midpoint is, and has the
 * half-offset it has. */
static void expect_sorted(const struct geometry *g, const struct midpoints *m)
{
    assert_int_equal(m->n_pairs, g->n_speakers * g->n_microphones);
    expect_rising(m->x_m, m->nx);
    expect_rising(m->y_m, m->ny);
    expect_rising(m->half_offset_m, m->n_offsets);
    for (size_t q = 0; q < g->n_positions * m->n_pairs; q++) {
        size_t k = q / m->n_pairs, pair = q % m->n_pairs;
        double at[3], mic[3];
        geometry_speaker(g, k, pair / g->n_microphones, at);
        geometry_microphone(g, k, 0, pair % g->n_microphones, mic);
        assert_true(m->ix[q] < m->nx && m->iy[q] < m->ny);
        assert_true(m->offset[pair] < m->n_offsets);
        assert_near(m->x_m[m->ix[q]], 0.5 * (at[0] + mic[0]), 1e-3);
        assert_near(m->y_m[m->iy[q]], 0.5 * (at[1] + mic[1]), 1e-3);
        assert_near(m->half_offset_m[m->offset[pair]],
                    0.5 * hypot(at[0] - mic[0], at[1] - mic[1]), 1e-4);
    }
}

static void a_straight_array_on_a_straight_stage_makes_a_lattice(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    struct midpoints *m = sort(&r.geometry);
    assert_int_equal(m->nx, 8);
    assert_int_equal(m->ny, 10);
    assert_near(m->plane_z_m, 0.0, 0.0);
    for (size_t q = 0; q < 8; q++)
        assert_near(m->x_m[q], 0.04 * ((double)q - 3.5), 1e-9);
    for (size_t q = 0; q < 10; q++)
        assert_near(m->y_m[q], 0.03 * ((double)q - 4.5), 1e-9);
    /* |s - m| / 2 = 0.03 |2 j - i - 1.5| for i, j in 0..3: 0.015 times 1 3 5 7 9. */
    assert_int_equal(m->n_offsets, 5);
    for (size_t q = 0; q < 5; q++)
        assert_near(m->half_offset_m[q], 0.015 * (2.0 * (double)q + 1.0), 1e-9);
    expect_sorted(&r.geometry, m);
    midpoints_destroy(m);
}

static void lines_may_be_uneven(void **state)
{
    (void)state;
    static const double mics_m[4] = {-0.31, -0.02, 0.055, 0.4};
    static const double stage_m[8] = {-0.3, -0.27, -0.2, 0.05, 0.06, 0.11, 0.19, 0.33};
    struct rig r;
    rig_default(&r);
    for (size_t e = 0; e < 4; e++)
        r.microphones_m[e][1] = mics_m[e];
    memcpy(r.positions_m, stage_m, sizeof stage_m);
    struct midpoints *m = sort(&r.geometry);
    assert_int_equal(m->nx, 8);
    assert_int_equal(m->ny, 16); /* no two of the sums of both lists are equal */
    expect_sorted(&r.geometry, m);
    midpoints_destroy(m);
}

static void a_stage_may_carry_a_plane_array(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    for (size_t e = 0; e < 4; e++) {
        r.speakers_m[e][0] = e % 2 ? 0.08 : 0.0;
        r.speakers_m[e][2] = r.microphones_m[e][2] = -0.4;
    }
    r.geometry.stage_axis[0] = -1.0;
    struct midpoints *m = sort(&r.geometry);
    assert_int_equal(m->nx, 9); /* half of 0.08 is one more step of the stage */
    assert_near(m->plane_z_m, -0.4, 1e-12);
    expect_sorted(&r.geometry, m);
    midpoints_destroy(m);
}

static void a_slanted_stage_is_sorted_too(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    r.geometry.stage_axis[0] = 0.8;
    r.geometry.stage_axis[1] = 0.6;
    struct midpoints *m = sort(&r.geometry);
    expect_sorted(&r.geometry, m);
    midpoints_destroy(m);
}

/* A survey by hand: a third of a millimetre is still the same line. */
static void small_errors_of_position_make_no_new_lines(void **state)
{
    (void)state;
    unsigned long long seed = 3;
    struct rig r;
    rig_default(&r);
    for (size_t e = 0; e < 4; e++) {
        for (int a = 0; a < 3; a++) {
            r.speakers_m[e][a] += 3e-4 * (2.0 * reference_random(&seed) - 1.0);
            r.microphones_m[e][a] += 3e-4 * (2.0 * reference_random(&seed) - 1.0);
        }
    }
    struct midpoints *m = sort(&r.geometry);
    assert_int_equal(m->nx, 8);
    assert_int_equal(m->ny, 10);
    expect_sorted(&r.geometry, m);
    midpoints_destroy(m);
}

static void one_pair_is_one_midpoint(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    r.geometry.n_speakers = r.geometry.n_microphones = r.geometry.n_positions = 1;
    struct midpoints *m = sort(&r.geometry);
    assert_int_equal(m->nx, 1);
    assert_int_equal(m->ny, 1);
    assert_int_equal(m->n_offsets, 1);
    expect_sorted(&r.geometry, m);
    midpoints_destroy(m);
}

static void co_located_pairs_have_no_offset(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    memcpy(r.speakers_m, r.microphones_m, sizeof r.speakers_m);
    struct midpoints *m = sort(&r.geometry);
    for (size_t e = 0; e < 4; e++)
        assert_near(m->half_offset_m[m->offset[5 * e]], 0.0, 1e-12);
    midpoints_destroy(m);
}

static void an_array_that_is_not_plane_is_refused_with_a_reason(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    r.speakers_m[2][2] = 0.05;
    expect_refused(&r.geometry);
    rig_default(&r);
    r.microphones_m[3][2] = -0.01;
    expect_refused(&r.geometry);
    rig_default(&r);
    r.geometry.stage_axis[0] = 0.8;
    r.geometry.stage_axis[2] = 0.6;
    expect_refused(&r.geometry);
}

/* 2 cm on a metre are 5 mm from end to end of this stage, on the way there and back a
 * half of the shortest wave, 17 mm; half a millimetre on a metre is none of it. */
static void a_stage_that_leaves_the_plane_is_refused(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    r.geometry.stage_axis[2] = -0.02;
    expect_refused(&r.geometry);
    r.geometry.stage_axis[2] = -0.0005;
    midpoints_destroy(sort(&r.geometry));
}

static void elements_strewn_over_the_plane_are_refused_with_a_reason(void **state)
{
    (void)state;
    unsigned long long seed = 9;
    double speakers_m[40][3] = {{0}}, microphones_m[40][3] = {{0}};
    const double at_m[1] = {0.0};
    for (size_t e = 0; e < 40; e++) {
        for (int a = 0; a < 2; a++) {
            speakers_m[e][a] = 40.0 * reference_random(&seed);
            microphones_m[e][a] = 40.0 * reference_random(&seed);
        }
    }
    const struct geometry g = {
        .sound_speed_m_s = 343.0,
        .n_speakers = 40,
        .n_microphones = 40,
        .n_positions = 1,
        .speakers_m = (const double(*)[3])speakers_m,
        .microphones_m = (const double(*)[3])microphones_m,
        .stage_axis = {1.0, 0.0, 0.0},
        .stage_positions_m = at_m,
    };
    expect_refused(&g);
}

static void destroying_nothing_is_harmless(void **state)
{
    (void)state;
    midpoints_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_straight_array_on_a_straight_stage_makes_a_lattice),
        cmocka_unit_test(lines_may_be_uneven),
        cmocka_unit_test(a_stage_may_carry_a_plane_array),
        cmocka_unit_test(a_slanted_stage_is_sorted_too),
        cmocka_unit_test(small_errors_of_position_make_no_new_lines),
        cmocka_unit_test(one_pair_is_one_midpoint),
        cmocka_unit_test(co_located_pairs_have_no_offset),
        cmocka_unit_test(an_array_that_is_not_plane_is_refused_with_a_reason),
        cmocka_unit_test(a_stage_that_leaves_the_plane_is_refused),
        cmocka_unit_test(elements_strewn_over_the_plane_are_refused_with_a_reason),
        cmocka_unit_test(destroying_nothing_is_harmless),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
