/* SPDX-License-Identifier: MIT */
/* `anlos bag record` as a person uses it, beside a bus on which the test publishes. */
#include "record_rig.h"

#include <errno.h>
#include <fcntl.h>
#include <nanomsg/nn.h>
#include <nanomsg/pubsub.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/bag/manifest.h"
#include "msgs/bus.h"
#include "nodes/rt/rundir.h"

#define DEADLINE_MS 60000
#define MAX_WORDS   24

extern char **environ;

struct rig {
    struct scratch *scratch;
    char bag[128], run_dir[128];
    struct bus *bus; /* of "stage" */
    uint64_t n;      /* published */
    pid_t pid;
    int out; /* stdout and stderr of the recorder */
    char text[8192];
};

static int setup(void **state)
{
    struct rig *g = calloc(1, sizeof *g);

    if (!g || scratch_open((void **)&g->scratch))
        return -1;
    snprintf(g->bag, sizeof g->bag, "%s/a.mcap", g->scratch->folder);
    snprintf(g->run_dir, sizeof g->run_dir, "%s/run", g->scratch->folder);
    const struct bus_config cfg = {
        .node = "stage", .run_dir = g->run_dir, .epoch_ns = EPOCH_NS};
    *state = g;
    return bus_create(&g->bus, &cfg, NULL);
}

static int teardown(void **state)
{
    struct rig *g = *state;
    void *scratch = g->scratch;

    bus_destroy(g->bus);
    free(g);
    return scratch_close(&scratch);
}

/* A program and the words up to NULL; prefix: of a shell's command line. */
static void start_program(struct rig *g, const char *prefix, const char *program,
                          const char *const *words)
{
    char command[2048];
    posix_spawn_file_actions_t files;
    int fds[2];
    size_t n = (size_t)snprintf(command, sizeof command, "%s exec %s/bin/%s", prefix,
                                BINARY_DIR, program);

    for (; *words; words++)
        n += (size_t)snprintf(command + n, sizeof command - n, " '%s'", *words);
    assert_true(n < sizeof command);
    char *const argv[] = {(char *)"sh", (char *)"-c", command, NULL};
    assert_int_equal(pipe2(fds, O_CLOEXEC), 0);
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, fds[1], 1);
    posix_spawn_file_actions_adddup2(&files, fds[1], 2);
    assert_int_equal(posix_spawn(&g->pid, "/bin/sh", &files, NULL, argv, environ), 0);
    posix_spawn_file_actions_destroy(&files);
    close(fds[1]);
    g->out = fds[0];
}

static void start(struct rig *g, const char *prefix, const char *const *words)
{
    start_program(g, prefix, "anlos bag record", words);
}

/* What it said until it ended; the exit code. */
static int finish(struct rig *g)
{
    size_t used = 0;
    ssize_t n;
    int status;

    for (;;) {
        struct pollfd p = {.fd = g->out, .events = POLLIN};
        assert_int_equal(poll(&p, 1, DEADLINE_MS), 1);
        n = read(g->out, g->text + used, sizeof g->text - 1 - used);
        if (n <= 0)
            break;
        used += (size_t)n;
    }
    g->text[used] = '\0';
    close(g->out);
    assert_int_equal(waitpid(g->pid, &status, 0), g->pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static int run(struct rig *g, const char *prefix, const char *const *words)
{
    start(g, prefix, words);
    return finish(g);
}

static int64_t now_ns(void)
{
    return clock_now_ns(clock_system());
}

static void publish(struct rig *g, size_t size)
{
    static uint8_t payload[4000];

    memcpy(payload, &g->n, sizeof g->n);
    assert_int_equal(bus_publish(g->bus, topic_stage_state(), 0, now_ns(), payload, size),
                     0);
    g->n++;
}

/* Until the recorder's file has so many bytes. */
static void publish_until(struct rig *g, off_t bytes)
{
    int64_t end_ns = now_ns() + DEADLINE_MS * 1000000LL;
    struct stat st = {.st_size = 0};

    while (stat(g->bag, &st) || st.st_size < bytes) {
        struct pollfd p = {.fd = g->out, .events = 0};
        assert_true(now_ns() < end_ns);
        publish(g, 4000);
        assert_int_equal(poll(&p, 1, 5), 0); /* not ended */
    }
}

/* Until it has written one: its file grows beyond any start of it. */
static void publish_until_recorded(struct rig *g)
{
    publish_until(g, 4000);
}

/* Of a bag without fault: its messages, the sequence going on without a hole. */
static uint64_t count_in_sequence(const char *path, uint64_t *last)
{
    struct error why = {""};
    struct bag_cursor *cursor;
    struct bag_message m;
    uint64_t n_faults, n = 0;

    assert_int_equal(bag_check(&n_faults, path, NULL, &why), 0);
    assert_int_equal(n_faults, 0);
    struct bag_catalog *c = open_catalog(path);
    assert_false(c->scanned);
    assert_int_equal(bag_cursor_create(&cursor, c), 0);
    for (; !bag_cursor_next(cursor, &m, &why); n++) {
        assert_true(!n || m.sequence == *last + 1);
        *last = m.sequence;
    }
    bag_cursor_destroy(cursor);
    bag_catalog_close(c);
    return n;
}

static void ctrl_c_ends_a_recording_that_has_everything_up_to_it(void **state)
{
    struct rig *g = *state;
    const char *const words[] = {"-o",         g->bag, "--run-dir", g->run_dir,
                                 "--flush-ms", "20",   NULL};
    uint64_t last = 0;
    char text[256];

    start(g, "", words);
    publish_until_recorded(g);
    for (int i = 0; i < 2000; i++) /* of a topic that others take the latest of */
        publish(g, 100);
    assert_int_equal(kill(g->pid, SIGINT), 0);
    assert_int_equal(finish(g), 0);
    assert_true(count_in_sequence(g->bag, &last) >= 2001);
    assert_int_equal(last, g->n - 1);
    assert_contains(g->text, "stage/state");
    assert_contains(g->text, ", 0 lost\n");
    assert_true(find_metadata(g->bag, MANIFEST_LOST, 0, "stage/state", text));
    assert_string_equal(text, "0");
}

static void it_ends_by_itself_after_the_duration(void **state)
{
    struct rig *g = *state;
    const char *const words[] = {"-o",           g->bag, "--run-dir", g->run_dir,
                                 "--duration-s", "0.2",  NULL};
    int64_t start_ns = now_ns();

    assert_int_equal(run(g, "", words), 0);
    assert_true(now_ns() - start_ns >= 200000000LL);
    assert_contains(g->text, "a.mcap: 0 messages in 0.");
    assert_contains(g->text, "record: no message came; 'anlos topic list' says what is");
    struct bag_catalog *c = open_catalog(g->bag);
    assert_false(c->scanned);
    bag_catalog_close(c);
}

/* One that wraps would stay on the screen each time. */
static void on_a_narrow_terminal_the_progress_keeps_to_its_line(void **state)
{
    struct rig *g = *state;
    const char *const words[] = {"-o", g->bag, "--duration-s", "0.1", NULL};
    const struct winsize narrow = {.ws_row = 24, .ws_col = 30};
    char prefix[128], shown[4096];
    int screen = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);

    assert_true(screen >= 0);
    assert_int_equal(grantpt(screen) | unlockpt(screen), 0);
    assert_int_equal(ioctl(screen, TIOCSWINSZ, &narrow), 0);
    int held = open(ptsname(screen), O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_true(held >= 0); /* what was shown stays until it is read */
    snprintf(prefix, sizeof prefix, "exec >%s;", ptsname(screen));
    assert_int_equal(run(g, prefix, words), 0);
    ssize_t n = read(screen, shown, sizeof shown - 1);
    assert_true(n > 0);
    shown[n] = '\0';
    const char *line = strstr(shown, "\033[K");
    assert_non_null(line);
    line += 3;
    assert_int_equal(strncmp(line, "0 s  ", 5), 0);
    assert_in_range(strcspn(line, "\r\n"), 20, 29);
    close(held);
    close(screen);
}

static void only_the_topics_named_are_recorded(void **state)
{
    struct rig *g = *state;
    const char *const words[] = {"-o",         g->bag, "--run-dir", g->run_dir,
                                 "stage/*",    "ping", "--exclude", "stage/m*,*command",
                                 "--flush-ms", "10",   NULL};
    char text[256];

    start(g, "", words);
    publish_until_recorded(g);
    assert_int_equal(kill(g->pid, SIGTERM), 0);
    assert_int_equal(finish(g), 0);
    assert_true(find_metadata(g->bag, MANIFEST_SESSION, 0, MANIFEST_TOPICS, text));
    assert_string_equal(text, "stage/*,ping");
    assert_true(find_metadata(g->bag, MANIFEST_LOST, 0, "stage/state", text));
    assert_true(find_metadata(g->bag, MANIFEST_LOST, 0, "ping", text));
    assert_false(find_metadata(g->bag, MANIFEST_LOST, 0, "stage/command", text));
    assert_false(find_metadata(g->bag, MANIFEST_LOST, 0, "stage/manual", text));
    assert_false(find_metadata(g->bag, MANIFEST_LOST, 0, "health", text));
}

static off_t size_of(const char *path)
{
    struct stat st;

    return stat(path, &st) ? 0 : st.st_size;
}

/* No faster than they are written, so that little is lost with the write that fails. */
static void a_full_disk_ends_it_with_one_error_and_a_whole_file(void **state)
{
    struct rig *g = *state;
    const char *const words[] = {"-o",         g->bag, "--run-dir", g->run_dir,
                                 "--flush-ms", "10",   NULL};
    int64_t end_ns = now_ns() + DEADLINE_MS * 1000000LL;
    struct pollfd p = {.events = 0};
    uint64_t last = 0;

    start(g, "ulimit -f 2000; ", words); /* 1 MB, in blocks of 512 bytes */
    p.fd = g->out;
    publish_until_recorded(g);
    do {
        off_t before = size_of(g->bag);
        for (int i = 0; i < 8; i++)
            publish(g, 4000);
        do {
            assert_true(now_ns() < end_ns);
            assert_true(poll(&p, 1, 2) >= 0);
        } while (size_of(g->bag) == before && !(p.revents & POLLHUP));
    } while (!(p.revents & POLLHUP));
    assert_int_equal(finish(g), 1);
    assert_contains(g->text, "a.mcap: File too large");
    assert_true(strstr(g->text, "File too large") ==
                strrchr(g->text, 'F'));                          /* said once */
    assert_in_range(count_in_sequence(g->bag, &last), 150, 256); /* of 1 MB */
}

/* A publisher whose first three messages nobody gets: it starts counting at 3.  What else
 * it sends before the recorder has connected is lost too, and tells its number. */
static void publish_from_third(struct rig *g)
{
    uint8_t message[ENVELOPE_SIZE + 4000] = {0};
    struct envelope e = {.topic = "stage/state",
                         .node = "stage",
                         .epoch_ns = now_ns(),
                         .sequence = 3,
                         .payload_size = 4000};
    char url[256];
    struct stat before, st;

    bus_destroy(g->bus);
    g->bus = NULL;
    snprintf(url, sizeof url, "ipc://%s/stage.stage-state.ipc", g->run_dir);
    int s = nn_socket(AF_SP, NN_PUB);
    assert_true(s >= 0 && nn_bind(s, url) >= 0);
    assert_int_equal(stat(g->bag, &before), 0);
    do {
        struct pollfd p = {.fd = g->out};
        e.publish_ns = now_ns();
        assert_true(e.publish_ns - e.epoch_ns < DEADLINE_MS * 1000000LL);
        envelope_pack(&e, message);
        assert_int_equal(nn_send(s, message, sizeof message, 0), sizeof message);
        e.sequence++;
        assert_int_equal(poll(&p, 1, 1), 0);
        assert_int_equal(stat(g->bag, &st), 0);
    } while (st.st_size < before.st_size + 200000); /* more than what was on its way */
    nn_close(s);
}

/* The first number that the bag has of a process that started after the recorder. */
static uint64_t first_of_the_younger(const char *path)
{
    struct bag_catalog *c = open_catalog(path);
    struct error why = {""};
    struct bag_source source;
    struct bag_cursor *cursor;
    struct bag_message m;

    assert_int_equal(bag_cursor_create(&cursor, c), 0);
    do {
        assert_int_equal(bag_cursor_next(cursor, &m, &why), 0);
        assert_int_equal(bag_source_of(&source, bag_catalog_channel(c, m.channel_id)), 0);
    } while (source.epoch_ns == EPOCH_NS);
    uint64_t first = m.sequence;
    bag_cursor_destroy(cursor);
    bag_catalog_close(c);
    return first;
}

static void messages_that_get_lost_are_told(void **state)
{
    struct rig *g = *state;
    const char *const words[] = {"-o",         g->bag, "--run-dir", g->run_dir,
                                 "--flush-ms", "10",   NULL};
    char text[256], expected[32];

    start(g, "", words);
    publish_until_recorded(g);
    publish_from_third(g);
    assert_int_equal(kill(g->pid, SIGINT), 0);
    assert_int_equal(finish(g), 1);
    unsigned long long lost = first_of_the_younger(g->bag);
    assert_true(lost >= 3);
    snprintf(expected, sizeof expected, ", %llu lost\n", lost);
    assert_contains(g->text, expected);
    snprintf(expected, sizeof expected, "%llu", lost);
    assert_true(find_metadata(g->bag, MANIFEST_LOST, 0, "stage/state", text));
    assert_string_equal(text, expected);
    assert_true(find_metadata(g->bag, MANIFEST_LOSS, 0, "stage/state", text));
    assert_string_equal(text, expected);
}

/* The launcher goes by the exit code. */
static void the_node_too_ends_with_1_when_messages_got_lost(void **state)
{
    struct rig *g = *state;
    char launch[200], text[256], expected[300];

    scratch_write(g->scratch, "node.yaml",
                  "nodes: [record]\nrecord: {path: unused.mcap, flush_ms: 10}\n");
    snprintf(launch, sizeof launch, "%s/node.yaml", g->scratch->folder);
    const char *const words[] = {"--launch", launch, "--run-dir", g->run_dir,
                                 "--record", g->bag, NULL};
    start_program(g, "", "anlos-record", words);
    publish_until(g, 40000); /* its launch file is attached */
    publish_from_third(g);
    assert_int_equal(kill(g->pid, SIGTERM), 0);
    assert_int_equal(finish(g), 1);
    assert_true(find_metadata(g->bag, MANIFEST_LOST, 0, "stage/state", text));
    assert_true(atoi(text) >= 3);
    snprintf(expected, sizeof expected, ", %s messages lost", text);
    assert_contains(g->text, expected);
}

/* Records beside a system whose launch file, vehicle.yaml, says that. */
static void record_beside(struct rig *g, const char *text)
{
    const char *const words[] = {"-o",         g->bag, "--run-dir", g->run_dir,
                                 "--flush-ms", "10",   NULL};
    const char *path = scratch_write(g->scratch, "vehicle.yaml", text);

    assert_int_equal(rundir_set_launch(g->run_dir, path, NULL), 0);
    start(g, "", words);
    publish_until_recorded(g);
    assert_int_equal(kill(g->pid, SIGINT), 0);
    assert_int_equal(finish(g), 0);
}

static void the_launch_file_of_what_runs_there_is_kept_unasked(void **state)
{
    static const char text[] = "nodes: [record]\nrecord: {path: unused.mcap}\n";
    struct rig *g = *state;
    char kept[200], read[64] = "";

    record_beside(g, text);
    assert_null(strstr(g->text, "attached"));
    assert_null(strstr(g->text, "launch file"));
    snprintf(kept, sizeof kept, "%s/kept.yaml", g->scratch->folder);
    assert_true(save_attachment(g->bag, MANIFEST_LAUNCH_FOLDER "vehicle.yaml", kept));
    FILE *f = fopen(kept, "re");
    assert_non_null(f);
    assert_int_equal(fread(read, 1, sizeof read - 1, f), sizeof text - 1);
    fclose(f);
    assert_string_equal(read, text);
}

static void one_that_is_damaged_by_now_is_left_out_with_a_word(void **state)
{
    struct rig *g = *state;
    char path[200];

    record_beside(g, "nodes: [aray]\n");
    assert_contains(g->text, "not attached: ");
    assert_contains(g->text, "vehicle.yaml");
    snprintf(path, sizeof path, "%s/kept.yaml", g->scratch->folder);
    assert_false(save_attachment(g->bag, MANIFEST_LAUNCH_FOLDER "vehicle.yaml", path));
}

static void wrong_arguments_are_named(void **state)
{
    struct rig *g = *state;
    static const struct {
        const char *words[8], *says;
    } cases[] = {
        {{NULL}, "-o FILE, or --snapshot DIR, is missing"},
        {{"-o", "a", "pings"}, "no topic is called \"pings\""},
        {{"-o", "a", "--exclude", "x"}, "no topic is called \"x\""},
        {{"-o", "a", "--split-mb", "0"}, "--split-mb 0: expected a number above 0"},
        {{"-o", "a", "--split-mb", "9", "--quota-mb", "10"},
         "--split-mb 9: expected no more than half of --quota-mb 10"},
        {{"-o", "a", "--flush-ms", "-3"}, "--flush-ms -3: expected a number above 0"},
        {{"-o", "a", "--duration-s", "long"}, "--duration-s long: expected"},
        {{"-o", "a", "--before-s", "0"},
         "record: --before-s 0: expected a number from 1"},
        {{"-o", "a", "--compression", "zip"}, "expected zstd, lz4 or none"},
        {{"-o", "a", "--shuffle"}, "--shuffle: is for --compression zstd or lz4"},
        {{"-o", "a", "--splitmb", "3"}, "did you mean --split-mb?"},
        {{"-o", "/no/such/folder/a"}, "/no/such/folder/a: No such file or directory"},
        {{"-o", "a", "--launch", "none.yaml"}, "none.yaml"},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *words[MAX_WORDS] = {"--run-dir", g->run_dir};
        for (size_t k = 0; cases[i].words[k]; k++)
            words[k + 2] = cases[i].words[k];
        assert_int_equal(run(g, "cd /tmp;", words), 2);
        assert_contains(g->text, "anlos bag record: ");
        assert_contains(g->text, cases[i].says);
    }
}

static void a_bag_that_is_there_is_not_touched(void **state)
{
    struct rig *g = *state;
    const char *const words[] = {"-o", g->bag, "--run-dir", g->run_dir, NULL};

    scratch_write(g->scratch, "a.mcap", "precious");
    assert_int_equal(run(g, "", words), 2);
    assert_contains(g->text, "a.mcap exists already");
}

static void help_names_every_option(void **state)
{
    const char *const words[] = {"--help", NULL};
    struct rig *g = *state;

    assert_int_equal(run(g, "", words), 0);
    assert_contains(g->text, "usage: anlos bag record -o FILE");
    assert_contains(g->text, "--quota-mb");
}

#define RIG_TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        RIG_TEST(ctrl_c_ends_a_recording_that_has_everything_up_to_it),
        RIG_TEST(it_ends_by_itself_after_the_duration),
        RIG_TEST(on_a_narrow_terminal_the_progress_keeps_to_its_line),
        RIG_TEST(only_the_topics_named_are_recorded),
        RIG_TEST(a_full_disk_ends_it_with_one_error_and_a_whole_file),
        RIG_TEST(messages_that_get_lost_are_told),
        RIG_TEST(the_node_too_ends_with_1_when_messages_got_lost),
        RIG_TEST(the_launch_file_of_what_runs_there_is_kept_unasked),
        RIG_TEST(one_that_is_damaged_by_now_is_left_out_with_a_word),
        RIG_TEST(wrong_arguments_are_named),
        RIG_TEST(a_bag_that_is_there_is_not_touched),
        RIG_TEST(help_names_every_option),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
