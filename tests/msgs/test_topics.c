/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "msgs/envelope.h"
#include "msgs/topics.h"

static void every_topic_is_found_by_its_name_and_unique(void **state)
{
    (void)state;
    size_t n = 0;
    for (const struct topic *t = topics_all(); t->name; t++, n++) {
        assert_ptr_equal(topics_find(t->name), t);
        for (const struct topic *u = topics_all(); u < t; u++)
            assert_string_not_equal(u->name, t->name);
    }
    assert_int_equal(n, 24);
}

static void an_unknown_name_finds_nothing(void **state)
{
    (void)state;
    assert_null(topics_find("pings"));
    assert_null(topics_find(""));
    assert_null(topics_find("*"));
}

static void every_topic_fits_the_envelope_and_its_bounds_make_sense(void **state)
{
    (void)state;
    for (const struct topic *t = topics_all(); t->name; t++) {
        assert_true(strlen(t->name) < ENVELOPE_TOPIC_SIZE);
        assert_non_null(t->schema);
        assert_true(t->rate_hz >= 0);
        assert_true(t->depth >= 1);
        if (t->policy == TOPIC_LATEST)
            assert_int_equal(t->depth, 1);
        assert_in_range(t->max_size, 1, UINT32_MAX - ENVELOPE_SIZE);
    }
}

/* "hand", "page" and "recorder" are a person's commands, "vehicle" a replay beside a node
 * can: they are not there all the time. */
static void every_publisher_is_a_node_or_a_person(void **state)
{
    (void)state;
    for (const struct topic *t = topics_all(); t->name; t++) {
        const char *name;
        size_t n = 0;
        for (; (name = topic_publisher(t, n)); n++) {
            const char *const *node = topics_nodes();
            while (*node && strcmp(*node, name) != 0)
                node++;
            assert_true(*node || !strcmp(name, "hand") || !strcmp(name, "vehicle") ||
                        !strcmp(name, "page") || !strcmp(name, "recorder"));
            assert_true(topic_is_published_by(t, name));
        }
        assert_true(n >= 1);
        assert_null(topic_publisher(t, n + 1));
        assert_false(topic_is_published_by(t, "nobody"));
        assert_false(topic_is_published_by(t, "*"));
    }
}

static void every_node_publishes_its_health(void **state)
{
    (void)state;
    size_t n = 0;
    for (const char *const *node = topics_nodes(); *node; node++, n++) {
        assert_true(strlen(*node) < ENVELOPE_NODE_SIZE);
        assert_true(topic_is_published_by(topic_health(), *node));
        assert_string_equal(topic_publisher(topic_health(), n), *node);
    }
    assert_int_equal(n, 13);
    assert_null(topic_publisher(topic_health(), n));
}

static void the_functions_name_the_topics_they_say(void **state)
{
    (void)state;
    const struct {
        const struct topic *topic;
        const char *name, *schema, *publisher;
    } cases[] = {
        {topic_survey(), "survey", "anlos.Survey", "array"},
        {topic_stage_command(), "stage/command", "anlos.StageCommand", "scan"},
        {topic_stage_state(), "stage/state", "anlos.StageState", "stage"},
        {topic_stage_manual(), "stage/manual", "anlos.StageManual", "hand"},
        {topic_fire(), "array/fire", "anlos.FireCommand", "scan"},
        {topic_ping(), "ping", "anlos.Ping", "array"},
        {topic_traces(), "traces", "anlos.Traces", "dsp"},
        {topic_volume(), "volume", "anlos.Volume", "recon"},
        {topic_detections(), "detections", "anlos.DetectionList", "track"},
        {topic_scan_status(), "scan/status", "anlos.ScanStatus", "scan"},
        {topic_receipt(), "receipt", "anlos.Receipt", "dsp"},
        {topic_receipt(), "receipt", "anlos.Receipt", "recon"},
        {topic_health(), "health", "anlos.Health", "launcher"},
        {topic_log(), "log", "anlos.Log", "launcher"},
        {topic_clock(), "clock", "anlos.Clock", "play"},
        {topic_host(), "host", "anlos.HostStatus", "launcher"},
        {topic_wall(), "wall", "anlos.WallList", "wall"},
        {topic_wall_given(), "wall/given", "anlos.WallList", "can"},
        {topic_echoes(), "echoes", "anlos.Echoes", "dsp"},
        {topic_ego(), "ego", "anlos.EgoMotion", "can"},
        {topic_ambient(), "ambient", "anlos.Ambient", "can"},
        {topic_places(), "array/places", "anlos.ElementPlaces", "dsp"},
        {topic_progress(), "progress", "anlos.Progress", "can"},
        {topic_save(), "record/save", "anlos.SaveRequest", "hand"},
        {topic_save(), "record/save", "anlos.SaveRequest", "can"},
        {topic_save_status(), "record/status", "anlos.SaveStatus", "record"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_string_equal(cases[i].topic->name, cases[i].name);
        assert_string_equal(cases[i].topic->schema->name, cases[i].schema);
        assert_true(topic_is_published_by(cases[i].topic, cases[i].publisher));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_topic_is_found_by_its_name_and_unique),
        cmocka_unit_test(an_unknown_name_finds_nothing),
        cmocka_unit_test(every_topic_fits_the_envelope_and_its_bounds_make_sense),
        cmocka_unit_test(every_publisher_is_a_node_or_a_person),
        cmocka_unit_test(every_node_publishes_its_health),
        cmocka_unit_test(the_functions_name_the_topics_they_say),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
