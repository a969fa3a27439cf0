/* SPDX-License-Identifier: MIT */
#include "tests/nodes/launch_load.h"

static void a_scan_is_stepped_and_what_it_subtracts_was_recorded(void **state)
{
    struct launchfile *l = launch_load(*state, "nodes: [dsp]\n");

    assert_false(l->scan.fixed);
    assert_int_equal(l->scan.n_speakers, 0);
    assert_int_equal(l->dsp.background, BACKGROUND_NONE);
    launchfile_destroy(l);
    l = launch_load(*state, "nodes: [dsp]\nscan: {mode: stepped, background: true}\n");
    assert_false(l->scan.fixed);
    assert_int_equal(l->dsp.background, BACKGROUND_RECORDED);
    launchfile_destroy(l);
}

static void a_fixed_array_has_its_speakers_and_backgrounds(void **state)
{
    static const uint32_t speakers[] = {0, 15, 5};
    struct launchfile *l =
        launch_load(*state, "nodes: [scan, dsp]\n"
                            "scan: {mode: fixed, speakers: [0, 15, 5]}\n"
                            "dsp: {background: adaptive, background_s: 2.5}\n");

    assert_true(l->scan.fixed);
    assert_int_equal(l->scan.n_speakers, 3);
    assert_memory_equal(l->scan.speakers, speakers, sizeof speakers);
    assert_int_equal(l->scan.background_frames, 8);
    assert_int_equal(l->dsp.background, BACKGROUND_ADAPTIVE);
    assert_true(l->dsp.background_s == 2.5);
    launchfile_destroy(l);
    l = launch_load(*state,
                    "nodes: [scan, dsp]\n"
                    "scan: {mode: fixed, background: true, background_frames: 20}\n");
    assert_int_equal(l->scan.background_frames, 20);
    assert_int_equal(l->dsp.background, BACKGROUND_RECORDED);
    launchfile_destroy(l);
}

static void what_does_not_fit_is_named(void **state)
{
    static const struct {
        const char *text, *says;
    } cases[] = {
        {"scan: {mode: quick}",
         ":2: scan.mode: expected stepped, continuous or fixed, not quick"},
        {"scan: {speakers: [1]}", ":2: scan.speakers: is of an array that stands; "
                                  "expected it with scan.mode: fixed"},
        {"dsp: {background: adaptive}", ":2: dsp.background: is of an array that "
                                        "stands; expected it with scan.mode: fixed"},
        {"scan: {mode: fixed, speakers: [1, 2, 1]}",
         ":2: scan.speakers: expected each speaker once, but 1 is there twice"},
        {"scan: {mode: fixed, background_frames: 0}",
         ":2: scan.background_frames: expected 1 to 1000, not 0"},
        {"scan: {mode: fixed}\ndsp: {background: soft}",
         ":3: dsp.background: expected none, recorded or adaptive, not soft"},
        {"scan: {mode: fixed}\ndsp: {background: recorded}",
         ":3: dsp.background: recorded does not go with scan.background: false, which "
         "says whether one is recorded"},
        {"scan: {mode: fixed, background: true}\ndsp: {background: adaptive}",
         ":3: dsp.background: adaptive does not go with scan.background: true, which "
         "says whether one is recorded"},
        {"scan: {mode: fixed}\ndsp: {background_s: 0}",
         ":3: dsp.background_s: expected over 0 and up to 3600, not 0"},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[300];
        snprintf(text, sizeof text, "nodes: [scan, dsp]\n%s\n", cases[i].text);
        assert_refused(*state, text, cases[i].says);
    }
}

static void launch_files_of_the_papers_arrangements_can_be_loaded(void **state)
{
    static const char *const names[] = {"full-array", "one-pair"};
    struct error why = {""};

    (void)state;
    for (size_t i = 0; i < 2; i++) {
        char path[300];
        struct launchfile *l = NULL;
        snprintf(path, sizeof path, "%s/launch/%s.yaml", SOURCE_DIR, names[i]);
        if (launchfile_load(&l, path, NULL, &why))
            fail_msg("%s", why.text);
        assert_int_equal(l->scan.fixed, i == 0);
        launchfile_destroy(l);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_scan_is_stepped_and_what_it_subtracts_was_recorded),
        TEST(a_fixed_array_has_its_speakers_and_backgrounds),
        TEST(what_does_not_fit_is_named),
        TEST(launch_files_of_the_papers_arrangements_can_be_loaded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
