/* SPDX-License-Identifier: MIT */
/* Each node's program that needs a survey, while there is none, and when it comes. */
#include "tests/hal/scratch.h"
#include "tests/nodes/alone.h"

#include <inttypes.h>

#include "msgs/array.pb-c.h"
#include "msgs/topics.h"
#include "msgs/traces.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "msgs/wall.pb-c.h"

#define NODES "nodes: [dsp, recon, wall, track]\n"
#define FIXED NODES "scan: {mode: fixed}\n"

struct first { /* who says what to whom */
    const char *node, *launch, *from;
    const struct topic *topic;
    const ProtobufCMessage *message;
    const char *count;
    uint64_t n; /* times */
};

/* All, once they are connected: of volumes the newest replaces what waits. */
static void send_early(struct alone *a, struct bus *from, const struct first *f)
{
    struct bus_message m;

    while (!alone_is_heard(from, f->topic))
        assert_false(alone_hear(a, &m));
    for (uint64_t i = 0; i < f->n; i++)
        assert_int_equal(
            bus_publish_message(from, f->topic, 1, alone_now_ns(), f->message), 0);
    while (alone_device(a, f->count) < f->n)
        assert_false(alone_hear(a, &m));
    assert_true(alone_is(a, ANLOS__HEALTH__STATE__STARTING));
}

static void tell_survey(struct alone *a, struct bus *array)
{
    const struct survey s = alone_survey();
    struct bus_message m;

    while (alone_is(a, ANLOS__HEALTH__STATE__STARTING)) {
        alone_tell_survey(array, &s);
        assert_false(alone_hear(a, &m));
    }
    alone_tell_survey(array, &s); /* as it comes each second */
}

/* Of all that the log says one line is of these, with their number, and none complains.
 */
static void check_log(const char *log, const struct first *f)
{
    char line[128];

    snprintf(line, sizeof line, "info    %s, ignored: %" PRIu64 "\n", f->count, f->n);
    assert_contains(log, line);
    assert_null(strstr(strstr(log, line) + strlen(line), "ignored"));
    assert_null(strstr(log, "cannot be used"));
    assert_null(strstr(log, "not known yet"));
    assert_null(strstr(log, "more in"));
}

static void check(void **state, const struct first *f)
{
    const struct scratch *s = *state;
    struct bus *array = alone_bus(s->folder, "array");
    struct bus *from = strcmp(f->from, "array") ? alone_bus(s->folder, f->from) : array;
    struct alone a;

    alone_start(&a, s->folder, f->node, f->launch);
    send_early(&a, from, f);
    tell_survey(&a, array);
    alone_stop(&a);
    char *log = alone_log(&a);
    check_log(log, f);
    free(log);
    if (from != array)
        bus_destroy(from);
    bus_destroy(array);
}

static void pings_before_the_survey_are_counted_and_told_of_once(void **state)
{
    Anlos__Ping ping = ANLOS__PING__INIT;

    ping.survey_id = ping.frame = 1;
    check(state, &(struct first){"dsp", FIXED, "array", topic_ping(), &ping.base,
                                 "pings before the survey", 3});
}

static void walls_are_not_heard_before_the_survey(void **state)
{
    Anlos__Echoes echoes = ANLOS__ECHOES__INIT;

    echoes.survey_id = echoes.frame = 1;
    check(state,
          &(struct first){"wall", FIXED "wall: {from: echoes}\n", "dsp", topic_echoes(),
                          &echoes.base, "pings before the survey", 3});
}

static void traces_before_the_survey_are_counted_and_told_of_once(void **state)
{
    Anlos__Traces traces = ANLOS__TRACES__INIT;

    traces.survey_id = traces.frame = 1;
    check(state, &(struct first){"recon", FIXED, "dsp", topic_traces(), &traces.base,
                                 "traces before the survey", 3});
}

static void so_are_those_of_a_scan(void **state)
{
    Anlos__Traces traces = ANLOS__TRACES__INIT;

    traces.survey_id = 1;
    check(state,
          &(struct first){"recon", NODES "recon: {method: backprojection}\n", "dsp",
                          topic_traces(), &traces.base, "traces before the survey", 3});
}

static void volumes_before_the_survey_are_counted_and_told_of_once(void **state)
{
    Anlos__Volume volume = ANLOS__VOLUME__INIT;

    volume.survey_id = volume.frame = 1;
    check(state, &(struct first){"track", FIXED, "recon", topic_volume(), &volume.base,
                                 "volumes before the survey", 1});
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(pings_before_the_survey_are_counted_and_told_of_once),
        TEST(walls_are_not_heard_before_the_survey),
        TEST(traces_before_the_survey_are_counted_and_told_of_once),
        TEST(so_are_those_of_a_scan),
        TEST(volumes_before_the_survey_are_counted_and_told_of_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
