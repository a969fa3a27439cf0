/* SPDX-License-Identifier: MIT */
/* `anlos doctor`: what it says of launch files, devices and systems that are not well. */
#include "hal/clock.h"
#include "tests/hal/scratch.h"

#include <arpa/inet.h>
#include <jansson.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include "msgs/keys.h"
#include "msgs/topics.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/doctor/doctor.h"
#include "tests/nodes/command.h"
#include "tests/nodes/living.h"

static struct scratch *scratch;
static char run_dir[128];

/* The programs of all nodes are there, whatever has been built. */
static int set_up(void **state)
{
    char name[64];

    (void)state;
    if (scratch_open((void **)&scratch))
        return -1;
    snprintf(run_dir, sizeof run_dir, "%s/run", scratch->folder);
    for (const char *const *n = topics_nodes(); *n; n++) {
        snprintf(name, sizeof name, "anlos-%s", *n);
        if (chmod(scratch_write(scratch, name, "#!/bin/sh\n"), 0755))
            return -1;
    }
    return setenv("ANLOS_BIN_DIR", scratch->folder, 1);
}

static int tear_down(void **state)
{
    void *s = scratch;

    (void)state;
    return scratch_close(&s);
}

/* Runs it on a launch file of this text, or without one, on this host of it, or without,
 * and returns its JSON. */
static json_t *run_host(struct command_result *r, const char *launch, const char *host)
{
    char path[600] = "";
    char *words[9] = {(char *)"doctor", (char *)"--json", (char *)"--run-dir", run_dir};

    if (launch) {
        snprintf(path, sizeof path, "%s", scratch_write(scratch, "a.yaml", launch));
        words[4] = (char *)"--launch";
        words[5] = path;
    }
    if (host) {
        words[6] = (char *)"--host";
        words[7] = (char *)host;
    }
    command_run(r, command_doctor, words);
    json_t *o = json_loads(r->out, 0, NULL);
    if (!o)
        fail_msg("no JSON: %s%s", r->out, r->err);
    return o;
}

static json_t *run(struct command_result *r, const char *launch)
{
    return run_host(r, launch, NULL);
}

/* The first finding of an area; NULL: there is none. */
static const json_t *find(const json_t *o, const char *area)
{
    const json_t *item;
    size_t i;

    json_array_foreach(json_object_get(o, "findings"), i, item)
    {
        if (!strcmp(json_string_value(json_object_get(item, "area")), area))
            return item;
    }
    return NULL;
}

static const char *text(const json_t *o, const char *area, const char *key)
{
    const json_t *item = find(o, area);

    if (!item)
        fail_msg("nothing is said of %s", area);
    return json_string_value(json_object_get(item, key));
}

static void expect(const json_t *o, const char *area, const char *level, const char *what)
{
    assert_string_equal(text(o, area, "level"), level);
    assert_contains(text(o, area, "what"), what);
}

static void a_good_launch_file_is_good(void **state)
{
    struct command_result r;

    (void)state;
    json_t *o = run(&r, "nodes: [array, stage, scan, dsp, recon, track, can, report]\n"
                        "array: {uri: 'sim:" SOURCE_DIR "/launch/scenes/point.yaml'}\n"
                        "report: {folder: /tmp/anlos-no-such-folder}\n");
    expect(o, "launch", "ok", "array, stage, scan, dsp");
    expect(o, "array", "ok", "speakers");
    expect(o, "stage", "ok", "needs no hardware");
    expect(o, "can", "ok", "to no vehicle");
    expect(o, "programs", "ok", scratch->folder);
    expect(o, "nodes", "ok", "nothing runs in");
    assert_contains(text(o, "results", "what"), "/tmp/anlos-no-such-folder");
    assert_non_null(find(o, "cores"));
    assert_non_null(find(o, "memory"));
    assert_non_null(find(o, "clock"));
    assert_non_null(find(o, "realtime"));
    assert_non_null(find(o, "libraries"));
    assert_int_equal(r.code, json_integer_value(json_object_get(o, "wrong")) > 0);
    assert_int_equal(access(run_dir, F_OK), -1); /* nothing is made */
    assert_int_equal(access("/tmp/anlos-no-such-folder", F_OK), -1);
    json_decref(o);
}

static void a_bad_launch_file_is_named_with_its_line(void **state)
{
    struct command_result r;

    (void)state;
    json_t *o = run(&r, "nodes: [array]\nrecon: {methd: fast}\n");
    assert_int_equal(r.code, 1);
    expect(o, "launch", "wrong", "a.yaml:2");
    assert_null(find(o, "array"));
    json_decref(o);
}

static void devices_that_are_not_there_are_wrong_with_advice(void **state)
{
    struct command_result r;

    (void)state;
    json_t *o = run(&r, "nodes: [array, stage, can]\n"
                        "array: {uri: 'alsa:hw:CARD=NoSuchCard?rig=" SOURCE_DIR
                        "/launch/vehicle-rig.yaml'}\n"
                        "stage: {uri: 'zaber:/dev/no-such-port?pitch_mm=25.4'}\n"
                        "can: {uri: 'socketcan:nosuch0'}\n");
    assert_int_equal(r.code, 1);
    expect(o, "array", "wrong", "NoSuchCard");
    assert_contains(text(o, "array", "todo"), "anlos array list");
    expect(o, "stage", "wrong", "/dev/no-such-port");
    assert_contains(text(o, "stage", "todo"), "plugged in");
    expect(o, "can", "wrong", "nosuch0");
    assert_contains(text(o, "can", "todo"), "ip -details link");
    json_decref(o);
}

static void a_device_name_that_is_wrong_is_told_with_its_option(void **state)
{
    struct command_result r;

    (void)state;
    json_t *o = run(&r, "nodes: [array, stage]\n"
                        "array: {uri: 'sim:/no/such/scene.yaml'}\n"
                        "stage: {uri: 'gpiod:gpiochip0?stp=17'}\n");
    assert_int_equal(r.code, 1);
    expect(o, "array", "wrong", "/no/such/scene.yaml");
    expect(o, "stage", "wrong", "stp");
    json_decref(o);
}

static void what_a_launch_would_refuse_is_wrong(void **state)
{
    struct command_result r;

    (void)state;
    json_t *o = run(&r, "nodes: [array, scan, can]\n"
                        "array: {uri: 'wav:/rec'}\n"
                        "scan: {background: true}\n"
                        "can: {uri: 'log:/tmp'}\n");
    assert_int_equal(r.code, 1);
    expect(o, "launch", "wrong", "scan.background: wav:/rec names no recording of it");
    expect(o, "can", "wrong", "/tmp cannot be written: Is a directory");
    json_decref(o);
}

static void a_folder_that_cannot_be_written_is_wrong(void **state)
{
    struct command_result r;
    char launch[600];

    (void)state;
    snprintf(launch, sizeof launch, "nodes: [report]\nreport: {folder: '%s/out'}\n",
             scratch_write(scratch, "a-file", "no folder"));
    json_t *o = run(&r, launch);
    assert_int_equal(r.code, 1);
    expect(o, "results", "wrong", "a-file is no folder");
    json_decref(o);
}

static void a_run_folder_too_long_for_sockets_is_wrong(void **state)
{
    struct command_result r;
    char folder[90];
    char *words[] = {(char *)"doctor", (char *)"--run-dir", folder, NULL};

    (void)state;
    memset(folder, 'x', sizeof folder - 1);
    folder[0] = '/';
    folder[sizeof folder - 1] = '\0';
    command_run(&r, command_doctor, words);
    assert_int_equal(r.code, 1);
    assert_contains(r.out, "wrong  run-dir");
}

static void of_several_machines_only_this_one_is_looked_at(void **state)
{
    static const char launch[] =
        "nodes: [stage, can, report]\n"
        "stage: {uri: 'zaber:/dev/no-such-port?pitch_mm=25.4'}\n"
        "hosts:\n"
        "  - {name: vehicle, endpoint: 'tcp://127.0.0.1:7400', nodes: [stage]}\n"
        "  - {name: desk, endpoint: 'tcp://127.0.0.1:7500', nodes: [can, report]}\n";
    struct command_result r;

    (void)state;
    json_t *o = run(&r, launch);
    expect(o, "host", "note", "which is this one?");
    assert_null(find(o, "stage"));
    assert_null(find(o, "can"));
    json_decref(o);
    o = run_host(&r, launch, "vehicle");
    assert_int_equal(r.code, 1);
    expect(o, "host", "ok", "vehicle");
    expect(o, "stage", "wrong", "/dev/no-such-port");
    assert_null(find(o, "can"));
    json_decref(o);
    o = run_host(&r, launch, "desk");
    assert_null(find(o, "stage"));
    expect(o, "can", "ok", "to no vehicle");
    json_decref(o);
    o = run_host(&r, launch, "moon");
    assert_int_equal(r.code, 1);
    expect(o, "host", "wrong", "--host moon");
    json_decref(o);
}

static void keys_are_looked_at_where_hosts_can_be_reached(void **state)
{
    static const char plain[] =
        "nodes: [stage, report]\nstage: {uri: 'sim:'}\nhosts:\n"
        "  - {name: vehicle, endpoint: 'tcp://127.0.0.1:7400', nodes: [stage]}\n"
        "  - {name: desk, endpoint: 'tcp://127.0.0.1:7500', nodes: [report]}\n";
    static const char encrypted[] =
        "nodes: [stage, report]\nstage: {uri: 'sim:'}\nhosts:\n"
        "  - {name: vehicle, endpoint: 'tcp://127.0.0.1:7400', nodes: [stage], keys: k}\n"
        "  - {name: desk, endpoint: 'tcp://10.0.0.2:7400', nodes: [report], keys: k}\n";
    char folder[600], peers[256], public[KEYS_TEXT_SIZE];
    struct command_result r;

    (void)state;
    json_t *o = run_host(&r, plain, "vehicle");
    expect(o, "keys", "note", "not encrypted");
    json_decref(o);
    o = run_host(&r, encrypted, "vehicle");
    assert_int_equal(r.code, 1);
    expect(o, "keys", "wrong", "secret.key: there is no key");
    json_decref(o);
    snprintf(folder, sizeof folder, "%s", scratch_path(scratch, "k"));
    assert_int_equal(keys_create(folder, "vehicle", public, NULL), 0);
    o = run_host(&r, encrypted, "vehicle");
    expect(o, "keys", "wrong", "host desk has no line");
    json_decref(o);
    /* Any other key will do: an example of RFC 32. */
    snprintf(peers, sizeof peers,
             "vehicle %s\ndesk "
             "rq:rM>}U?@Lns47E1%%kR.o@n%%FcmmsL/@{H8]yf7\n",
             public);
    scratch_write(scratch, "k/peers", peers);
    o = run_host(&r, encrypted, "vehicle");
    expect(o, "keys", "ok", "those of 1 others");
    json_decref(o);
    assert_int_equal(chmod(scratch_path(scratch, "k/secret.key"), 0604), 0);
    o = run_host(&r, encrypted, "vehicle");
    expect(o, "keys", "wrong", "others may read it (mode 604)");
    json_decref(o);
}

static void a_port_of_the_view_that_is_taken_is_noted(void **state)
{
    struct command_result r;
    struct sockaddr_in to = {.sin_family = AF_INET,
                             .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof to;
    char launch[128];
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    (void)state;
    assert_int_equal(bind(fd, (struct sockaddr *)&to, sizeof to), 0);
    assert_int_equal(listen(fd, 1), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&to, &size), 0);
    snprintf(launch, sizeof launch, "nodes: [view]\nview: {port: %u}\n",
             ntohs(to.sin_port));
    json_t *o = run(&r, launch);
    expect(o, "view", "note", "is in use");
    json_decref(o);
    close(fd);
    o = run(&r, launch);
    expect(o, "view", "ok", "http://127.0.0.1:");
    json_decref(o);
}

static void faults_losses_and_crashes_of_a_system_are_told(void **state)
{
    struct command_result r;
    Anlos__Health fault = ANLOS__HEALTH__INIT, losing = fault;
    Anlos__TopicCount pings = ANLOS__TOPIC_COUNT__INIT, *topics[] = {&pings};
    const json_t *item;
    size_t i;
    char all[4096] = "";

    (void)state;
    fault.state = ANLOS__HEALTH__STATE__FAULT;
    fault.text = (char *)"the limit switch is pressed";
    losing.state = ANLOS__HEALTH__STATE__READY;
    losing.text = (char *)"";
    pings.topic = (char *)"ping";
    pings.messages = 100;
    pings.dropped = 3;
    losing.topics = topics;
    losing.n_topics = 1;
    living_end(living_start(run_dir, "track", LIVING, &losing), SIGKILL);
    pid_t stage = living_start(run_dir, "stage", LIVING, &fault);
    pid_t dsp = living_start(run_dir, "dsp", LIVING, &losing);
    json_t *o = run(&r, "nodes: [stage, dsp, track]\n");
    assert_int_equal(r.code, 1);
    json_array_foreach(json_object_get(o, "findings"), i, item)
    {
        size_t used = strlen(all);
        snprintf(all + used, sizeof all - used, "%.5s %.300s\n",
                 json_string_value(json_object_get(item, "level")),
                 json_string_value(json_object_get(item, "what")));
    }
    assert_contains(all, "wrong stage has a fault: the limit switch is pressed");
    assert_contains(all, "note dsp: of ping, 0 messages never arrived and 3 were pushed");
    assert_contains(all, "note track was killed or crashed");
    assert_contains(all, "wrong track of the launch file does not run, others do");
    assert_contains(all, "ok 2 run in");
    json_decref(o);
    living_end(stage, SIGTERM);
    living_end(dsp, SIGTERM);
}

/* What it says hangs on the machine and on who else uses it. */
static void the_load_of_a_drive_is_told(void **state)
{
    struct command_result r;

    (void)state;
    json_t *o = run(&r,
                    "nodes: [array, scan, dsp, recon, wall, track]\n"
                    "array: {uri: 'sim:" SOURCE_DIR "/launch/scenes/drive-person.yaml'}\n"
                    "scan: {mode: fixed}\n");
    assert_non_null(find(o, "load"));
    assert_int_equal(r.code, json_integer_value(json_object_get(o, "wrong")) > 0);
    json_decref(o);
}

static void a_load_that_is_not_measured_is_told(void **state)
{
    static const char real[] = "nodes: [array, scan, dsp, recon]\n"
                               "array: {uri: 'alsa:hw:CARD=NoSuchCard?rig=" SOURCE_DIR
                               "/launch/vehicle-rig.yaml'}\n"
                               "scan: {mode: fixed}\n";
    Anlos__Health ready = ANLOS__HEALTH__INIT;
    struct command_result r;

    (void)state;
    ready.state = ANLOS__HEALTH__STATE__READY;
    ready.text = (char *)"";
    json_t *o = run(&r, real);
    expect(o, "load", "note", "with a simulated array only");
    json_decref(o);
    o = run(&r, "nodes: [array, scan, dsp, recon]\n"
                "array: {uri: 'sim:" SOURCE_DIR "/launch/scenes/point.yaml'}\n"
                "scan: {mode: fixed}\n");
    expect(o, "load", "note", "is not measured: ");
    json_decref(o);
    pid_t array = living_start(run_dir, "array", LIVING, &ready);
    o = run(&r, real);
    expect(o, "load", "ok", "is not measured while the system runs");
    json_decref(o);
    living_end(array, SIGTERM);
    o = run(&r, "nodes: [play, dsp, recon]\nscan: {mode: fixed}\nplay: {bag: a}\n");
    assert_null(find(o, "load")); /* a bag has no pace that must be kept */
    json_decref(o);
}

static void look_and_hang(const void *ctx, struct findings *out)
{
    (void)ctx;
    (void)out;
    for (;;)
        pause();
}

static void look_and_crash(const void *ctx, struct findings *out)
{
    (void)ctx;
    (void)out;
    kill(getpid(), SIGKILL);
}

static void look_and_tell(const void *ctx, struct findings *out)
{
    finding_add(out, FINDING_NOTE, "thing", "%s \"quoted\"", (const char *)ctx);
    finding_todo(out, "do this");
}

static void judge(void (*look)(const void *, struct findings *), struct findings *f)
{
    const struct check c = {"thing", look};
    struct check_job job;

    check_start(&job, &c, "a text");
    check_finish(&job, &c,
                 clock_monotonic_ns() + (look == look_and_hang ? 50 : 20000) * 1000000LL,
                 f);
    assert_int_equal(f->n, 1);
    assert_string_equal(f->list[0].area, "thing");
}

static void a_check_that_hangs_is_a_finding(void **state)
{
    struct findings f = {0};

    (void)state;
    judge(look_and_hang, &f);
    assert_int_equal(f.list[0].level, FINDING_WRONG);
    assert_contains(f.list[0].what, "no answer in time");
    findings_clear(&f);
}

static void a_check_that_crashes_is_a_finding(void **state)
{
    struct findings f = {0};

    (void)state;
    judge(look_and_crash, &f);
    assert_int_equal(f.list[0].level, FINDING_WRONG);
    assert_contains(f.list[0].what, "Killed");
    findings_clear(&f);
}

static void what_a_check_finds_comes_as_it_is(void **state)
{
    struct findings f = {0};

    (void)state;
    judge(look_and_tell, &f);
    assert_int_equal(f.list[0].level, FINDING_NOTE);
    assert_string_equal(f.list[0].what, "a text \"quoted\"");
    assert_string_equal(f.list[0].todo, "do this");
    findings_clear(&f);
}

static void wrong_arguments_are_refused(void **state)
{
    struct command_result r;
    char *file[] = {(char *)"doctor", (char *)"demo.yaml", NULL};
    char *typo[] = {(char *)"doctor", (char *)"--lunch", (char *)"a.yaml", NULL};
    char *value[] = {(char *)"doctor", (char *)"--launch", NULL};
    char **all[] = {file, typo, value};
    static const char *const texts[] = {"--launch FILE", "did you mean --launch",
                                        "expected a value"};

    (void)state;
    for (size_t i = 0; i < 3; i++) {
        command_run(&r, command_doctor, all[i]);
        assert_int_equal(r.code, 2);
        assert_contains(r.err, texts[i]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_good_launch_file_is_good),
        cmocka_unit_test(a_bad_launch_file_is_named_with_its_line),
        cmocka_unit_test(devices_that_are_not_there_are_wrong_with_advice),
        cmocka_unit_test(a_device_name_that_is_wrong_is_told_with_its_option),
        cmocka_unit_test(what_a_launch_would_refuse_is_wrong),
        cmocka_unit_test(a_folder_that_cannot_be_written_is_wrong),
        cmocka_unit_test(a_run_folder_too_long_for_sockets_is_wrong),
        cmocka_unit_test(of_several_machines_only_this_one_is_looked_at),
        cmocka_unit_test(keys_are_looked_at_where_hosts_can_be_reached),
        cmocka_unit_test(a_port_of_the_view_that_is_taken_is_noted),
        cmocka_unit_test(faults_losses_and_crashes_of_a_system_are_told),
        cmocka_unit_test(the_load_of_a_drive_is_told),
        cmocka_unit_test(a_load_that_is_not_measured_is_told),
        cmocka_unit_test(a_check_that_hangs_is_a_finding),
        cmocka_unit_test(a_check_that_crashes_is_a_finding),
        cmocka_unit_test(what_a_check_finds_comes_as_it_is),
        cmocka_unit_test(wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
