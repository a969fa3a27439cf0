/* SPDX-License-Identifier: MIT */
/* A node in this process, and a bus that listens to it. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/bus.h"
#include "msgs/log.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "nodes/rt/node.h"

#define DEADLINE_MS 60000
#define DEADLINE_NS (DEADLINE_MS * 1000000LL)

struct rig {
    struct scratch *scratch;
    char launch[512];
    struct node *node;
};

static int create(struct rig *r, const char *name, const char *option, const char *value)
{
    char *argv[] = {
        (char *)"program",  (char *)"--launch", r->launch,     (char *)"--run-dir",
        r->scratch->folder, (char *)option,     (char *)value, NULL};

    return node_create(&r->node, name, "Does nothing.", option ? value ? 7 : 6 : 5, argv);
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scratch_open((void **)&r->scratch))
        return -1;
    snprintf(r->launch, sizeof r->launch, "%s",
             scratch_write(r->scratch, "a.yaml", "nodes: [scan]\n"));
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;
    void *scratch = r->scratch;

    free(r);
    return scratch_close(&scratch);
}

static struct bus *listen(const struct rig *r, const struct topic *t)
{
    const struct bus_config cfg = {
        .node = "test", .run_dir = r->scratch->folder, .listen_only = true};
    struct bus *b = NULL;

    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(b, t), 0);
    return b;
}

/* Keeps the node going until the bus has a message. */
static ProtobufCMessage *hear(struct rig *r, struct bus *b)
{
    struct bus_message m;
    struct node_message in;
    int64_t end = node_now_ns(r->node) + DEADLINE_NS;

    while (bus_receive(b, &m, 0) == -ETIMEDOUT) {
        assert_true(node_now_ns(r->node) < end);
        node_next(r->node, &in, 10);
    }
    ProtobufCMessage *content = bus_message_unpack(&m);
    bus_message_free(&m);
    assert_non_null(content);
    return content;
}

static void health_is_published_without_being_asked(void **state)
{
    struct rig *r = *state;

    assert_int_equal(create(r, "scan", NULL, NULL), 0);
    struct bus *b = listen(r, topic_health());
    Anlos__Health *h = (Anlos__Health *)hear(r, b);
    assert_string_equal(h->node, "scan");
    assert_int_equal(h->pid, getpid());
    assert_int_equal(h->state, ANLOS__HEALTH__STATE__STARTING);
    assert_true(h->rss_bytes > 0);
    assert_true(h->n_topics > 0);
    anlos__health__free_unpacked(h, NULL);
    bus_destroy(b);
    assert_int_equal(node_finish(r->node, 0), 0);
}

static size_t count_overruns(void *device, struct device_count *out)
{
    *out = (struct device_count){.name = "overruns", .value = ++*(uint64_t *)device};
    return 1;
}

static void health_carries_what_the_device_counts_now(void **state)
{
    struct rig *r = *state;
    uint64_t overruns = 41;

    assert_int_equal(create(r, "scan", NULL, NULL), 0);
    node_device(r->node, count_overruns, &overruns);
    struct bus *b = listen(r, topic_health());
    uint64_t last = 41;
    for (int i = 0; i < 2; i++) { /* one may go by before the listener is connected */
        Anlos__Health *h = (Anlos__Health *)hear(r, b);
        assert_int_equal(h->n_device, 1);
        assert_string_equal(h->device[0]->name, "overruns");
        assert_true(h->device[0]->value > last && h->device[0]->value <= overruns);
        last = h->device[0]->value;
        anlos__health__free_unpacked(h, NULL);
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "again");
    }
    bus_destroy(b);
    node_finish(r->node, 0);
}

static const Anlos__TopicCount *find_count(const Anlos__Health *h, const char *topic,
                                           bool published)
{
    for (size_t i = 0; i < h->n_topics; i++)
        if (!strcmp(h->topics[i]->topic, topic) && h->topics[i]->published == published)
            return h->topics[i];
    fail_msg("no count of %s", topic);
    return NULL;
}

/* The node does not turn: what comes was said at once. */
static Anlos__Health *next_health(struct bus *b)
{
    struct bus_message m;

    assert_int_equal(bus_receive(b, &m, DEADLINE_MS), 0);
    Anlos__Health *h = (Anlos__Health *)bus_message_unpack(&m);
    bus_message_free(&m);
    assert_non_null(h);
    return h;
}

/* A bus that has heard all that the node said of itself so far. */
static struct bus *listen_from_now(struct rig *r)
{
    struct bus *b = listen(r, topic_health());
    Anlos__Health *h = (Anlos__Health *)hear(r, b);

    node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "from now");
    while (strcmp(h->text, "from now")) {
        anlos__health__free_unpacked(h, NULL);
        h = next_health(b);
    }
    anlos__health__free_unpacked(h, NULL);
    return b;
}

static void health_carries_faults_that_last(void **state)
{
    struct rig *r = *state;

    assert_int_equal(create(r, "scan", "--log-level", "error"), 0);
    struct bus *b = listen_from_now(r);
    node_fault(r->node, NODE_FAULT_CHANNELS_SILENT, 0, 16); /* nothing new */
    node_fault(r->node, NODE_FAULT_CHANNELS_SILENT, 3, 16);
    for (int i = 0; i < 2; i++) {
        Anlos__Health *h = next_health(b);
        assert_int_equal(h->n_faults, 1);
        assert_string_equal(h->faults[0]->name, NODE_FAULT_CHANNELS_SILENT);
        assert_int_equal(h->faults[0]->count, 3);
        assert_int_equal(h->faults[0]->of, 16);
        anlos__health__free_unpacked(h, NULL);
        if (i == 0)
            node_state(r->node, ANLOS__HEALTH__STATE__READY, "again");
    }
    node_fault(r->node, NODE_FAULT_CHANNELS_SILENT, 0, 16);
    Anlos__Health *h = next_health(b);
    assert_int_equal(h->n_faults, 0);
    anlos__health__free_unpacked(h, NULL);
    bus_destroy(b);
    node_finish(r->node, 0);
}

static void health_tells_how_old_the_sound_was(void **state)
{
    struct rig *r = *state;
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;
    Anlos__Health *h = NULL;

    assert_int_equal(create(r, "scan", "--log-level", "error"), 0);
    assert_int_equal(node_subscribe(r->node, topic_scan_status()), 0);
    struct bus *b = listen(r, topic_health());
    int64_t start = node_now_ns(r->node);
    for (int i = 0; !h || !find_count(h, "scan/status", false)->latency_n; i++) {
        assert_true(node_now_ns(r->node) < start + DEADLINE_NS); /* connects first */
        int64_t capture_ns = node_now_ns(r->node) - 500000000;
        node_publish(r->node, topic_scan_status(), capture_ns, &s.base);
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "turn %d", i);
        if (h)
            anlos__health__free_unpacked(h, NULL);
        h = (Anlos__Health *)hear(r, b);
    }
    const Anlos__TopicCount *in = find_count(h, "scan/status", false);
    const Anlos__TopicCount *out = find_count(h, "scan/status", true);
    assert_true(in->latency_n > 0 && out->latency_n >= in->latency_n);
    double oldest_s = 0.5 + (double)(node_now_ns(r->node) - start) * 1e-9;
    assert_true(out->latency_median_s >= 0.5 && out->latency_p99_s <= oldest_s);
    assert_true(in->latency_median_s >= 0.5 && in->latency_p99_s <= oldest_s);
    assert_int_equal(find_count(h, "health", true)->latency_n, 0); /* of no sound */
    anlos__health__free_unpacked(h, NULL);
    bus_destroy(b);
    node_finish(r->node, 0);
}

static void a_change_of_state_is_said_at_once(void **state)
{
    struct rig *r = *state;

    assert_int_equal(create(r, "scan", "--log-level", "error"), 0);
    struct bus *b = listen_from_now(r);
    node_state(r->node, ANLOS__HEALTH__STATE__DEGRADED, "only %d of %d", 3, 4);
    Anlos__Health *h = next_health(b);
    assert_int_equal(h->state, ANLOS__HEALTH__STATE__DEGRADED);
    assert_string_equal(h->text, "only 3 of 4");
    anlos__health__free_unpacked(h, NULL);
    bus_destroy(b);
    node_finish(r->node, 0);
}

static void what_it_logs_is_on_the_bus_whatever_is_printed(void **state)
{
    struct rig *r = *state;
    struct bus_message m;
    int err = -ETIMEDOUT;

    assert_int_equal(create(r, "scan", "--log-level", "error"), 0);
    struct bus *b = listen(r, topic_log());
    int64_t start = node_machine_ns(r->node);
    for (int i = 0; err == -ETIMEDOUT; i++) { /* it has to connect first */
        assert_true(node_machine_ns(r->node) < start + DEADLINE_NS);
        node_log(r->node, LOG_LEVEL_DEBUG, "not for the bus");
        node_log(r->node, LOG_LEVEL_INFO, "try %d", i);
        err = bus_receive(b, &m, 100);
    }
    assert_int_equal(err, 0);
    Anlos__Log *l = (Anlos__Log *)bus_message_unpack(&m);
    assert_non_null(l);
    assert_string_equal(m.envelope.node, "scan");
    assert_string_equal(l->node, "scan");
    assert_int_equal(l->level, ANLOS__LOG__LEVEL__INFO);
    assert_int_equal(strncmp(l->text, "try ", 4), 0);
    assert_true(l->stamp_ns >= start && l->stamp_ns <= node_machine_ns(r->node));
    anlos__log__free_unpacked(l, NULL);
    bus_message_free(&m);
    bus_destroy(b);
    node_finish(r->node, 0);
}

static void messages_come_unpacked_with_their_sender(void **state)
{
    struct rig *r = *state;
    struct node_message in;
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;
    int err = -ETIMEDOUT;

    assert_int_equal(create(r, "scan", NULL, NULL), 0);
    assert_int_equal(node_subscribe(r->node, topic_scan_status()), 0);
    s.pings_done = 17;
    int64_t end = node_now_ns(r->node) + DEADLINE_NS;
    while (err == -ETIMEDOUT && node_now_ns(r->node) < end) { /* it connects first */
        assert_int_equal(node_publish(r->node, topic_scan_status(), 123, &s.base), 0);
        err = node_next(r->node, &in, 100);
    }
    assert_int_equal(err, 0);
    assert_ptr_equal(in.topic, topic_scan_status());
    assert_int_equal(((const Anlos__ScanStatus *)in.content)->pings_done, 17);
    assert_string_equal(in.from, "scan");
    assert_int_equal(in.capture_ns, 123);
    assert_true(in.epoch_ns > 0 && in.publish_ns >= in.epoch_ns);
    node_finish(r->node, 0);
}

static void waiting_ends_when_its_time_is_over(void **state)
{
    struct rig *r = *state;
    struct node_message in;

    assert_int_equal(create(r, "scan", NULL, NULL), 0);
    int64_t start = node_now_ns(r->node);
    assert_int_equal(node_next(r->node, &in, 0), -ETIMEDOUT);
    assert_int_equal(node_next(r->node, &in, 50), -ETIMEDOUT);
    assert_true(node_now_ns(r->node) - start >= 50000000);
    node_finish(r->node, 0);
}

static void exit_codes_tell_bad_configuration_from_failure(void **state)
{
    struct rig *r = *state;
    static const struct {
        int err, code;
    } cases[] = {{0, 0},       {-ESHUTDOWN, 0}, {-EINVAL, 2}, {-ENODEV, 2}, {-ENOENT, 2},
                 {-EACCES, 2}, {-EIO, 1},       {-ENOMEM, 1}, {-EBADMSG, 2}};

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(create(r, "scan", NULL, NULL), 0);
        assert_int_equal(node_finish(r->node, cases[i].err), cases[i].code);
    }
}

/* Lines of errors that a node writes which ends of -EBADMSG; says: it has told why,
 * before its last turn or in it. */
static unsigned count_errors(struct rig *r, bool before, bool says, const char *word)
{
    char text[4096];
    struct node_message in;
    unsigned n = 0;
    int saved = dup(STDERR_FILENO),
        log = open(scratch_path(r->scratch, "log"), O_CREAT | O_TRUNC | O_RDWR, 0600);

    assert_true(saved >= 0 && log >= 0);
    assert_int_equal(create(r, "scan", NULL, NULL), 0);
    dup2(log, STDERR_FILENO);
    if (says)
        node_log(r->node, LOG_LEVEL_ERROR, "a.mcap: byte 7: damaged");
    if (before)
        assert_int_equal(node_next(r->node, &in, 0), -ETIMEDOUT);
    assert_int_equal(node_finish(r->node, -EBADMSG), 2);
    dup2(saved, STDERR_FILENO);
    ssize_t length = pread(log, text, sizeof text - 1, 0);
    assert_true(length >= 0);
    text[length] = '\0';
    for (const char *p = text; (p = strstr(p, " error ")); p++)
        n++;
    assert_contains(text, word);
    close(log);
    close(saved);
    return n;
}

static void why_a_node_ends_is_said_once(void **state)
{
    assert_int_equal(count_errors(*state, false, true, "byte 7: damaged"), 1);
    assert_int_equal(count_errors(*state, false, false, "ends: Bad message"), 1);
    /* What came of another turn may have had no consequences. */
    assert_int_equal(count_errors(*state, true, true, "ends: Bad message"), 2);
}

static void help_and_mistakes_end_the_program(void **state)
{
    struct rig *r = *state;

    r->node = (struct node *)(uintptr_t)1;
    assert_int_equal(create(r, "scan", "--help", NULL), 0);
    assert_null(r->node);
    assert_int_equal(create(r, "scan", "--what", NULL), 2);
    assert_int_equal(create(r, "scan", "--log-level", "loud"), 2);
    assert_int_equal(create(r, "scan", "--log-format", "xml"), 2);
    scratch_write(r->scratch, "a.yaml", "nodes: [radar]\n");
    assert_int_equal(create(r, "scan", NULL, NULL), 2);
}

static void a_name_can_be_had_only_once(void **state)
{
    struct rig *r = *state;
    struct rig other = *r;

    assert_int_equal(create(r, "scan", NULL, NULL), 0);
    assert_int_equal(create(&other, "scan", NULL, NULL), 2);
    node_finish(r->node, 0);
}

/* Last: the stop flag stays up. */
static void a_signal_ends_the_wait_for_good(void **state)
{
    struct rig *r = *state;
    struct node_message in;

    assert_int_equal(create(r, "scan", NULL, NULL), 0);
    raise(SIGTERM);
    assert_int_equal(node_next(r->node, &in, -1), -ESHUTDOWN);
    assert_int_equal(node_next(r->node, &in, 1000), -ESHUTDOWN);
    node_finish(r->node, 0);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(health_is_published_without_being_asked),
        TEST(health_carries_what_the_device_counts_now),
        TEST(health_carries_faults_that_last),
        TEST(health_tells_how_old_the_sound_was),
        TEST(a_change_of_state_is_said_at_once),
        TEST(what_it_logs_is_on_the_bus_whatever_is_printed),
        TEST(messages_come_unpacked_with_their_sender),
        TEST(waiting_ends_when_its_time_is_over),
        TEST(exit_codes_tell_bad_configuration_from_failure),
        TEST(why_a_node_ends_is_said_once),
        TEST(help_and_mistakes_end_the_program),
        TEST(a_name_can_be_had_only_once),
        TEST(a_signal_ends_the_wait_for_good),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
