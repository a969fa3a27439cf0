#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "hal/tail.h"

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
static void the_whole_chirp_comes_back_from_the_far_corners_of_the_volume(void **state)
{
    struct survey s = make_survey();
    (void)state;
    s.has_volume = true;
    for (int a = 0; a < 3; a++) {
        s.volume_m[a][0] = a == 2 ? 2 : 0;
        s.volume_m[a][1] = a == 2 ? 3 : 1;
    }
    double path_m = sqrt(1 + 1 + 9) + sqrt(0.9 * 0.9 + 0.25 + 9);
    double needed = path_m / 340 * 48000;
    size_t tail = tail_samples(&s);
    assert_true((double)tail >= needed);
    assert_true((double)tail <= needed + 100);
    s.latency_samples = 50;
    assert_int_equal(tail_samples(&s), tail + 50);
}

static void without_a_volume_the_far_gate_counts(void **state)
{
    struct survey s = make_survey();
    (void)state;
    size_t usual = tail_samples(&s);
    assert_true((double)usual >= 2 * TAIL_DEFAULT_FAR_M / 340 * 48000);
    s.has_gate = true;
    s.gate_m[1] = TAIL_DEFAULT_FAR_M;
    assert_int_equal(tail_samples(&s), usual);
    s.gate_m[1] = 2;
    assert_true(tail_samples(&s) < usual);
    /* The microphones sweep x 0.1..1.1 at y 0.5, so the plane's far corner is (1.6, 1):
     * from speaker 0 at stage 0 there, and back to the microphone. */
    double path_m = sqrt(1.6 * 1.6 + 1 + 4) + sqrt(1.5 * 1.5 + 0.25 + 4);
    assert_true((double)tail_samples(&s) >= path_m / 340 * 48000);
}

static void a_tail_is_at_most_a_slot(void **state)
{
    struct survey s = make_survey();
    (void)state;
    s.has_gate = true;
    s.gate_m[1] = 100;
    assert_int_equal(tail_samples(&s), 3000);
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
        cmocka_unit_test(the_whole_chirp_comes_back_from_the_far_corners_of_the_volume),
        cmocka_unit_test(without_a_volume_the_far_gate_counts),
        cmocka_unit_test(a_tail_is_at_most_a_slot),
        cmocka_unit_test(a_slot_that_is_long_enough_needs_no_tail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
