/* SPDX-License-Identifier: MIT */
/* `anlos can decode`, and what `anlos doctor` says, of an interface of the guest. */
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

#include "hal/can/socket.h"
#include "msgs/can/e2e.h"
#include "msgs/can/frames.h"
#include "nodes/anlos/commands.h"
#include "tests/nodes/command.h"

#define DEADLINE_S 60

struct rig {
    pid_t pid;
    FILE *out;
    int err_fd, bus;
    struct can_protection protection;
};

static void start(struct rig *r, char *const words[])
{
    struct error why = {""};
    int out_fd;

    memset(r, 0, sizeof *r);
    r->protection.base = CAN_BASE_DEFAULT;
    r->pid = command_start(command_can, words, &out_fd, &r->err_fd);
    r->out = fdopen(out_fd, "r");
    assert_non_null(r->out);
    setvbuf(r->out, NULL, _IONBF, 0); /* so that poll tells what is there */
    assert_int_equal(can_socket_open(&r->bus, "vcan0", 0, &why), 0);
}

static int finish(struct rig *r)
{
    int status;

    assert_int_equal(waitpid(r->pid, &status, 0), r->pid);
    fclose(r->out);
    close(r->err_fd);
    close(r->bus);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void send_frame(struct rig *r, struct can_frame_data f)
{
    can_protect(&r->protection, &f);
    can_protection_sent(&r->protection, &f);
    assert_int_equal(can_socket_send(r->bus, &f), 0);
}

static void send_status(struct rig *r)
{
    struct can_frame_data f;

    can_pack_status(&f, CAN_BASE_DEFAULT, &(struct can_status){.state = CAN_ACTIVE});
    send_frame(r, f);
}

static bool has_answered(struct rig *r, int timeout_ms)
{
    struct pollfd p = {.fd = fileno(r->out), .events = POLLIN};

    return poll(&p, 1, timeout_ms) > 0;
}

/* Once it listens, what is sent comes out. */
static void send_until_answered(struct rig *r)
{
    time_t end = time(NULL) + DEADLINE_S;

    do {
        assert_true(time(NULL) < end);
        send_status(r);
    } while (!has_answered(r, 20));
}

static json_t *next(struct rig *r, const char *name)
{
    char line[4000];

    for (;;) { /* ends at the end of the file, or with a line of that name */
        assert_true(has_answered(r, DEADLINE_S * 1000));
        assert_non_null(fgets(line, sizeof line, r->out));
        json_t *o = json_loads(line, 0, NULL);
        assert_non_null(o);
        const char *is = json_string_value(json_object_get(o, "name"));
        if (is ? !strcmp(is, name) : !strcmp("summary", name))
            return o;
        json_decref(o);
    }
}

static void frames_are_shown_as_they_come_until_ctrl_c(void **state)
{
    (void)state;
    struct rig r;
    char *words[] = {"can", "decode", "vcan0", "--json", NULL};
    struct can_frame_data f;
    const struct can_object object = {.id = 42, .position_m = {3.25, -1.5, 0.5}};

    start(&r, words);
    send_until_answered(&r);
    can_pack_object_fd(&f, CAN_BASE_DEFAULT, &object);
    send_frame(&r, f);
    json_t *o = next(&r, "ObjectFD");
    assert_string_equal(json_string_value(json_object_get(o, "e2e")), "ok");
    assert_string_equal(json_string_value(json_object_get(o, "interface")), "vcan0");
    double x = json_number_value(json_object_get(json_object_get(o, "signals"), "X"));
    assert_true(x == 3.25);
    int64_t now_ns = (int64_t)time(NULL) * 1000000000;
    int64_t age_ns = now_ns - json_integer_value(json_object_get(o, "time_ns"));
    assert_in_range(age_ns + 2000000000, 0, (DEADLINE_S + 2) * 1000000000LL);
    json_decref(o);

    f.id = 0x300; /* somebody else's, which is not listened to */
    assert_int_equal(can_socket_send(r.bus, &f), 0);
    assert_int_equal(kill(r.pid, SIGINT), 0);
    o = next(&r, "summary");
    json_t *sum = json_object_get(o, "summary");
    json_t *fd = json_object_get(json_object_get(sum, "messages"), "ObjectFD");
    assert_int_equal(json_integer_value(json_object_get(fd, "frames")), 1);
    assert_int_equal(json_integer_value(json_object_get(sum, "other_identifiers")), 0);
    json_decref(o);
    assert_int_equal(finish(&r), 130);
}

static void after_the_seconds_asked_for_it_ends(void **state)
{
    (void)state;
    struct rig r;
    char *words[] = {"can", "decode", "vcan0", "--seconds", "0.2", NULL};

    start(&r, words);
    assert_int_equal(finish(&r), 1); /* nothing came */
}

static void an_interface_that_goes_down_ends_it_with_the_sum_of_what_came(void **state)
{
    (void)state;
    struct rig r;
    char *words[] = {"can", "decode", "vcan0", "--json", NULL};

    start(&r, words);
    send_until_answered(&r);
    assert_int_equal(system("ip link set vcan0 down"), 0);
    json_t *o = next(&r, "summary");
    assert_non_null(json_object_get(o, "summary"));
    json_decref(o);
    assert_int_equal(finish(&r), 1);
    assert_int_equal(system("ip link set vcan0 up"), 0);
}

static void the_doctor_says_that_an_interface_takes_no_fd_frames(void **state)
{
    struct command_result r;
    char path[] = "/tmp/anlos-can-XXXXXX";
    char *words[] = {"doctor", "--launch", path, NULL};
    FILE *f = fdopen(mkstemp(path), "w");

    (void)state;
    assert_non_null(f);
    fputs("nodes: [can]\ncan: {uri: \"socketcan:vcan1\", fd: true}\n", f);
    assert_int_equal(fclose(f), 0);
    assert_int_equal(system("ip link add vcan1 type vcan && ip link set vcan1 mtu 16 up"),
                     0);
    command_run(&r, command_doctor, words);
    assert_non_null(strstr(r.out, "vcan1 takes no CAN FD frames"));
    assert_int_equal(system("ip link set vcan1 down && ip link set vcan1 mtu 72 up"), 0);
    command_run(&r, command_doctor, words);
    assert_non_null(strstr(r.out, "vcan1 is up, takes FD frames"));
    assert_int_equal(system("ip link del vcan1"), 0);
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_are_shown_as_they_come_until_ctrl_c),
        cmocka_unit_test(after_the_seconds_asked_for_it_ends),
        cmocka_unit_test(an_interface_that_goes_down_ends_it_with_the_sum_of_what_came),
        cmocka_unit_test(the_doctor_says_that_an_interface_takes_no_fd_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
