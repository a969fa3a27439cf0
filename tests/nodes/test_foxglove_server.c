/* SPDX-License-Identifier: MIT */
/* The server, against clients that behave and clients that do not. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "msgs/array.pb-c.h"
#include "nodes/foxglove/channels.h"
#include "nodes/foxglove/server.h"
#include "tests/nodes/foxglove_samples.h"
#include "tests/nodes/foxglove_socket.h"

#define SDK          "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n"
#define QUEUE_BYTES  ((size_t)1 << 20)
#define TOTAL_BYTES  (QUEUE_BYTES + QUEUE_BYTES / 2)
#define PING_SAMPLES 25000

struct rig {
    struct web *web;
    struct foxglove_server *server;
    struct samples samples;
    float sound[PING_SAMPLES];
    int port;
};

/* So that there are channels. */
static void send_all(struct rig *r)
{
    Anlos__Ping ping = ANLOS__PING__INIT;
    const struct foxglove_message all[] = {
        samples_survey(&r->samples),
        samples_volume(&r->samples),
        samples_log(&r->samples),
        samples_message(topic_ping(), "array", &ping.base),
    };

    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        foxglove_server_message(r->server, &all[i]);
}

/* write_ms: how long a write may wait for a client. */
static int open_rig(void **state, int write_ms)
{
    const struct web_config at = {
        .address = "127.0.0.1", .write_ms = write_ms, .silence_s = 60};
    struct rig *r = calloc(1, sizeof *r);
    struct foxglove_config cfg;

    *state = r;
    if (!r || !samples_open(&r->samples) || web_create(&r->web, &at, NULL))
        return -1;
    r->port = (int)web_port(r->web);
    foxglove_config_default(&cfg, 42);
    cfg.max_clients = 3;
    cfg.queue_bytes = QUEUE_BYTES;
    cfg.total_bytes = TOTAL_BYTES;
    if (foxglove_server_create(&r->server, r->web, &cfg) || web_start(r->web, NULL))
        return -1;
    send_all(r);
    return 0;
}

static int setup(void **state)
{
    return open_rig(state, 60000);
}

static int setup_impatient(void **state)
{
    return open_rig(state, 300);
}

static int teardown(void **state)
{
    struct rig *r = *state;

    foxglove_server_stop(r->server);
    web_destroy(r->web);
    foxglove_server_destroy(r->server);
    samples_close(&r->samples);
    free(r);
    return 0;
}

static size_t channel_of(const char *name)
{
    struct channel c;

    for (size_t i = 0; i < channels_count(); i++) {
        channel_get(i, &c);
        if (!strcmp(c.name, name))
            return i;
    }
    fail_msg("no channel %s", name);
    return 0;
}

/* A text that has this in it; others are ignored, binary ones too. */
static void assert_hears(int fd, const char *part)
{
    struct socket_frame f;
    bool found = false;

    while (!found) {
        if (!socket_next(fd, &f))
            fail_msg("hung up before \"%s\"", part);
        found = f.op == OP_TEXT && strstr((const char *)f.data, part);
        free(f.data);
    }
}

/* The next message; its subscription. */
static uint32_t next_message(int fd, struct socket_frame *f)
{
    for (;;) {
        assert_true(socket_next(fd, f));
        if (f->op == OP_BINARY && f->data[0] == 1)
            return f->data[1] | (uint32_t)f->data[2] << 8 | (uint32_t)f->data[3] << 16 |
                   (uint32_t)f->data[4] << 24;
        free(f->data);
    }
}

/* A connection, once there is room: a client of before may still be leaving. */
static int connected(const struct rig *r)
{
    for (;;) {
        int fd = socket_open(r->port), status = socket_shake(fd, SDK);
        if (status == 101)
            return fd;
        assert_int_equal(status, 503);
        close(fd);
    }
}

static int client(const struct rig *r)
{
    int fd = connected(r);

    assert_hears(fd, "serverInfo");
    assert_hears(fd, "\"op\":\"advertise\"");
    return fd;
}

static void subscribe(int fd, unsigned id, const char *name)
{
    char text[128];

    snprintf(text, sizeof text,
             "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":%u,\"channelId\":%zu}]}",
             id, channel_of(name));
    socket_say(fd, text);
}

/* What was said before has been heard when the answer to this is there. */
static void settle(int fd)
{
    socket_say(fd, "{\"op\":\"settle\"}");
    assert_hears(fd, "settle: no such operation");
}

static void send_volume(struct rig *r)
{
    const struct foxglove_message survey = samples_survey(&r->samples),
                                  volume = samples_volume(&r->samples);

    foxglove_server_message(r->server, &survey);
    foxglove_server_message(r->server, &volume);
}

static void assert_works(struct rig *r, int fd)
{
    struct socket_frame f;

    send_volume(r);
    subscribe(fd, 77, "volume");
    while (next_message(fd, &f) != 77)
        free(f.data);
    assert_true(f.size > 13 + sizeof r->samples.intensity);
    free(f.data);
}

static void either_subprotocol_is_spoken_and_no_other(void **state)
{
    static const struct {
        const char *lines;
        int status;
    } cases[] = {
        {SDK, 101},
        {"Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n", 101},
        {"Sec-WebSocket-Protocol: chat, foxglove.sdk.v1\r\n", 101},
        {"Sec-WebSocket-Protocol: chat\r\n", 400},
        {"", 400},
        {SDK "Origin: https://app.foxglove.dev\r\n", 101},
        {SDK "Origin: http://evil.com\r\n", 403},
    };
    struct rig *r = *state;
    struct foxglove_counts before, n;

    foxglove_server_counts(r->server, &before);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int fd = socket_open(r->port);
        struct socket_frame f;
        assert_int_equal(socket_shake(fd, cases[i].lines), cases[i].status);
        if (cases[i].status == 101) {
            assert_hears(fd, "serverInfo");
            socket_frame(fd, OP_CLOSE, true, "\x03\xe8", 2);
            while (socket_next(fd, &f)) /* until it hangs up: it is counted no more */
                free(f.data);
        }
        close(fd);
    }
    foxglove_server_counts(r->server, &n);
    assert_int_equal(n.refused, before.refused + 3);
}

static void a_late_client_gets_the_newest_state(void **state)
{
    struct rig *r = *state;
    struct socket_frame f;

    send_volume(r);
    int fd = client(r);
    subscribe(fd, 5, "view/cloud");
    assert_int_equal(next_message(fd, &f), 5);
    free(f.data);
    close(fd);
}

static void an_image_is_shown_when_its_survey_has_come(void **state)
{
    struct rig *r = *state;
    r->samples.survey.wall_distance_m = 1.1;
    assert_true(samples_pack_survey(&r->samples));
    const struct foxglove_message survey = samples_survey(&r->samples),
                                  volume = samples_volume(&r->samples);
    struct socket_frame f;
    int fd = client(r);

    subscribe(fd, 5, "view/cloud");
    settle(fd);
    foxglove_server_message(r->server, &volume);
    foxglove_server_message(r->server, &survey);
    assert_int_equal(next_message(fd, &f), 5);
    free(f.data);
    close(fd);
}

static void nonsense_is_answered_and_the_connection_goes_on(void **state)
{
    static const struct {
        int op;
        const char *data, *answer;
    } cases[] = {
        {OP_TEXT, "rubbish", "not JSON"},
        {OP_TEXT, "", "not JSON"},
        {OP_TEXT, "{\"op\":\"dance\"}", "dance: no such operation"},
        {OP_TEXT, "{\"op\":\"advertise\",\"channels\":[]}", "no such capability"},
        {OP_TEXT,
         "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":1,\"channelId\":4294967295}]}",
         "no channel 4294967295"},
        {OP_TEXT, "{\"op\":\"unsubscribe\",\"subscriptionIds\":[9]}",
         "no subscription 9"},
        {OP_BINARY, "rubbish", "no operation of the protocol"},
        {OP_BINARY, "\1abcdefg", "no such capability"},
        {OP_BINARY, "", "empty"},
    };
    struct rig *r = *state;
    int fd = client(r);

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        socket_frame(fd, cases[i].op, true, cases[i].data, strlen(cases[i].data));
        assert_hears(fd, cases[i].answer);
    }
    assert_works(r, fd);
    close(fd);
}

static void a_channel_is_subscribed_to_once(void **state)
{
    struct rig *r = *state;
    int fd = client(r);

    subscribe(fd, 1, "ping");
    subscribe(fd, 2, "ping");
    assert_hears(fd, "subscribed to already");
    subscribe(fd, 1, "log");
    assert_hears(fd, "id 1 is that of another");
    socket_say(fd, "{\"op\":\"unsubscribe\",\"subscriptionIds\":[1]}");
    subscribe(fd, 1, "log");
    settle(fd);
    const struct foxglove_message log = samples_log(&r->samples);
    struct socket_frame f;
    foxglove_server_message(r->server, &log);
    assert_int_equal(next_message(fd, &f), 1);
    free(f.data);
    close(fd);
}

static void a_channel_is_offered_from_its_first_message_on(void **state)
{
    struct rig *r = *state;
    const struct foxglove_message m = samples_detections(&r->samples);
    int fd = client(r);

    subscribe(fd, 1, "view/objects");
    assert_hears(fd, "there is no channel");
    foxglove_server_message(r->server, &m);
    assert_hears(fd, "\"topic\":\"view/objects\"");
    struct socket_frame f;
    subscribe(fd, 1, "view/objects");
    assert_int_equal(next_message(fd, &f), 1);
    free(f.data);
    close(fd);
}

static void a_request_may_come_in_parts(void **state)
{
    static const char text[] = "{\"op\":\"in parts\"}";
    struct rig *r = *state;
    struct socket_frame f;
    int fd = client(r);

    socket_frame(fd, OP_TEXT, false, text, 4);
    socket_frame(fd, OP_CONTINUATION, false, text + 4, 4);
    socket_frame(fd, OP_PING, true, "p", 1); /* may come between */
    socket_frame(fd, OP_CONTINUATION, true, text + 8, sizeof text - 9);
    do {
        assert_true(socket_next(fd, &f));
        free(f.data);
    } while (f.op != OP_PONG);
    assert_hears(fd, "in parts: no such operation");
    close(fd);
}

static void endless_parts_are_cut(void **state)
{
    struct rig *r = *state;
    char *part = calloc(60000, 1);
    int fd = client(r);

    assert_non_null(part);
    socket_frame(fd, OP_TEXT, false, part, 60000);
    for (int i = 0; i < 5; i++)
        socket_frame(fd, OP_CONTINUATION, false, part, 60000);
    socket_frame(fd, OP_CONTINUATION, true, part, 60000);
    assert_hears(fd, "too long");
    socket_frame(fd, OP_TEXT, true, part, 60000);
    assert_hears(fd, "not JSON");
    assert_works(r, fd);
    free(part);
    close(fd);
}

/* Reads on until the other side has hung up; the reason that it gave, 0: none. */
static int reason_of_end(int fd)
{
    struct socket_frame f;
    int reason = 0;

    while (socket_next(fd, &f)) {
        if (f.op == OP_CLOSE && f.size >= 2)
            reason = f.data[0] << 8 | f.data[1];
        free(f.data);
    }
    return reason;
}

/* RFC 6455 5.4: such a client has lost its place. */
static void a_part_of_nothing_ends_the_connection(void **state)
{
    struct rig *r = *state;
    int fd = client(r);

    socket_frame(fd, OP_CONTINUATION, true, "x", 1);
    assert_int_equal(reason_of_end(fd), 1002);
    close(fd);
}

static void more_clients_than_allowed_are_refused(void **state)
{
    struct rig *r = *state;
    int fds[3];

    for (int i = 0; i < 3; i++)
        fds[i] = client(r); /* which waits until all of before have left */
    int fd = socket_open(r->port);
    assert_int_equal(socket_shake(fd, SDK), 503);
    close(fd);
    assert_works(r, fds[0]);
    for (int i = 0; i < 3; i++)
        close(fds[i]);
}

/* Of 100 kB, in step with a client that reads it. */
static void ping_in_step(struct rig *r, int reader, int64_t n)
{
    Anlos__Ping ping = ANLOS__PING__INIT;
    struct tensor_view view;
    struct socket_frame f;

    ping.samples = tensor_borrow_f32(&view, r->sound, 2, (size_t)1, (size_t)PING_SAMPLES);
    struct foxglove_message m = samples_message(topic_ping(), "array", &ping.base);
    m.publish_ns = n;
    foxglove_server_message(r->server, &m);
    next_message(reader, &f);
    assert_int_equal(f.data[5] | f.data[6] << 8, n);
    free(f.data);
}

static void a_client_that_never_reads_keeps_nobody_waiting(void **state)
{
    struct rig *r = *state;
    int slow = client(r), quick = client(r);
    struct foxglove_counts before, n;
    struct socket_frame f;

    foxglove_server_counts(r->server, &before);
    subscribe(slow, 1, "ping");
    settle(slow);
    subscribe(quick, 1, "ping");
    settle(quick);
    for (int64_t i = 0; i < 200; i++)
        ping_in_step(r, quick, i);
    foxglove_server_counts(r->server, &n);
    n.dropped -= before.dropped;
    assert_true(n.dropped > 50); /* 20 MB, of which the socket and the queue hold some */
    assert_true(n.dropped < 200);
    assert_int_equal(n.skipped, before.skipped);

    /* Now it reads: it was told, and what it gets at last is the newest. */
    bool told = false;
    int64_t last = -1;
    while (last != 199) {
        if (!socket_next(slow, &f))
            break; /* it may have been given up meanwhile */
        if (f.op == OP_TEXT)
            told = told || strstr((const char *)f.data, "too slow");
        else if (f.data[0] == 1)
            last = f.data[5] | f.data[6] << 8;
        free(f.data);
    }
    assert_int_equal(last, 199);
    if (!told)
        assert_hears(slow, "too slow");
    close(slow);
    close(quick);
}

/* Two that never read have no more waiting than what all may have together, and one of
 * them not all of it. */
static void what_waits_for_all_is_bounded(void **state)
{
    struct rig *r = *state;
    int slow[] = {client(r), client(r)}, quick = client(r);
    struct foxglove_counts n;
    size_t most = 0;

    for (int i = 0; i < 2; i++) {
        subscribe(slow[i], 1, "ping");
        settle(slow[i]);
    }
    subscribe(quick, 1, "ping");
    settle(quick);
    for (int64_t i = 0; i < 200; i++) {
        ping_in_step(r, quick, i);
        foxglove_server_counts(r->server, &n);
        assert_in_range(n.waiting, 0, TOTAL_BYTES);
        most = n.waiting > most ? n.waiting : most;
    }
    assert_in_range(most, QUEUE_BYTES, TOTAL_BYTES); /* both had some of it */
    for (int i = 0; i < 2; i++) {
        assert_hears(slow[i], "too slow");
        close(slow[i]);
    }
    close(quick);
}

static void a_client_that_vanishes_is_forgotten(void **state)
{
    struct rig *r = *state;

    for (int i = 0; i < 10; i++) { /* more than there is room for at once */
        int fd = connected(r);
        subscribe(fd, 1, "view/cloud");
        send_volume(r);
        close(fd);
    }
}

static void the_time_is_told_and_told_to_who_comes_later(void **state)
{
    static const uint8_t expected[] = {2, 8, 7, 6, 5, 4, 3, 2, 1};
    struct rig *r = *state;
    struct socket_frame f;

    foxglove_server_time(r->server, 0x0102030405060708);
    int fd = connected(r);
    do {
        assert_true(socket_next(fd, &f));
        if (f.op == OP_BINARY)
            break;
        free(f.data);
    } while (true);
    assert_int_equal(f.size, sizeof expected);
    assert_memory_equal(f.data, expected, sizeof expected);
    free(f.data);
    close(fd);
}

/* It takes none of the threads for ever. */
static void a_client_that_never_reads_is_given_up(void **state)
{
    struct rig *r = *state;
    int dead = client(r), quick = client(r);
    struct foxglove_counts n;

    subscribe(dead, 1, "ping");
    settle(dead);
    subscribe(quick, 1, "ping");
    settle(quick);
    for (int64_t i = 0; i < 100; i++)
        ping_in_step(r, quick, i);
    do {
        settle(quick);
        foxglove_server_counts(r->server, &n);
    } while (n.clients > 1);
    ping_in_step(r, quick, 100);
    close(dead);
    close(quick);
}

static void goodbye_is_said_at_the_end(void **state)
{
    struct rig *r = *state;
    struct socket_frame f;
    int fd = client(r);

    foxglove_server_stop(r->server);
    assert_true(socket_next(fd, &f));
    assert_int_equal(f.op, OP_CLOSE);
    assert_memory_equal(f.data, "\x03\xe9", 2);
    free(f.data);
    close(fd);
    fd = socket_open(r->port);
    assert_int_equal(socket_shake(fd, SDK), 503);
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(either_subprotocol_is_spoken_and_no_other),
        cmocka_unit_test(a_late_client_gets_the_newest_state),
        cmocka_unit_test(an_image_is_shown_when_its_survey_has_come),
        cmocka_unit_test(nonsense_is_answered_and_the_connection_goes_on),
        cmocka_unit_test(a_channel_is_subscribed_to_once),
        cmocka_unit_test(a_channel_is_offered_from_its_first_message_on),
        cmocka_unit_test(a_request_may_come_in_parts),
        cmocka_unit_test(endless_parts_are_cut),
        cmocka_unit_test(a_part_of_nothing_ends_the_connection),
        cmocka_unit_test(more_clients_than_allowed_are_refused),
        cmocka_unit_test(a_client_that_never_reads_keeps_nobody_waiting),
        cmocka_unit_test(what_waits_for_all_is_bounded),
        cmocka_unit_test(a_client_that_vanishes_is_forgotten),
        cmocka_unit_test(the_time_is_told_and_told_to_who_comes_later),
        cmocka_unit_test(goodbye_is_said_at_the_end),
    };
    const struct CMUnitTest impatient[] = {
        cmocka_unit_test(a_client_that_never_reads_is_given_up),
    };
    int failed = cmocka_run_group_tests(tests, setup, teardown);
    return failed + cmocka_run_group_tests(impatient, setup_impatient, teardown);
}
