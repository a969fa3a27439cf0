/* SPDX-License-Identifier: MIT */
/* What is written into a node's sockets, by whoever can open them, ends no process. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>
#include <nanomsg/nn.h>
#include <nanomsg/pubsub.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "msgs/endpoint.h"
#include "msgs/wire_guard.h"
#include "run_folder.h"

/* nanomsg's wire format, SP over IPC.  A handshake names the protocol of who sends it:
 * 0x20 is PUB, 0x21 SUB, 0x10 neither. */
#define HELLO(protocol) "\0SP\0\0" protocol "\0\0"
#define LENGTH(n)       "\0\0\0\0\0\0\0" n
#define BYTES(text)                                                                      \
    {                                                                                    \
        text, sizeof(text) - 1                                                           \
    }

struct bytes {
    const char *data;
    size_t size;
};

#define WRONG(protocol)                                                                  \
    {                                                                                    \
        BYTES(HELLO(protocol) "\2" LENGTH("\5") "hello"),                                \
            BYTES(HELLO(protocol) "\0" LENGTH("\5") "hello"),                            \
            BYTES(HELLO(protocol) "\xff\xff\xff\xff\xff\xff\xff\xff\xff"),               \
            BYTES(HELLO(protocol) "\1" LENGTH("\5") "hello"),                            \
            BYTES(HELLO(protocol) "\1" LENGTH("\0")),                                    \
            BYTES(HELLO(protocol) "\1" LENGTH("\0") "\1" LENGTH("\1") "x\3"),            \
            BYTES(HELLO(protocol) "\1\xff\xff\xff\xff\xff\xff\xff\xff"),                 \
            BYTES(HELLO(protocol) "\1\0\0"), BYTES(HELLO("\x10")), BYTES("\0SP"),        \
            BYTES("GET / HTTP/1.0\r\n\r\n"),                                             \
    }
static const struct bytes of_subscriber[] = WRONG("\x21");
static const struct bytes of_publisher[] = WRONG("\x20");
#define N_WRONG (sizeof of_subscriber / sizeof *of_subscriber)

static void address_of(struct sockaddr_un *at, const char *node, const struct topic *t)
{
    char url[ENDPOINT_URL_SIZE];
    *at = (struct sockaddr_un){.sun_family = AF_UNIX};
    assert_int_equal(endpoint_url(url, run_folder, node, t->name, NULL), 0);
    strcpy(at->sun_path, endpoint_path(url));
}

/* Sends, and reads until the other end has had enough of it. */
static void say(int fd, const struct bytes *b)
{
    char answer[64];
    assert_int_equal(send(fd, b->data, b->size, MSG_NOSIGNAL), b->size);
    shutdown(fd, SHUT_WR);
    while (recv(fd, answer, sizeof answer, 0) > 0)
        ;
    close(fd);
}

static void say_to(const char *node, const struct topic *t, const struct bytes *b)
{
    struct sockaddr_un at;
    int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    address_of(&at, node, t);
    assert_int_equal(connect(fd, (struct sockaddr *)&at, sizeof at), 0);
    say(fd, b);
}

/* Until one is heard. */
static void meet(struct bus *array, struct bus *dsp)
{
    struct bus_message m;
    int64_t end_ms = now_ms() + DEADLINE_MS;
    do {
        assert_int_equal(bus_publish(array, topic_ping(), 0, 0, "sound", 5), 0);
        assert_true(now_ms() < end_ms);
    } while (bus_receive(dsp, &m, 20) != 0);
    assert_memory_equal(m.payload, "sound", 5);
    bus_message_free(&m);
}

static void no_wrong_byte_in_any_nodes_socket_ends_it(void **state)
{
    (void)state;
    for (const char *const *node = topics_nodes(); *node; node++) {
        struct bus *b = open_bus(*node, 1);
        for (const struct topic *t = topics_all(); t->name; t++)
            for (size_t i = 0; topic_is_published_by(t, *node) && i < N_WRONG; i++)
                say_to(*node, t, &of_subscriber[i]);
        bus_destroy(b);
    }
}

static void it_is_counted_and_costs_who_listens_nothing(void **state)
{
    (void)state;
    struct bus *array = open_bus("array", 1), *dsp = open_bus("dsp", 1);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    meet(array, dsp);
    uint64_t before = bus_refused(array);
    say_to("array", topic_ping(), &of_subscriber[0]);
    assert_true(bus_refused(array) > before);
    for (int i = 0; i < 20; i++)
        meet(array, dsp);
    assert_int_equal(count_of(dsp, topic_ping(), false).gaps, 0);
    bus_destroy(dsp);
    bus_destroy(array);
}

static void a_false_publisher_ends_nobody_and_the_true_one_is_heard(void **state)
{
    (void)state;
    for (size_t i = 0; i < N_WRONG; i++) {
        struct sockaddr_un at;
        address_of(&at, "array", topic_ping());
        unlink(at.sun_path);
        int fd = socket(AF_UNIX, SOCK_STREAM, 0);
        assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
        assert_int_equal(listen(fd, 1), 0);
        struct bus *dsp = open_bus("dsp", 1);
        assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
        int peer = accept(fd, NULL, NULL);
        assert_true(peer >= 0);
        close(fd);
        say(peer, &of_publisher[i]);
        struct bus *array = open_bus("array", 1);
        meet(array, dsp);
        bus_destroy(array);
        bus_destroy(dsp);
    }
}

/* The moments differ from round to round; nanomsg alone overlooks every tenth. */
static void who_hangs_up_after_the_handshake_is_connected_to_again(void **state)
{
    const int soon_ms = 1;
    struct sockaddr_un at;
    char hello[8];
    (void)state;
    address_of(&at, "array", topic_ping());
    unlink(at.sun_path);
    int listener = socket(AF_UNIX, SOCK_STREAM, 0), s = nn_socket(AF_SP, NN_SUB);
    assert_int_equal(bind(listener, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(listener, 1), 0);
    nn_setsockopt(s, NN_SOL_SOCKET, NN_RECONNECT_IVL, &soon_ms, sizeof soon_ms);
    char url[ENDPOINT_URL_SIZE];
    assert_int_equal(endpoint_url(url, run_folder, "array", "ping", NULL), 0);
    assert_true(nn_connect(s, url) >= 0);
    for (int i = 0; i < 500; i++) {
        struct pollfd comes = {.fd = listener, .events = POLLIN};
        assert_int_equal(poll(&comes, 1, DEADLINE_MS), 1);
        int peer = accept(listener, NULL, NULL);
        assert_int_equal(send(peer, HELLO("\x20"), 8, MSG_NOSIGNAL), 8);
        assert_int_equal(recv(peer, hello, sizeof hello, MSG_WAITALL), 8);
        for (volatile int wait = 0; wait < i * 200; wait++)
            ;
        close(peer);
    }
    nn_close(s);
    close(listener);
}

/* -- the calls themselves ---------------------------------------------------------------
 */

static ssize_t read_from(int fd, char *into, size_t size)
{
    struct iovec part = {into, size};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    return recvmsg(fd, &message, 0);
}

/* Both ends of a connection to a socket of that name: [0] is who connected. */
static void join(int ends[2], const char *name)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    int listener = socket(AF_UNIX, SOCK_STREAM, 0);
    snprintf(at.sun_path, sizeof at.sun_path, "%s/%s", run_folder, name);
    unlink(at.sun_path);
    assert_int_equal(bind(listener, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(listener, 1), 0);
    ends[0] = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(connect(ends[0], (struct sockaddr *)&at, sizeof at), 0);
    ends[1] = accept4(listener, NULL, NULL, SOCK_CLOEXEC);
    assert_true(ends[1] >= 0);
    close(listener);
}

struct step {
    size_t sent;      /* more of it is sent */
    ssize_t reads[3]; /* what is then read at once, as often as that is not 0 */
};

/* Over a new connection: of what a publisher sends, who reads 64 bytes gets the steps'.
 */
static void read_in_steps(const struct bytes *b, const struct step *steps, size_t n)
{
    char got[64];
    size_t sent = 0, at = 0;
    int ends[2];
    join(ends, "a.ipc");
    for (size_t i = 0; i < n; sent += steps[i++].sent) {
        assert_int_equal(send(ends[1], b->data + sent, steps[i].sent, 0), steps[i].sent);
        for (size_t k = 0; k < 3 && steps[i].reads[k]; k++) {
            assert_int_equal(read_from(ends[0], got, sizeof got), steps[i].reads[k]);
            assert_memory_equal(got, b->data + at, (size_t)steps[i].reads[k]);
            at += (size_t)steps[i].reads[k];
        }
    }
    assert_int_equal(sent, b->size);
    close(ends[0]);
    close(ends[1]);
}

/* Frames of 5 bytes, of none, and of 258. */
#define FRAMES                                                                           \
    HELLO("\x20")                                                                        \
    "\1" LENGTH("\5") "hello"                                                            \
                      "\1" LENGTH("\0") "\1\0\0\0\0\0\0\1\2"

static void nothing_is_read_ahead_however_it_comes(void **state)
{
    static char sent[sizeof FRAMES - 1 + 258 + 1];
    const struct bytes b = {sent, sizeof sent};
    static const struct step at_once[] = {
        {8 + 14 + 9 + 9 + 258 + 1, {8, 9, 5}},
        {0, {9, 9, 64}},
        {0, {64, 64, 64}},
        {0, {2, 1}},
    };
    static const struct step in_parts[] = {
        {3, {3}},        {5 + 4, {5, 4}},           {5 + 2, {5, 2}},
        {3 + 8, {3, 8}}, {1 + 9 + 200, {1, 9, 64}}, {58 + 1, {64, 64, 64}},
        {0, {2, 1}},
    };
    (void)state;
    memcpy(sent, FRAMES, sizeof FRAMES - 1);
    sent[sizeof sent - 1] = 1; /* the next one's first */
    uint64_t before = wire_guard_refused();
    read_in_steps(&b, at_once, sizeof at_once / sizeof *at_once);
    read_in_steps(&b, in_parts, sizeof in_parts / sizeof *in_parts);
    assert_int_equal(wire_guard_refused(), before);
}

static void of_each_frame_the_first_byte_is_looked_at(void **state)
{
    static const char sent[] = HELLO("\x20") "\1" LENGTH("\1") "x\2" LENGTH("\1") "x";
    char got[64];
    int ends[2];
    (void)state;
    uint64_t before = wire_guard_refused();
    join(ends, "a.ipc");
    assert_int_equal(send(ends[1], sent, sizeof sent - 1, 0), sizeof sent - 1);
    assert_int_equal(read_from(ends[0], got, sizeof got), 8);
    assert_int_equal(read_from(ends[0], got, sizeof got), 9);
    assert_int_equal(read_from(ends[0], got, sizeof got), 1);
    assert_int_equal(read_from(ends[0], got, sizeof got), 0);
    assert_int_equal(wire_guard_refused(), before + 1);
    close(ends[0]);
    close(ends[1]);
}

/* More than nanomsg itself can use. */
static void a_descriptor_that_is_not_watched_is_not_connected(void **state)
{
    enum { WATCHED = 4096 };
    struct rlimit limit;
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    (void)state;
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    int high = fcntl(fd, F_DUPFD_CLOEXEC, WATCHED);
    close(fd);
    if (high < 0) /* the machine allows no such thing */
        skip();
    snprintf(at.sun_path, sizeof at.sun_path, "%s/none.ipc", run_folder);
    assert_int_equal(connect(high, (struct sockaddr *)&at, sizeof at), -1);
    assert_int_equal(errno, EMFILE);
    assert_int_equal(dup2(high, WATCHED - 1), WATCHED - 1);
    assert_int_equal(connect(WATCHED - 1, (struct sockaddr *)&at, sizeof at), -1);
    assert_int_equal(errno, ENOENT);
    close(high);
    close(WATCHED - 1);
}

static uint32_t events_of(int epoll)
{
    struct epoll_event event = {.events = 0};
    return epoll_wait(epoll, &event, 1, 0) > 0 ? event.events : 0;
}

static void that_one_hangs_up_is_told_after_what_it_sent_and_after_a_pause(void **state)
{
    char got[64];
    int ends[2], epoll = epoll_create1(EPOLL_CLOEXEC);
    (void)state;
    join(ends, "a.ipc");
    struct epoll_event of = {.events = EPOLLIN, .data.ptr = ends};
    assert_int_equal(epoll_ctl(epoll, EPOLL_CTL_ADD, ends[0], &of), 0);
    assert_int_equal(send(ends[1], HELLO("\x20") "\1", 9, 0), 9);
    close(ends[1]);
    assert_int_equal(events_of(epoll), EPOLLIN);
    assert_int_equal(read_from(ends[0], got, sizeof got), 8);
    of.events = 0;
    assert_int_equal(epoll_ctl(epoll, EPOLL_CTL_MOD, ends[0], &of), 0);
    assert_int_equal(events_of(epoll), 0);
    assert_int_equal(read_from(ends[0], got, sizeof got), 1);
    assert_int_equal(events_of(epoll), EPOLLHUP);
    close(ends[0]);
    close(epoll);
}

static void who_goes_is_not_refused(void **state)
{
    char got[64];
    (void)state;
    uint64_t before = wire_guard_refused();
    for (int end = 0; end < 2; end++) {
        int ends[2];
        join(ends, "a.ipc");
        assert_int_equal(send(ends[!end], HELLO("\x20"), 8, 0), 8);
        close(ends[!end]);
        assert_int_equal(read_from(ends[end], got, sizeof got), 8);
        assert_int_equal(read_from(ends[end], got, sizeof got), 0);
        close(ends[end]);
    }
    assert_int_equal(wire_guard_refused(), before);
}

static void what_is_none_of_ours_is_read_as_it_comes(void **state)
{
    char got[64];
    int ends[2];
    (void)state;
    join(ends, "a.socket");
    assert_int_equal(send(ends[1], "hello, hello", 12, 0), 12);
    assert_int_equal(read_from(ends[0], got, sizeof got), 12);
    close(ends[0]);
    close(ends[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_is_read_ahead_however_it_comes),
        cmocka_unit_test(of_each_frame_the_first_byte_is_looked_at),
        cmocka_unit_test(a_descriptor_that_is_not_watched_is_not_connected),
        cmocka_unit_test(that_one_hangs_up_is_told_after_what_it_sent_and_after_a_pause),
        cmocka_unit_test(who_goes_is_not_refused),
        cmocka_unit_test(what_is_none_of_ours_is_read_as_it_comes),
        cmocka_unit_test(no_wrong_byte_in_any_nodes_socket_ends_it),
        cmocka_unit_test(it_is_counted_and_costs_who_listens_nothing),
        cmocka_unit_test(a_false_publisher_ends_nobody_and_the_true_one_is_heard),
        cmocka_unit_test(who_hangs_up_after_the_handshake_is_connected_to_again),
    };
    return cmocka_run_group_tests(tests, make_run_folder, remove_run_folder);
}
