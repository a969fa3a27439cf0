/* SPDX-License-Identifier: MIT */
/* The bus between two hosts: two run folders of this machine, and two of its loopback
 * addresses. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <zmq.h>

#include "two_folders.h"

#define MB ((size_t)1 << 20)

static void by_tcp(void)
{
    by_tcp_at("127.0.0.1", "127.0.0.2");
    write_hosts();
}

static void messages_of_megabytes_cross_whole_and_in_order(void **state)
{
    (void)state;
    by_tcp();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    uint8_t *data = malloc(8 * MB);
    assert_non_null(data);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    meet(array, topic_ping(), dsp);
    for (unsigned k = 0; k < 6; k++) {
        memset(data, (int)k, 8 * MB);
        publish(array, topic_ping(), data, 8 * MB - k);
    }
    for (unsigned k = 0; k < 6; k++) {
        struct bus_message m = receive(dsp);
        assert_int_equal(m.envelope.payload_size, 8 * MB - k);
        assert_string_equal(m.envelope.node, "array");
        memset(data, (int)k, 8 * MB);
        assert_memory_equal(m.payload, data, 8 * MB - k);
        bus_message_free(&m);
    }
    assert_int_equal(count_of(dsp, topic_ping(), false).gaps, 0);
    assert_int_equal(count_of(array, topic_ping(), true).peers, 1);
    free(data);
    bus_destroy(dsp);
    bus_destroy(array);
}

static void a_publisher_that_comes_back_is_heard_again(void **state)
{
    (void)state;
    by_tcp();
    struct bus *dsp = open_on(1, "dsp", 1);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    for (int64_t epoch_ns = 1; epoch_ns <= 2; epoch_ns++) {
        struct bus *array = open_on(0, "array", epoch_ns);
        meet(array, topic_ping(), dsp);
        bus_destroy(array);
    }
    assert_int_equal(count_of(dsp, topic_ping(), false).gaps, 0);
    bus_destroy(dsp);
}

/* Health comes of every node, from both hosts. */
static void a_node_here_and_one_there_are_heard_alike(void **state)
{
    (void)state;
    by_tcp();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    const struct bus_config tool = {.run_dir = folders[1], .listen_only = true};
    struct bus *listener;
    assert_int_equal(bus_create(&listener, &tool, NULL), 0);
    assert_int_equal(bus_subscribe(listener, topic_health()), 0);
    meet(array, topic_health(), listener);
    meet(dsp, topic_health(), listener);
    bus_destroy(listener);
    bus_destroy(dsp);
    bus_destroy(array);
}

static void a_command_line_is_heard_from_either_host(void **state)
{
    (void)state;
    by_tcp();
    strcpy(hosts.list[0].nodes[0], "stage");
    write_hosts();
    for (int i = 0; i < 2; i++) {
        struct bus *stage = open_on(0, "stage", 1), *hand = open_on(i, "hand", 1);
        assert_int_equal(bus_subscribe(stage, topic_stage_manual()), 0);
        meet(hand, topic_stage_manual(), stage);
        bus_destroy(hand);
        bus_destroy(stage);
    }
}

static void hosts_by_ipc_hear_each_other_in_their_folders(void **state)
{
    char endpoint[100];
    (void)state;
    hosts.n = 0;
    snprintf(endpoint, sizeof endpoint, "ipc://%s", folders[0]);
    add_host("vehicle", endpoint, "array");
    snprintf(endpoint, sizeof endpoint, "ipc://%s", folders[1]);
    add_host("computer", endpoint, "dsp");
    write_hosts();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    assert_int_equal(bus_subscribe(array, topic_receipt()), 0);
    meet(array, topic_ping(), dsp);
    meet(dsp, topic_receipt(), array);
    bus_destroy(dsp);
    bus_destroy(array);
}

/* It is at the other end of a link that carries nothing, say. */
static void a_subscriber_that_does_not_read_holds_nobody_up(void **state)
{
    const int few = 1;
    const unsigned n = 400;
    unsigned got = 0;
    char url[64];
    (void)state;
    by_tcp();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    void *context = zmq_ctx_new(), *s = zmq_socket(context, ZMQ_SUB);
    uint8_t *data = calloc(1, MB);
    url_of(url, 0, "array", topic_ping());
    assert_non_null(data);
    assert_int_equal(zmq_setsockopt(s, ZMQ_RCVHWM, &few, sizeof few), 0);
    assert_int_equal(zmq_setsockopt(s, ZMQ_SUBSCRIBE, "", 0), 0);
    assert_int_equal(zmq_connect(s, url), 0);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    while (count_of(array, topic_ping(), true).peers < 2)
        publish(array, topic_ping(), "hello", 5);
    for (unsigned k = 0; k < n; k++)
        publish(array, topic_ping(), data, MB);
    uint64_t last = count_of(array, topic_ping(), true).messages - 1;
    struct bus_message m = receive(dsp); /* who reads hears what is new */
    while (m.envelope.sequence < last) {
        publish(array, topic_ping(), "hello", 5);
        bus_message_free(&m);
        m = receive(dsp);
    }
    bus_message_free(&m);
    while (zmq_recv(s, data, MB, ZMQ_DONTWAIT) >= 0)
        got++;
    assert_true(got < n / 2); /* the rest was not kept for it */
    free(data);
    zmq_close(s);
    zmq_ctx_term(context);
    bus_destroy(dsp);
    bus_destroy(array);
}

static void a_stranger_that_sends_rubbish_disturbs_nobody(void **state)
{
    /* The second begins as ZMTP does, and goes on with a frame of 2^63 bytes. */
    static const uint8_t rubbish[][12] = {
        {"GET / HTTP/1"}, {0xff, 0x7f, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff}};
    (void)state;
    by_tcp();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    for (int i = 0; i < 2; i++) {
        int fd = connect_plainly(0, "array", topic_ping());
        assert_int_equal(send(fd, rubbish[i], 12, MSG_NOSIGNAL), 12);
        meet(array, topic_ping(), dsp);
        close(fd);
    }
    bus_destroy(dsp);
    bus_destroy(array);
}

static void a_false_publisher_is_refused_and_an_absurd_one_cut_off(void **state)
{
    static uint8_t sound[ENVELOPE_SIZE + 5], stage[ENVELOPE_SIZE + 8192 + 5];
    struct envelope e = {.topic = "stage/state", .node = "dsp", .payload_size = 5};
    struct bus_message m;
    char url[64];
    (void)state;
    by_tcp();
    strcpy(hosts.list[0].nodes[0], "stage");
    write_hosts();
    struct bus *dsp = open_on(1, "dsp", 1);
    void *context = zmq_ctx_new(), *s = zmq_socket(context, ZMQ_PUB);
    url_of(url, 0, "stage", topic_stage_state());
    assert_int_equal(zmq_bind(s, url), 0);
    assert_int_equal(bus_subscribe(dsp, topic_stage_state()), 0);
    envelope_pack(&e, stage); /* its topic takes 4 kB */
    int64_t end_ms = now_ms() + DEADLINE_MS;
    while (bus_refused(dsp) < 1) { /* dsp does not publish stage/state */
        assert_int_equal(zmq_send(s, stage, ENVELOPE_SIZE + 5, 0), ENVELOPE_SIZE + 5);
        assert_true(now_ms() < end_ms);
        assert_int_equal(bus_receive(dsp, &m, 20), -ETIMEDOUT);
    }
    assert_int_equal(zmq_send(s, stage, sizeof stage, 0), sizeof stage);
    strcpy(e.node, "stage");
    envelope_pack(&e, sound);
    do { /* it is connected again, and only the sound ones arrive */
        assert_int_equal(zmq_send(s, sound, sizeof sound, 0), sizeof sound);
        assert_true(now_ms() < end_ms);
    } while (bus_receive(dsp, &m, 20) != 0);
    assert_string_equal(m.envelope.node, "stage");
    bus_message_free(&m);
    zmq_close(s);
    zmq_ctx_term(context);
    bus_destroy(dsp);
}

static int listen_plainly(int i, const char *node, const struct topic *t)
{
    const int yes = 1;
    struct sockaddr_in at = {.sin_family = AF_INET};
    at.sin_port = htons((uint16_t)hosts_port(&hosts.list[i], node, t));
    assert_int_equal(inet_pton(AF_INET, hosts.list[i].address, &at.sin_addr), 1);
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes), 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(fd, 1), 0);
    return fd;
}

static void a_port_that_something_else_had_before_is_connected_to_again(void **state)
{
    static const char answer[] = "HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n";
    char word[64];
    (void)state;
    by_tcp();
    int fd = listen_plainly(0, "array", topic_ping());
    struct bus *dsp = open_on(1, "dsp", 1);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    int peer = accept(fd, NULL, NULL);
    assert_true(peer >= 0);
    close(fd);
    assert_int_equal(send(peer, answer, sizeof answer, MSG_NOSIGNAL), sizeof answer);
    while (recv(peer, word, sizeof word, 0) > 0) /* until dsp has had enough of it */
        ;
    close(peer);
    struct bus *array = open_on(0, "array", 1);
    meet(array, topic_ping(), dsp);
    bus_destroy(dsp);
    bus_destroy(array);
}

static void a_port_that_is_taken_is_complained_about(void **state)
{
    const struct bus_config cfg = {.node = "array", .run_dir = folders[0]};
    struct error why = {""};
    struct bus *b;
    char url[64];
    (void)state;
    by_tcp();
    url_of(url, 0, "array", topic_ping());
    int fd = listen_plainly(0, "array", topic_ping());
    assert_int_equal(bus_create(&b, &cfg, &why), -EADDRINUSE);
    assert_non_null(strstr(why.text, url));
    assert_non_null(strstr(why.text, "topic ping"));
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(messages_of_megabytes_cross_whole_and_in_order),
        cmocka_unit_test(a_publisher_that_comes_back_is_heard_again),
        cmocka_unit_test(a_node_here_and_one_there_are_heard_alike),
        cmocka_unit_test(a_command_line_is_heard_from_either_host),
        cmocka_unit_test(hosts_by_ipc_hear_each_other_in_their_folders),
        cmocka_unit_test(a_subscriber_that_does_not_read_holds_nobody_up),
        cmocka_unit_test(a_stranger_that_sends_rubbish_disturbs_nobody),
        cmocka_unit_test(a_false_publisher_is_refused_and_an_absurd_one_cut_off),
        cmocka_unit_test(a_port_that_something_else_had_before_is_connected_to_again),
        cmocka_unit_test(a_port_that_is_taken_is_complained_about),
    };
    return cmocka_run_group_tests(tests, make_folders, remove_folders);
}
