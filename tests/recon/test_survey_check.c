/* SPDX-License-Identifier: MIT */
/* What a survey may say, and how it is told that it may not. */
#include "tests/recon/survey_numbers.h"

static void each_number_out_of_range_is_refused_by_name(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        const struct change *c = &numbers[i];
        struct survey s = example();
        struct error why = {""};
        memcpy((char *)&s + c->offset, &c->value, sizeof c->value);
        int err = survey_check(&s, &why);
        if (c->says && (err != -EINVAL || !strstr(why.text, c->says)))
            fail_msg("change %zu: %d, \"%s\", expected \"%s\"", i, err, why.text,
                     c->says);
        if (!c->says && err)
            fail_msg("change %zu: refused: %s", i, why.text);
    }
}

static void parts_that_are_not_there_are_not_checked(void **state)
{
    (void)state;
    struct survey s = example();
    s.has_gate = s.has_volume = s.has_wall = s.has_mount = false;
    s.gate_m[1] = s.volume_m[0][0] = s.wall_normal[0] = s.mount_x_axis[0] = NAN;
    assert_int_equal(survey_check(&s, NULL), 0);
}

static void assert_refused(const struct survey *s, const char *says)
{
    struct error why = {""};
    assert_int_equal(survey_check(s, &why), -EINVAL);
    if (!strstr(why.text, says))
        fail_msg("\"%s\" does not say \"%s\"", why.text, says);
}

/* Each list is of a length that it may have, all together would take days. */
static void more_paths_than_can_be_planned_for_are_refused(void **state)
{
    (void)state;
    static double elements[SURVEY_MAX_ELEMENTS][3], positions[SURVEY_MAX_ELEMENTS];
    struct survey s = example();
    s.speakers_m = s.microphones_m = elements;
    s.stage_positions_m = positions;
    s.n_responses = 0;
    s.n_speakers = s.n_microphones = s.n_positions = 256;
    assert_int_equal(survey_check(&s, NULL), 0);
    s.n_positions = 257;
    assert_refused(&s, "257 positions; expected at most 16777216 paths");
    s.n_speakers = s.n_microphones = s.n_positions = SURVEY_MAX_ELEMENTS;
    assert_refused(&s, "expected at most 16777216 paths");
}

static void counts_and_lists_are_refused_by_name(void **state)
{
    (void)state;
    struct survey s = example();
    s.slot_samples = 0;
    assert_refused(&s, "slot_samples");
    s = example();
    s.slot_samples = SIZE_MAX;
    assert_refused(&s, "slot_samples");
    s = example();
    s.n_speakers = 0;
    assert_refused(&s, "speakers_m");
    s = example();
    s.n_microphones = SURVEY_MAX_ELEMENTS + 1;
    assert_refused(&s, "microphones_m");
    s = example();
    s.stage_positions_m = NULL;
    assert_refused(&s, "positions_m");
    s = example();
    s.speakers_m[1][2] = NAN;
    assert_refused(&s, "speakers_m[1]");
    s = example();
    s.microphones_m[2][0] = 1001;
    assert_refused(&s, "microphones_m[2]");
    s = example();
    s.stage_positions_m[3] = INFINITY;
    assert_refused(&s, "positions_m[3]");
    s = example();
    s.source = (enum survey_source)7;
    assert_refused(&s, "source");
    s = example();
    s.mount_y_axis[1] = 0.6; /* still a unit vector */
    s.mount_y_axis[2] = 0.8;
    assert_refused(&s, "right angles");
}

/* 18 kHz of band: a time-bandwidth product of 10 takes 10 / 18000 s = 0.5556 ms.  What a
 * replica is, is not asked: a pulse is one too. */
static void a_chirp_too_short_to_sweep_its_band_is_refused(void **state)
{
    (void)state;
    struct survey s = example();
    s.chirp_duration_s = 1e-9;
    assert_refused(&s, "chirp duration_s is 1e-09, too short to sweep 2000 to 20000 Hz; "
                       "expected at least 0.000555");
    s.chirp_duration_s = 0.00055;
    assert_refused(&s, "too short");
    s.chirp_duration_s = 0.00056;
    assert_int_equal(survey_check(&s, NULL), 0);
    s = foreign_example();
    s.chirp_duration_s = 0.00055;
    assert_int_equal(survey_check(&s, NULL), 0);
}

static void calibration_is_refused_by_serial(void **state)
{
    (void)state;
    struct survey s = example();
    s.n_responses = 2;
    assert_refused(&s, "one for each of the 3");
    s = example();
    s.responses[1].n_points = 1;
    assert_refused(&s, "mic-1");
    s = example();
    s.responses[2].frequency_hz[2] = 1000.5;
    assert_refused(&s, "mic-2: frequency 2");
    s = example();
    s.responses[0].frequency_hz[0] = -1;
    assert_refused(&s, "mic-0: frequency 0");
    s = example();
    s.responses[0].gain_db[1] = NAN;
    assert_refused(&s, "mic-0: gain 1");
    s = example();
    memset(s.responses[0].serial, 'x', sizeof s.responses[0].serial);
    assert_refused(&s, "does not end");
}

static void places_and_replica_are_checked(void **state)
{
    (void)state;
    struct error why;
    struct survey s = foreign_example();
    s.n_microphones = 2;
    assert_int_equal(survey_check(&s, &why), -EINVAL);
    assert_non_null(strstr(why.text, "one speaker and one microphone"));
    s = foreign_example();
    s.pings_m[17][0][1] = NAN;
    assert_int_equal(survey_check(&s, &why), -EINVAL);
    assert_non_null(strstr(why.text, "pings speaker[17]"));
    s.pings_m[17][0][1] = 0;
    s.replica[3] = INFINITY;
    assert_int_equal(survey_check(&s, &why), -EINVAL);
    assert_non_null(strstr(why.text, "replica sample 3"));
    s.replica[3] = 0;
    s.n_replica = s.slot_samples + 1;
    assert_int_equal(survey_check(&s, &why), -EINVAL);
    assert_non_null(strstr(why.text, "replica has 3001 samples"));
}

/* 24 ms of 62.5: the gate has to end 0.1 m before the next speaker is heard at 4.118 m.
 */
static void a_slot_shorter_than_the_chirp_needs_a_gate_within_it(void **state)
{
    (void)state;
    struct survey s = example();
    assert_false(survey_overlaps(&s));
    s.slot_samples = 1152;
    assert_true(survey_overlaps(&s));
    s.gate_m[1] = 4.0;
    assert_int_equal(survey_check(&s, NULL), 0);
    s.gate_m[1] = 4.03;
    assert_refused(&s, "before the next speaker is heard");
    s.has_gate = false;
    assert_refused(&s, "gate_m");
}

static void only_opposite_chirps_sound_together(void **state)
{
    (void)state;
    struct survey s = example();
    s.together = 2;
    assert_refused(&s, "together");
    s.chirp_alternates = true;
    assert_int_equal(survey_check(&s, NULL), 0);
    s.together = 3;
    assert_refused(&s, "together is 3");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_number_out_of_range_is_refused_by_name),
        cmocka_unit_test(parts_that_are_not_there_are_not_checked),
        cmocka_unit_test(more_paths_than_can_be_planned_for_are_refused),
        cmocka_unit_test(counts_and_lists_are_refused_by_name),
        cmocka_unit_test(a_chirp_too_short_to_sweep_its_band_is_refused),
        cmocka_unit_test(calibration_is_refused_by_serial),
        cmocka_unit_test(places_and_replica_are_checked),
        cmocka_unit_test(a_slot_shorter_than_the_chirp_needs_a_gate_within_it),
        cmocka_unit_test(only_opposite_chirps_sound_together),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
