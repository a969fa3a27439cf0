/* SPDX-License-Identifier: MIT */
#include "tests/nodes/launch_load.h"

static void a_fixed_array_is_tracked_unless_told(void **state)
{
    struct launchfile *l = launch_load(*state, "nodes: [track]\n");

    assert_int_equal(l->track.mode, OBJECT_TRACKER_AUTO);
    assert_int_equal(l->track.confirm_hits, 2);
    assert_int_equal(l->track.confirm_of, 3);
    launchfile_destroy(l);
}

static void everything_can_be_said(void **state)
{
    struct launchfile *l = launch_load(
        *state,
        "nodes: [track]\n"
        "track: {mode: lists, threshold_db: 15, confirm_hits: 3, confirm_of: 5,\n"
        "        confirm_existence: 0.5, detection_probability: 0.7, clutter: 2,\n"
        "        sidelobe_db: 10, look_s: 0.1, acceleration_psd: 1, join_m: 1,\n"
        "        coast_s: 2, min_existence: 0.2}\n");

    assert_int_equal(l->track.mode, OBJECT_TRACKER_LISTS);
    assert_int_equal(l->track.confirm_hits, 3);
    assert_int_equal(l->track.confirm_of, 5);
    assert_true(l->track.threshold_db == 15.0 && l->track.min_existence == 0.2);
    assert_true(l->track.confirm_existence == 0.5 && l->track.clutter == 2.0);
    assert_true(l->track.detection_probability == 0.7 && l->track.sidelobe_db == 10.0);
    assert_true(l->track.look_s == 0.1 && l->track.acceleration_psd == 1.0);
    assert_true(l->track.join_m == 1.0 && l->track.coast_s == 2.0);
    launchfile_destroy(l);
}

static void what_makes_no_sense_is_refused(void **state)
{
    static const char *const bad[][2] = {
        {"confirm_hits: 6", ":2: track.confirm_hits: expected 1 to 3, not 6"},
        {"mode: maybe", ":2: track.mode: expected auto, lists or tracks, not maybe"},
        {"coast_s: 0", ":2: track.coast_s: expected 0.01 to 60, not 0"},
    };

    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct error why = {""};
        struct launchfile *l = NULL;
        char text[128];
        snprintf(text, sizeof text, "nodes: [track]\ntrack: {%s}\n", bad[i][0]);
        const char *path = scratch_write(*state, "a.yaml", text);
        assert_int_equal(launchfile_load(&l, path, NULL, &why), -EINVAL);
        assert_error(why.text, path, bad[i][1]);
    }
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_fixed_array_is_tracked_unless_told),
        TEST(everything_can_be_said),
        TEST(what_makes_no_sense_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
