/* SPDX-License-Identifier: MIT */
/* recon.frames in a launch file: images of a fixed array. */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/rt/launchfile.h"

static int parse(struct launchfile **l, const char *frames, struct error *why)
{
    char text[256];
    int n =
        snprintf(text, sizeof text, "nodes: [recon]\nscan: {mode: fixed}\n%s\n", frames);
    return launchfile_parse(l, "drive.yaml", text, (size_t)n, why);
}

static void by_default_the_pings_of_a_frame_make_its_image_by_power(void **state)
{
    (void)state;
    struct error why = {""};
    struct launchfile *l;
    assert_int_equal(parse(&l, "", &why), 0);
    assert_int_equal(l->recon.frames.pings, 0);
    assert_int_equal(l->recon.frames.sum, FRAMES_POWER);
    assert_false(l->recon.frames.every_ping);
    launchfile_destroy(l);
}

static void pings_their_sum_and_their_pace_can_be_set(void **state)
{
    (void)state;
    struct error why = {""};
    struct launchfile *l;
    assert_int_equal(
        parse(&l, "recon: {frames: {pings: 4, sum: coherent, every: ping}}", &why), 0);
    assert_int_equal(l->recon.frames.pings, 4);
    assert_int_equal(l->recon.frames.sum, FRAMES_COHERENT);
    assert_true(l->recon.frames.every_ping);
    launchfile_destroy(l);
}

static void what_they_cannot_be_is_refused_by_name(void **state)
{
    (void)state;
    static const struct {
        const char *frames, *said;
    } wrong[] = {
        {"recon: {frames: {pings: 257}}", "recon.frames.pings: expected 0 to 256"},
        {"recon: {frames: {sum: loud}}", "recon.frames.sum: expected coherent or power"},
        {"recon: {frames: {every: day}}", "recon.frames.every: expected ping or frame"},
        {"recon: {method: fast}", "recon.method: is for scans"},
        {"recon: {options: {snr_db: 10}}", "recon.options: is for scans"},
        {"recon: {preview: true}", "recon.preview: is for scans"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        struct error why = {""};
        struct launchfile *l;
        assert_int_equal(parse(&l, wrong[i].frames, &why), -EINVAL);
        if (!strstr(why.text, wrong[i].said))
            fail_msg("%s", why.text);
    }
}

static void of_a_scan_they_are_refused(void **state)
{
    (void)state;
    static const char text[] = "nodes: [recon]\nrecon: {frames: {pings: 4}}\n";
    struct error why = {""};
    struct launchfile *l;
    assert_int_equal(launchfile_parse(&l, "a.yaml", text, sizeof text - 1, &why),
                     -EINVAL);
    assert_non_null(strstr(why.text, "recon.frames"));
    assert_non_null(strstr(why.text, "scan.mode: fixed"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(by_default_the_pings_of_a_frame_make_its_image_by_power),
        cmocka_unit_test(pings_their_sum_and_their_pace_can_be_set),
        cmocka_unit_test(what_they_cannot_be_is_refused_by_name),
        cmocka_unit_test(of_a_scan_they_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
