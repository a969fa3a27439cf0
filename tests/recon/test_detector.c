/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdlib.h>

#include "recon/detection/detector.h"
#include "tests/recon/reference.h"

enum { NX = 160, NZ = 200, CELLS = NX * NZ, IMAGES = 12 };

static const struct grid grid = {{-1.6, 0, 0.5}, {0.02, 0.02, 0.02}, {NX, 1, NZ}};

static void start(struct detector *d)
{
    static double speakers[2][3] = {{-0.4, 0, 0}, {0.4, 0, 0}};
    static double microphones[4][3] = {
        {-0.5, 0, 0}, {-0.2, 0, 0}, {0.2, 0, 0}, {0.5, 0, 0}};
    const struct survey s = {.speakers_m = speakers,
                             .n_speakers = 2,
                             .microphones_m = microphones,
                             .n_microphones = 4,
                             .sample_rate_hz = 48000.0,
                             .sound_speed_m_s = 343.0,
                             .slot_samples = 1152,
                             .chirp_start_hz = 2000.0,
                             .chirp_stop_hz = 20000.0,
                             .chirp_duration_s = 0.02};
    const struct detector_config cfg = {.threshold_db = 12.0,
                                        .min_existence = 0.5,
                                        .cfar = CFAR_ORDERED,
                                        .false_alarm_rate = 1e-4};

    detector_init(d, &cfg);
    assert_int_equal(detector_survey(d, &s), 0);
}

static struct volume volume_of(const struct detector *d, const float *image,
                               uint32_t frame, bool standing_left)
{
    return (struct volume){.survey_id = d->survey_id,
                           .capture_ns = (int64_t)frame * 400000000,
                           .frame = frame,
                           .grid = grid,
                           .intensity = image,
                           .method = "frames",
                           .sound_speed_m_s = 343.0,
                           .pings_used = 8,
                           .pings_expected = 8,
                           .standing_left = standing_left};
}

/* x^spikes, x exponential of mean 1: with 1 a gamma distribution of shape 1. */
static void show(struct detector *d, uint32_t frame, double spikes, bool standing_left,
                 unsigned long long *seed)
{
    float *image = malloc(CELLS * sizeof *image);
    struct object_list list;
    struct error why;

    assert_non_null(image);
    for (size_t i = 0; i < CELLS; i++)
        image[i] = (float)pow(-log(reference_random(seed)), spikes);
    const struct volume v = volume_of(d, image, frame, standing_left);
    assert_int_equal(detector_volume(d, &v, NULL, &list, &why), 0);
    free(image);
}

/* A start, or a stop of the vehicle, does not tell what noise is where all that stands
 * was taken away. */
static void what_stands_makes_no_noise_where_it_was_taken_away(void **state)
{
    unsigned long long seed = 5;
    struct detector d;

    (void)state;
    start(&d);
    for (uint32_t i = 1; i <= IMAGES; i++)
        show(&d, i, i <= IMAGES / 2 ? 3.0 : 1.0, i <= IMAGES / 2, &seed);
    assert_near(cfar_noise(d.cells[0])->shape, 1.0, 0.1);
    assert_false(cfar_noise(d.cells[0])->heavy);
    assert_true(cfar_noise(d.cells[1])->shape < 0.6);
    detector_clear(&d);
}

/* A background begins with few pings: for a while it leaves of what stands. */
static void noise_is_not_learnt_while_a_background_begins(void **state)
{
    unsigned long long seed = 9;
    struct detector d;

    (void)state;
    start(&d);
    show(&d, 1, 3.0, true, &seed);
    assert_true(d.settling);
    show(&d, 1, 3.0, false, &seed); /* at the same time */
    assert_true(d.settling);
    assert_false(cfar_has_learnt(d.cells[0]));
    show(&d, 2, 1.0, false, &seed); /* 0.4 s later: over 7 rounds of 48 ms */
    assert_false(d.settling);
    assert_true(cfar_has_learnt(d.cells[0]));
    detector_clear(&d);
}

/* Noise, and a spot at x 0.4, z 2.0.  Free it. */
static float *draw_one_bright(void)
{
    unsigned long long seed = 3;
    float *image = malloc(CELLS * sizeof *image);

    assert_non_null(image);
    for (size_t i = 0; i < CELLS; i++)
        image[i] = (float)-log(reference_random(&seed));
    for (size_t z = 74; z <= 76; z++)
        for (size_t x = 99; x <= 101; x++)
            image[z * NX + x] = x == 100 && z == 75 ? 2000.0f : 500.0f;
    return image;
}

/* Beside one that stands out, and where nothing does. */
static void what_moves_is_an_object_where_it_does_not_stand_out(void **state)
{
    const struct volume_mover movers[3] = {
        {{0.4f, 0.0f, 2.0f}, {0.3f, 0.0f, -1.2f}, 20.0f},
        {{-0.6f, 0.0f, 0.8f + 1.6f}, {1.0f, 0.0f, 0.5f}, 12.0f},
        {{0.5f, 0.0f, 2.1f}, {-0.3f, 0.0f, 1.2f}, 15.0f}};
    const struct volume_mover ambiguous[2] = {
        {{0.4f, 0.0f, 2.0f}, {0.9f, 0.0f, -0.2f}, 90.0f},
        {{1.2f, 0.0f, 1.8f}, {0.2f, 0.0f, 0.7f}, 20.0f}};
    float *image = draw_one_bright();
    struct object_list list;
    struct error why;
    struct detector d;

    (void)state;
    start(&d);
    struct volume v = volume_of(&d, image, 1, true);
    const struct walls none = {.n = 0};
    assert_int_equal(detector_volume(&d, &v, &none, &list, &why), 0);
    assert_int_equal(list.n, 1);
    assert_false(list.objects[0].moves);
    v.movers = movers;
    v.n_movers = 3;
    assert_int_equal(detector_volume(&d, &v, &none, &list, &why), 0);
    assert_int_equal(list.n, 2);
    const struct object *bright = &list.objects[0], *faint = &list.objects[1];
    assert_true(bright->moves && faint->moves);
    assert_near(bright->course_m_s[0], 0.3, 1e-6); /* of the brighter one beside it */
    assert_near(bright->course_m_s[1], -1.2, 1e-6);
    assert_near(faint->virtual_m[0], -0.6, 1e-6);
    assert_near(faint->virtual_m[2], 2.4, 1e-6);
    assert_near(faint->existence, 0.5, 1e-6);
    assert_near(faint->level_db, 10.0 * log10(12.0), 1e-6);
    for (size_t i = 0; i < 2; i++)
        assert_true(list.objects[i].has_course);
    v.ambiguous = ambiguous; /* beside the first, and alone */
    v.n_ambiguous = 2;
    assert_int_equal(detector_volume(&d, &v, &none, &list, &why), 0);
    assert_int_equal(list.n, 3);
    assert_true(list.objects[0].moves);
    assert_near(list.objects[0].course_m_s[0], 0.3, 1e-6);
    assert_true(list.objects[2].has_course && !list.objects[2].moves);
    assert_near(list.objects[2].virtual_m[0], 1.2, 1e-6);
    assert_near(list.objects[2].course_m_s[1], 0.7, 1e-6);
    v.n_ambiguous = 0;
    const struct volume_mover here = {.power = 12.0f}; /* from outside, in the array */
    v.movers = &here;
    v.n_movers = 1;
    assert_int_equal(detector_volume(&d, &v, &none, &list, &why), 0);
    assert_int_equal(list.n, 2);
    for (int i = 0; i < 6; i++)
        assert_true(isfinite(list.objects[1].place.covariance_m2[i]));
    free(image);
    detector_clear(&d);
}

/* Of two that are near the brighter one; what stands out nowhere is none by that. */
static void what_stands_out_goes_along_the_course_that_is_told_there(void **state)
{
    const struct volume_course courses[3] = {
        {{{0.5f, 0.0f, 2.1f}, {-0.3f, 0.0f, 1.2f}, 15.0f}, 0.9f},
        {{{0.4f, 0.0f, 2.0f}, {3.0f, 0.0f, -2.0f}, 20.0f}, 0.75f},
        {{{-0.6f, 0.0f, 2.4f}, {1.0f, 0.0f, 0.5f}, 90.0f}, 0.97f}};
    float *image = draw_one_bright();
    struct object_list list;
    struct error why;
    struct detector d;

    (void)state;
    start(&d);
    struct volume v = volume_of(&d, image, 1, false);
    const struct walls none = {.n = 0};
    v.courses = courses;
    v.n_courses = 3;
    assert_int_equal(detector_volume(&d, &v, &none, &list, &why), 0);
    assert_int_equal(list.n, 1);
    const struct object *o = &list.objects[0];
    assert_true(o->has_course && !o->moves);
    assert_near(o->course_m_s[0], 3.0, 1e-6);
    assert_near(o->course_m_s[1], -2.0, 1e-6);
    assert_near(o->course_doubt, 0.25, 1e-6);
    free(image);
    detector_clear(&d);
}

/* What it had while it stood serves one that sets off, until more is known. */
static void one_that_sets_off_knows_noise_already(void **state)
{
    unsigned long long seed = 7;
    struct detector d;

    (void)state;
    start(&d);
    for (uint32_t i = 1; i <= IMAGES / 2; i++)
        show(&d, i, 3.0, false, &seed);
    assert_true(cfar_has_learnt(d.cells[1]));
    assert_true(cfar_noise(d.cells[1])->shape < 0.6);
    detector_clear(&d);
}

/* Within reach of two places. */
static void expect_held(const bool *held, const double at_m[2][3], double reach_m)
{
    for (size_t i = 0; i < CELLS; i++) {
        double x = grid.origin_m[0] + grid.step_m[0] * (double)(i % NX);
        double z = grid.origin_m[2] + grid.step_m[2] * (double)(i / NX);
        double to_first = hypot(x - at_m[0][0], z - at_m[0][2]);
        double to_second = hypot(x - at_m[1][0], z - at_m[1][2]);
        double nearest = fmin(to_first, to_second);
        if (fabs(nearest - reach_m) > 1e-6)
            assert_int_equal(held[i], nearest < reach_m);
    }
}

/* Seen along the array, at whatever height: the detector hears none. */
static void what_is_held_is_within_its_reach_wherever_it_is(void **state)
{
    static const double held[2][3] = {{0.83, 0.4, 1.31}, {-1.2, 0.0, 3.9}};
    unsigned long long seed = 11;
    struct detector d;
    float *image = calloc(CELLS, sizeof *image);

    (void)state;
    assert_non_null(image);
    start(&d);
    show(&d, 1, 1.0, false, &seed);
    const struct volume v = {
        .survey_id = d.survey_id, .grid = grid, .intensity = image, .frame = 2};
    detector_learn(&d, &v, held, 2, 0.33);
    expect_held(d.held, held, 0.33);
    detector_clear(&d);
    free(image);
}

/* Two who fill most rings of the gate, which do not tell them from clutter: as they are
 * known, noise is what it is. */
static void who_is_tracked_teaches_no_noise(void **state)
{
    static const double known_m[2][3] = {{0.0, 0.0, 1.5}, {0.5, 0.4, 3.2}};
    unsigned long long seed = 13;
    struct object_list list;
    struct error why;

    (void)state;
    for (int known = 0; known <= 1; known++) {
        struct detector d;
        float *image = malloc(CELLS * sizeof *image);
        assert_non_null(image);
        start(&d);
        show(&d, 1, 1.0, false, &seed);
        if (known) {
            detector_know(&d, known_m, 2, 0.6);
            expect_held(d.known, known_m, 0.6);
        }
        for (uint32_t frame = 2; frame <= 4; frame++) {
            for (size_t i = 0; i < CELLS; i++) {
                double x = grid.origin_m[0] + grid.step_m[0] * (double)(i % NX);
                double z = grid.origin_m[2] + grid.step_m[2] * (double)(i / NX);
                bool body = hypot(x, z - 1.5) < 0.58 || hypot(x - 0.5, z - 3.2) < 0.58;
                bool bright = body && i % 5 == 0;
                image[i] = (float)((bright ? 5.0 : 1.0) * -log(reference_random(&seed)));
            }
            const struct volume v = volume_of(&d, image, frame, false);
            assert_int_equal(detector_volume(&d, &v, NULL, &list, &why), 0);
        }
        double shape = cfar_noise(d.cells[0])->shape;
        assert_true(known ? fabs(shape - 1.0) < 0.05 : shape < 0.9);
        detector_clear(&d);
        free(image);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_stands_makes_no_noise_where_it_was_taken_away),
        cmocka_unit_test(noise_is_not_learnt_while_a_background_begins),
        cmocka_unit_test(what_moves_is_an_object_where_it_does_not_stand_out),
        cmocka_unit_test(what_stands_out_goes_along_the_course_that_is_told_there),
        cmocka_unit_test(one_that_sets_off_knows_noise_already),
        cmocka_unit_test(what_is_held_is_within_its_reach_wherever_it_is),
        cmocka_unit_test(who_is_tracked_teaches_no_noise),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
