/* SPDX-License-Identifier: MIT */
/* A system on two hosts, which are two loopback addresses of this machine. */
#include "tests/e2e/two_hosts.h"

#include <arpa/inet.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include "msgs/hosts.h"

static unsigned first_port(void)
{
    return 30000 + (unsigned)getpid() % 40 * hosts_n_ports();
}

static pid_t start(struct scratch *s, const char *host)
{
    return start_in(s, NULL, host);
}

static void assert_secret_is_nowhere(struct scratch *s, const char *host)
{
    char text[8192];
    struct keys keys;

    assert_int_equal(keys_read(&keys, scratch_path(s, "keys/vehicle"), NULL), 0);
    read_says(s, host, text, sizeof text);
    assert_null(strstr(text, keys.secret));
}

static void array_and_reconstruction_on_two_hosts_find_the_object(void **state)
{
    struct scratch *s = *state;

    make_host_keys(s);
    write_launch(s, "127.0.0.1", "127.0.0.2", first_port(), true);
    pid_t vehicle = start(s, "vehicle"), computer = start(s, "computer");
    assert_ends(s, "vehicle", vehicle, 0);
    assert_ends(s, "computer", computer, 0);
    assert_says(s, "vehicle", "encrypted with the keys in ");
    assert_secret_is_nowhere(s, "vehicle");
    assert_detections(s);
    json_t *report = read_report(s);
    const json_t *hosts = json_object_get(report, "hosts");
    assert_int_equal(json_array_size(hosts), 2);
    for (size_t i = 0; i < 2; i++) { /* the clock is the same */
        const json_t *o = json_array_get(hosts, i);
        double round_trip_s = json_number_value(json_object_get(o, "round_trip_s"));
        assert_true(round_trip_s > 0);
        assert_true(fabs(json_number_value(json_object_get(o, "clock_ahead_s"))) <=
                    round_trip_s);
    }
    json_decref(report);
    assert_says(s, "vehicle", "host computer: done, results are in ");
    assert_int_equal(access(scratch_path(s, "vehicle/can.candump"), F_OK), 0);
}

static void a_host_that_is_stopped_may_come_back_during_the_scan(void **state)
{
    struct scratch *s = *state;

    write_launch(s, "127.0.0.1", "127.0.0.2", first_port(), false);
    pid_t vehicle = start(s, "vehicle"), computer = start(s, "computer");
    wait_for_pings(s, "vehicle.run", 8);
    assert_int_equal(kill(computer, SIGINT), 0);
    assert_ends(s, "computer", computer, 128 + SIGINT);
    computer = start(s, "computer");
    assert_ends(s, "vehicle", vehicle, 0);
    assert_ends(s, "computer", computer, 0);
    assert_says(s, "vehicle", "host computer was stopped; this one waits");
    assert_says(s, "vehicle", "host computer was started again");
    assert_detections(s);
    json_decref(read_report(s));
}

static void a_host_that_fails_ends_the_other(void **state)
{
    struct scratch *s = *state;

    write_launch(s, "127.0.0.1", "127.0.0.2", first_port(), false);
    pid_t vehicle = start(s, "vehicle"), computer = start(s, "computer");
    wait_for_pings(s, "vehicle.run", 1);
    /* The report cannot write any more, which no new start mends. */
    assert_int_equal(unlink(scratch_path(s, "computer/.anlos-launch.lock")), 0);
    assert_int_equal(rmdir(scratch_path(s, "computer")), 0);
    scratch_write(s, "computer", "not a folder");
    assert_ends(s, "computer", computer, 2);
    assert_ends(s, "vehicle", vehicle, 1);
    assert_says(s, "vehicle", "host computer: ended with exit code 2");
}

static void a_host_that_is_none_of_the_file_is_refused(void **state)
{
    write_launch(*state, "127.0.0.1", "127.0.0.2", first_port(), false);
    assert_ends(*state, "laptop", start(*state, "laptop"), 2);
    assert_says(*state, "laptop", "--host laptop: expected one of vehicle, computer");
}

static void a_host_that_is_not_this_machine_is_refused(void **state)
{
    /* An address of RFC 5737, nobody's. */
    write_launch(*state, "127.0.0.1", "192.0.2.1", first_port(), false);
    assert_ends(*state, "computer", start(*state, "computer"), 2);
    assert_says(*state, "computer",
                "host computer: 192.0.2.1: is no address of this machine");
}

static void a_host_that_others_can_reach_needs_keys(void **state)
{
    struct scratch *s = *state;

    write_launch(s, "127.0.0.1", "192.0.2.1", first_port(), false);
    assert_int_equal(setenv("XDG_CONFIG_HOME", s->folder, 1), 0);
    pid_t vehicle = start(s, "vehicle");
    unsetenv("XDG_CONFIG_HOME");
    assert_ends(s, "vehicle", vehicle, 2);
    assert_says(s, "vehicle", "/anlos/keys/secret.key: there is no key: 'anlos keys new");
}

static void keys_that_others_can_read_are_refused(void **state)
{
    struct scratch *s = *state;

    make_host_keys(s);
    write_launch(s, "127.0.0.1", "127.0.0.2", first_port(), true);
    assert_int_equal(chmod(scratch_path(s, "keys/vehicle/secret.key"), 0644), 0);
    assert_ends(s, "vehicle", start(s, "vehicle"), 2);
    assert_says(s, "vehicle", "secret.key: others may read it (mode 644)");
}

static void a_port_in_use_is_refused_with_its_name(void **state)
{
    struct sockaddr_in at = {.sin_family = AF_INET};
    struct host h = {.port = first_port()};
    char text[128];
    unsigned port = hosts_port(&h, "recon", topic_volume());
    int fd = socket(AF_INET, SOCK_STREAM, 0);

    at.sin_port = htons((uint16_t)port);
    assert_int_equal(inet_pton(AF_INET, "127.0.0.2", &at.sin_addr), 1);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(fd, 1), 0);
    write_launch(*state, "127.0.0.1", "127.0.0.2", first_port(), false);
    assert_ends(*state, "computer", start(*state, "computer"), 2);
    snprintf(text, sizeof text,
             "tcp://127.0.0.2:%u, for topic volume: cannot bind: Address already in use",
             port);
    assert_says(*state, "computer", text);
    close(fd);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(array_and_reconstruction_on_two_hosts_find_the_object),
        TEST(a_host_that_is_stopped_may_come_back_during_the_scan),
        TEST(a_host_that_fails_ends_the_other),
        TEST(a_host_that_is_none_of_the_file_is_refused),
        TEST(a_host_that_is_not_this_machine_is_refused),
        TEST(a_host_that_others_can_reach_needs_keys),
        TEST(keys_that_others_can_read_are_refused),
        TEST(a_port_in_use_is_refused_with_its_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
