/* SPDX-License-Identifier: MIT */
/* The launcher while memory, descriptors, processes or threads give out, at every place
 * where they may, with shell scripts in the place of the nodes. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <fcntl.h>
#include <unistd.h>

#include "msgs/bus.h"
#include "msgs/keys.h"
#include "nodes/launcher/devices.h"
#include "nodes/launcher/host_peers.h"
#include "nodes/launcher/launcher.h"
#include "nodes/launcher/site.h"
#include "nodes/launcher/truth.h"
#include "nodes/rt/launchfile_hosts.h"
#include "nodes/rt/stop.h"
#include "tests/failing.h"

struct rig {
    struct scratch *scratch;
    struct launchfile *launch;
    struct arguments arguments;
    char launch_path[512], log_path[512];
};

static void write_node(struct rig *r, const char *name, const char *script)
{
    assert_int_equal(chmod(scratch_write(r->scratch, name, script), 0755), 0);
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    struct error why = {""};

    if (!r || scratch_open((void **)&r->scratch))
        return -1;
    write_node(r, "anlos-scan", "#!/bin/sh\nexit 0\n");
    write_node(r, "anlos-report", "#!/bin/sh\nexit 0\n");
    snprintf(r->log_path, sizeof r->log_path, "%s", scratch_path(r->scratch, "log"));
    snprintf(r->launch_path, sizeof r->launch_path, "%s",
             scratch_write(r->scratch, "launch.yaml",
                           "nodes: [scan, report]\narray: {uri: 'wav:/rec'}\n"));
    r->arguments = (struct arguments){.launch = r->launch_path,
                                      .run_dir = r->scratch->folder,
                                      .log_level = LOG_LEVEL_INFO};
    *state = r;
    if (launchfile_load(&r->launch, r->launch_path, NULL, &why))
        print_error("%s\n", why.text);
    return r->launch ? 0 : -1;
}

static int teardown(void **state)
{
    struct rig *r = *state;
    void *scratch = r->scratch;

    launchfile_destroy(r->launch);
    free(r);
    return scratch_close(&scratch);
}

/* What the launcher said; -1: descriptors as they were. */
static int listen_to(const struct rig *r, int saved, struct error *why)
{
    if (saved < 0) {
        int log =
            openat(AT_FDCWD, r->log_path, O_CREAT | O_TRUNC | O_RDWR | O_APPEND, 0600);
        saved = dup(STDERR_FILENO);
        dup2(log, STDERR_FILENO);
        close_range((unsigned)log, (unsigned)log, 0);
        return saved;
    }
    int log = openat(AT_FDCWD, r->log_path, O_RDONLY);
    ssize_t n = read(log, why->text, sizeof why->text - 1);
    why->text[n > 0 ? n : 0] = '\0';
    dup2(saved, STDERR_FILENO);
    close_range((unsigned)log, (unsigned)log, 0);
    close_range((unsigned)saved, (unsigned)saved, 0);
    return 0;
}

static int launch_work(void *context, struct error *why)
{
    const struct rig *r = context;
    const struct launcher_config cfg = {.launch = r->launch,
                                        .arguments = &r->arguments,
                                        .run_dir = r->scratch->folder,
                                        .bin_dir = r->scratch->folder};
    bool reported;
    int saved = listen_to(r, -1, why);
    int code = launcher_run(&cfg, &reported);

    listen_to(r, saved, why);
    assert_int_equal(code == EXIT_WORKED, reported);
    return -code;
}

static void a_launch_that_fails_says_why(void **state)
{
    const struct failing_work work = {
        .name = "launching", .run = launch_work, .context = *state};

    assert_true(failing_each(&work) > 10);
}

static int site_work(void *context, struct error *why)
{
    const struct rig *r = context;
    char run_dir[RUNDIR_SIZE];
    int err = site_open(r->launch, &r->arguments, run_dir, why);

    if (!err)
        site_close(r->launch, run_dir);
    return err;
}

static void a_run_folder_that_cannot_be_had_is_refused_with_a_reason(void **state)
{
    const struct failing_work work = {
        .name = "a run folder", .run = site_work, .context = *state};

    assert_true(failing_each(&work) > 2);
}

static int devices_work(void *context, struct error *why)
{
    const struct rig *r = context;

    return devices_check(r->launch, why);
}

static void a_device_that_cannot_be_looked_at_is_told(void **state)
{
    struct rig *r = *state;
    struct error why = {""};
    const struct failing_work work = {
        .name = "devices", .run = devices_work, .context = r};

    launchfile_destroy(r->launch);
    r->launch = NULL;
    const char *path = scratch_write(r->scratch, "devices.yaml",
                                     "nodes: [array, stage, scan, can, report]\n"
                                     "array: {uri: 'sim:" SOURCE_DIR
                                     "/tests/nodes/point.yaml'}\n"
                                     "stage: {uri: 'sim:'}\n"
                                     "can: {uri: 'log:can.candump'}\n");
    if (launchfile_load(&r->launch, path, NULL, &why))
        fail_msg("%s", why.text);
    assert_true(failing_each(&work) > 50);
}

/* -- of a system on several hosts
 * ---------------------------------------------------------------------------------
 */

static int peer_on(struct bus *bus, const struct launchfile *l)
{
    static struct host_peering peering;
    int err = host_peering_open(&peering, bus, &l->hosts, 1, 2);

    if (!err)
        host_peering_tell(&peering, clock_now_ns(clock_system()));
    return err;
}

static int peering_work(void *context, struct error *why)
{
    const struct rig *r = context;
    char run_dir[RUNDIR_SIZE];
    struct bus *bus;
    int err = site_open(r->launch, &r->arguments, run_dir, why);

    if (err)
        return err;
    const struct bus_config cfg = {
        .node = "launcher", .run_dir = run_dir, .epoch_ns = 1, .world = BUS_LIVE};
    err = bus_create(&bus, &cfg, why);
    if (!err) {
        err = peer_on(bus, r->launch);
        if (err)
            error_say(why, err, "the other hosts: %s", strerror(-err));
        bus_destroy(bus);
    }
    site_close(r->launch, run_dir);
    return err;
}

/* Encrypted, over this machine's own addresses. */
static void load_hosts(struct rig *r)
{
    static const char *const names[] = {"vehicle", "computer"};
    unsigned port = 10000 + (unsigned)getpid() * 7 % 250 * hosts_n_ports();
    char text[600], peers[300] = "";
    struct error why = {""};

    for (size_t i = 0; i < 2; i++) {
        char public[KEYS_TEXT_SIZE], folder[128];
        snprintf(folder, sizeof folder, "%s/%s", r->scratch->folder, names[i]);
        if (keys_create(folder, names[i], public, &why))
            fail_msg("%s", why.text);
        size_t n = strlen(peers);
        snprintf(peers + n, sizeof peers - n, "%s %s\n", names[i], public);
    }
    scratch_write(r->scratch, "vehicle/peers", peers);
    snprintf(text, sizeof text,
             "nodes: [scan, report]\nhosts:\n"
             "  - {name: vehicle, endpoint: 'tcp://127.0.0.1:%u', keys: vehicle, nodes: "
             "[scan]}\n"
             "  - {name: computer, endpoint: 'tcp://127.0.0.2:%u', nodes: [report]}\n"
             "array: {uri: 'wav:/rec'}\n",
             port, port);
    launchfile_destroy(r->launch);
    r->launch = NULL;
    if (launchfile_load(&r->launch, scratch_write(r->scratch, "hosts.yaml", text), NULL,
                        &why) ||
        launchfile_choose_host(r->launch, "vehicle", &why))
        fail_msg("%s", why.text);
}

static void hosts_that_cannot_be_joined_are_told(void **state)
{
    const struct failing_work work = {
        .name = "peering", .run = peering_work, .context = *state};

    load_hosts(*state);
    assert_true(failing_each(&work) > 50);
}

/* -- what stands at the end of a launch
 * ---------------------------------------------------------------------------------------
 */

/* The report is read before: of a text that it has no memory for jansson ends the
 * process. */
struct table {
    const struct rig *rig;
    struct truth found;
};

static int table_work(void *context, struct error *why)
{
    const struct table *table = context;
    struct truth t = table->found;
    FILE *f = fopen(table->rig->log_path, "w");

    if (!f)
        return error_say(why, -errno, "the table: %s", strerror(errno));
    int err = truth_read_scene(&t, SOURCE_DIR "/tests/nodes/point.yaml", why);
    if (!err) {
        truth_match(&t);
        truth_print(&t, f);
    }
    bool failed = ferror(f);
    failed = fclose(f) || failed;
    return err || !failed ? err : error_say(why, -EIO, "the table is cut");
}

static void check_table(void *context, int err)
{
    const struct table *table = context;
    char text[4096] = "";

    if (err)
        return;
    FILE *f = fopen(table->rig->log_path, "r");
    assert_non_null(f);
    assert_in_range(fread(text, 1, sizeof text - 1, f), 1, sizeof text - 2);
    fclose(f);
    assert_contains(text, "point (point)");
    assert_contains(text, "vehicle frame");
}

static void a_table_that_is_not_whole_is_told(void **state)
{
    struct rig *r = *state;
    static struct table table;
    struct error why = {""};
    const struct failing_work work = {
        .name = "the table", .run = table_work, .check = check_table, .context = &table};

    scratch_write(r->scratch, "detections.json",
                  "{\"frame\": \"vehicle\", \"mirrored_at_wall\": true, \"detections\": "
                  "[{\"position_m\": [0.4, 0.2, 0.44], \"existence\": 0.8}]}");
    table = (struct table){.rig = r};
    if (truth_read_detections(&table.found, r->scratch->folder, &why))
        fail_msg("%s", why.text);
    assert_true(failing_each(&work) > 20);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_launch_that_fails_says_why),
        TEST(a_run_folder_that_cannot_be_had_is_refused_with_a_reason),
        TEST(a_device_that_cannot_be_looked_at_is_told),
        TEST(hosts_that_cannot_be_joined_are_told),
        TEST(a_table_that_is_not_whole_is_told),
    };
    return cmocka_run_group_tests(tests, scratch_in_memory, NULL);
}
