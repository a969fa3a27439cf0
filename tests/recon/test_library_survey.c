/* SPDX-License-Identifier: MIT */
/* What a program may say of an array beside its places: what is emitted, how microphones
 * hear, the air, several walls. */
#include "tests/recon/library_rig.h"

/* A scan in which microphone m records gains[m] times what it should; NULL: 1. */
static void feed(struct anlos_pipeline *p, const double gains[MICS])
{
    for (size_t k = 0; k < POSITIONS * SPEAKERS; k++) {
        struct anlos_ping ping = make_ping(k / SPEAKERS, k % SPEAKERS);
        echo(samples, k / SPEAKERS, k % SPEAKERS, 0.01);
        for (size_t i = 0; gains && i < MICS * PING; i++)
            samples[i] *= (float)gains[i / PING];
        ping.capture_ns = (int64_t)k * SECOND / 32;
        ok(anlos_pipeline_ping(p, &ping, &why));
    }
}

static struct anlos_object find(const struct anlos_survey *s, const double gains[MICS],
                                float *brightest)
{
    struct anlos_object o = {.size = sizeof o};
    struct anlos_list list = {.size = sizeof list};
    struct anlos_image image = {.size = sizeof image};
    struct anlos_config cfg;
    struct anlos_pipeline *p;

    anlos_config_init(&cfg);
    ok(anlos_pipeline_create(&p, &cfg, s, &why));
    feed(p, gains);
    ok(anlos_pipeline_list(p, &list, &why));
    assert_true(list.n >= 1);
    ok(anlos_pipeline_object(p, 0, &o, &why));
    ok(anlos_pipeline_image(p, &image, &why));
    *brightest = 0.0f;
    for (size_t i = 0; i < image.n[0] * image.n[1] * image.n[2]; i++)
        *brightest = fmaxf(*brightest, image.intensity[i]);
    anlos_pipeline_destroy(p);
    return o;
}

/* -- what is emitted --------------------------------------------------------------------
 */

static float replica[SLOT], emitted[SLOT];

/* In place of a chirp that is something else. */
static struct anlos_survey *make_survey_with_replica(void)
{
    struct anlos_survey *s = make_survey(POSITIONS);
    const double rate = (STOP_HZ - START_HZ) / CHIRP_S;

    for (size_t i = 0; i < SLOT; i++) {
        double t = (double)i / RATE_HZ;
        replica[i] = (float)cos(2 * PI * (START_HZ * t + 0.5 * rate * t * t));
    }
    ok(anlos_survey_chirp(s, 9000.0, 3000.0, 0.01, true, &why));
    ok(anlos_survey_replica(s, replica, SLOT, START_HZ, STOP_HZ, &why));
    return s;
}

static void what_is_emitted_may_be_any_sound(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey_with_replica();
    float brightest;

    ok(anlos_survey_check(s, &why));
    emitted[0] = 7.0f;
    assert_int_equal(anlos_survey_emission(s, false, emitted, SLOT - 1), SLOT);
    assert_true(emitted[0] == 7.0f); /* no room: untouched */
    assert_int_equal(anlos_survey_emission(s, false, emitted, SLOT), SLOT);
    assert_memory_equal(emitted, replica, sizeof replica);
    struct anlos_object o = find(s, NULL, &brightest);
    assert_true(distance(o.virtual_m, point_m) < 0.01);
    anlos_survey_destroy(s);
}

static void a_sound_lasts_as_long_as_its_samples(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey_with_replica();
    uint64_t at_first = anlos_survey_id(s);

    ok(anlos_survey_sampling(s, 1.1 * RATE_HZ, SLOT, 0, &why));
    ok(anlos_survey_check(s, &why));
    assert_int_equal(anlos_survey_emission(s, false, NULL, 0), SLOT);
    assert_true(anlos_survey_id(s) != at_first);
    ok(anlos_survey_sampling(s, RATE_HZ, SLOT, 0, &why));
    assert_true(anlos_survey_id(s) == at_first);
    ok(anlos_survey_chirp(s, START_HZ, STOP_HZ, 0.01, false, &why)); /* takes its place */
    assert_int_equal(anlos_survey_emission(s, false, NULL, 0), 480);
    anlos_survey_destroy(s);
}

static void a_sound_that_cannot_be_emitted_is_refused(void **state)
{
    (void)state;
    enum { I = ANLOS_INVALID };
    struct anlos_survey *s = make_survey(POSITIONS);
    uint64_t id = anlos_survey_id(s);

    refused(anlos_survey_replica(NULL, replica, SLOT, 2e3, 2e4, &why), I, "survey is");
    refused(anlos_survey_replica(s, NULL, SLOT, 2e3, 2e4, &why), I, "replica is NULL");
    refused(anlos_survey_replica(s, replica, 1, 2e3, 2e4, &why), I, "2 to slot_samples");
    refused(anlos_survey_replica(s, replica, SLOT + 1, 2e3, 2e4, &why), I, "1500");
    refused(anlos_survey_replica(s, replica, SLOT, NAN, 2e4, &why), I, "chirp");
    refused(anlos_survey_firing(s, true, 0, &why), I, "together is 0");
    refused(anlos_survey_firing(s, true, 3, &why), I, "together is 3");
    assert_true(anlos_survey_id(s) == id);
    anlos_survey_destroy(s);
}

/* Of two chirps in turn the second runs down: from behind it is the first. */
static void the_second_of_two_chirps_is_the_first_one_backwards(void **state)
{
    (void)state;
    static float up[SLOT], down[SLOT];
    struct anlos_survey *s = make_survey(POSITIONS);

    assert_int_equal(anlos_survey_emission(s, true, down, SLOT), SLOT);
    assert_int_equal(anlos_survey_emission(s, false, up, SLOT), SLOT);
    assert_memory_equal(up, down, sizeof up); /* there is one alone */
    ok(anlos_survey_firing(s, true, 1, &why));
    assert_int_equal(anlos_survey_emission(s, true, down, SLOT), SLOT);
    const double rate = (STOP_HZ - START_HZ) / CHIRP_S;
    for (size_t i = 0; i < SLOT; i++) {
        double t = (double)i / RATE_HZ;
        double falls = cos(2 * PI * (STOP_HZ * t - 0.5 * rate * t * t));
        if (fabs((double)down[i] - falls) > 1e-3)
            fail_msg("sample %zu is %g, expected %g", i, (double)down[i], falls);
    }
    anlos_survey_destroy(s);
}

/* -- how it is heard --------------------------------------------------------------------
 */

static void a_microphone_that_hears_less_counts_as_much(void **state)
{
    (void)state;
    static const double hz[2] = {1000.0, 24000.0}, flat_db[2] = {0.0, 0.0},
                        less_db[2] = {-20.0, -20.0};
    const double gains[MICS] = {1.0, 0.1, 1.0, 0.1};
    struct anlos_survey *plain = make_survey(POSITIONS), *s = make_survey(POSITIONS);
    float expected, untold, told;

    find(plain, NULL, &expected);
    find(plain, gains, &untold);
    for (size_t m = 0; m < MICS; m++)
        ok(anlos_survey_response(s, m, hz, m % 2 ? less_db : flat_db, 2, &why));
    ok(anlos_survey_response(s, 0, hz, flat_db, 2, &why)); /* again */
    struct anlos_object o = find(s, gains, &told);
    assert_true(untold < 0.5f * expected);
    if (fabsf(told / expected - 1.0f) > 0.05f)
        fail_msg("%g, expected %g", (double)told, (double)expected);
    assert_true(distance(o.virtual_m, point_m) < 0.01);
    anlos_survey_destroy(plain);
    anlos_survey_destroy(s);
}

static void a_response_that_is_none_is_refused(void **state)
{
    (void)state;
    enum { I = ANLOS_INVALID };
    static const double hz[2] = {1000.0, 24000.0}, db[2] = {0.0, 3.0},
                        bad[2] = {0.0, NAN};
    struct anlos_survey *s = make_survey(POSITIONS);

    refused(anlos_survey_response(NULL, 0, hz, db, 2, &why), I, "survey is NULL");
    refused(anlos_survey_response(s, MICS, hz, db, 2, &why), I, "microphone 4 of 4");
    refused(anlos_survey_response(s, 0, bad, db, 2, &why), I, "response frequencies");
    refused(anlos_survey_response(s, 0, hz, bad, 2, &why), I, "response gains");
    refused(anlos_survey_response(s, 0, hz, db, 0, &why), I, "response frequencies");
    ok(anlos_survey_check(s, &why));
    ok(anlos_survey_response(s, 0, hz, db, 2, &why));
    refused(anlos_survey_check(s, &why), I,
            "microphone 1 has 0 points"); /* of all of them, or of none */
    anlos_survey_destroy(s);
}

/* Dry: 331.45 m/s times the root of the temperature over 273.15 K (Cramer 1993, of an
 * ideal gas to 0.1 %), so that what is heard as late is nearer in the cold. */
static void in_cold_air_what_is_heard_as_late_is_nearer(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    const double cold_m_s = 331.45 * sqrt(263.15 / 273.15);
    float brightest;

    ok(anlos_survey_air(s, -10.0, 0.0, &why));
    struct anlos_object o = find(s, NULL, &brightest);
    double expected_m = point_m[2] * cold_m_s / SPEED;
    if (fabs(o.virtual_m[2] - expected_m) > 0.006)
        fail_msg("z %g, expected %g", o.virtual_m[2], expected_m);
    ok(anlos_survey_air(s, 35.0, 0.0, &why));
    double dry_m = find(s, NULL, &brightest).virtual_m[2];
    ok(anlos_survey_air(s, 35.0, 1.0, &why));
    assert_true(find(s, NULL, &brightest).virtual_m[2] > dry_m + 0.003);
    refused(anlos_survey_air(s, 51.0, 0.0, &why), ANLOS_INVALID, "air of 51 C");
    refused(anlos_survey_air(s, 20.0, 1.1, &why), ANLOS_INVALID, "humidity of 1.1");
    anlos_survey_destroy(s);
}

/* -- walls ------------------------------------------------------------------------------
 */

static void each_wall_mirrors_what_is_seen_in_its_ranges(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey_without_wall(POSITIONS);
    float brightest;

    ok(anlos_survey_add_wall(s, z_axis, 0.8, 2.0, 4.0, &why));
    ok(anlos_survey_add_wall(s, z_axis, 0.7, 0.8, 2.0, &why));
    struct anlos_object o = find(s, NULL, &brightest);
    assert_true(o.placed && o.wall == 2);
    assert_true(fabs(o.position_m[2] - (2 * 0.7 - point_m[2])) < 0.01);
    anlos_survey_destroy(s);
}

/* Past it is heard directly, if at all. */
static void a_wall_mirrors_between_its_ends(void **state)
{
    static const double near_m[3] = {-1.0, 0.0, 0.8}, far_m[3] = {1.0, 0.0, 0.8},
                        beside_m[3] = {3.0, 0.0, 0.8}, nan_m[3] = {NAN, 0.0, 0.8};
    float brightest;

    (void)state;
    for (int past = 0; past <= 1; past++) {
        struct anlos_survey *s = make_survey_without_wall(POSITIONS);
        refused(anlos_survey_end_wall(s, near_m, far_m, &why), ANLOS_INVALID,
                "no wall was added");
        ok(anlos_survey_add_wall(s, z_axis, 0.8, 0.0, 0.0, &why));
        refused(anlos_survey_end_wall(s, near_m, near_m, &why), ANLOS_INVALID,
                "one place");
        refused(anlos_survey_end_wall(s, near_m, nan_m, &why), ANLOS_INVALID,
                "where the wall ends");
        refused(anlos_survey_end_wall(s, near_m, NULL, &why), ANLOS_INVALID,
                "to_m is NULL");
        ok(anlos_survey_end_wall(s, past ? beside_m : near_m, far_m, &why));
        struct anlos_object o = find(s, NULL, &brightest);
        assert_int_equal(o.wall, past ? 0 : 1);
        assert_int_equal(o.behind_no_wall, past);
        anlos_survey_destroy(s);
    }
}

/* The image's box as it is behind the wall, turned over to the front of it: by hand. */
static void a_list_says_which_floor_it_can_tell_of(void **state)
{
    (void)state;
    struct anlos_survey *s = make_survey(POSITIONS);
    struct anlos_list list = {.size = sizeof list};
    struct anlos_area area = {.size = sizeof area};
    struct anlos_image image = {.size = sizeof image};
    struct anlos_config cfg;
    struct anlos_pipeline *p;

    anlos_config_init(&cfg);
    ok(anlos_pipeline_create(&p, &cfg, s, &why));
    refused(anlos_pipeline_area(p, 0, &area, &why), ANLOS_NOT_READY, "no list");
    feed(p, NULL);
    ok(anlos_pipeline_list(p, &list, &why));
    ok(anlos_pipeline_image(p, &image, &why));
    assert_int_equal(list.n_areas, 1);
    ok(anlos_pipeline_area(p, 0, &area, &why));
    assert_int_equal(area.wall, 1);
    double low_m[2] = {INFINITY, INFINITY}, high_m[2] = {-INFINITY, -INFINITY};
    assert_true(area.n_corners >= 3 && area.n_corners <= 8);
    for (size_t k = 0; k < area.n_corners; k++)
        for (int a = 0; a < 2; a++) {
            low_m[a] = fmin(low_m[a], area.corners_m[k][a]);
            high_m[a] = fmax(high_m[a], area.corners_m[k][a]);
        }
    assert_true(fabs(low_m[0] - image.origin_m[0]) < 1e-9);
    assert_true(fabs(high_m[1] - (1.6 - image.origin_m[2])) < 1e-9);
    refused(anlos_pipeline_area(p, 1, &area, &why), ANLOS_INVALID, "area 1 of 1");
    anlos_pipeline_destroy(p);
    anlos_survey_destroy(s);
}

static void a_ninth_wall_is_refused(void **state)
{
    (void)state;
    for (int gated = 0; gated <= 1; gated++) {
        struct anlos_survey *s = make_survey_without_wall(POSITIONS);
        for (int i = 0; i < 8; i++)
            ok(anlos_survey_add_wall(s, z_axis, 0.5 + 0.02 * i, 0, gated ? 4 : 0, &why));
        ok(anlos_survey_check(s, &why));
        refused(anlos_survey_add_wall(s, z_axis, 0.4, 0, 0, &why), ANLOS_INVALID,
                "more than 8");
        anlos_survey_destroy(s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_emitted_may_be_any_sound),
        cmocka_unit_test(a_sound_lasts_as_long_as_its_samples),
        cmocka_unit_test(a_sound_that_cannot_be_emitted_is_refused),
        cmocka_unit_test(the_second_of_two_chirps_is_the_first_one_backwards),
        cmocka_unit_test(a_microphone_that_hears_less_counts_as_much),
        cmocka_unit_test(a_response_that_is_none_is_refused),
        cmocka_unit_test(in_cold_air_what_is_heard_as_late_is_nearer),
        cmocka_unit_test(each_wall_mirrors_what_is_seen_in_its_ranges),
        cmocka_unit_test(a_wall_mirrors_between_its_ends),
        cmocka_unit_test(a_list_says_which_floor_it_can_tell_of),
        cmocka_unit_test(a_ninth_wall_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
