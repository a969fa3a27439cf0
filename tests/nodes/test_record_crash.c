/* SPDX-License-Identifier: MIT */
/* `anlos bag record` killed in the middle of its work, again and again: what the file has
 * is without a hole and reaches up to the last flush. */
#include "record_rig.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/inotify.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/bag/recover.h"
#include "msgs/bus.h"

#define N_KILLS       100
#define FLUSH_MS      "10"
#define FLUSH_NS      10000000LL
#define PAYLOAD_BYTES 8192
#define AHEAD_BYTES   (1 << 20) /* that may be published and not yet be in the file */
#define MOST_BYTES    (4 << 20) /* published before the kill */
#define DEADLINE_NS   60000000000LL

/* How old the newest message saved is when the process dies: the interval, and the time
 * of a message's way and of a sync to the disk, which a busy machine stretches. */
#define USUAL_AGE_NS (FLUSH_NS + 500000000LL)

extern char **environ;

struct rig {
    struct scratch *scratch;
    char bag[128], saved[128], run_dir[128];
    struct bus *bus;
    uint64_t sequence; /* of the next message */
    int watch;
    uint32_t random;
};

static int setup(void **state)
{
    struct rig *g = calloc(1, sizeof *g);
    struct error why = {""};

    if (!g || scratch_open((void **)&g->scratch))
        return -1;
    const char *folder = g->scratch->folder;
    snprintf(g->bag, sizeof g->bag, "%s/a.mcap", folder);
    snprintf(g->saved, sizeof g->saved, "%s/saved.mcap", folder);
    snprintf(g->run_dir, sizeof g->run_dir, "%s/run", folder);
    const struct bus_config cfg = {
        .node = "array", .run_dir = g->run_dir, .epoch_ns = EPOCH_NS};
    g->watch = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
    g->random = 20191105;
    *state = g;
    return bus_create(&g->bus, &cfg, &why) || g->watch < 0 ||
                   inotify_add_watch(g->watch, folder, IN_MODIFY | IN_CREATE) < 0
               ? -1
               : 0;
}

static int teardown(void **state)
{
    struct rig *g = *state;
    void *scratch = g->scratch;

    bus_destroy(g->bus);
    close(g->watch);
    free(g);
    return scratch_close(&scratch);
}

/* Below n.  A linear congruential generator (Numerical Recipes); its high bits. */
static uint32_t draw(struct rig *g, uint32_t n)
{
    g->random = g->random * 1664525u + 1013904223u;
    return (uint32_t)((uint64_t)g->random * n >> 32);
}

static int64_t now_ns(void)
{
    return clock_now_ns(clock_system());
}

static pid_t start_recorder(struct rig *g)
{
    char *const argv[] = {(char *)"anlos",     (char *)"bag", (char *)"record",
                          (char *)"-o",        g->bag,        (char *)"ping",
                          (char *)"--run-dir", g->run_dir,    (char *)"--flush-ms",
                          (char *)FLUSH_MS,    NULL};
    posix_spawn_file_actions_t files;
    pid_t pid;

    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, 1, "/dev/null", O_WRONLY, 0);
    int err = posix_spawn(&pid, BINARY_DIR "/bin/anlos", &files, NULL, argv, environ);
    posix_spawn_file_actions_destroy(&files);
    assert_int_equal(err, 0);
    return pid;
}

static void fill(uint8_t *payload, uint64_t sequence)
{
    for (size_t k = 0; k < PAYLOAD_BYTES; k++)
        payload[k] = (uint8_t)(sequence * 29 + k * (k >> 6));
    memcpy(payload, &sequence, sizeof sequence);
}

static void publish(struct rig *g)
{
    uint8_t payload[PAYLOAD_BYTES];

    fill(payload, g->sequence++);
    assert_int_equal(
        bus_publish(g->bus, topic_ping(), 1, now_ns(), payload, sizeof payload), 0);
}

static uint64_t file_size(const struct rig *g)
{
    struct stat st;

    return stat(g->bag, &st) ? 0 : (uint64_t)st.st_size;
}

/* Until something happens to the file, or timeout_ms are over. */
static void await_change(struct rig *g, int timeout_ms)
{
    struct pollfd p = {.fd = g->watch, .events = POLLIN};
    char events[4096];

    assert_true(poll(&p, 1, timeout_ms) >= 0);
    while (read(g->watch, events, sizeof events) > 0)
        ;
}

/* Nobody tells when the recorder has connected: the file does, when it has a message. */
static void publish_until_recorded(struct rig *g)
{
    int64_t end_ns = now_ns() + DEADLINE_NS;

    while (file_size(g) < PAYLOAD_BYTES) {
        assert_true(now_ns() < end_ns);
        publish(g);
        await_change(g, 1);
    }
}

static void publish_bytes(struct rig *g, uint64_t bytes)
{
    uint64_t start = file_size(g);
    int64_t end_ns = now_ns() + DEADLINE_NS;

    for (uint64_t sent = 0; sent < bytes; sent += PAYLOAD_BYTES) {
        publish(g);
        while (start + sent > file_size(g) + AHEAD_BYTES) {
            assert_true(now_ns() < end_ns);
            await_change(g, 1000);
        }
    }
}

/* The publish stamp of the newest message that is saved; all before it are there too. */
static int64_t newest_saved(struct rig *g, uint64_t *n)
{
    struct bag_recovery found;
    struct error why = {""};
    struct bag_cursor *cursor;
    struct bag_message m;
    uint8_t expected[PAYLOAD_BYTES];
    uint64_t first = 0;

    if (bag_recover(&found, g->bag, g->saved, NULL, &why))
        fail_msg("%s", why.text);
    assert_int_equal(found.n_nameless, 0);
    struct bag_catalog *c = open_catalog(g->saved);
    assert_int_equal(bag_cursor_create(&cursor, c), 0);
    for (*n = 0; !bag_cursor_next(cursor, &m, &why); ++*n) {
        first = *n ? first : m.sequence;
        assert_int_equal(m.sequence, first + *n);
        fill(expected, m.sequence);
        assert_int_equal(m.data.size, sizeof expected);
        assert_memory_equal(m.data.data, expected, sizeof expected);
    }
    int64_t newest_ns = (int64_t)c->end_time;
    bag_cursor_destroy(cursor);
    bag_catalog_close(c);
    assert_int_equal(unlink(g->saved), 0);
    assert_int_equal(unlink(g->bag), 0);
    return newest_ns;
}

static int compare(const void *a, const void *b)
{
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;

    return x < y ? -1 : x > y;
}

static void
a_recorder_that_is_killed_loses_no_more_than_the_last_flush_interval(void **state)
{
    struct rig *g = *state;
    int64_t ages_ns[N_KILLS];
    uint64_t all = 0, n;

    for (int i = 0; i < N_KILLS; i++) {
        pid_t pid = start_recorder(g);
        publish_until_recorded(g);
        publish_bytes(g, draw(g, MOST_BYTES));
        int64_t killed_ns = now_ns();
        assert_int_equal(kill(pid, SIGKILL), 0);
        assert_int_equal(waitpid(pid, NULL, 0), pid);
        ages_ns[i] = killed_ns - newest_saved(g, &n);
        assert_true(n > 0);
        all += n;
    }
    qsort(ages_ns, N_KILLS, sizeof *ages_ns, compare);
    print_message("%llu messages saved; the newest was %.1f ms old, usually, and %.1f ms "
                  "at most\n",
                  (unsigned long long)all, 1e-6 * (double)ages_ns[N_KILLS / 2],
                  1e-6 * (double)ages_ns[N_KILLS - 1]);
    assert_true(ages_ns[N_KILLS / 2] < USUAL_AGE_NS);
    /* And what was sent is there, but for a share that the interval explains. */
    assert_true(all > (uint64_t)N_KILLS * (MOST_BYTES / 2 - AHEAD_BYTES) / PAYLOAD_BYTES);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(
            a_recorder_that_is_killed_loses_no_more_than_the_last_flush_interval, setup,
            teardown),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
