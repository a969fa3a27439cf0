/* SPDX-License-Identifier: MIT */
/* `anlos topic` against a bus that this process publishes on. */
#include <jansson.h>
#include <poll.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "msgs/bus.h"
#include "msgs/stage.pb-c.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/feed.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"

#define DEADLINE_S 60

static char run_dir[64];

static int set_up(void **state)
{
    (void)state;
    strcpy(run_dir, "/tmp/anlos-topic-XXXXXX");
    return mkdtemp(run_dir) ? 0 : -1;
}

static void list_shows_every_topic_of_the_table(void **state)
{
    (void)state;
    struct command_result r;
    char *words[] = {"topic", "list", NULL};
    command_run(&r, command_topic, words);
    assert_int_equal(r.code, 0);
    for (const struct topic *t = topics_all(); t->name; t++) {
        assert_non_null(strstr(r.out, t->name));
        assert_non_null(strstr(r.out, t->schema->name));
    }
}

static void list_is_json_for_programs(void **state)
{
    char *words[] = {"topic", "list", "--json", NULL};
    struct command_result r;
    size_t n = 0;

    (void)state;
    command_run(&r, command_topic, words);
    assert_int_equal(r.code, 0);
    json_t *list = json_loads(r.out, 0, NULL);
    assert_non_null(list);
    for (const struct topic *t = topics_all(); t->name; t++, n++) {
        const json_t *o = json_array_get(list, n);
        assert_string_equal(json_string_value(json_object_get(o, "topic")), t->name);
        assert_int_equal(json_integer_value(json_object_get(o, "max_bytes")),
                         t->max_size);
        assert_string_equal(
            json_string_value(json_array_get(json_object_get(o, "publishers"), 0)),
            topic_publisher(t, 0));
    }
    assert_int_equal(json_array_size(list), n);
    json_decref(list);
}

static void nothing_running_is_said_clearly(void **state)
{
    (void)state;
    struct command_result r;
    char *echo[] = {"topic", "echo", "ping", "--run-dir", run_dir, NULL};
    char *hz[] = {"topic", "hz", "--run-dir", run_dir, NULL};
    char *bw[] = {"topic", "bw", "--run-dir", run_dir, NULL};
    char *delay[] = {"topic", "delay", "--run-dir", run_dir, NULL};
    char **all[] = {echo, hz, bw, delay};
    for (int i = 0; i < 4; i++) {
        command_run(&r, command_topic, all[i]);
        assert_int_equal(r.code, 1);
        assert_non_null(strstr(r.err, "nothing is running"));
        assert_non_null(strstr(r.err, run_dir));
        assert_string_equal(r.out, "");
    }
}

static void a_folder_that_is_not_there_is_not_made(void **state)
{
    (void)state;
    struct command_result r;
    char away[96];
    char *hz[] = {"topic", "hz", "--run-dir", away, NULL};
    char *top[] = {"top", "--once", "--run-dir", away, NULL};
    snprintf(away, sizeof away, "%s/away", run_dir);
    command_run(&r, command_topic, hz);
    assert_int_equal(r.code, 1);
    assert_non_null(strstr(r.err, "nothing is running"));
    command_run(&r, command_top, top);
    assert_int_equal(r.code, 1);
    assert_non_null(strstr(r.err, "nothing is running"));
    assert_int_equal(access(away, F_OK), -1);
}

static void wrong_arguments_are_refused(void **state)
{
    (void)state;
    struct command_result r;
    char *none[] = {"topic", NULL}, *verb[] = {"topic", "list2", NULL};
    char *which[] = {"topic", "echo", NULL}, *typo[] = {"topic", "echo", "pings", NULL};
    char *count[] = {"topic", "echo", "ping", "--count", "0", NULL};
    char *time[] = {"topic", "hz", "--seconds", "-3", NULL};
    char *ages[] = {"topic", "hz", "--seconds", "1e12", NULL};
    char *listed[] = {"topic", "list", "--count", "3", NULL};
    char *whole[] = {"topic", "hz", "--full", NULL};
    char *echoed[] = {"topic", "echo", "ping", "--seconds", "3", NULL};
    char *odd[] = {"topic", "hz", "xyzzy", NULL};
    char *field[] = {"topic", "echo", "ego", "--field", "speed", NULL};
    char *both[] = {"topic", "echo", "ego", "--mcap", "--full", NULL};
    char *unnamed[] = {"topic", "pub", NULL};
    char *paced[] = {"topic", "pub", "ego", "--rate", "0", NULL};
    char *silent[] = {"topic", "pub", "ego", "--timeout", "3", NULL};
    char **all[] = {none,  verb,   which, typo,  count, time,    ages,  listed,
                    whole, echoed, odd,   field, both,  unnamed, paced, silent};
    static const char *const texts[] = {"is missing",
                                        "list2",
                                        "expected a topic",
                                        "pings: no such topic; did you mean ping?",
                                        "--count 0",
                                        "--seconds -3",
                                        "--seconds 1e12",
                                        "list has no such option",
                                        "hz has no such",
                                        "echo has no such",
                                        "xyzzy: no such topic; 'anlos topic list'",
                                        "speed: anlos.EgoMotion has no such field",
                                        "--mcap: not with --full",
                                        "pub: expected one topic",
                                        "--rate 0",
                                        "pub has no such"};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        command_run(&r, command_topic, all[i]);
        assert_int_equal(r.code, 2);
        assert_non_null(strstr(r.err, texts[i]));
    }
}

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Publishes states until the child has written something or ended, then reads its output
 * to the end. */
static size_t publish_until_answered(int fd, char *text, size_t size)
{
    struct bus_config cfg = {.node = "stage", .run_dir = run_dir, .epoch_ns = 1};
    struct error why = {0};
    struct bus *bus;
    size_t used = 0;
    double deadline_s = now_s() + DEADLINE_S;
    struct pollfd p = {.fd = fd, .events = POLLIN};
    Anlos__StageState m = ANLOS__STAGE_STATE__INIT;
    m.state = ANLOS__STAGE_STATE__STATE__MOVING;
    m.position_m = 0.25;
    m.text = "on its way";
    assert_int_equal(bus_create(&bus, &cfg, &why), 0);
    while (!poll(&p, 1, 5)) { /* the time between two states */
        assert_true(now_s() < deadline_s);
        assert_int_equal(bus_publish_message(bus, topic_stage_state(), 11, 22, &m.base),
                         0);
    }
    assert_true(feed_answers(run_dir));
    for (ssize_t n; used + 1 < size && (n = read(fd, text + used, size - 1 - used)) > 0;)
        used += (size_t)n;
    text[used] = '\0';
    bus_destroy(bus);
    return used;
}

static int ended(pid_t pid)
{
    int status;
    assert_int_equal(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void echo_prints_a_message_as_one_line_of_json(void **state)
{
    (void)state;
    char text[4096];
    int out, err;
    char *words[] = {"topic",  "echo",      "stage/state", "--count", "1",
                     "--wait", "--run-dir", run_dir,       NULL};
    pid_t pid = command_start(command_topic, words, &out, &err);
    publish_until_answered(out, text, sizeof text);
    assert_int_equal(ended(pid), 0);
    close(out);
    close(err);
    char *end = strchr(text, '\n');
    assert_non_null(end);
    *end = '\0';
    json_t *j = json_loads(text, 0, NULL);
    assert_non_null(j);
    assert_string_equal(json_string_value(json_object_get(j, "topic")), "stage/state");
    assert_string_equal(json_string_value(json_object_get(j, "from")), "stage");
    assert_int_equal(json_integer_value(json_object_get(j, "capture_ns")), 11);
    const json_t *content = json_object_get(j, "content");
    assert_string_equal(json_string_value(json_object_get(content, "state")), "MOVING");
    assert_near(json_real_value(json_object_get(content, "position_m")), 0.25, 0.0);
    json_decref(j);
}

/* The row of stage/state in what the verb prints after so many seconds. */
static const char *watch_for(const char *seconds, const char *verb, char *text,
                             size_t size)
{
    int out, err;
    char *words[] = {"topic",  (char *)verb, "stage/state", "--seconds", (char *)seconds,
                     "--wait", "--run-dir",  run_dir,       NULL};
    pid_t pid = command_start(command_topic, words, &out, &err);
    publish_until_answered(out, text, size);
    assert_int_equal(ended(pid), 0);
    close(out);
    close(err);
    const char *row = strstr(text, "\nstage/state ");
    assert_non_null(row);
    assert_null(strstr(text, "\033")); /* in a pipe nothing is drawn */
    return row;
}

/* A busy machine may hear nothing for half a second. */
static const char *watch(const char *verb, char *text, size_t size)
{
    static const char *const seconds[] = {"0.5", "5", "30"};
    const char *row = NULL;
    unsigned long messages = 0;
    for (size_t i = 0; i < 3 && messages <= 3; i++) {
        row = watch_for(seconds[i], verb, text, size);
        assert_int_equal(sscanf(row, " stage/state %*s %lu", &messages), 1);
    }
    return row;
}

static void hz_tells_rate_intervals_and_gaps(void **state)
{
    (void)state;
    char text[4096], from[16];
    unsigned long messages = 0, gaps = 99;
    double rate_hz, expected_hz, mean_ms, min_ms, max_ms, std_ms;
    const char *row = watch("hz", text, sizeof text);
    assert_int_equal(sscanf(row, " stage/state %15s %lu %lf/%lf %lf %lf %lf %lf %lu",
                            from, &messages, &rate_hz, &expected_hz, &mean_ms, &min_ms,
                            &max_ms, &std_ms, &gaps),
                     9);
    assert_string_equal(from, "stage");
    assert_true(messages > 3);
    assert_near(expected_hz, topic_stage_state()->rate_hz, 0.0);
    /* Rounded to 0.5 Hz and 0.05 ms at the worst. */
    assert_near(rate_hz * mean_ms, 1000.0, 0.5 * mean_ms + 0.05 * rate_hz);
    assert_true(min_ms <= mean_ms && mean_ms <= max_ms && std_ms <= max_ms - min_ms);
    assert_int_equal(gaps, 0);
}

static void bw_tells_bytes_a_second_and_of_a_message(void **state)
{
    (void)state;
    char text[4096], from[16];
    unsigned long messages = 0;
    double mean, min, max;
    Anlos__StageState m = ANLOS__STAGE_STATE__INIT;
    m.state = ANLOS__STAGE_STATE__STATE__MOVING;
    m.position_m = 0.25;
    m.text = "on its way";
    double size = (double)anlos__stage_state__get_packed_size(&m);
    const char *row = watch("bw", text, sizeof text);
    assert_int_equal(sscanf(row, " stage/state %15s %lu %*f %*[kB] %lf B %lf B %lf B",
                            from, &messages, &mean, &min, &max),
                     5);
    assert_near(mean, size, 0.0);
    assert_near(min, size, 0.0);
    assert_near(max, size, 0.0);
}

static void delay_tells_times_since_sound_and_sending(void **state)
{
    (void)state;
    char text[4096], from[16];
    unsigned long messages = 0;
    double capture[2], published[2];
    const char *row = watch("delay", text, sizeof text);
    assert_int_equal(sscanf(row, " stage/state %15s %lu %lf %lf %lf %lf", from, &messages,
                            &capture[0], &capture[1], &published[0], &published[1]),
                     6);
    /* Its stamps are 11 and 22 ns after 1970. */
    double now_ms = 1e3 * (double)time(NULL);
    for (int i = 0; i < 2; i++) {
        assert_near(capture[i], now_ms, 60e3);
        assert_near(published[i], now_ms, 60e3);
    }
}

static void ctrl_c_ends_it_with_the_table_so_far(void **state)
{
    (void)state;
    char text[4096];
    int out, err;
    size_t used = 0;
    char *words[] = {"topic",  "hz",        "--seconds", "1000",
                     "--wait", "--run-dir", run_dir,     NULL};
    pid_t pid = command_start(command_topic, words, &out, &err);
    assert_true(read(err, text, sizeof text) > 0); /* "yet; waiting" */
    assert_int_equal(kill(pid, SIGINT), 0);
    for (ssize_t n; used + 1 < sizeof text &&
                    (n = read(out, text + used, sizeof text - 1 - used)) > 0;)
        used += (size_t)n;
    text[used] = '\0';
    assert_int_equal(ended(pid), 130);
    close(out);
    close(err);
    assert_non_null(strstr(text, "scan/status"));
}

/* A bus of that node lives while this runs in a child; its words go to r. */
static void pub_beside(const char *node, enum bus_world world, char *const words[],
                       struct command_result *r)
{
    const struct bus_config cfg = {
        .node = node, .run_dir = run_dir, .epoch_ns = 1, .world = world};
    struct error why = {0};
    struct bus *bus;
    int ready[2], done[2];
    char c;
    assert_int_equal(pipe(ready) || pipe(done), 0);
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (!pid) {
        close(done[1]);
        if (bus_create(&bus, &cfg, &why) || write(ready[1], "", 1) != 1)
            _exit(1);
        _exit(read(done[0], &c, 1) < 0); /* until the other end is closed */
    }
    close(done[0]);
    assert_int_equal(read(ready[0], &c, 1), 1);
    command_run(r, command_topic, words);
    close(done[1]);
    assert_int_equal(ended(pid), 0);
    close(ready[0]);
    close(ready[1]);
}

static void what_a_process_says_is_refused_from_outside(void **state)
{
    (void)state;
    struct command_result r;
    char json[] = "{}";
    char *ego[] = {"topic", "pub", "ego", json, "--run-dir", run_dir, NULL};
    char *ping[] = {"topic", "pub", "ping", json, "--run-dir", run_dir, NULL};
    char *forced[] = {"topic",   "pub",       "ping",  json,
                      "--force", "--run-dir", run_dir, NULL};
    char *nobody[] = {"topic", "pub",       "ego",   json, "--from",
                      "stage", "--run-dir", run_dir, NULL};
    const struct {
        const char *beside;
        enum bus_world world;
        char **words;
        const char *says;
    } cases[] = {
        {"can", BUS_LIVE, ego, "can runs and says it already; --force"},
        {"stage", BUS_LIVE, ping, "only the process array says that"},
        {"array", BUS_LIVE, ping, "array itself runs"},
        {"array", BUS_LIVE, forced, "array itself runs"},
        {"dsp", BUS_REPLAY, ego, "replays a bag"},
        {"stage", BUS_LIVE, nobody, "--from stage: nobody of that name says ego"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        pub_beside(cases[i].beside, cases[i].world, cases[i].words, &r);
        assert_int_equal(r.code, 2);
        assert_non_null(strstr(r.err, cases[i].says));
    }
}

static void what_a_person_asks_for_is_said_beside_a_process_that_may_ask_too(void **state)
{
    (void)state;
    struct command_result r;
    char json[] = "{\"reason\": \"brake\"}";
    char *words[] = {"topic", "pub", "record/save", json, "--run-dir", run_dir, NULL};

    pub_beside("can", BUS_LIVE, words, &r);
    assert_null(strstr(r.err, "says it already"));
    assert_int_equal(r.code, 0);
}

/* What pub prints of a message, as echo would. */
static json_t *published(const char *json, const char *more, struct command_result *r)
{
    char *words[] = {"topic",  "pub",       "ego",   (char *)json, "--print",
                     "--wait", "--run-dir", run_dir, (char *)more, NULL};
    command_run(r, command_topic, words);
    return json_loads(r->out, JSON_DISABLE_EOF_CHECK, NULL);
}

static void what_comes_from_outside_has_a_name_and_stamps_of_its_own(void **state)
{
    (void)state;
    struct command_result r;
    double before_s = (double)time(NULL);
    json_t *j = published("{\"speed_m_s\": 1.5, \"valid\": true}", NULL, &r);
    assert_int_equal(r.code, 0);
    assert_non_null(j);
    assert_string_equal(json_string_value(json_object_get(j, "from")), "vehicle");
    assert_near(1e-9 * json_number_value(json_object_get(j, "capture_ns")), before_s, 60);
    json_t *content = json_object_get(j, "content");
    assert_near(json_number_value(json_object_get(content, "speed_m_s")), 1.5, 0.0);
    assert_true(json_is_true(json_object_get(content, "valid")));
    json_decref(j);
}

static void a_recorded_line_is_not_said_as_if_it_were_now(void **state)
{
    (void)state;
    struct command_result r;
    const char *old = "{\"topic\": \"ego\", \"capture_ns\": 11, \"content\": {}}";
    assert_null(published(old, NULL, &r));
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "a recording is for 'anlos bag play'"));
    json_t *j = published(old, "--force", &r);
    assert_int_equal(r.code, 0);
    assert_int_equal(json_integer_value(json_object_get(j, "capture_ns")), 11);
    json_decref(j);
    assert_null(published("{\"topic\": \"ping\", \"content\": {}}", NULL, &r));
    assert_non_null(strstr(r.err, "a message of ping, not of ego"));
}

static void a_wrong_message_is_named_by_its_line(void **state)
{
    (void)state;
    struct command_result r;
    FILE *lines = tmpfile();
    char *words[] = {"topic",  "pub",       "ego",   "-", "--print",
                     "--wait", "--run-dir", run_dir, NULL};
    assert_non_null(lines);
    fputs("{\"valid\": true}\n\n{\"valid\": 2}\n{}\n", lines);
    rewind(lines);
    int before = dup(STDIN_FILENO);
    dup2(fileno(lines), STDIN_FILENO);
    command_run(&r, command_topic, words);
    dup2(before, STDIN_FILENO);
    close(before);
    fclose(lines);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "line 3: valid: expected true or false"));
    assert_non_null(strstr(r.out, "\"sequence\":0"));
    assert_null(strstr(r.out, "\"sequence\":1"));
}

static void who_listens_hears_what_is_published(void **state)
{
    (void)state;
    char text[4096] = "", *end;
    int out, err;
    struct command_result r;
    char *echo[] = {"topic",         "echo",    "ambient", "--field",
                    "temperature_c", "--count", "2",       "--wait",
                    "--run-dir",     run_dir,   NULL};
    char *pub[] = {"topic",   "pub", "ambient",   "{\"temperature_c\": 21.5}",
                   "--count", "2",   "--run-dir", run_dir,
                   "--wait",  NULL};
    pid_t pid = command_start(command_topic, echo, &out, &err);
    assert_true(read(err, text, sizeof text) > 0); /* "yet; waiting" */
    for (struct pollfd p = {.fd = out, .events = POLLIN}; !poll(&p, 1, 0);) {
        command_run(&r, command_topic,
                    pub); /* echo may come to listen during the first */
        assert_int_equal(r.code, 0);
    }
    ssize_t n = read(out, text, sizeof text - 1);
    assert_true(n > 0);
    text[n] = '\0';
    assert_near(strtod(text, &end), 21.5, 0.0);
    assert_int_equal(*end, '\n');
    kill(pid, SIGINT);
    ended(pid);
    close(out);
    close(err);
}

static void silence_ends_echo_with_timeout(void **state)
{
    (void)state;
    struct command_result r;
    char *words[] = {"topic",  "echo",      "ping",  "--timeout", "0.2",
                     "--wait", "--run-dir", run_dir, NULL};
    command_run(&r, command_topic, words);
    assert_int_equal(r.code, 1);
    assert_non_null(strstr(r.err, "no message for 0.2 s"));
    assert_string_equal(r.out, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(list_shows_every_topic_of_the_table),
        cmocka_unit_test(list_is_json_for_programs),
        cmocka_unit_test(nothing_running_is_said_clearly),
        cmocka_unit_test(a_folder_that_is_not_there_is_not_made),
        cmocka_unit_test(wrong_arguments_are_refused),
        cmocka_unit_test(echo_prints_a_message_as_one_line_of_json),
        cmocka_unit_test(hz_tells_rate_intervals_and_gaps),
        cmocka_unit_test(bw_tells_bytes_a_second_and_of_a_message),
        cmocka_unit_test(delay_tells_times_since_sound_and_sending),
        cmocka_unit_test(
            what_a_person_asks_for_is_said_beside_a_process_that_may_ask_too),
        cmocka_unit_test(what_a_process_says_is_refused_from_outside),
        cmocka_unit_test(what_comes_from_outside_has_a_name_and_stamps_of_its_own),
        cmocka_unit_test(a_recorded_line_is_not_said_as_if_it_were_now),
        cmocka_unit_test(a_wrong_message_is_named_by_its_line),
        cmocka_unit_test(who_listens_hears_what_is_published),
        cmocka_unit_test(silence_ends_echo_with_timeout),
        cmocka_unit_test(ctrl_c_ends_it_with_the_table_so_far),
    };
    int failed = cmocka_run_group_tests(tests, set_up, NULL);
    char command[128];
    snprintf(command, sizeof command, "rm -rf %s", run_dir);
    return system(command) ? 1 : failed;
}
