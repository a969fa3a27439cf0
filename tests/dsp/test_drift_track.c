/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "dsp/drift.h"
#include "tests/dsp/near.h"

static const struct drift_measurement silent = {0.0, INFINITY};

static void a_clear_ping_is_believed(void **state)
{
    const struct drift_measurement clear = {1.1e-3, 1e-14}, next = {-4e-4, 1e-14};
    struct drift_track t;

    (void)state;
    drift_track_start(&t);
    assert_near(drift_track_update(&t, &clear), 1.1e-3, 1e-7);
    assert_near(drift_track_update(&t, &next), -4e-4, 1e-7);
}

static void a_silent_ping_takes_the_stretch_of_those_before(void **state)
{
    const struct drift_measurement clear = {1.1e-3, 1e-14};
    struct drift_track t;

    (void)state;
    drift_track_start(&t);
    assert_true(drift_track_update(&t, &silent) == 0.0);
    drift_track_update(&t, &clear);
    for (int i = 0; i < 1000; i++)
        assert_near(drift_track_update(&t, &silent), 1.1e-3, 1e-7);
    assert_true(t.variance > 1e-8 && t.variance <= 4e-6);
}

/* Errors of 1e-4 in each ping, of either sign in turn. */
static void pings_that_contradict_each_other_are_averaged(void **state)
{
    struct drift_track t;

    (void)state;
    drift_track_start(&t);
    for (int i = 0; i < 200; i++) {
        const struct drift_measurement m = {8e-4 + (i % 2 ? 1e-4 : -1e-4), 1e-8};
        double stretch = drift_track_update(&t, &m);
        if (i >= 20)
            assert_near(stretch, 8e-4, 2.5e-5);
    }
}

static void the_stretch_stays_within_its_bound(void **state)
{
    const struct drift_measurement wild = {0.02, 1e-14};
    struct drift_track t;

    (void)state;
    drift_track_start(&t);
    assert_true(drift_track_update(&t, &wild) == DRIFT_MAX_STRETCH);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_clear_ping_is_believed),
        cmocka_unit_test(a_silent_ping_takes_the_stretch_of_those_before),
        cmocka_unit_test(pings_that_contradict_each_other_are_averaged),
        cmocka_unit_test(the_stretch_stays_within_its_bound),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
