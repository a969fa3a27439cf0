/* SPDX-License-Identifier: MIT */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <unistd.h>

#include "nodes/launcher/devices.h"

#define SCENE SOURCE_DIR "/tests/nodes/point.yaml"

static int check(struct scratch *s, const char *nodes, const char *parts,
                 struct error *why)
{
    char text[1024];
    struct launchfile *l = NULL;

    why->text[0] = '\0';
    snprintf(text, sizeof text, "nodes: [%s]\n%sreport: {folder: %s}\n", nodes, parts,
             s->folder);
    if (launchfile_load(&l, scratch_write(s, "a.yaml", text), NULL, why))
        fail_msg("%s", why->text);
    int err = devices_check(l, why);
    launchfile_destroy(l);
    return err;
}

static void devices_that_are_there_are_fine_and_no_log_is_made(void **state)
{
    struct scratch *s = *state;
    struct error why;

    if (check(s, "array, stage, can", "array: {uri: 'sim:" SCENE "'}\n", &why))
        fail_msg("%s", why.text);
    assert_int_not_equal(access(scratch_path(s, "can.candump"), F_OK), 0);
    if (check(s, "array, can",
              "array: {uri: 'sim:" SCENE "'}\ncan: {uri: 'sim:" SCENE "?log=x'}\n", &why))
        fail_msg("%s", why.text);
    assert_int_not_equal(access(scratch_path(s, "x"), F_OK), 0);
}

static void what_is_not_there_is_named_with_file_and_key(void **state)
{
    static const struct {
        const char *parts, *said;
        int err;
    } cases[] = {
        {"array: {uri: 'sim:nowhere.yaml'}\n", "a.yaml: array.uri: sim:", -ENOENT},
        {"array: {uri: 'wav:nowhere'}\n", "a.yaml: array.uri: wav:", -ENOENT},
        {"array: {uri: 'alsa:hw:9'}\n", "a.yaml: array.uri: alsa:hw:9", -EINVAL},
        {"array: {uri: 'sim:" SCENE "'}\nstage: {uri: 'zaber:/dev/no?pitch_mm=1'}\n",
         "a.yaml: stage.uri: zaber:/dev/no", -ENOENT},
        {"array: {uri: 'sim:" SCENE "'}\ncan: {uri: 'socketcan:nocan'}\n",
         "a.yaml: can.uri: socketcan:nocan", -ENODEV},
        {"array: {uri: 'sim:" SCENE "'}\ncan: {uri: 'sim:/nowhere.yaml?log=x'}\n",
         "a.yaml: can.uri: sim:/nowhere.yaml?log=", -ENOENT},
        {"array: {uri: 'sim:" SCENE "'}\ncan: {uri: 'sim:" SCENE "?lgo=x'}\n",
         "?lgo=x: there is no option \"lgo\"; expected log, interface", -EINVAL},
        {"array: {uri: 'sim:" SCENE "'}\ncan: {uri: 'log:x?interface=a b'}\n",
         "interface \"a b\": expected a name", -EINVAL},
        {"array: {uri: 'sim:" SCENE "'}\ncan: {uri: 'log:x?interfaces=a'}\n",
         "x?interfaces=a: there is no option \"interfaces\"", -EINVAL},
        {"array: {uri: 'sim:" SCENE "'}\ncan: {uri: 'log:/tmp'}\n",
         "a.yaml: can.uri: log:/tmp: /tmp cannot be written: Is a directory", -EISDIR},
        {"array: {uri: 'sim:" SCENE "'}\ncan: {uri: 'sim:" SCENE "?log=/dev/null/x'}\n",
         "/dev/null/x cannot be written: Not a directory", -ENOTDIR},
    };
    struct error why;

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(check(*state, "array, stage, can", cases[i].parts, &why),
                         cases[i].err);
        assert_contains(why.text, cases[i].said);
    }
}

#define DRIVE SOURCE_DIR "/launch/scenes/drive-nothing.yaml"
#define OTHER SOURCE_DIR "/launch/scenes/drive-clutter.yaml"

static void simulated_devices_have_to_go_together(void **state)
{
    static const struct {
        const char *parts, *said; /* NULL: nothing */
    } cases[] = {
        {"array: {uri: 'sim:" DRIVE "'}\nscan: {mode: fixed}\n"
         "can: {uri: 'sim:" OTHER "?log=x'}\n",
         "drive-nothing.yaml (array.uri); name the same scene in both"},
        {"array: {uri: 'sim:" DRIVE "'}\ncan: {uri: 'log:x'}\n",
         "a.yaml: scan.mode: " DRIVE " is a drive"},
        {"array: {uri: 'sim:" DRIVE "'}\nscan: {mode: fixed}\n"
         "can: {uri: 'sim:" SOURCE_DIR
         "/launch/../launch/scenes/drive-nothing.yaml?ego=off'}\n",
         NULL},
        {"array: {uri: 'sim:" DRIVE "'}\nscan: {mode: fixed}\ncan: {uri: 'log:x'}\n",
         NULL},
        {"array: {uri: 'sim:" DRIVE "'}\nscan: {mode: fixed, speakers: [0, 16]}\n",
         "a.yaml: scan.speakers: the survey has speakers 0 to 15, not 16"},
        {"array: {uri: 'sim:" SOURCE_DIR "/launch/scenes/corner.yaml'}\n"
         "scan: {mode: fixed}\n",
         "a.yaml: scan.mode is fixed, but the survey has "},
    };
    struct error why;

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int err = check(*state, "array, scan, can", cases[i].parts, &why);
        assert_int_equal(err, cases[i].said ? -EINVAL : 0);
        if (cases[i].said)
            assert_contains(why.text, cases[i].said);
    }
}

static void a_recording_without_a_background_has_none_to_be_scanned(void **state)
{
    static const struct {
        const char *parts, *said; /* NULL: nothing */
    } cases[] = {
        {"array: {uri: 'wav:/rec'}\nscan: {background: true}\n",
         "a.yaml: scan.background: wav:/rec names no recording of it; name one with"},
        {"array: {uri: 'wav:/rec?loop=yes'}\nscan: {background: true}\n",
         "a.yaml: scan.background: wav:/rec?loop=yes names no recording of it"},
        {"array: {uri: 'wav:/rec?background=/empty'}\nscan: {background: true}\n", NULL},
        {"array: {uri: 'wav:/rec'}\nscan: {background: false}\n", NULL},
    };
    struct scratch *s = *state;

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[200];
        struct error why = {""};
        struct launchfile *l = NULL;
        snprintf(text, sizeof text, "nodes: [array, scan]\n%s", cases[i].parts);
        if (launchfile_load(&l, scratch_write(s, "a.yaml", text), NULL, &why))
            fail_msg("%s", why.text);
        assert_int_equal(devices_fit(l, &why), cases[i].said ? -EINVAL : 0);
        if (cases[i].said)
            assert_contains(why.text, cases[i].said);
        launchfile_destroy(l);
    }
}

static void what_no_node_uses_is_not_looked_at(void **state)
{
    struct error why;

    assert_int_equal(check(*state, "dsp", "array: {uri: 'wav:nowhere'}\n", &why), 0);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(devices_that_are_there_are_fine_and_no_log_is_made),
        TEST(what_is_not_there_is_named_with_file_and_key),
        TEST(simulated_devices_have_to_go_together),
        TEST(a_recording_without_a_background_has_none_to_be_scanned),
        TEST(what_no_node_uses_is_not_looked_at),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
