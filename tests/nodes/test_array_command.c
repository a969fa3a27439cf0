/* SPDX-License-Identifier: MIT */
/* `anlos array` where no card is: its own null device stands for one. */
#include <jansson.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/anlos/commands.h"
#include "tests/nodes/command.h"

static char config[64];

static int set_up(void **state)
{
    static const char text[] = "pcm.null { type null hint { show on "
                               "description \"Nothing at all\" } }\n";
    (void)state;
    strcpy(config, "/tmp/anlos-asound-XXXXXX");
    int fd = mkstemp(config);
    if (fd < 0 || write(fd, text, strlen(text)) != (ssize_t)strlen(text) || close(fd))
        return -1;
    return setenv("ALSA_CONFIG_PATH", config, 1);
}

static int tear_down(void **state)
{
    (void)state;
    return unlink(config);
}

static void list_names_the_plugins_too(void **state)
{
    struct command_result r;
    char *words[] = {"array", "list", NULL};
    (void)state;
    command_run(&r, command_array, words);
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.out, "device"));
    assert_non_null(strstr(r.out, "null "));
    assert_non_null(strstr(r.out, "Nothing at all"));
}

static void list_is_there_as_json(void **state)
{
    struct command_result r;
    char *words[] = {"array", "list", "--json", NULL};
    (void)state;
    command_run(&r, command_array, words);
    assert_int_equal(r.code, 0);
    json_t *o = json_loads(r.out, 0, NULL);
    assert_true(json_is_array(o) && json_array_size(o) >= 1);
    const json_t *last = json_array_get(o, json_array_size(o) - 1);
    assert_string_equal(json_string_value(json_object_get(last, "device")), "null");
    assert_true(json_is_false(json_object_get(last, "card")));
    assert_true(json_is_true(json_object_get(last, "capture")));
    json_decref(o);
}

static void probe_tells_what_a_device_can_do(void **state)
{
    static const char *const parts[] = {
        "playback",    "capture", "S32 S24 S24_3 float S16",
        "44100 48000", "mmap rw", "one clock no: it is no card's own device"};
    struct command_result r;
    char *words[] = {"array", "probe", "alsa:null?rig=lab.yaml", NULL};
    (void)state;
    command_run(&r, command_array, words);
    assert_int_equal(r.code, 0);
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++)
        assert_non_null(strstr(r.out, parts[i]));
}

static void probe_is_there_as_json(void **state)
{
    struct command_result r;
    char *words[] = {"array", "probe", "null", "--json", NULL};
    (void)state;
    command_run(&r, command_array, words);
    assert_int_equal(r.code, 0);
    json_t *o = json_loads(r.out, 0, NULL);
    assert_non_null(o);
    const json_t *playback = json_object_get(o, "playback");
    assert_true(json_is_false(json_object_get(o, "one_clock")));
    assert_int_equal(json_array_size(json_object_get(playback, "formats")), 5);
    assert_int_equal(
        json_integer_value(json_array_get(json_object_get(playback, "channels"), 0)), 1);
    json_decref(o);
}

static void what_is_wrong_is_said(void **state)
{
    static const struct {
        char *words[5];
        const char *text;
    } cases[] = {
        {{"array", NULL}, "expected list or probe DEVICE"},
        {{"array", "show", NULL}, "show: expected list or probe DEVICE"},
        {{"array", "list", "hw:0", NULL}, "expected list or probe DEVICE"},
        {{"array", "probe", NULL}, "probe: expected one device"},
        {{"array", "probe", "hw:77", NULL}, "hw:77: playback: no such device; "},
        {{"array", "list", "--jsn", NULL}, "did you mean --json?"},
    };
    struct command_result r;
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        command_run(&r, command_array, cases[i].words);
        assert_int_equal(r.code, 2);
        assert_non_null(strstr(r.err, cases[i].text));
        assert_string_equal(r.out, "");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(list_names_the_plugins_too),
        cmocka_unit_test(list_is_there_as_json),
        cmocka_unit_test(probe_tells_what_a_device_can_do),
        cmocka_unit_test(probe_is_there_as_json),
        cmocka_unit_test(what_is_wrong_is_said),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
