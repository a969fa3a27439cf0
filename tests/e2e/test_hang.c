/* SPDX-License-Identifier: MIT */
/* Every node of a small drive is stopped in turn, for a moment, until the vehicle has
 * been told of it, and for good: who is back in time is left alone, who hangs is killed
 * and started again, and what the vehicle is told meanwhile is not that all is well. */
#include "tests/e2e/can_log.h"

#include <errno.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "hal/clock.h"
#include "msgs/bus.h"
#include "msgs/health.pb-c.h"
#include "msgs/topics.h"

#define MS          INT64_C(1000000)
#define DEADLINE_NS (180000 * MS) /* for one thing to happen, on a busy machine */
#define MOMENT_NS   (300 * MS)
#define LATE_NS     (1000 * MS) /* a moment that took so long was none */

static const char *const names[] = {"array", "scan",  "dsp", "recon",
                                    "wall",  "track", "can", "report"};
enum { NODES = sizeof names / sizeof *names };

/* What has to be told of a node that hangs; 0: nothing. */
static const uint16_t faults[NODES] = {1u << CAN_FAULT_IMAGE_STALE,
                                       1u << CAN_FAULT_NODE_LOST,
                                       1u << CAN_FAULT_IMAGE_STALE,
                                       1u << CAN_FAULT_IMAGE_STALE,
                                       1u << CAN_FAULT_WALL_LOST,
                                       1u << CAN_FAULT_IMAGE_STALE,
                                       0,
                                       0};

struct member { /* as its newest health has it */
    pid_t pid;
    uint64_t messages; /* of health */
    Anlos__Health__State state;
    uint64_t hung; /* as the launcher counts */
};

struct world {
    struct scratch *scratch;
    char log_path[128];
    pid_t pid;
    struct bus *bus;
    struct member members[NODES];
    uint64_t restarts;
    struct can_log log;
};

static int64_t now_ns(void)
{
    return clock_now_ns(clock_system());
}

static int member_of(const char *name)
{
    for (int i = 0; i < NODES; i++)
        if (!strcmp(names[i], name))
            return i;
    return -1;
}

static void take_counts(struct world *w, const Anlos__Health *h)
{
    char name[24];

    for (size_t i = 0; i < h->n_device; i++) {
        if (!strcmp(h->device[i]->name, "restarts"))
            w->restarts = h->device[i]->value;
        for (int k = 0; k < NODES; k++) {
            snprintf(name, sizeof name, "%s hung", names[k]);
            if (!strcmp(h->device[i]->name, name))
                w->members[k].hung = h->device[i]->value;
        }
    }
}

static void take_health(struct world *w, const Anlos__Health *h)
{
    int i = member_of(h->node);

    if (!strcmp(h->node, "launcher"))
        take_counts(w, h);
    if (i < 0)
        return;
    w->members[i].pid = (pid_t)h->pid;
    w->members[i].state = h->state;
    w->members[i].messages++;
}

static void show(struct world *w)
{
    char line[400];
    FILE *f = fopen(scratch_path(w->scratch, "says"), "r");

    while (f && fgets(line, sizeof line, f))
        print_message("%s", line);
    if (f)
        fclose(f);
}

/* What comes within 20 ms. */
static void go_on(struct world *w)
{
    struct bus_message m;

    if (!bus_receive(w->bus, &m, 20)) {
        ProtobufCMessage *h = bus_message_unpack(&m);
        if (h)
            take_health(w, (const Anlos__Health *)h);
        if (h)
            protobuf_c_message_free_unpacked(h, NULL);
        bus_message_free(&m);
    }
    can_log_read(&w->log, w->log_path);
}

#define WAIT_UNTIL(w, what, condition)                                                   \
    do {                                                                                 \
        for (int64_t end_ = now_ns() + DEADLINE_NS; !(condition); go_on(w))              \
            if (now_ns() > end_) {                                                       \
                show(w);                                                                 \
                fail_msg("%s: %s does not come", what, #condition);                      \
            }                                                                            \
    } while (0)

static bool is_active(const struct world *w)
{
    const struct can_log_status *s = can_log_now(&w->log);

    return s && s->state == CAN_ACTIVE;
}

/* There is room for so many; only what comes from now on is of interest. */
static void forget_statuses(struct world *w)
{
    if (w->log.n_statuses)
        w->log.statuses[0] = w->log.statuses[w->log.n_statuses - 1];
    w->log.n_statuses = w->log.n_statuses > 0;
}

static void start(struct world *w)
{
    struct error why = {""};
    const struct bus_config cfg = {.run_dir = w->scratch->folder, .listen_only = true};
    char text[1024], launch[128];

    snprintf(text, sizeof text,
             "nodes: [array, scan, dsp, recon, wall, track, can, report]\n"
             "array: {uri: 'sim:%s?slot_samples=4800'}\n"
             "scan: {mode: fixed}\n"
             "dsp: {background: adaptive}\n"
             "recon: {frames: {pings: 2, sum: power, every: ping}}\n"
             "wall: {from: echoes}\n"
             "can: {uri: 'sim:%s?log=can.candump'}\n"
             "report: {folder: %s/out}\n",
             SOURCE_DIR "/launch/scenes/drive-nothing.yaml",
             SOURCE_DIR "/launch/scenes/drive-nothing.yaml", w->scratch->folder);
    scratch_write(w->scratch, "launch.yaml", text);
    snprintf(launch, sizeof launch, "%s/launch.yaml", w->scratch->folder);
    snprintf(w->log_path, sizeof w->log_path, "%s/out/can.candump", w->scratch->folder);
    w->log = (struct can_log){.tally = {.checks = {.base = CAN_BASE_DEFAULT}}};
    assert_int_equal(bus_create(&w->bus, &cfg, &why), 0);
    assert_int_equal(bus_subscribe(w->bus, topic_health()), 0);
    w->pid = fork();
    assert_true(w->pid >= 0);
    if (w->pid)
        return;
    if (!freopen(scratch_path(w->scratch, "says"), "w", stdout) ||
        dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
        _exit(98);
    execl(BINARY_DIR "/bin/anlos", "anlos", "launch", launch, "--run-dir",
          w->scratch->folder, NULL);
    _exit(99);
}

static void end(struct world *w)
{
    int status;

    kill(w->pid, SIGINT);
    assert_int_equal(waitpid(w->pid, &status, 0), w->pid);
    bus_destroy(w->bus);
    if (w->log.file)
        fclose(w->log.file);
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 130) {
        show(w);
        fail_msg("the launch ended with status %x", (unsigned)status);
    }
}

/* How long it was stopped: the test may be late itself. */
static int64_t stop_for_a_moment(struct world *w, int i)
{
    int64_t start_ns = now_ns();

    assert_int_equal(kill(w->members[i].pid, SIGSTOP), 0);
    while (now_ns() - start_ns < MOMENT_NS)
        go_on(w);
    assert_int_equal(kill(w->members[i].pid, SIGCONT), 0);
    return now_ns() - start_ns;
}

static void assert_moment_is_survived(struct world *w, int i)
{
    pid_t pid = w->members[i].pid;

    if (stop_for_a_moment(w, i) < LATE_NS) {
        uint64_t heard = w->members[i].messages;
        WAIT_UNTIL(w, names[i], w->members[i].messages >= heard + 2);
        assert_int_equal(w->members[i].pid, pid);
        assert_int_equal(w->members[i].hung, 0);
    }
    WAIT_UNTIL(w, names[i], is_active(w));
}

static bool was_told(const struct world *w, uint16_t fault)
{
    for (size_t k = 1; k < w->log.n_statuses; k++)
        if ((w->log.statuses[k].faults & fault) == fault &&
            w->log.statuses[k].state != CAN_ACTIVE)
            return true;
    return false;
}

/* Since it was told first, so many statuses; none of them says that all is well. */
static size_t count_told(const struct world *w, uint16_t fault)
{
    size_t n = 0;

    for (size_t k = 1; k < w->log.n_statuses; k++) {
        const struct can_log_status *s = &w->log.statuses[k];
        n += n || ((s->faults & fault) == fault && s->state != CAN_ACTIVE);
        if (n)
            assert_int_not_equal(s->state, CAN_ACTIVE);
    }
    return n;
}

static bool works(const struct member *m)
{
    return m->state == ANLOS__HEALTH__STATE__READY;
}

/* For as long as it takes until the vehicle has been told for a while, which is before
 * the launcher gives the node up. */
static void assert_stop_is_told(struct world *w, int i)
{
    struct member *m = &w->members[i];
    uint64_t heard = m->messages, hung = m->hung;
    pid_t pid = m->pid;

    if (!faults[i] || faults[i] == 1u << CAN_FAULT_NODE_LOST) /* that is known as late */
        return;
    /* Not while a fault of a busy machine is about to go. */
    WAIT_UNTIL(w, names[i], m->messages > heard && is_active(w));
    forget_statuses(w);
    int64_t start_ns = now_ns();
    assert_int_equal(kill(pid, SIGSTOP), 0);
    WAIT_UNTIL(w, names[i], m->hung > hung || count_told(w, faults[i]) >= 3);
    kill(pid, SIGCONT); /* if it is there still */
    int64_t took_ns = now_ns() - start_ns;
    print_message("%s: told for a while after %.1f s\n", names[i],
                  1e-9 * (double)took_ns);
    if (took_ns < 1500 * MS) { /* half of what is allowed */
        heard = m->messages;
        WAIT_UNTIL(w, names[i], m->messages >= heard + 2);
        assert_int_equal(m->pid, pid);
        assert_int_equal(m->hung, hung);
    }
    WAIT_UNTIL(w, names[i], works(m) && is_active(w));
}

/* The longest time without a word of the sensor. */
static int64_t longest_silence(const struct world *w)
{
    int64_t longest = 0;

    for (size_t k = 1; k < w->log.n_statuses; k++) {
        int64_t gap = w->log.statuses[k].stamp_ns - w->log.statuses[k - 1].stamp_ns;
        longest = gap > longest ? gap : longest;
    }
    return longest;
}

/* It may have said something just before it was stopped: not sooner than 2 s after. */
static void assert_hang_is_ended(struct world *w, int i)
{
    struct member *m = &w->members[i];
    uint64_t restarts = w->restarts, hung = m->hung;
    pid_t pid = m->pid;

    uint64_t heard = m->messages;
    WAIT_UNTIL(w, names[i], m->messages > heard); /* the limit runs from here */
    forget_statuses(w);
    int64_t start_ns = now_ns();
    assert_int_equal(kill(pid, SIGSTOP), 0);
    WAIT_UNTIL(w, names[i], m->hung == hung + 1);
    int64_t hung_ns = now_ns() - start_ns;
    assert_true(hung_ns > 1900 * MS);
    WAIT_UNTIL(w, names[i], m->pid != pid);
    WAIT_UNTIL(w, names[i], w->restarts > restarts);
    if (faults[i])
        WAIT_UNTIL(w, names[i], was_told(w, faults[i]));
    WAIT_UNTIL(w, names[i], works(m) && is_active(w) && w->log.n_statuses > 1);
    print_message("%s: killed after %.1f s, active again after %.1f\n", names[i],
                  1e-9 * (double)hung_ns, 1e-9 * (double)(now_ns() - start_ns));
    if (!strcmp(names[i], "can"))
        assert_true(longest_silence(w) > 1900 * MS);
}

static void whoever_hangs_is_started_again_and_the_vehicle_is_told(void **state)
{
    struct world w = {.scratch = *state};

    start(&w);
    for (int i = 0; i < NODES; i++) {
        WAIT_UNTIL(&w, names[i], w.members[i].pid && is_active(&w));
        forget_statuses(&w);
        assert_moment_is_survived(&w, i);
        assert_stop_is_told(&w, i);
        assert_hang_is_ended(&w, i);
    }
    end(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(
            whoever_hangs_is_started_again_and_the_vehicle_is_told, scratch_open,
            scratch_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
