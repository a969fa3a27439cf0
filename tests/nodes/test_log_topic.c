/* SPDX-License-Identifier: MIT */
/* The lines of a log on the bus. */
#include "tests/hal/scratch.h"

#include <poll.h>

#include "msgs/bus.h"
#include "msgs/log.pb-c.h"
#include "nodes/rt/log_topic.h"

#define S_NS        1000000000LL
#define DEADLINE_MS 60000

struct rig {
    struct scratch *scratch;
    struct bus *node, *listener;
    struct log_topic topic;
    struct log_line line;
};

static struct bus *open_bus(const struct rig *r, const char *node)
{
    const struct bus_config cfg = {
        .node = node, .run_dir = r->scratch->folder, .epoch_ns = 1, .listen_only = !node};
    struct bus *b = NULL;

    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    return b;
}

static void send(struct rig *r, const char *text)
{
    snprintf(r->line.text, sizeof r->line.text, "%s", text);
    log_topic_send(&r->topic, &r->line);
}

/* The next line, or NULL when there is none yet. */
static Anlos__Log *take(struct rig *r, int timeout_ms)
{
    struct bus_message m;

    if (bus_receive(r->listener, &m, timeout_ms))
        return NULL;
    assert_ptr_equal(m.topic, topic_log());
    assert_string_equal(m.envelope.node, "recon");
    Anlos__Log *l = (Anlos__Log *)bus_message_unpack(&m);
    bus_message_free(&m);
    assert_non_null(l);
    return l;
}

/* The next line with this text. */
static Anlos__Log *wait_for(struct rig *r, const char *text)
{
    Anlos__Log *l;

    while ((l = take(r, DEADLINE_MS)) && strcmp(l->text, text))
        anlos__log__free_unpacked(l, NULL);
    assert_non_null(l);
    return l;
}

/* A node whose lines are heard. */
static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    Anlos__Log *l;

    if (!r || scratch_open((void **)&r->scratch))
        return -1;
    r->node = open_bus(r, "recon");
    r->listener = open_bus(r, NULL);
    r->topic = (struct log_topic){
        .bus = r->node, .room = LOG_TOPIC_BURST, .start_ns = -LOG_TOPIC_HOLD_NS};
    r->line = (struct log_line){.stamp_ns = S_NS, .level = LOG_LEVEL_WARNING};
    strcpy(r->line.node, "recon");
    assert_int_equal(bus_subscribe(r->listener, topic_log()), 0);
    for (int i = 0; i < DEADLINE_MS / 10; i++) {
        r->line.stamp_ns += S_NS; /* so that there is always room */
        send(r, "connecting");
        if ((l = take(r, 10)))
            break;
    }
    anlos__log__free_unpacked(l, NULL);
    send(r, "connected");
    anlos__log__free_unpacked(wait_for(r, "connected"), NULL);
    r->line.stamp_ns += 3600 * S_NS;
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;
    void *scratch = r->scratch;

    bus_destroy(r->node);
    bus_destroy(r->listener);
    free(r);
    return scratch_close(&scratch);
}

static void a_line_comes_with_all_it_says(void **state)
{
    struct rig *r = *state;

    r->line.repeats = 37;
    r->line.repeats_s = 10.0;
    r->line.repeats_ago_s = 4.0;
    send(r, "can0 is down");
    Anlos__Log *l = wait_for(r, "can0 is down");
    assert_int_equal(l->stamp_ns, r->line.stamp_ns);
    assert_int_equal(l->level, ANLOS__LOG__LEVEL__WARNING);
    assert_string_equal(l->node, "recon");
    assert_int_equal(l->repeats, 37);
    assert_true(l->repeats_s == 10.0);
    assert_true(l->repeats_ago_s == 4.0);
    assert_int_equal(l->left_out, 0);
    anlos__log__free_unpacked(l, NULL);
}

static void a_fault_in_a_loop_does_not_flood_the_bus(void **state)
{
    struct rig *r = *state;

    for (int i = 0; i < 1000; i++)
        send(r, "fault");
    for (int i = 0; i < LOG_TOPIC_BURST; i++)
        anlos__log__free_unpacked(wait_for(r, "fault"), NULL);
    r->line.stamp_ns += S_NS; /* now there is room for another ten */
    for (int i = 0; i < 20; i++)
        send(r, "later");
    for (int i = 0; i < LOG_TOPIC_RATE_HZ; i++) {
        Anlos__Log *l = take(r, DEADLINE_MS);
        assert_string_equal(l->text, "later"); /* no more faults came */
        assert_int_equal(l->left_out, i ? 0 : 1000 - LOG_TOPIC_BURST);
        anlos__log__free_unpacked(l, NULL);
    }
    assert_int_equal(r->topic.left_out, 20 - LOG_TOPIC_RATE_HZ);
}

static void what_was_left_out_is_said_when_nothing_follows(void **state)
{
    struct rig *r = *state;

    for (int i = 0; i < LOG_TOPIC_BURST + 7; i++)
        send(r, "fault");
    send(r, ""); /* a tick: there is no room yet */
    r->line.stamp_ns += S_NS;
    send(r, "");
    send(r, ""); /* there is nothing more to say */
    for (int i = 0; i < LOG_TOPIC_BURST; i++)
        anlos__log__free_unpacked(wait_for(r, "fault"), NULL);
    Anlos__Log *l = wait_for(r, "lines before this were left out");
    assert_int_equal(l->left_out, 7);
    anlos__log__free_unpacked(l, NULL);
    assert_null(take(r, 0));
}

static uint64_t lines_sent(const struct rig *r)
{
    struct bus_count counts[32];
    size_t n = bus_counts(r->node, counts, 32);

    for (size_t i = 0; i < n && i < 32; i++)
        if (counts[i].topic == topic_log() && counts[i].published)
            return counts[i].messages;
    fail_msg("the node does not publish its log");
    return 0;
}

static void a_log_sends_its_lines(void **state)
{
    struct rig *r = *state;
    const struct log_config cfg = {.fd = -1, .node = "recon", .clock = clock_system()};
    struct log *log;

    assert_int_equal(log_create(&log, &cfg), 0);
    log_topic_start(&r->topic, log, r->node, 0);
    log_write(log, LOG_LEVEL_INFO, "an event");
    Anlos__Log *l = wait_for(r, "an event");
    assert_int_equal(l->level, ANLOS__LOG__LEVEL__INFO);
    anlos__log__free_unpacked(l, NULL);
    log_topic_stop(&r->topic, log);
    uint64_t sent = lines_sent(r);
    log_write(log, LOG_LEVEL_INFO, "after that");
    log_destroy(log);
    assert_int_equal(lines_sent(r), sent);
}

static void lines_of_the_first_second_wait_for_their_listeners(void **state)
{
    struct rig *r = *state;
    uint64_t sent = lines_sent(r);

    r->topic.start_ns = r->line.stamp_ns;
    send(r, "first");
    send(r, "second");
    send(r, ""); /* a tick within the second */
    assert_int_equal(lines_sent(r), sent);
    r->line.stamp_ns += LOG_TOPIC_HOLD_NS;
    send(r, "");
    assert_int_equal(lines_sent(r), sent + 2);
    Anlos__Log *l = wait_for(r, "first");
    assert_int_equal(l->stamp_ns, r->topic.start_ns);
    anlos__log__free_unpacked(l, NULL);
    anlos__log__free_unpacked(wait_for(r, "second"), NULL);
}

static void more_than_can_wait_goes_out_in_order(void **state)
{
    struct rig *r = *state;
    char text[16];

    r->topic.start_ns = r->line.stamp_ns;
    for (int i = 0; i < LOG_TOPIC_HELD + 2; i++) {
        snprintf(text, sizeof text, "%d", i);
        send(r, text);
    }
    log_topic_flush(&r->topic);
    for (int i = 0; i < LOG_TOPIC_HELD + 2; i++) {
        Anlos__Log *l = take(r, DEADLINE_MS);
        assert_non_null(l);
        assert_int_equal(atoi(l->text), i);
        anlos__log__free_unpacked(l, NULL);
    }
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_line_comes_with_all_it_says),
        TEST(a_fault_in_a_loop_does_not_flood_the_bus),
        TEST(what_was_left_out_is_said_when_nothing_follows),
        TEST(a_log_sends_its_lines),
        TEST(lines_of_the_first_second_wait_for_their_listeners),
        TEST(more_than_can_wait_goes_out_in_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
