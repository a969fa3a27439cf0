/* SPDX-License-Identifier: MIT */
/* The whole system on two hosts, each a network namespace, over a link of 20 ms delay
 * each way that loses 1 % of the packets and is cut for a while. */
#include "tests/e2e/two_hosts.h"

#include <dirent.h>
#include <poll.h>
#include <time.h>

#define LINK "netem delay 20ms limit 10000 loss "

static void command(const char *format, const char *host)
{
    char text[200];

    snprintf(text, sizeof text, format, host, host);
    if (system(text) != 0)
        fail_msg("%s", text);
}

static int make_link(void **state)
{
    (void)state;
    command("ip netns add vehicle && ip netns add computer && ip link add to%s netns "
            "vehicle type veth peer name tovehicle netns computer",
            "computer");
    command("ip -n vehicle address add 10.0.0.1/24 dev to%s", "computer");
    command("ip -n computer address add 10.0.0.2/24 dev to%s", "vehicle");
    /* One segment a packet: else the kernel hands netem up to 64 kB to lose at once. */
    command("ip -n vehicle link set to%s gso_max_segs 1 up", "computer");
    command("ip -n computer link set to%s gso_max_segs 1 up", "vehicle");
    command("tc -n vehicle qdisc add dev to%s root " LINK "1%%", "computer");
    command("tc -n computer qdisc add dev to%s root " LINK "1%%", "vehicle");
    return 0;
}

static int remove_link(void **state)
{
    (void)state;
    command("ip netns del vehicle && ip netns del %s", "computer");
    return 0;
}

/* The launchers must go on meanwhile. */
static void hold(double seconds, pid_t a, pid_t b)
{
    struct timespec now;
    double end;

    clock_gettime(CLOCK_MONOTONIC, &now);
    for (end = (double)now.tv_sec + 1e-9 * (double)now.tv_nsec + seconds;
         (double)now.tv_sec + 1e-9 * (double)now.tv_nsec < end;
         clock_gettime(CLOCK_MONOTONIC, &now)) {
        assert_int_equal(waitpid(a, NULL, WNOHANG), 0);
        assert_int_equal(waitpid(b, NULL, WNOHANG), 0);
        poll(NULL, 0, 100);
    }
}

static void assert_nothing_runs(void)
{
    char path[300], name[32];
    DIR *d = opendir("/proc");

    assert_non_null(d);
    for (struct dirent *e; (e = readdir(d));) {
        snprintf(path, sizeof path, "/proc/%s/comm", e->d_name);
        FILE *f = fopen(path, "r");
        if (!f)
            continue;
        if (fgets(name, sizeof name, f) && !strncmp(name, "anlos", 5))
            fail_msg("%s still runs", name);
        fclose(f);
    }
    closedir(d);
}

static json_int_t number(const json_t *report, const char *part, const char *name)
{
    return json_integer_value(json_object_get(json_object_get(report, part), name));
}

/* 20 ms each way, between two that have the same clock.  No host is late, and what is
 * told is the shortest of eight: none of its packets was lost and sent again. */
static void assert_link_was_measured(const json_t *report)
{
    const json_t *hosts = json_object_get(report, "hosts");

    assert_int_equal(json_array_size(hosts), 2);
    for (size_t i = 0; i < 2; i++) {
        const json_t *o = json_array_get(hosts, i);
        double round_trip_s = json_number_value(json_object_get(o, "round_trip_s"));
        double ahead_s = json_number_value(json_object_get(o, "clock_ahead_s"));
        assert_true(round_trip_s >= 0.040 && round_trip_s < 0.041);
        assert_true(fabs(ahead_s) <= 0.5 * (round_trip_s - 0.040) + 1e-4);
    }
}

/* Silent: packets go nowhere, and neither end is told. */
static void link_is_cut_silently(bool cut)
{
    const char *change = cut ? "tc -n vehicle qdisc change dev to%s root " LINK "100%%"
                             : "tc -n vehicle qdisc change dev to%s root " LINK "1%%";

    command(change, "computer");
}

static void a_link_that_is_down_for_3_s_costs_no_ping(void **state)
{
    struct scratch *s = *state;

    pid_t vehicle = start_in(s, "vehicle", "vehicle");
    pid_t computer = start_in(s, "computer", "computer");
    wait_for_pings(s, "vehicle.run", 8);
    command("ip -n vehicle link set to%s down", "computer");
    hold(3.0, vehicle, computer);
    command("ip -n vehicle link set to%s up", "computer");
    assert_ends(s, "vehicle", vehicle, 0);
    assert_ends(s, "computer", computer, 0);
    assert_nothing_runs();
    assert_detections(s);
    json_t *report = read_report(s);
    assert_link_was_measured(report);
    json_decref(report);
}

/* Twice as long as the connections last: what is under way then is lost. */
static void what_a_longer_cut_loses_is_counted_and_taken_again(void **state)
{
    struct scratch *s = *state;

    pid_t vehicle = start_in(s, "vehicle", "vehicle");
    pid_t computer = start_in(s, "computer", "computer");
    wait_for_pings(s, "vehicle.run", 8);
    link_is_cut_silently(true);
    hold(14.0, vehicle, computer);
    link_is_cut_silently(false);
    assert_ends(s, "vehicle", vehicle, 0);
    assert_ends(s, "computer", computer, 0);
    assert_nothing_runs();
    assert_detections(s);
    json_t *report = read_report(s);
    assert_true(number(report, "messages_lost", "gaps") > 0);
    assert_true(number(report, "pings", "retaken") > 0);
    json_decref(report);
    assert_says(s, "vehicle", "host computer is not heard any more");
    assert_says(s, "vehicle", "host computer is heard again, after ");
}

static int open_all(void **state)
{
    int err = scratch_open(state);

    if (!err) {
        make_host_keys(*state);
        write_launch(*state, "10.0.0.1", "10.0.0.2", 7400, true);
    }
    return err ? err : make_link(state);
}

static int close_all(void **state)
{
    int err = remove_link(state);

    return scratch_close(state) ? -1 : err;
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, open_all, close_all)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_link_that_is_down_for_3_s_costs_no_ping),
        TEST(what_a_longer_cut_loses_is_counted_and_taken_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
