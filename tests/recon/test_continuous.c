/* SPDX-License-Identifier: MIT */
/* A stage that goes on while its speakers sound: where a survey says that pings are
 * taken, and images of echoes whose every frequency has its own place, in double
 * precision. */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/coherent/midpoint.h"
#include "recon/processing.h"
#include "tests/recon/rig.h"
#include "tests/recon/survey_example.h"

#define CHIRP_S   0.0625
#define SPEED_M_S 0.1
#define SLOT_S    0.1
#define SPECTRUM  200 /* lines of an echo's spectrum: unambiguous over 1.9 m */

/* <f^3> / <f^2> under Hann's window over 2 to 20 kHz, by summing. */
static double sharpest_hz(void)
{
    double sum2 = 0.0, sum3 = 0.0;
    for (int q = 1; q < 1000; q++) {
        double f = 2000.0 + 18.0 * q, w = 0.5 - 0.5 * cos(2.0 * M_PI * q / 1000.0);
        sum2 += w * f * f;
        sum3 += w * f * f * f;
    }
    return sum3 / sum2;
}

static double chirp_m(bool down)
{
    double part = (sharpest_hz() - 2000.0) / 18000.0;
    return SPEED_M_S * CHIRP_S * (down ? 1.0 - part : part);
}

/* Rounds of 4 slots of 0.1 s: 4 cm, as far as the rig's positions are apart. */
static void set_off(struct rig *r, bool alternates)
{
    rig_default(r);
    r->geometry.slot_m = SPEED_M_S * SLOT_S;
    r->geometry.chirp_m[0] = chirp_m(false);
    r->geometry.chirp_m[1] = chirp_m(alternates);
    r->geometry.echo_m = SPEED_M_S * 2.0 * 1.2 / 343.0;
    r->geometry.together = 1;
}

static double range_at(const double element[3], double stage_m, const double at[3])
{
    return sqrt(pow(element[0] + stage_m - at[0], 2.0) + pow(element[1] - at[1], 2.0) +
                pow(element[2] - at[2], 2.0));
}

/* What of a point is heard of a frequency that leaves so long after sample 0 of a ping.
 */
static double complex line_of(const struct rig *r, size_t position, size_t speaker,
                              size_t microphone, const struct scatterer *point,
                              double f_hz, double leaves_s)
{
    double c = r->geometry.sound_speed_m_s;
    double stage_m = r->positions_m[position] +
                     SPEED_M_S * (SLOT_S * (double)speaker + leaves_s);
    double there_m = range_at(r->speakers_m[speaker], stage_m, point->at_m), back_m = 0.0;
    for (int step = 0; step < 3; step++)
        back_m = range_at(r->microphones_m[microphone],
                          stage_m + SPEED_M_S * (there_m + back_m) / c, point->at_m);
    return point->gain / (there_m * back_m) *
           cexp(-2.0 * M_PI * I * f_hz * (there_m + back_m) / c);
}

static void moving_trace(const struct rig *r, size_t position, size_t speaker,
                         size_t microphone, bool down, const struct scatterer *point,
                         float complex *out)
{
    double complex lines[SPECTRUM], sum;
    for (int q = 0; q < SPECTRUM; q++) {
        double part = (double)q / SPECTRUM, f_hz = 2000.0 + 18000.0 * part;
        double leaves_s = CHIRP_S * (down ? 1.0 - part : part);
        lines[q] = (0.5 - 0.5 * cos(2.0 * M_PI * part)) * 2.0 / SPECTRUM *
                   line_of(r, position, speaker, microphone, point, f_hz, leaves_s);
    }
    for (size_t n = 0; n < r->format.n_samples; n++) {
        double t = r->format.t0_s + (double)n / r->format.rate_hz;
        sum = 0.0;
        for (int q = 0; q < SPECTRUM; q++) {
            double f_hz = 2000.0 + 18000.0 * q / SPECTRUM - r->format.carrier_hz;
            sum += lines[q] * cexp(2.0 * M_PI * I * f_hz * t);
        }
        out[n] = (float complex)sum;
    }
}

/* The image of a point, [grid] on the heap. */
static float *image_of(const struct rig *r, const char *method, bool alternates,
                       const struct scatterer *point)
{
    struct pool *pool;
    size_t n_m = r->geometry.n_microphones, n = r->format.n_samples;
    float complex *traces = malloc(n_m * n * sizeof *traces);
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    assert_true(traces && image);
    assert_int_equal(pool_create(&pool, 1), 0);
    struct imager *im = rig_imager(r, method, pool);
    for (size_t p = 0; p < r->geometry.n_positions * r->geometry.n_speakers; p++) {
        size_t j = p % r->geometry.n_speakers;
        for (size_t i = 0; i < n_m; i++)
            moving_trace(r, p / r->geometry.n_speakers, j, i, alternates && j % 2, point,
                         traces + i * n);
        assert_true(imager_add(im, p / r->geometry.n_speakers, j, traces, NULL));
    }
    imager_image(im, image);
    imager_destroy(im);
    pool_destroy(pool);
    free(traces);
    return image;
}

static const struct scatterer aside = {{0.12, -0.11, 1.3}, 1.0};

static void expect_where_it_is(const char *method, bool alternates, double within_m)
{
    struct rig r;
    struct peak_fit fit, rest;
    set_off(&r, alternates);
    rig_look_at(&r, 0.12, -0.11, 1.3, 15, 0.008);
    float *image = image_of(&r, method, alternates, &aside);
    float peak = rig_peak(&r, image, &fit);
    free(image);
    assert_near(fit.position_m[0], 0.12, within_m);
    assert_near(fit.position_m[1], -0.11, within_m);
    assert_near(fit.position_m[2], 1.3, within_m);
    /* As bright, to a quarter of a decibel, as of an array that stands. */
    memset(r.geometry.chirp_m, 0, sizeof r.geometry.chirp_m);
    r.geometry.slot_m = r.geometry.echo_m = 0.0;
    image = rig_image(&r, method, &aside, 1, 1);
    assert_near(10.0 * log10((double)(peak / rig_peak(&r, image, &rest))), 0.0, 0.25);
    free(image);
}

static void a_point_is_where_it_is(void **state)
{
    (void)state;
    expect_where_it_is("fast", false, 6e-4); /* without dip moveout */
    expect_where_it_is("backprojection", false, 3e-4);
}

static void chirps_up_and_down_agree_where_it_is(void **state)
{
    (void)state;
    expect_where_it_is("fast", true, 6e-4); /* without dip moveout */
    expect_where_it_is("backprojection", true, 3e-4);
}

/* Who takes the stage to stand finds it beside, half a round on, and fainter. */
static void an_array_that_is_taken_to_stand_sees_it_elsewhere(void **state)
{
    (void)state;
    struct rig r, standing;
    struct peak_fit fit;
    set_off(&r, false);
    rig_look_at(&r, 0.12, -0.11, 1.3, 15, 0.008);
    float *image = image_of(&r, "fast", false, &aside);
    float peak = rig_peak(&r, image, &fit);
    free(image);
    memcpy(&standing, &r, sizeof r);
    standing.geometry = geometry_standing(&r.geometry);
    image = image_of(&standing, "fast", false, &aside);
    assert_true(rig_peak(&standing, image, &fit) < 0.9f * peak);
    assert_true(fit.position_m[0] < 0.12 - 0.01);
    free(image);
}

/* Back-projection on whole voxels and voxel by voxel. */
static void both_ways_of_back_projection_agree(void **state)
{
    (void)state;
    struct rig r;
    float *image[2];
    set_off(&r, false);
    for (int way = 0; way < 2; way++) {
        rig_look_at(&r, 0.12, -0.11, 1.3, 9, 0.01); /* 4 voxels from place to place */
        r.positions_m[3] += way ? 2e-4 : 0.0;       /* or not */
        image[way] = image_of(&r, "backprojection", false, &aside);
    }
    assert_below(rig_difference(&r, image[0], image[1]), 0.02);
    free(image[0]);
    free(image[1]);
}

static void others_refuse_it(void **state)
{
    (void)state;
    struct rig r;
    struct pool *pool;
    struct imager *im = NULL;
    const char *why = "";
    set_off(&r, false);
    assert_int_equal(pool_create(&pool, 1), 0);
    for (const char *m = imager_methods(); *m; m += strlen(m) + 1) {
        bool can = !strcmp(m, "fast") || !strcmp(m, "backprojection") ||
                   !strcmp(m, "iterative");
        int err = rig_try(&r, m, pool, &im, &why);
        assert_int_equal(err, can ? 0 : -ENOTSUP);
        if (!err)
            imager_destroy(im);
        else
            assert_non_null(strstr(why, "stands"));
    }
    pool_destroy(pool);
}

static void each_speaker_has_midpoints_of_its_own(void **state)
{
    (void)state;
    struct rig r;
    struct midpoints *m;
    const char *why = "";
    set_off(&r, false);
    assert_int_equal(midpoints_create(&m, &r.geometry, &why), 0);
    assert_int_equal(m->n_places, 4);
    assert_int_equal(m->nx, 4 * 8);
    assert_int_equal(m->ny, 10);
    for (size_t q = 0; q < 8 * 16; q++) {
        double s[3], i[3];
        geometry_pair(&r.geometry, q, s, i);
        assert_near(m->x_m[m->ix[q]], 0.5 * (s[0] + i[0]), 1e-12);
        assert_near(m->y_m[m->iy[q]], 0.5 * (s[1] + i[1]), 1e-12);
        assert_true(m->ix[q] >= m->x_range[m->iy[q]][0]);
        assert_true(m->ix[q] < m->x_range[m->iy[q]][1]);
    }
    /* The lowest line is of the lowest speaker alone. */
    assert_int_equal(m->x_range[0][0], 0);
    assert_int_equal(m->x_range[0][1], 8);
    midpoints_destroy(m);
    r.geometry.stage_axis[0] = 0.8;
    r.geometry.stage_axis[1] = 0.6;
    assert_int_equal(midpoints_create(&m, &r.geometry, &why), -ENOTSUP);
}

/* 3 cm in a round of two slots of 62.5 ms: 24 cm/s. */
static void a_survey_says_where_its_pings_are_taken(void **state)
{
    (void)state;
    struct survey s = example();
    struct geometry g;
    double place[3], speed_m_s = 0.03 / (2 * 0.0625), c = s.sound_speed_m_s;
    s.continuous = true;
    assert_int_equal(survey_check(&s, NULL), 0);
    assert_near(survey_speed_m_s(&s), speed_m_s, 1e-12);
    assert_near(survey_duration_s(&s), 4 * 2 * 0.0625, 1e-12);
    processing_geometry(&g, &s);
    double leaves_s = 17.5 / 48000 +
                      0.0625 * (sharpest_hz() - s.chirp_start_hz) / 18000.0;
    geometry_speaker(&g, 2, 1, place);
    assert_near(place[0], 0.1 + 0.06 + speed_m_s * (0.0625 + leaves_s), 1e-6);
    geometry_microphone(&g, 2, 1, 0, place);
    double echo_s = (s.gate_m[0] + s.gate_m[1]) / c;
    assert_near(place[0], -0.1 + 0.06 + speed_m_s * (0.0625 + leaves_s + echo_s), 1e-6);
    s.continuous = false;
    processing_geometry(&g, &s);
    assert_true(survey_speed_m_s(&s) == 0.0);
    geometry_microphone(&g, 2, 1, 0, place);
    assert_near(place[0], -0.1 + 0.06, 1e-12);
}

/* Two that sound together leave from one slot, up and down. */
static void speakers_of_a_slot_differ_by_their_chirps(void **state)
{
    (void)state;
    struct survey s = example();
    struct geometry g;
    s.continuous = s.chirp_alternates = true;
    s.together = 2;
    assert_int_equal(survey_check(&s, NULL), 0);
    processing_geometry(&g, &s);
    double part = (sharpest_hz() - 2000.0) / 18000.0;
    assert_near(survey_speed_m_s(&s), 0.03 / 0.0625, 1e-12);
    assert_near(geometry_gone_on_m(&g, 0) - geometry_gone_on_m(&g, 1),
                0.03 * (2.0 * part - 1.0), 1e-6);
}

static void expect_refused(struct survey s, const char *says)
{
    struct error why = {""};
    s.continuous = true;
    assert_int_equal(survey_check(&s, &why), -EINVAL);
    if (!strstr(why.text, says))
        fail_msg("\"%s\" does not say \"%s\"", why.text, says);
}

static void what_a_stage_cannot_do_is_refused(void **state)
{
    (void)state;
    double uneven[4] = {0, 0.03, 0.0603, 0.09}, far[4] = {0, 0.07, 0.14, 0.21};
    struct survey s = example();
    s.stage_positions_m = uneven;
    expect_refused(s, "positions_m[2] is 0.0603");
    s.stage_positions_m = far;
    expect_refused(s, "0.56 m/s");
    s = example();
    s.n_positions = 1;
    expect_refused(s, "one position");
    s = example();
    s.slot_samples = 1440; /* 30 ms: a round of two is shorter than the chirp */
    expect_refused(s, "a round of 2 slots is over before");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_is_where_it_is),
        cmocka_unit_test(chirps_up_and_down_agree_where_it_is),
        cmocka_unit_test(an_array_that_is_taken_to_stand_sees_it_elsewhere),
        cmocka_unit_test(both_ways_of_back_projection_agree),
        cmocka_unit_test(others_refuse_it),
        cmocka_unit_test(each_speaker_has_midpoints_of_its_own),
        cmocka_unit_test(a_survey_says_where_its_pings_are_taken),
        cmocka_unit_test(speakers_of_a_slot_differ_by_their_chirps),
        cmocka_unit_test(what_a_stage_cannot_do_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
