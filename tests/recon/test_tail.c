/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "recon/tail.h"

static double speakers_m[2][3] = {{0, 0, 0}, {0, 1, 0}};
static double microphones_m[1][3] = {{0.1, 0.5, 0}};
static double positions_m[2] = {0, 1};

/* The paper's slot, chirp and rate. */
static struct survey make_survey(void)
{
    return (struct survey){.sound_speed_m_s = 340,
                           .sample_rate_hz = 48000,
                           .chirp_duration_s = 0.0625,
                           .slot_samples = 3000,
                           .n_speakers = 2,
                           .n_microphones = 1,
                           .n_positions = 2,
                           .speakers_m = speakers_m,
                           .microphones_m = microphones_m,
                           .stage_axis = {1, 0, 0},
                           .stage_positions_m = positions_m};
}

/* From speaker 0 at stage 0 to the corner (1, 1, 3) and back to the microphone. */
static void there_is_a_tail_when_the_far_corners_echo_into_the_next_slot(void **state)
{
    struct survey s = make_survey();
    (void)state;
    s.has_volume = true;
    for (int a = 0; a < 3; a++) {
        s.volume_m[a][0] = a == 2 ? 2 : 0;
        s.volume_m[a][1] = a == 2 ? 3 : 1;
    }
    double path_m = sqrt(1 + 1 + 9) + sqrt(0.9 * 0.9 + 0.25 + 9);
    double needed = 3000 + path_m / 340 * 48000;
    s.slot_samples = (size_t)needed - 1;
    assert_true(tail_samples(&s) > 0);
    s.slot_samples = (size_t)needed + 100;
    assert_int_equal(tail_samples(&s), 0);
    s.latency_samples = 200;
    assert_true(tail_samples(&s) > 0);
}

/* The longest direct path: from speaker 0 to the microphone a stage's metre further. */
static void a_next_emission_that_begins_in_the_tail_is_in_it_whole(void **state)
{
    struct survey s = make_survey();
    (void)state;
    s.slot_samples = 3500;
    double direct_m = sqrt(1.1 * 1.1 + 0.25);
    double needed = 3000 + direct_m / 340 * 48000;
    assert_true((double)tail_samples(&s) >= needed);
    assert_true((double)tail_samples(&s) <= needed + 200);
}

static void without_a_volume_the_far_gate_counts(void **state)
{
    struct survey s = make_survey();
    (void)state;
    s.has_gate = true;
    s.gate_m[1] = 2;
    /* The microphones sweep x 0.1..1.1 at y 0.5, so the plane's far corner is (1.6, 1):
     * from speaker 0 at stage 0 there, and back to the microphone. */
    double path_m = sqrt(1.6 * 1.6 + 1 + 4) + sqrt(1.5 * 1.5 + 0.25 + 4);
    s.slot_samples = 3000 + (size_t)(path_m / 340 * 48000);
    assert_true(tail_samples(&s) > 0);
    s.slot_samples += 150;
    assert_int_equal(tail_samples(&s), 0);
    s.has_gate = false;
    assert_true(tail_samples(&s) > 0);
}

static void a_tail_is_at_most_a_slot(void **state)
{
    struct survey s = make_survey();
    (void)state;
    s.has_gate = true;
    s.gate_m[1] = 100;
    assert_int_equal(tail_samples(&s), 3000);
}

/* 24 ms of a chirp of 62.5: the ping goes on for the far end of the gate and the chirp
 * from there, two slots and more. */
static void
emissions_that_overlap_have_a_tail_as_long_as_chirp_and_gate_ask_for(void **state)
{
    struct survey s = make_survey();
    (void)state;
    s.slot_samples = 1152;
    s.latency_samples = 30;
    s.has_gate = true;
    s.gate_m[1] = 3.9;
    double needed = 30 + (2 * 3.9 / 340 + 0.0625) * 48000;
    double most = 30 + 1152 + 0.0625 * 48000;
    assert_true((double)(s.slot_samples + tail_samples(&s)) >= needed);
    assert_true((double)(s.slot_samples + tail_samples(&s)) <= most + 65);
}

static void a_slot_that_is_long_enough_needs_no_tail(void **state)
{
    struct survey s = make_survey();
    (void)state;
    s.slot_samples = 10000;
    assert_int_equal(tail_samples(&s), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(there_is_a_tail_when_the_far_corners_echo_into_the_next_slot),
        cmocka_unit_test(a_next_emission_that_begins_in_the_tail_is_in_it_whole),
        cmocka_unit_test(without_a_volume_the_far_gate_counts),
        cmocka_unit_test(a_tail_is_at_most_a_slot),
        cmocka_unit_test(
            emissions_that_overlap_have_a_tail_as_long_as_chirp_and_gate_ask_for),
        cmocka_unit_test(a_slot_that_is_long_enough_needs_no_tail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
