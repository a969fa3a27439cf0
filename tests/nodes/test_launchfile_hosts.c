/* SPDX-License-Identifier: MIT */
#include "tests/nodes/launch_load.h"

#include <unistd.h>

#include "nodes/rt/launchfile_hosts.h"

#define NODES   "nodes: [array, dsp, report]\narray: {uri: 'sim:a.yaml'}\nhosts:\n"
#define VEHICLE "  - {name: vehicle, endpoint: 'tcp://10.0.0.1:7400', nodes: [array]}\n"
#define COMPUTER                                                                         \
    "  - {name: computer, endpoint: 'tcp://10.0.0.2:7400', nodes: [dsp, report]}\n"

static void hosts_are_taken_and_one_is_chosen(void **state)
{
    struct launchfile *l = launch_load(*state, NODES VEHICLE COMPUTER);

    assert_int_equal(l->hosts.n, 2);
    assert_string_equal(l->hosts.list[0].name, "vehicle");
    assert_string_equal(l->hosts.list[0].address, "10.0.0.1");
    assert_int_equal(l->hosts.list[0].port, 7400);
    assert_int_equal(launchfile_choose_host(l, "computer", NULL), 0);
    assert_int_equal(l->hosts.here, 1);
    assert_true(launchfile_runs_here(l, "dsp"));
    assert_true(launchfile_runs_here(l, "report"));
    assert_false(launchfile_runs_here(l, "array"));
    assert_false(launchfile_runs_here(l, "stage")); /* nowhere */
    launchfile_destroy(l);
}

static void without_hosts_all_is_here(void **state)
{
    struct launchfile *l = launch_load(*state, "nodes: [dsp]\n");
    struct error why = {""};

    assert_int_equal(launchfile_choose_host(l, NULL, NULL), 0);
    assert_true(launchfile_runs_here(l, "dsp"));
    assert_false(launchfile_runs_here(l, "array"));
    assert_int_equal(launchfile_choose_host(l, "vehicle", &why), -EINVAL);
    assert_contains(why.text, "has no hosts");
    launchfile_destroy(l);
}

static void a_host_that_is_not_in_the_file_is_refused_with_those_that_are(void **state)
{
    struct launchfile *l = launch_load(*state, NODES VEHICLE COMPUTER);
    struct error why = {""};

    assert_int_equal(launchfile_choose_host(l, NULL, &why), -EINVAL);
    assert_contains(why.text, "--host, one of vehicle, computer");
    assert_int_equal(launchfile_choose_host(l, "laptop", &why), -EINVAL);
    assert_contains(why.text, "--host laptop: expected one of vehicle, computer");
    launchfile_destroy(l);
}

static void what_cannot_work_is_refused_with_its_line(void **state)
{
    static const struct {
        const char *text, *rest;
    } cases[] = {
        {NODES VEHICLE "  - {name: b, endpoint: 'tcp://10.0.0.2:7400', nodes: [dsp]}\n",
         ":3: hosts: expected each node on one host, but report is on none"},
        {NODES COMPUTER
         "  - {name: b, endpoint: 'tcp://10.0.0.3:7400', nodes: [array, dsp]}\n",
         ":5: hosts[1].nodes: expected each node on one host, but dsp is on computer and "
         "b"},
        {NODES COMPUTER
         "  - {name: b, endpoint: 'tcp://10.0.0.3:7400', nodes: [array, array]}\n",
         ":5: hosts[1].nodes: expected each node on one host, but array is on b and b"},
        {NODES COMPUTER
         "  - {name: b, endpoint: 'tcp://10.0.0.3:7400', nodes: [array, can]}\n",
         ":5: hosts[1].nodes: b: can is not one of the launch file's nodes"},
        {NODES COMPUTER
         "  - {name: computer, endpoint: 'tcp://10.0.0.3:7400', nodes: [array]}\n",
         ":5: hosts[1].name: expected each host once, but computer is there twice"},
        {NODES COMPUTER "  - {name: here, endpoint: 'tcp://10.0.0.3:7400', nodes: "
                        "[array]}\n",
         ":5: hosts[1].name: expected up to 31 letters, digits, '-', '_' and '.', and "
         "not 'here', but found \"here\""},
        {NODES COMPUTER "  - {name: b, endpoint: 'ipc:///run/b', nodes: [array]}\n",
         ":5: hosts[1].endpoint: expected all by tcp:// or all by ipc://, but computer "
         "and b differ"},
        {NODES "  - {name: a, endpoint: 'ipc:///run/a', nodes: [dsp, report]}\n"
               "  - {name: b, endpoint: 'ipc:///run/a', nodes: [array]}\n",
         ":5: hosts[1].endpoint: a and b have the same folder"},
        {NODES "  - {name: a, endpoint: 'ipc:///run/a', nodes: [dsp, report], keys: k}\n",
         ":4: hosts[0].keys: a: expected none with an endpoint ipc://: it never leaves "
         "this machine"},
        {NODES COMPUTER "  - {name: b, endpoint: 'vehicle', nodes: [array]}\n",
         ":5: hosts[1].endpoint: b: vehicle: expected tcp://ADDRESS:PORT or "
         "ipc:///FOLDER"},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {""};
        struct launchfile *l = NULL;
        const char *path = scratch_write(*state, "a.yaml", cases[i].text);
        assert_int_equal(launchfile_load(&l, path, NULL, &why), -EINVAL);
        assert_error(why.text, path, cases[i].rest);
    }
}

static void keys_are_of_the_launch_files_folder_or_the_usual_one(void **state)
{
    struct scratch *s = *state;
    struct launchfile *l = launch_load(
        s, NODES "  - {name: vehicle, endpoint: 'tcp://10.0.0.1:7400', nodes: [array], "
                 "keys: mine}\n" COMPUTER);
    char expected[200];

    assert_int_equal(launchfile_choose_host(l, "vehicle", NULL), 0);
    snprintf(expected, sizeof expected, "%s/mine", s->folder);
    assert_string_equal(l->hosts.list[0].keys, expected);
    launchfile_destroy(l);
    assert_int_equal(chdir(s->folder), 0); /* by a name of no folder */
    assert_int_equal(launchfile_load(&l, "a.yaml", NULL, NULL), 0);
    assert_string_equal(l->hosts.list[0].keys, expected);
    assert_int_equal(chdir("/"), 0);
    assert_int_equal(setenv("XDG_CONFIG_HOME", "/tmp/of/mine", 1), 0);
    assert_int_equal(launchfile_choose_host(l, "computer", NULL), 0);
    unsetenv("XDG_CONFIG_HOME");
    assert_string_equal(l->hosts.list[1].keys, "/tmp/of/mine/anlos/keys");
    launchfile_destroy(l);
}

static void hosts_of_one_machine_need_no_keys(void **state)
{
    struct launchfile *l = launch_load(
        *state, NODES
        "  - {name: vehicle, endpoint: 'tcp://127.0.0.1:7400', nodes: [array]}\n"
        "  - {name: desk, endpoint: 'tcp://127.0.0.2:7400', nodes: [dsp, report]}\n");

    assert_int_equal(launchfile_choose_host(l, "vehicle", NULL), 0);
    assert_string_equal(l->hosts.list[0].keys, "");
    assert_int_equal(launchfile_check_keys(l, NULL), 0);
    launchfile_destroy(l);
}

static void ports_that_overlap_are_refused_with_how_far_apart_they_must_be(void **state)
{
    const char *path = scratch_write(
        *state, "a.yaml",
        NODES COMPUTER "  - {name: b, endpoint: 'tcp://10.0.0.2:7401', nodes: "
                       "[array]}\n");
    struct error why = {""};
    struct launchfile *l = NULL;
    char expected[200];

    snprintf(expected, sizeof expected,
             ":5: hosts[1].endpoint: computer and b have the same address: expected "
             "ports at least %u apart",
             hosts_n_ports());
    assert_int_equal(launchfile_load(&l, path, NULL, &why), -EINVAL);
    assert_error(why.text, path, expected);
}

static void a_node_alone_needs_to_know_its_host_once(void **state)
{
    struct scratch *s = *state;
    struct launchfile *l = launch_load(s, NODES VEHICLE COMPUTER);
    struct error why = {""};
    struct hosts written;

    assert_int_equal(launchfile_join_hosts(l, NULL, s->folder, &why), -EINVAL);
    assert_contains(why.text, "which one is this?");
    assert_int_equal(launchfile_join_hosts(l, "vehicle", s->folder, NULL), 0);
    assert_int_equal(hosts_read(&written, s->folder, NULL), 0);
    assert_int_equal(written.n, 2);
    assert_int_equal(written.here, 0);
    assert_int_equal(launchfile_join_hosts(l, NULL, s->folder, NULL), 0);
    launchfile_destroy(l);
}

static void the_one_to_start_from_can_be_loaded(void **state)
{
    struct error why = {""};
    struct launchfile *l = NULL;

    (void)state;
    if (launchfile_load(&l, SOURCE_DIR "/launch/two-hosts.yaml", NULL, &why))
        fail_msg("%s", why.text);
    assert_int_equal(l->hosts.n, 2);
    launchfile_destroy(l);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(hosts_are_taken_and_one_is_chosen),
        TEST(without_hosts_all_is_here),
        TEST(a_host_that_is_not_in_the_file_is_refused_with_those_that_are),
        TEST(what_cannot_work_is_refused_with_its_line),
        TEST(keys_are_of_the_launch_files_folder_or_the_usual_one),
        TEST(hosts_of_one_machine_need_no_keys),
        TEST(ports_that_overlap_are_refused_with_how_far_apart_they_must_be),
        TEST(the_one_to_start_from_can_be_loaded),
        TEST(a_node_alone_needs_to_know_its_host_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
