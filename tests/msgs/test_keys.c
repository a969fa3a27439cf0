/* SPDX-License-Identifier: MIT */
/* Who may listen and command between hosts: those whose keys are permitted. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <zmq.h>

#include "msgs/keys.h"
#include "two_folders.h"

static char key_folders[2][100], publics[2][KEYS_TEXT_SIZE];
static const char *const names[] = {"vehicle", "computer"};

static char *path_in(const char *folder, const char *name)
{
    static char path[400];
    snprintf(path, sizeof path, "%.100s/%.100s", folder, name);
    return path;
}

static void write_file(const char *path, const char *text, mode_t mode)
{
    char fresh[500];
    snprintf(fresh, sizeof fresh, "%s.new", path);
    FILE *f = fopen(fresh, "w");
    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
    assert_int_equal(chmod(fresh, mode), 0);
    assert_int_equal(rename(fresh, path), 0);
}

/* Whom host i permits; NULL: not that one. */
static void permit(int i, const char *vehicle, const char *computer)
{
    char text[300] = "# a comment\n\n";
    size_t n = strlen(text);
    if (vehicle)
        n += (size_t)snprintf(text + n, sizeof text - n, "vehicle %s\n", vehicle);
    if (computer)
        snprintf(text + n, sizeof text - n, "computer %s\n", computer);
    write_file(path_in(key_folders[i], "peers"), text, 0644);
}

static void by_tcp_with_keys(void)
{
    by_tcp_at("127.0.0.3", "127.0.0.4");
    for (int i = 0; i < 2; i++)
        strcpy(hosts.list[i].keys, key_folders[i]);
    for (int i = 0; i < 2; i++)
        permit(i, publics[0], publics[1]);
    write_hosts();
}

static int make_keys(void **state)
{
    if (make_folders(state))
        return -1;
    for (int i = 0; i < 2; i++) {
        snprintf(key_folders[i], sizeof key_folders[i], "%s/keys-%s", run_folder,
                 names[i]);
        if (keys_create(key_folders[i], names[i], publics[i], NULL))
            return -1;
    }
    return 0;
}

static int remove_keys(void **state)
{
    for (int i = 0; i < 2; i++) {
        unlink(path_in(key_folders[i], "secret.key"));
        unlink(path_in(key_folders[i], "peers"));
        rmdir(key_folders[i]);
    }
    return remove_folders(state);
}

/* ---- what is said in the log */

struct says {
    pthread_mutex_t lock;
    char text[4096];
};

static void hear(void *ctx, const char *text)
{
    struct says *s = ctx;
    pthread_mutex_lock(&s->lock);
    size_t n = strlen(s->text);
    snprintf(s->text + n, sizeof s->text - n, "%s\n", text);
    pthread_mutex_unlock(&s->lock);
}

static bool has_said(struct says *s, const char *part)
{
    pthread_mutex_lock(&s->lock);
    bool has = strstr(s->text, part);
    pthread_mutex_unlock(&s->lock);
    return has;
}

/* Until a moment has passed, which waits for messages of b that must not come. */
static void assert_silence(struct bus *b, int ms)
{
    struct bus_message m;
    assert_int_equal(bus_receive(b, &m, ms), -ETIMEDOUT);
}

static void assert_says(struct bus *b, struct says *s, const char *part)
{
    int64_t end_ms = now_ms() + DEADLINE_MS;
    while (!has_said(s, part)) {
        if (now_ms() > end_ms)
            fail_msg("expected \"%s\" in \"%s\"", part, s->text);
        assert_silence(b, 20);
    }
}

/* Until one arrives that is sent from now on, and none that must never. */
static void meet_again(struct bus *from, const struct topic *t, struct bus *to)
{
    struct bus_message m;
    int64_t end_ms = now_ms() + DEADLINE_MS;
    bool is_new = false;
    do {
        publish(from, t, "again", 5);
        assert_true(now_ms() < end_ms);
        if (bus_receive(to, &m, 20) != 0)
            continue;
        is_new = !memcmp(m.payload, "again", 5);
        assert_memory_not_equal(m.payload, "never", 5);
        bus_message_free(&m);
    } while (!is_new);
}

/* ---- hostile programs */

struct intruder {
    const char *what, *why; /* it is refused, as the log says; NULL: that depends on which
                             * end is the first to see that they have nothing in common */
    bool encrypts;
    bool permitted;    /* has the secret of a host that is let in */
    bool wrong_server; /* thinks that it talks to another one */
};

static void *intrude(void *context, const struct intruder *x, const char *url)
{
    char public[KEYS_TEXT_SIZE], secret[KEYS_TEXT_SIZE], other[KEYS_TEXT_SIZE];
    struct keys keys;
    void *s = zmq_socket(context, ZMQ_SUB);
    assert_int_equal(zmq_setsockopt(s, ZMQ_SUBSCRIBE, "", 0), 0);
    assert_int_equal(zmq_curve_keypair(other, secret), 0);
    assert_int_equal(zmq_curve_keypair(public, secret), 0);
    assert_int_equal(keys_read(&keys, key_folders[1], NULL), 0);
    if (x->encrypts) {
        const char *server = x->wrong_server ? other : publics[0];
        assert_int_equal(zmq_setsockopt(s, ZMQ_CURVE_SERVERKEY, server, KEYS_TEXT_SIZE),
                         0);
        assert_int_equal(zmq_setsockopt(s, ZMQ_CURVE_PUBLICKEY,
                                        x->permitted ? keys.public : public,
                                        KEYS_TEXT_SIZE),
                         0);
        assert_int_equal(zmq_setsockopt(s, ZMQ_CURVE_SECRETKEY,
                                        x->permitted ? keys.secret : secret,
                                        KEYS_TEXT_SIZE),
                         0);
    }
    assert_int_equal(zmq_connect(s, url), 0);
    return s;
}

static void who_has_no_permitted_key_hears_nothing_and_is_counted(void **state)
{
    static const struct intruder intruders[] = {
        {"without keys", NULL, false, false, false},
        {"with an unknown key", "peers", true, false, false},
        {"with another server's key", "another key for this host", true, true, true},
    };
    (void)state;
    for (size_t i = 0; i < sizeof intruders / sizeof *intruders; i++) {
        const int none = 0;
        struct says says = {.lock = PTHREAD_MUTEX_INITIALIZER};
        char url[64], heard[64];
        by_tcp_with_keys();
        struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
        void *context = zmq_ctx_new();
        bus_on_refusal(array, hear, &says);
        url_of(url, 0, "array", topic_ping());
        void *s = intrude(context, &intruders[i], url);
        assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
        int64_t end_ms = now_ms() + DEADLINE_MS;
        while (bus_refused_connections(array) < 1) {
            publish(array, topic_ping(), "sound", 5);
            if (now_ms() > end_ms)
                fail_msg("%s: not counted", intruders[i].what);
            poll(NULL, 0, 1);
        }
        meet(array, topic_ping(), dsp); /* who may hears */
        assert_int_equal(count_of(array, topic_ping(), true).peers, 1);
        assert_int_equal(zmq_recv(s, heard, sizeof heard, ZMQ_DONTWAIT), -1);
        if (intruders[i].why)
            assert_says(dsp, &says, intruders[i].why);
        if (intruders[i].encrypts && !intruders[i].permitted) /* ZAP knows who asks */
            assert_says(dsp, &says, "a connection from 127.0.0.1 was refused");
        zmq_setsockopt(s, ZMQ_LINGER, &none, sizeof none);
        zmq_close(s);
        zmq_ctx_term(context);
        bus_destroy(dsp);
        bus_destroy(array);
    }
}

/* One that says as ZMTP does (RFC 23) that it knows no mechanism of security, and waits.
 */
static void who_says_that_it_has_no_keys_is_refused_for_that(void **state)
{
    static const uint8_t greeting[64] = {0xff, 0,    0, 0, 0,   0,   0,   0,
                                         1,    0x7f, 3, 0, 'N', 'U', 'L', 'L'};
    struct says says = {.lock = PTHREAD_MUTEX_INITIALIZER};
    (void)state;
    by_tcp_with_keys();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    bus_on_refusal(array, hear, &says);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    meet(array, topic_ping(), dsp);
    int fd = connect_plainly(0, "array", topic_ping());
    assert_int_equal(send(fd, greeting, sizeof greeting, MSG_NOSIGNAL), sizeof greeting);
    assert_says(dsp, &says, "to topic ping was refused: it has no keys");
    assert_int_equal(bus_refused_connections(array), 1);
    close(fd);
    bus_destroy(dsp);
    bus_destroy(array);
}

/* From the same address, and with nothing shown when the other one's key is taken. */
static void
a_stranger_that_was_there_before_a_host_is_counted_and_the_host_is_not(void **state)
{
    struct bus_message m;
    char signature;
    (void)state;
    by_tcp_with_keys();
    struct bus *array = open_on(0, "array", 1);
    int fd = connect_plainly(0, "array", topic_ping());
    assert_int_equal(recv(fd, &signature, 1, 0), 1); /* accepted */
    struct bus *dsp = open_on(1, "dsp", 1);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    meet(array, topic_ping(), dsp);
    close(fd);
    int64_t end_ms = now_ms() + DEADLINE_MS;
    while (bus_refused_connections(array) < 1) {
        assert_true(now_ms() < end_ms);
        assert_int_equal(bus_receive(dsp, &m, 20), -ETIMEDOUT);
    }
    bus_destroy(dsp);
    while (count_of(array, topic_ping(), true).peers > 0) {
        assert_true(now_ms() < end_ms);
        poll(NULL, 0, 1);
    }
    fd = connect_plainly(0, "array", topic_ping()); /* a sign that its end was seen */
    close(fd);
    while (bus_refused_connections(array) < 2) {
        assert_true(now_ms() < end_ms);
        poll(NULL, 0, 1);
    }
    assert_int_equal(bus_refused_connections(array), 2);
    bus_destroy(array);
}

/* More than have a place from the beginning, and none of them ends before all are there.
 */
static void of_many_strangers_at_once_each_is_counted(void **state)
{
    int fds[100];
    const size_t n = sizeof fds / sizeof *fds;
    struct bus_message m;
    (void)state;
    by_tcp_with_keys();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    meet(array, topic_ping(), dsp);
    for (size_t i = 0; i < n; i++) {
        char signature; /* who has sent it has accepted the connection */
        fds[i] = connect_plainly(0, "array", topic_ping());
        assert_int_equal(recv(fds[i], &signature, 1, 0), 1);
    }
    for (size_t i = 0; i < n; i++)
        close(fds[i]);
    int64_t end_ms = now_ms() + DEADLINE_MS;
    while (bus_refused_connections(array) < n) {
        if (now_ms() > end_ms)
            fail_msg("%d of %zu", (int)bus_refused_connections(array), n);
        assert_int_equal(bus_receive(dsp, &m, 20), -ETIMEDOUT);
    }
    meet(array, topic_ping(), dsp);
    assert_int_equal(bus_refused_connections(array), n);
    bus_destroy(dsp);
    bus_destroy(array);
}

static void the_largest_message_crosses_with_keys(void **state)
{
    const size_t most = topic_ping()->max_size;
    uint8_t *data = calloc(1, most);
    (void)state;
    assert_non_null(data);
    by_tcp_with_keys();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    meet(array, topic_ping(), dsp);
    publish(array, topic_ping(), data, most);
    struct bus_message m = receive(dsp);
    assert_int_equal(m.envelope.payload_size, most);
    bus_message_free(&m);
    assert_int_equal(count_of(dsp, topic_ping(), false).gaps, 0);
    free(data);
    bus_destroy(dsp);
    bus_destroy(array);
}

static void a_program_that_speaks_no_zmtp_is_refused_and_counted(void **state)
{
    struct says says = {.lock = PTHREAD_MUTEX_INITIALIZER};
    (void)state;
    by_tcp_with_keys();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    bus_on_refusal(array, hear, &says);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    meet(array, topic_ping(), dsp); /* of one address: who was let in is known by now */
    int fd = connect_plainly(0, "array", topic_ping());
    assert_int_equal(send(fd, "GET / HTTP/1.1\r\n\r\n", 18, MSG_NOSIGNAL), 18);
    shutdown(fd, SHUT_WR);
    assert_says(dsp, &says, "to topic ping was refused: it does not speak");
    assert_int_equal(bus_refused_connections(array), 1);
    meet(array, topic_ping(), dsp);
    close(fd);
    bus_destroy(dsp);
    bus_destroy(array);
}

/* A program has the port of a host that is away, and commands in its name. */
static void a_false_host_is_not_heard(void **state)
{
    static uint8_t command[ENVELOPE_SIZE + 5];
    struct envelope e = {.topic = "stage/manual", .node = "hand", .payload_size = 5};
    (void)state;
    for (int encrypts = 0; encrypts < 2; encrypts++) {
        const int yes = 1, none = 0;
        struct says says = {.lock = PTHREAD_MUTEX_INITIALIZER};
        char public[KEYS_TEXT_SIZE], secret[KEYS_TEXT_SIZE], url[64];
        by_tcp_with_keys();
        strcpy(hosts.list[0].nodes[0], "stage");
        write_hosts();
        void *context = zmq_ctx_new(), *s = zmq_socket(context, ZMQ_PUB);
        assert_int_equal(zmq_curve_keypair(public, secret), 0);
        if (encrypts) {
            assert_int_equal(zmq_setsockopt(s, ZMQ_CURVE_SERVER, &yes, sizeof yes), 0);
            assert_int_equal(
                zmq_setsockopt(s, ZMQ_CURVE_SECRETKEY, secret, KEYS_TEXT_SIZE), 0);
        }
        url_of(url, 1, "hand", topic_stage_manual());
        assert_int_equal(zmq_bind(s, url), 0);
        struct bus *stage = open_on(0, "stage", 1);
        bus_on_refusal(stage, hear, &says);
        assert_int_equal(bus_subscribe(stage, topic_stage_manual()), 0);
        envelope_pack(&e, command);
        int64_t end_ms = now_ms() + DEADLINE_MS;
        while (!has_said(&says, "host computer is not who it should be")) {
            assert_int_equal(zmq_send(s, command, sizeof command, 0), sizeof command);
            if (now_ms() > end_ms)
                fail_msg("nothing was said: %s", says.text);
            assert_silence(stage, 20);
        }
        zmq_setsockopt(s, ZMQ_LINGER, &none, sizeof none);
        zmq_close(s);
        zmq_ctx_term(context);
        struct bus *hand = open_on(1, "hand", 1); /* and once the true one is there */
        meet(hand, topic_stage_manual(), stage);
        bus_destroy(hand);
        bus_destroy(stage);
    }
}

static void a_key_that_is_taken_out_ends_what_it_let_in_until_it_is_back(void **state)
{
    struct says says = {.lock = PTHREAD_MUTEX_INITIALIZER},
                sent_away = {.lock = PTHREAD_MUTEX_INITIALIZER};
    char other[KEYS_TEXT_SIZE], secret[KEYS_TEXT_SIZE];
    struct bus_message m;
    (void)state;
    assert_int_equal(zmq_curve_keypair(other, secret), 0);
    const char *const instead[] = {NULL, other}; /* removed, or changed */
    for (int i = 0; i < 2; i++) {
        by_tcp_with_keys();
        says.text[0] = sent_away.text[0] = 0;
        struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
        bus_on_refusal(array, hear, &says);
        bus_on_refusal(dsp, hear, &sent_away);
        assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
        meet(array, topic_ping(), dsp);
        permit(0, publics[0], instead[i]);
        assert_says(array, &says, "/peers has changed: ");
        int64_t end_ms = now_ms() + DEADLINE_MS;
        while (!bus_refused_connections(array)) { /* it comes again, and is refused */
            publish(array, topic_ping(), "sound", 5);
            assert_true(now_ms() < end_ms);
            while (bus_receive(dsp, &m, 20) == 0)
                bus_message_free(&m);
        }
        assert_int_equal(count_of(array, topic_ping(), true).peers, 0);
        publish(array, topic_ping(), "never", 5);
        assert_says(dsp, &sent_away, "host vehicle does not let this one in");
        permit(0, publics[0], publics[1]);
        meet_again(array, topic_ping(), dsp);
        bus_destroy(dsp);
        bus_destroy(array);
    }
}

static void a_host_whose_key_is_taken_out_is_no_longer_heard(void **state)
{
    struct says says = {.lock = PTHREAD_MUTEX_INITIALIZER};
    struct bus_message m;
    (void)state;
    by_tcp_with_keys();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    bus_on_refusal(dsp, hear, &says);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    meet(array, topic_ping(), dsp);
    permit(1, NULL, publics[1]);
    int64_t end_ms = now_ms() + DEADLINE_MS;
    while (count_of(dsp, topic_ping(), false).peers ||
           count_of(array, topic_ping(), true).peers) {
        publish(array, topic_ping(), "sound", 5);
        assert_true(now_ms() < end_ms);
        while (bus_receive(dsp, &m, 20) == 0)
            bus_message_free(&m);
    }
    publish(array, topic_ping(), "never", 5);
    permit(1, publics[0], publics[1]);
    meet_again(array, topic_ping(), dsp);
    bus_destroy(dsp);
    bus_destroy(array);
}

/* Takes the port of a topic in the moment in which it is free. */
struct thief {
    pthread_t thread;
    struct sockaddr_in at;
    atomic_bool stop;
    atomic_int fd; /* -1: it does not have it yet */
};

static void *steal(void *arg)
{
    struct thief *t = arg;
    const int yes = 1;
    while (!t->stop) {
        int fd = socket(AF_INET, SOCK_STREAM, 0);
        if (fd >= 0 && !setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) &&
            !bind(fd, (struct sockaddr *)&t->at, sizeof t->at) && !listen(fd, 1)) {
            t->fd = fd;
            return NULL;
        }
        if (fd >= 0)
            close(fd);
    }
    return NULL;
}

static void
a_port_that_is_lost_with_the_keys_is_said_once_and_had_back_when_it_is_free(void **state)
{
    static const char lost[] =
        "topic ping: after the keys have changed its port cannot be bound";
    struct says says = {.lock = PTHREAD_MUTEX_INITIALIZER};
    struct thief t = {.at.sin_family = AF_INET, .fd = -1};
    int64_t end_ms = now_ms() + DEADLINE_MS;
    char other[KEYS_TEXT_SIZE], secret[KEYS_TEXT_SIZE];
    struct bus_message m;
    (void)state;
    assert_int_equal(zmq_curve_keypair(other, secret), 0);
    by_tcp_with_keys();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    bus_on_refusal(array, hear, &says);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    meet(array, topic_ping(), dsp);
    t.at.sin_port = htons((uint16_t)hosts_port(&hosts.list[0], "array", topic_ping()));
    assert_int_equal(inet_pton(AF_INET, hosts.list[0].address, &t.at.sin_addr), 1);
    assert_int_equal(pthread_create(&t.thread, NULL, steal, &t), 0);
    for (int i = 0; t.fd < 0; i++) { /* each change of the keys is a chance for it */
        permit(0, i % 2 ? publics[0] : other, publics[1]);
        for (int k = 0; k < 20 && t.fd < 0; k++) {
            publish(array, topic_ping(), "lost", 4);
            assert_true(now_ms() < end_ms);
            if (bus_receive(dsp, &m, 100) == 0)
                bus_message_free(&m);
        }
    }
    pthread_join(t.thread, NULL);
    while (!has_said(&says, lost)) {
        publish(array, topic_ping(), "lost", 4);
        assert_true(now_ms() < end_ms);
        if (bus_receive(dsp, &m, 20) == 0)
            bus_message_free(&m);
    }
    /* Whoever publishes does not wait for it: 0.2 s each time would be 60 s. */
    int64_t began_ms = now_ms();
    for (int i = 0; i < 300; i++)
        publish(array, topic_ping(), "lost", 4);
    assert_in_range(now_ms() - began_ms, 0, 30000);
    pthread_mutex_lock(&says.lock);
    assert_null(strstr(strstr(says.text, lost) + 1, lost));
    pthread_mutex_unlock(&says.lock);
    close(t.fd);
    end_ms = now_ms() + DEADLINE_MS;
    while (!has_said(&says, "topic ping: its port is bound again")) {
        publish(array, topic_ping(), "again", 5);
        assert_true(now_ms() < end_ms);
        if (bus_receive(dsp, &m, 20) == 0)
            bus_message_free(&m);
    }
    meet_again(array, topic_ping(), dsp);
    bus_destroy(dsp);
    bus_destroy(array);
}

static void a_slip_in_the_file_of_peers_changes_nothing_but_is_said(void **state)
{
    struct says says = {.lock = PTHREAD_MUTEX_INITIALIZER};
    (void)state;
    by_tcp_with_keys();
    struct bus *array = open_on(0, "array", 1), *dsp = open_on(1, "dsp", 1);
    bus_on_refusal(array, hear, &says);
    assert_int_equal(bus_subscribe(dsp, topic_ping()), 0);
    meet(array, topic_ping(), dsp);
    write_file(path_in(key_folders[0], "peers"), "# later\ncomputer nonsense\n", 0644);
    assert_says(array, &says, "peers:2: expected HOST KEY");
    assert_says(array, &says, "who was permitted before still is");
    meet_again(array, topic_ping(), dsp);
    assert_int_equal(count_of(dsp, topic_ping(), false).gaps, 0);
    bus_destroy(dsp);
    bus_destroy(array);
}

/* ---- the files */

static void a_host_without_good_keys_does_not_start(void **state)
{
    static const struct {
        const char *file, *text;
        mode_t mode;
        int err;
        const char *says;
    } cases[] = {
        {"secret.key", "good", 0644, -EACCES, "others may read it (mode 644)"},
        {"secret.key", "good", 0604, -EACCES, "others may read it"},
        {"secret.key", "good", 0620, -EACCES, "others may write it"},
        {"secret.key", "vehicle tooshort\n", 0600, -EINVAL, "secret.key:1: expected"},
        {"secret.key", "", 0600, -EINVAL, "is empty"},
        {"peers", "good", 0666, -EACCES, "others may write it (mode 666)"},
        {"peers", "# nobody\n", 0644, -EINVAL, "host computer has no line"},
        {"peers", "computer\n", 0644, -EINVAL, "peers:1: expected HOST KEY"},
        {"peers", "long", 0644, -EINVAL, "peers:3: expected a line of at most 254"},
    };
    char lengthy[800];
    (void)state;
    /* A comment whose end would be a line of its own, and permit somebody. */
    snprintf(lengthy, sizeof lengthy, "vehicle %s\n# more\n#%254s\ncomputer %s\n",
             publics[0],
             "computer "
             "nonsense",
             publics[1]);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct bus_config cfg = {.node = "array", .run_dir = folders[0]};
        struct error why = {""};
        struct bus *b;
        char good[400] = "", kept[500];
        by_tcp_with_keys();
        const char *path = path_in(key_folders[0], cases[i].file);
        snprintf(kept, sizeof kept, "%s.kept", path);
        FILE *f = fopen(path, "r");
        assert_non_null(f);
        assert_true(fread(good, 1, sizeof good - 1, f) > 0);
        fclose(f);
        assert_int_equal(rename(path, kept), 0);
        write_file(path,
                   !strcmp(cases[i].text, "good")   ? good
                   : !strcmp(cases[i].text, "long") ? lengthy
                                                    : cases[i].text,
                   cases[i].mode);
        int err = bus_create(&b, &cfg, &why);
        path = path_in(key_folders[0], cases[i].file);
        assert_int_equal(rename(kept, path), 0);
        if (err != cases[i].err || !strstr(why.text, cases[i].says))
            fail_msg("case %zu: %d, %s", i, err, why.text);
    }
}

static void without_keys_nothing_is_reached_but_from_this_machine(void **state)
{
    const struct bus_config cfg = {.node = "array", .run_dir = folders[0]};
    struct error why = {""};
    struct bus *b;
    (void)state;
    by_tcp_at("10.0.0.1", "127.0.0.4");
    write_hosts();
    assert_int_equal(bus_create(&b, &cfg, &why), -EINVAL);
    assert_non_null(strstr(why.text, "host vehicle: no keys are named for it"));
    strcpy(hosts.list[0].keys, "/nowhere/at all"); /* a blank in it */
    write_hosts();
    assert_int_equal(bus_create(&b, &cfg, &why), -ENOENT);
    assert_non_null(strstr(why.text, "anlos keys new --out /nowhere/at all"));
    by_tcp_at("127.0.0.3", "10.0.0.1"); /* the other one is elsewhere */
    write_hosts();
    assert_int_equal(bus_create(&b, &cfg, &why), -EINVAL);
}

static void a_new_key_is_its_owners_alone_and_never_replaces_another(void **state)
{
    char folder[150], public[KEYS_TEXT_SIZE], again[KEYS_TEXT_SIZE];
    struct error why = {""};
    struct keys keys;
    struct stat st;
    (void)state;
    snprintf(folder, sizeof folder, "%s/deep/er", run_folder);
    mode_t mask = umask(0);
    assert_int_equal(keys_create(folder, "vehicle", public, &why), 0);
    umask(mask);
    assert_int_equal(stat(path_in(folder, "secret.key"), &st), 0);
    assert_int_equal(st.st_mode & 0777, 0600);
    assert_int_equal(stat(folder, &st), 0);
    assert_int_equal(st.st_mode & 0777, 0700);
    assert_int_equal(keys_read(&keys, folder, &why), 0);
    assert_string_equal(keys.public, public);
    assert_string_equal(keys.host, "vehicle");
    assert_string_equal(keys.peers.list[0].key, public);
    assert_int_equal(keys_create(folder, "vehicle", again, &why), -EEXIST);
    assert_int_equal(keys_read(&keys, folder, &why), 0);
    assert_string_equal(keys.public, public);
    assert_int_equal(keys_create(folder, "a host", again, &why), -EINVAL);
    /* A link that somebody has planted is not followed. */
    unlink(path_in(folder, "secret.key"));
    assert_int_equal(symlink("/tmp/anlos-planted", path_in(folder, "secret.key")), 0);
    assert_int_equal(keys_create(folder, "vehicle", again, &why), -EEXIST);
    assert_int_equal(access("/tmp/anlos-planted", F_OK), -1);
    unlink(path_in(folder, "secret.key"));
    unlink(path_in(folder, "peers"));
    rmdir(folder);
    *strrchr(folder, '/') = 0;
    assert_int_equal(rmdir(folder), 0);
}

static void an_address_that_is_not_ours_is_complained_about(void **state)
{
    const struct bus_config cfg = {.node = "array", .run_dir = folders[0]};
    struct error why = {""};
    struct bus *b;
    (void)state;
    by_tcp_with_keys();
    strcpy(hosts.list[0].address, "192.0.2.1"); /* of RFC 5737, nobody's */
    write_hosts();
    assert_int_equal(bus_create(&b, &cfg, &why), -EADDRNOTAVAIL);
    assert_non_null(strstr(why.text, "tcp://192.0.2.1:"));
    assert_non_null(strstr(why.text, "not this machine"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(who_has_no_permitted_key_hears_nothing_and_is_counted),
        cmocka_unit_test(who_says_that_it_has_no_keys_is_refused_for_that),
        cmocka_unit_test(
            a_stranger_that_was_there_before_a_host_is_counted_and_the_host_is_not),
        cmocka_unit_test(of_many_strangers_at_once_each_is_counted),
        cmocka_unit_test(the_largest_message_crosses_with_keys),
        cmocka_unit_test(a_program_that_speaks_no_zmtp_is_refused_and_counted),
        cmocka_unit_test(a_false_host_is_not_heard),
        cmocka_unit_test(a_key_that_is_taken_out_ends_what_it_let_in_until_it_is_back),
        cmocka_unit_test(a_host_whose_key_is_taken_out_is_no_longer_heard),
        cmocka_unit_test(
            a_port_that_is_lost_with_the_keys_is_said_once_and_had_back_when_it_is_free),
        cmocka_unit_test(a_slip_in_the_file_of_peers_changes_nothing_but_is_said),
        cmocka_unit_test(a_host_without_good_keys_does_not_start),
        cmocka_unit_test(without_keys_nothing_is_reached_but_from_this_machine),
        cmocka_unit_test(a_new_key_is_its_owners_alone_and_never_replaces_another),
        cmocka_unit_test(an_address_that_is_not_ours_is_complained_about),
    };
    return cmocka_run_group_tests(tests, make_keys, remove_keys);
}
