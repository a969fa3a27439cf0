/* SPDX-License-Identifier: MIT */
/* A survey by itself: its copy, its id, its emissions, its air and its frame. */
#include "tests/recon/survey_numbers.h"

static void a_copy_is_equal_and_its_own(void **state)
{
    (void)state;
    struct survey s = example(), copy;
    assert_int_equal(survey_copy(&copy, &s), 0);
    assert_surveys_equal(&s, &copy);
    assert_ptr_not_equal(copy.speakers_m, s.speakers_m);
    assert_ptr_not_equal(copy.responses[0].gain_db, s.responses[0].gain_db);
    survey_clear(&copy);
    assert_null(copy.speakers_m);
    assert_int_equal(copy.n_responses, 0);
    survey_clear(&copy);
}

static void pings_with_places_of_their_own_find_room(void **state)
{
    (void)state;
    struct survey s = {.sound_speed_m_s = 340.0};
    assert_int_equal(survey_make_pings(&s, 3), 0);
    assert_int_equal(s.n_positions, 3);
    assert_int_equal(s.n_speakers, 1);
    assert_int_equal(s.n_microphones, 1);
    assert_true(s.sound_speed_m_s == 340.0);
    for (size_t p = 0; p < 3; p++) {
        assert_true(s.stage_positions_m[p] == 0.0);
        for (int a = 0; a < 3; a++)
            assert_true(s.pings_m[p][0][a] == 0.0 && s.pings_m[p][1][a] == 0.0);
    }
    for (int a = 0; a < 3; a++)
        assert_true(s.speakers_m[0][a] == 0.0 && s.microphones_m[0][a] == 0.0);
    survey_clear(&s);
}

static void the_same_array_may_be_in_other_air_and_have_been_knocked(void **state)
{
    const struct survey original = example();
    struct survey other;

    (void)state;
    assert_int_equal(survey_copy(&other, &original), 0);
    assert_true(survey_is_same_array(&original, &other));
    other.sound_speed_m_s += 5.0;
    other.gate_m[1] -= 0.1;
    other.microphones_m[0][1] += 0.049;
    other.speakers_m[original.n_speakers - 1][2] -= 0.049;
    assert_true(survey_is_same_array(&original, &other));
    other.microphones_m[0][1] += 0.002;
    assert_false(survey_is_same_array(&original, &other));
    other.microphones_m[0][1] = original.microphones_m[0][1];
    other.speakers_m[0][0] = NAN;
    assert_false(survey_is_same_array(&original, &other));
    other.speakers_m[0][0] = original.speakers_m[0][0];
    other.n_microphones--;
    assert_false(survey_is_same_array(&original, &other));
    other.n_microphones++;
    other.chirp_stop_hz += 1.0;
    assert_false(survey_is_same_array(&original, &other));
    survey_clear(&other);
}

static void the_id_changes_with_every_number(void **state)
{
    (void)state;
    const struct survey original = example();
    const uint64_t id = survey_id(&original);
    assert_true(id != 0);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        struct survey s = example();
        memcpy((char *)&s + numbers[i].offset, &numbers[i].value, sizeof(double));
        assert_true((survey_id(&s) != id) == (numbers[i].offset != AT(temperature_c)));
    }
    struct survey s = example();
    s.chirp_sine = false;
    assert_true(survey_id(&s) != id);
    s = example();
    s.slot_samples++;
    assert_true(survey_id(&s) != id);
    s = example();
    s.n_positions--;
    assert_true(survey_id(&s) != id);
    s = example();
    s.has_wall = false;
    assert_true(survey_id(&s) != id);
    s = example();
    s.microphones_m[1][1] = nextafter(s.microphones_m[1][1], 1);
    assert_true(survey_id(&s) != id);
    s = example();
    s.responses[2].gain_db[1] = 1e-9;
    assert_true(survey_id(&s) != id);
    s = example();
    s.responses[2].serial[0] = 'M';
    assert_true(survey_id(&s) != id);
}

/* What it was before surveys had alternating chirps and shared slots: bags have it. */
static void an_old_surveys_id_stays(void **state)
{
    (void)state;
    struct survey s = example();
    assert_true(survey_id(&s) == UINT64_C(0x43b31253f187fcd8));
    s.together = 1;
    assert_true(survey_id(&s) == UINT64_C(0x43b31253f187fcd8));
    s.chirp_alternates = true;
    const uint64_t alternating = survey_id(&s);
    assert_true(alternating != UINT64_C(0x43b31253f187fcd8));
    s.together = 2;
    assert_true(survey_id(&s) != alternating);
    s = example();
    s.continuous = true;
    assert_true(survey_id(&s) != UINT64_C(0x43b31253f187fcd8));
}

static void emissions_share_slots_and_alternate_by_their_order(void **state)
{
    (void)state;
    struct survey s = example();
    assert_int_equal(survey_slot_of(&s, 5), 5);
    assert_int_equal(survey_slots(&s, 5), 5);
    assert_int_equal(survey_slots(&s, 0), 0);
    assert_false(survey_is_down(&s, 1));
    s.chirp_alternates = true;
    s.together = 2;
    assert_int_equal(survey_slot_of(&s, 4), 2);
    assert_int_equal(survey_slot_of(&s, 5), 2);
    assert_int_equal(survey_slots(&s, 5), 3);
    assert_true(survey_is_down(&s, 5) && !survey_is_down(&s, 4));
    /* 62.5 ms are not over after two slots of 24 ms. */
    s.slot_samples = 1152;
    assert_false(survey_round_fits(&s, 4));
    assert_true(survey_round_fits(&s, 6));
}

static void the_id_does_not_depend_on_the_source_or_the_sign_of_zero(void **state)
{
    (void)state;
    struct survey s = example();
    const uint64_t id = survey_id(&s);
    s.source = SURVEY_REPLAY;
    s.temperature_c = NAN;
    s.stage_axis[1] = -0.0;
    assert_true(survey_id(&s) == id);
}

/* Against the ideal gas, sqrt(gamma R T / M), another formula than Cramer's. */
static void the_speed_of_sound_is_that_of_dry_air(void **state)
{
    (void)state;
    for (double t = -20; t <= 50; t += 5) {
        double ideal = sqrt(1.4 * 8.314462618 * (t + 273.15) / 28.9647e-3);
        double c = survey_sound_speed_m_s(t);
        assert_true(fabs(c / ideal - 1) < 1e-3);
    }
}

/* The ideal gas again, with the heat and the mass of water vapour; the vapour's pressure
 * by Buck's formula (1981), not by Giacomo's. */
static void humid_air_is_faster_as_its_vapour_is_lighter(void **state)
{
    const double r = 8.314462618;
    (void)state;
    for (double t = 0; t <= 30; t += 5)
        for (double humidity = 0; humidity <= 1; humidity += 0.25) {
            double saturated_pa = 611.21 * exp((18.678 - t / 234.5) * (t / (257.14 + t)));
            double x = humidity * saturated_pa / 101325;
            double heat = (1 - x) * 29.12 + x * 33.58;
            double mass = (1 - x) * 28.9655e-3 + x * 18.0153e-3;
            double ideal = sqrt(heat / (heat - r) * r * (t + 273.15) / mass);
            double c = survey_humid_sound_speed_m_s(t, humidity);
            assert_true(fabs(c / ideal - 1) < 6e-4);
            double dry = sqrt(29.12 / (29.12 - r) * r * (t + 273.15) / 28.9655e-3);
            assert_true(fabs(c / survey_sound_speed_m_s(t) - ideal / dry) < 1.5e-4);
        }
}

/* Looking along the vehicle's x: array x to the left, y up, z ahead. */
static void array_coordinates_become_vehicle_coordinates(void **state)
{
    (void)state;
    struct survey s = example();
    double p[3] = {1, 2, 3};
    survey_to_vehicle(&s, p, p);
    assert_true(p[0] == 3.5 + 3 && p[1] == 0.25 + 1 && p[2] == 0.5 + 2);
    const double q[3] = {1, 2, 3};
    double out[3];
    s.has_mount = false;
    survey_to_vehicle(&s, q, out);
    assert_memory_equal(out, q, sizeof q);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_copy_is_equal_and_its_own),
        cmocka_unit_test(pings_with_places_of_their_own_find_room),
        cmocka_unit_test(the_same_array_may_be_in_other_air_and_have_been_knocked),
        cmocka_unit_test(the_id_changes_with_every_number),
        cmocka_unit_test(an_old_surveys_id_stays),
        cmocka_unit_test(emissions_share_slots_and_alternate_by_their_order),
        cmocka_unit_test(the_id_does_not_depend_on_the_source_or_the_sign_of_zero),
        cmocka_unit_test(the_speed_of_sound_is_that_of_dry_air),
        cmocka_unit_test(humid_air_is_faster_as_its_vapour_is_lighter),
        cmocka_unit_test(array_coordinates_become_vehicle_coordinates),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
