/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "msgs/hosts.h"
#include "run_folder.h"

static struct host host_at(const char *name, const char *endpoint, const char *node)
{
    struct host h = {.n_nodes = 1};
    struct error why = {""};
    strcpy(h.name, name);
    strcpy(h.nodes[0], node);
    if (host_set_endpoint(&h, endpoint, &why) != 0)
        fail_msg("%s", why.text);
    return h;
}

static struct hosts two_hosts(const char *a, const char *b)
{
    struct hosts h = {.n = 2, .here = 1};
    h.list[0] = host_at("vehicle", a, "array");
    h.list[1] = host_at("computer", b, "recon");
    return h;
}

static void write_file(const char *text)
{
    char path[100];
    snprintf(path, sizeof path, "%s/hosts", run_folder);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
}

static void without_a_file_all_is_on_this_machine(void **state)
{
    (void)state;
    struct hosts h = {.n = 3};
    assert_int_equal(hosts_read(&h, run_folder, NULL), 0);
    assert_int_equal(h.n, 0);
}

static void what_was_written_is_read_again(void **state)
{
    (void)state;
    const struct hosts h = two_hosts("tcp://10.0.0.1:7400", "tcp://10.0.0.2:7500");
    struct hosts back;
    assert_int_equal(hosts_write(&h, run_folder, NULL), 0);
    assert_int_equal(hosts_read(&back, run_folder, NULL), 0);
    assert_int_equal(back.n, 2);
    assert_int_equal(back.here, 1);
    assert_string_equal(back.list[0].name, "vehicle");
    assert_string_equal(back.list[0].address, "10.0.0.1");
    assert_int_equal(back.list[0].port, 7400);
    assert_string_equal(back.list[0].nodes[0], "array");
    assert_string_equal(back.list[1].name, "computer");
    assert_int_equal(back.list[1].port, 7500);
    const struct hosts none = {0};
    assert_int_equal(hosts_write(&none, run_folder, NULL), 0);
    assert_int_equal(hosts_read(&back, run_folder, NULL), 0);
    assert_int_equal(back.n, 0);
}

static void a_file_that_is_not_one_of_hosts_is_refused(void **state)
{
    static const char nine_hosts[] =
        "here a\na ipc:///a\nb ipc:///b\nc ipc:///c\nd ipc:///d\ne ipc:///e\n"
        "f ipc:///f\ng ipc:///g\nh ipc:///h\ni ipc:///i\n";
    static const char *const texts[] = {
        "",
        "here\n",
        "here vehicle\n",
        "vehicle tcp://10.0.0.1:7400 array\n",
        "here computer\nvehicle tcp://10.0.0.1:7400 array\n",
        "here vehicle\nvehicle\n",
        "here vehicle\nvehicle udp://10.0.0.1:7400 array\n",
        "here vehicle\nvehicle tcp://10.0.0.1:7400 a_name_that_is_much_too_long\n",
        "here a\na tcp://10.0.0.1:7400 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17\n",
        nine_hosts,
        "\n\n",
    };
    (void)state;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        struct hosts h;
        struct error why = {""};
        write_file(texts[i]);
        if (hosts_read(&h, run_folder, &why) != -EINVAL)
            fail_msg("taken: %s", texts[i]);
        assert_non_null(strstr(why.text, "/hosts: "));
    }
}

static void an_endpoint_that_others_could_not_reach_is_refused(void **state)
{
    static const char *const texts[] = {
        "10.0.0.1:7400",
        "tcp://",
        "tcp://10.0.0.1",
        "tcp://10.0.0.1:",
        "tcp://10.0.0.1:x",
        "tcp://10.0.0.1:-1",
        "tcp://10.0.0.1:80",
        "tcp://10.0.0.1:65535",
        "tcp://10.0.0.1:7400/x",
        "tcp://10.0.0.1:99999999999999999999",
        "tcp://10.0.0.256:7400",
        "tcp://0.0.0.0:7400",
        "tcp://vehicle:7400",
        "tcp://:7400",
        "ipc://",
        "ipc://run",
        "ipc:///",
        "ipc:///with a blank",
    };
    (void)state;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        struct host h = {.n_nodes = 0};
        struct error why = {""};
        if (host_set_endpoint(&h, texts[i], &why) != -EINVAL)
            fail_msg("taken: %s", texts[i]);
        assert_non_null(strstr(why.text, texts[i]));
        assert_non_null(strstr(why.text, "expected"));
    }
}

static void each_publisher_of_each_topic_has_a_port_of_its_own(void **state)
{
    static char taken[4096];
    const struct host h = host_at("vehicle", "tcp://10.0.0.1:7400", "array");
    const char *node;
    unsigned n = 0;
    (void)state;
    for (const struct topic *t = topics_all(); t->name; t++)
        for (size_t i = 0; (node = topic_publisher(t, i)); i++, n++) {
            unsigned port = hosts_port(&h, node, t);
            assert_in_range(port, 7400, 7400 + hosts_n_ports() - 1);
            assert_false(taken[port - 7400]++);
        }
    assert_int_equal(n, hosts_n_ports());
}

static void hosts_with_a_port_or_a_folder_in_common_overlap(void **state)
{
    const struct host a = host_at("a", "tcp://10.0.0.1:7400", "array");
    struct host b = host_at("b", "tcp://10.0.0.1:7400", "recon");
    (void)state;
    assert_true(hosts_overlap(&a, &b));
    b.port += hosts_n_ports() - 1;
    assert_true(hosts_overlap(&a, &b));
    assert_true(hosts_overlap(&b, &a));
    b.port++;
    assert_false(hosts_overlap(&a, &b));
    b = host_at("b", "tcp://10.0.0.2:7400", "recon");
    assert_false(hosts_overlap(&a, &b));
    const struct host c = host_at("c", "ipc:///run/c", "array");
    struct host d = host_at("d", "ipc:///run/d", "recon");
    assert_false(hosts_overlap(&c, &d));
    d = host_at("d", "ipc:///run/c", "recon");
    assert_true(hosts_overlap(&c, &d));
}

static void a_node_is_where_it_is_listed_and_one_that_is_not_anywhere(void **state)
{
    const struct hosts h = two_hosts("tcp://10.0.0.1:7400", "tcp://10.0.0.2:7400");
    (void)state;
    assert_true(hosts_may_run(&h, 0, "array"));
    assert_false(hosts_may_run(&h, 1, "array"));
    assert_true(hosts_may_run(&h, 1, "recon"));
    assert_true(hosts_may_run(&h, 0, "hand"));
    assert_true(hosts_may_run(&h, 1, "hand"));
}

static void an_address_of_another_machine_is_not_ours(void **state)
{
    const struct host ours = host_at("a", "tcp://127.0.0.1:7400", "array");
    const struct host other =
        host_at("b", "tcp://192.0.2.1:7400", "array"); /* RFC 5737 */
    struct error why = {""};
    (void)state;
    assert_int_equal(host_check_address(&ours, NULL), 0);
    assert_int_equal(host_check_address(&other, &why), -EADDRNOTAVAIL);
    assert_string_equal(why.text, "host b: 192.0.2.1: is no address of this machine");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_a_file_all_is_on_this_machine),
        cmocka_unit_test(what_was_written_is_read_again),
        cmocka_unit_test(a_file_that_is_not_one_of_hosts_is_refused),
        cmocka_unit_test(an_endpoint_that_others_could_not_reach_is_refused),
        cmocka_unit_test(each_publisher_of_each_topic_has_a_port_of_its_own),
        cmocka_unit_test(hosts_with_a_port_or_a_folder_in_common_overlap),
        cmocka_unit_test(a_node_is_where_it_is_listed_and_one_that_is_not_anywhere),
        cmocka_unit_test(an_address_of_another_machine_is_not_ours),
    };
    return cmocka_run_group_tests(tests, make_run_folder, remove_run_folder);
}
