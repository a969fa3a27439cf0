/* SPDX-License-Identifier: MIT */
#include "hal/turn.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS       INT64_C(1000000)
#define FIRED_NS (INT64_C(1795393947) * 1000 * MS)

/* Two speakers, a slot of 10 ms each, a ping of 15 ms. */
static const struct survey survey = {
    .sample_rate_hz = 48000, .slot_samples = 480, .n_speakers = 2};
#define PING 720

static int64_t now_ns(void *state)
{
    return *(int64_t *)state;
}

static int sleep_until_ns(void *state, int64_t t_ns)
{
    int64_t *now = state;
    *now = t_ns > *now ? t_ns : *now;
    return 0;
}

/* When emission after emission begins after the shot was fired, ms; and that it was
 * waited for, or not. */
static void assert_pace(const struct array_shot *shot, const int *at_ms, size_t n,
                        bool paced)
{
    int64_t now = FIRED_NS, t0_ns;
    const struct clock_source clock = {now_ns, sleep_until_ns, &now};
    struct turn t;

    turn_start(&t, shot, now);
    for (size_t k = 0; k < n; k++) {
        assert_int_equal(turn_wait(&t, &survey, PING, &clock, &t0_ns, NULL), 0);
        assert_int_equal((t0_ns - FIRED_NS) / MS, at_ms[k]);
        assert_int_equal((now - FIRED_NS) / MS, paced ? at_ms[k] + 15 : 0);
        turn_advance(&t);
    }
}

static void a_stage_that_goes_on_is_waited_for_slot_after_slot(void **state)
{
    static const int in_time[] = {180, 190, 200, 210}, late[] = {0, 10, 20, 30},
                     stands[] = {0, 0, 0, 0};
    struct array_shot shot = {
        .n_speakers = 2, .n_rounds = 2, .start_ns = FIRED_NS + 180 * MS};

    (void)state;
    assert_pace(&shot, in_time, 4, true);
    shot.start_ns = FIRED_NS - 30 * MS;
    assert_pace(&shot, late, 4, true);
    shot.start_ns = 0; /* nothing moves it */
    assert_pace(&shot, stands, 4, false);
}

static void a_shot_without_end_has_its_pace_and_any_other_none(void **state)
{
    static const int goes_on[] = {0, 10, 20, 30, 40}, at_once[] = {0, 0};
    struct array_shot shot = {.n_speakers = 2, .endless = true};

    (void)state;
    assert_pace(&shot, goes_on, 5, true);
    shot.endless = false;
    assert_pace(&shot, at_once, 2, false);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_stage_that_goes_on_is_waited_for_slot_after_slot),
        cmocka_unit_test(a_shot_without_end_has_its_pace_and_any_other_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
