/* SPDX-License-Identifier: MIT */
/* The loop of a node: which handler gets what, and when timers run. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <unistd.h>

#include "msgs/bus.h"
#include "msgs/scan.pb-c.h"
#include "msgs/topics.h"
#include "nodes/rt/loop.h"

#define N           20
#define DEADLINE_NS 60000000000LL
#define PERIOD_NS   20000000LL

/* Another node sends N receipts at once, when it is heard, and they are all waiting
 * before the first of them is taken. */
struct talk {
    struct node *node;
    struct bus *dsp;
    bool sent;
    int taken, prompt, each, last, wrong;
    int taken_by_last;      /* before the last timer ran */
    int end;                /* what the handler returns at the end */
    int64_t due_ns, end_ns; /* of the timer that is periodic; of the test */
    int ticks;
    int64_t early_ns;
    int ended_with, closed;
};

static struct bus_count count_of(struct talk *t)
{
    struct bus_count counts[32];
    size_t n = node_counts(t->node, counts, 32);

    for (size_t i = 0; i < n; i++)
        if (counts[i].topic == topic_receipt() && !counts[i].published)
            return counts[i];
    return (struct bus_count){.peers = 0};
}

static bool is_heard(struct talk *t)
{
    struct bus_count counts[32];
    size_t n = bus_counts(t->dsp, counts, 32);

    for (size_t i = 0; i < n; i++)
        if (counts[i].topic == topic_receipt() && counts[i].peers)
            return true;
    return false;
}

static int64_t at_once_unless_sent(const void *self)
{
    return ((const struct talk *)self)->sent ? LOOP_NEVER : 0;
}

static int send_all(void *self)
{
    struct talk *t = self;
    Anlos__Receipt receipt = ANLOS__RECEIPT__INIT;

    assert_true(node_machine_ns(t->node) < t->end_ns);
    if (!is_heard(t))
        return 0;
    for (int i = 0; i < N; i++)
        assert_int_equal(
            bus_publish_message(t->dsp, topic_receipt(), 0, 1, &receipt.base), 0);
    while (count_of(t).queued < N)
        assert_true(node_machine_ns(t->node) < t->end_ns);
    t->sent = true;
    return 0;
}

static int64_t at_once_when_sent(const void *self)
{
    return ((const struct talk *)self)->sent ? 0 : LOOP_NEVER;
}

static int count_prompt(void *self)
{
    ((struct talk *)self)->prompt++;
    return 0;
}

static int64_t never_due(const void *self)
{
    (void)self;
    return LOOP_NEVER;
}

static int count_each(void *self)
{
    ((struct talk *)self)->each++;
    return 0;
}

static int run_last(void *self)
{
    struct talk *t = self;

    t->last++;
    t->taken_by_last = t->taken;
    return LOOP_DONE;
}

static int take(void *self, const struct node_message *in)
{
    struct talk *t = self;

    t->wrong += in->topic != topic_receipt();
    t->taken++;
    return t->end && t->taken == 3 ? t->end : 0;
}

static int take_none(void *self, const struct node_message *in)
{
    (void)in;
    ((struct talk *)self)->wrong++;
    return 0;
}

static bool never(const void *self)
{
    (void)self;
    return false;
}

static const struct loop_input inputs[] = {
    {.topic = topic_receipt, .take = take},
    {.topic = topic_detections, .take = take_none, .wanted = never},
    {.topic = NULL},
};

static const struct loop_timer timers[] = {
    {.due_ns = at_once_unless_sent, .run = send_all},
    {.due_ns = at_once_when_sent, .run = count_prompt},
    {.due_ns = never_due, .run = count_each, .when = LOOP_EACH},
    {.due_ns = at_once_when_sent, .run = run_last, .when = LOOP_LAST},
    {.run = NULL},
};

static void start(struct talk *t, struct scratch *s)
{
    char launch[512];
    char *argv[] = {(char *)"program",   (char *)"--launch", launch,
                    (char *)"--run-dir", s->folder,          NULL};
    const struct bus_config cfg = {.node = "dsp", .run_dir = s->folder, .epoch_ns = 1};

    snprintf(launch, sizeof launch, "%s", scratch_write(s, "a.yaml", "nodes: [scan]\n"));
    *t = (struct talk){.dsp = NULL};
    assert_int_equal(node_create(&t->node, "scan", "Does nothing.", 5, argv), 0);
    assert_int_equal(bus_create(&t->dsp, &cfg, NULL), 0);
    t->end_ns = node_machine_ns(t->node) + DEADLINE_NS;
}

static void stop(struct talk *t)
{
    bus_destroy(t->dsp);
    assert_int_equal(node_finish(t->node, 0), 0);
}

static void what_is_due_runs_between_messages_and_what_runs_last_behind_them(void **state)
{
    const struct loop loop = {.inputs = inputs, .timers = timers};
    struct talk t;

    start(&t, *state);
    assert_int_equal(loop_run(t.node, &loop, &t), 0);
    assert_int_equal(t.taken, N);
    assert_int_equal(t.wrong, 0);
    assert_int_equal(t.last, 1);
    assert_int_equal(t.taken_by_last, N);
    assert_true(t.prompt >= N);
    assert_int_equal(t.each, 1 + N);
    stop(&t);
}

static void what_a_handler_returns_ends_the_loop(void **state)
{
    const struct loop loop = {.inputs = inputs, .timers = timers};
    struct talk t;

    start(&t, *state);
    t.end = -EPROTO;
    assert_int_equal(loop_run(t.node, &loop, &t), -EPROTO);
    assert_int_equal(t.taken, 3);
    assert_int_equal(t.last, 0);
    stop(&t);
}

static void what_is_not_wanted_is_not_heard(void **state)
{
    const struct loop loop = {.inputs = inputs, .timers = timers};
    struct bus_count counts[32];
    struct talk t;

    start(&t, *state);
    assert_int_equal(loop_run(t.node, &loop, &t), 0);
    size_t n = node_counts(t.node, counts, 32);
    for (size_t i = 0; i < n; i++)
        assert_true(counts[i].published || counts[i].topic != topic_detections());
    stop(&t);
}

static int64_t due(const void *self)
{
    return ((const struct talk *)self)->due_ns;
}

static int tick(void *self)
{
    struct talk *t = self;
    int64_t now = node_machine_ns(t->node);

    t->early_ns = t->due_ns - now > t->early_ns ? t->due_ns - now : t->early_ns;
    t->due_ns = now + PERIOD_NS;
    return ++t->ticks == 5 ? LOOP_DONE : 0;
}

static void a_timer_runs_without_messages_and_never_early(void **state)
{
    static const struct loop_timer clock[] = {{.due_ns = due, .run = tick},
                                              {.run = NULL}};
    const struct loop loop = {.timers = clock};
    struct talk t;

    start(&t, *state);
    int64_t begin = node_machine_ns(t.node);
    t.due_ns = begin;
    assert_int_equal(loop_run(t.node, &loop, &t), 0);
    assert_int_equal(t.ticks, 5);
    assert_int_equal(t.early_ns, 0);
    assert_true(node_machine_ns(t.node) - begin >= 4 * PERIOD_NS);
    stop(&t);
}

static int count_end(void *self, int err)
{
    struct talk *t = self;

    t->ended_with = err;
    return NODE_TOLD;
}

static void count_close(void *self)
{
    if (self)
        ((struct talk *)self)->closed++;
}

static int done(void *self)
{
    (void)self;
    return LOOP_DONE;
}

static void what_a_node_ends_with_is_its_exit_code(void **state)
{
    static const struct loop_timer at_once[] = {{.due_ns = due, .run = done},
                                                {.run = NULL}};
    const struct loop loop = {.timers = at_once, .end = count_end, .close = count_close};
    struct talk t;

    start(&t, *state);
    t.ended_with = -1;
    assert_int_equal(loop_main(t.node, &loop, &t, 0, NULL), EXIT_FAILED);
    assert_int_equal(t.ended_with, 0);
    assert_int_equal(t.closed, 1);
    bus_destroy(t.dsp);
}

static void what_could_not_be_opened_ends_a_node_that_never_ran(void **state)
{
    static const struct loop_timer at_once[] = {{.due_ns = due, .run = tick},
                                                {.run = NULL}};
    const struct loop loop = {.timers = at_once, .end = count_end, .close = count_close};
    const struct error why = {"no such thing"};
    struct talk t;

    start(&t, *state);
    assert_int_equal(loop_main(t.node, &loop, &t, -ENOENT, &why), EXIT_BAD_INPUT);
    assert_int_equal(t.ticks, 0);
    assert_int_equal(t.ended_with, 0);
    assert_int_equal(t.closed, 1);
    bus_destroy(t.dsp);
}

/* Another try would not help: the launcher is to stop, not to start it again. */
static void what_another_name_would_mend_is_bad_input(void **state)
{
    static const int errors[] = {-EISDIR, -ENAMETOOLONG, -ELOOP, -EMLINK};
    static const struct loop_timer at_once[] = {{.due_ns = due, .run = tick},
                                                {.run = NULL}};
    const struct loop loop = {.timers = at_once, .end = count_end, .close = count_close};
    const struct error why = {"no such file"};

    for (size_t i = 0; i < sizeof errors / sizeof *errors; i++) {
        struct talk t;
        start(&t, *state);
        assert_int_equal(loop_main(t.node, &loop, &t, errors[i], &why), EXIT_BAD_INPUT);
        bus_destroy(t.dsp);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_is_due_runs_between_messages_and_what_runs_last_behind_them),
        TEST(what_a_handler_returns_ends_the_loop),
        TEST(what_is_not_wanted_is_not_heard),
        TEST(a_timer_runs_without_messages_and_never_early),
        TEST(what_a_node_ends_with_is_its_exit_code),
        TEST(what_could_not_be_opened_ends_a_node_that_never_ran),
        TEST(what_another_name_would_mend_is_bad_input),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
