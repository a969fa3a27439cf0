/* A whole system that records itself. */
#include "tests/nodes/record_rig.h"

#include <errno.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include "hal/room/room.h"
#include "msgs/bag/manifest.h"

#define SCENE SOURCE_DIR "/launch/scenes/point.yaml"

static void write_launch(struct scratch *s)
{
    char text[1024];

    snprintf(text, sizeof text,
             "nodes: [stage, array, scan, dsp, recon, track, can, report]\n"
             "array: {uri: 'sim:" SCENE "'}\n"
             "stage: {uri: 'sim:?pace=fast'}\n"
             "scan: {background: true}\n"
             "report: {folder: %s/out}\n"
             "record: {flush_ms: 10}\n",
             s->folder);
    scratch_write(s, "launch.yaml", text);
}

/* `anlos launch --record BAG`, to its end; the exit code.  Writes what it said. */
static int launch(struct scratch *s, const char *bag)
{
    char file[128], says[128];
    int status;
    pid_t pid = fork();

    if (pid < 0)
        return -1;
    if (!pid) {
        snprintf(file, sizeof file, "%s/launch.yaml", s->folder);
        snprintf(says, sizeof says, "%s/says", s->folder);
        if (!freopen(says, "w", stdout) || dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
            _exit(98);
        execl(BINARY_DIR "/bin/anlos", "anlos", "launch", file, "--run-dir", s->folder,
              "--record", bag, NULL);
        _exit(99);
    }
    return waitpid(pid, &status, 0) == pid && WIFEXITED(status) ? WEXITSTATUS(status)
                                                                : -1;
}

static bool said(struct scratch *s, const char *what, bool print)
{
    char line[500];
    bool found = false;
    FILE *f = fopen(scratch_path(s, "says"), "r");

    while (f && fgets(line, sizeof line, f)) {
        found |= strstr(line, what) != NULL;
        if (print)
            print_message("%s", line);
    }
    if (f)
        fclose(f);
    return found;
}

/* They are there before the recorder is all ears. */
static bool is_older(const char *node)
{
    return !strcmp(node, "launcher") || !strcmp(node, "record");
}

/* From 0 on and without a hole, each topic of each process. */
static void check_sequences(const struct bag_catalog *c)
{
    static struct sender {
        struct bag_source source;
        uint64_t next;
    } senders[64];
    struct bag_cursor *cursor;
    struct complaint why = {""};
    struct bag_message m;
    size_t n = 0;

    assert_int_equal(bag_cursor_create(&cursor, c), 0);
    while (!bag_cursor_next(cursor, &m, &why)) {
        struct bag_source of;
        size_t i = 0;
        assert_int_equal(bag_source_of(&of, bag_catalog_channel(c, m.channel_id)), 0);
        while (i < n && (senders[i].source.topic != of.topic ||
                         strcmp(senders[i].source.node, of.node) ||
                         senders[i].source.epoch_ns != of.epoch_ns))
            i++;
        assert_true(i < sizeof senders / sizeof *senders);
        if (i == n)
            senders[n++] =
                (struct sender){.source = of, .next = is_older(of.node) ? m.sequence : 0};
        if (m.sequence != senders[i].next)
            fail_msg("%s from %s: %u where %llu comes next", of.topic->name, of.node,
                     m.sequence, (unsigned long long)senders[i].next);
        senders[i].next++;
    }
    bag_cursor_destroy(cursor);
    assert_true(n >= 12);
}

static uint64_t count_topic(const struct bag_catalog *c, const char *topic)
{
    uint64_t n = 0;

    for (size_t i = 0; i < c->n_channels; i++)
        if (bytes_equal(c->channels[i].record.channel.topic, bytes_of(topic)))
            n += c->counts[c->channels[i].record.channel.id];
    return n;
}

static uint64_t pings_of_scene(void)
{
    struct room *room = NULL;

    assert_int_equal(room_load(&room, SCENE, NULL), 0);
    const struct survey *s = room_survey(room);
    uint64_t n = 2 * s->n_positions * s->n_speakers; /* both passes */
    room_destroy(room);
    return n;
}

static void a_system_that_records_itself_has_every_message_from_the_first(void **state)
{
    struct scratch *s = *state;
    char bag[128], text[256];

    write_launch(s);
    snprintf(bag, sizeof bag, "%s/new/folder/a.mcap", s->folder);
    if (launch(s, bag) != 0) {
        said(s, "", true);
        fail();
    }
    assert_true(said(s, ", 0 messages lost", false));
    struct bag_catalog *c = open_catalog(bag);
    assert_false(c->scanned);
    check_sequences(c);
    assert_true(count_topic(c, "ping") >= pings_of_scene());
    assert_true(count_topic(c, "volume") > 0);
    assert_true(count_topic(c, "detections") > 0);
    assert_true(count_topic(c, "survey") > 0);
    bag_catalog_close(c);
    for (const struct topic *t = topics_all(); t->name; t++) {
        assert_true(find_metadata(bag, MANIFEST_LOST, 0, t->name, text));
        assert_string_equal(text, "0");
    }
    assert_true(find_metadata(bag, MANIFEST_GEOMETRY, 0, MANIFEST_SOURCE, text));
    assert_string_equal(text, "SIMULATION");
    assert_true(save_attachment(bag, "launch/launch.yaml", scratch_path(s, "l.yaml")));
    assert_true(save_attachment(bag, "launch/point.yaml", scratch_path(s, "p.yaml")));
    assert_true(save_attachment(bag, MANIFEST_SURVEY, scratch_path(s, "s.yaml")));
}

/* In a process of its own: the mount is its own too. */
static int record_onto_a_small_disk(struct scratch *s)
{
    char bag[128];
    uint64_t n_faults;
    struct bag_catalog *c;

    snprintf(bag, sizeof bag, "%s/small", s->folder);
    if (mkdir(bag, 0777) || unshare(CLONE_NEWNS) ||
        mount(NULL, "/", NULL, MS_REC | MS_PRIVATE, NULL) ||
        mount("tmpfs", bag, "tmpfs", 0, "size=1m"))
        return 77;
    strcat(bag, "/a.mcap");
    if (launch(s, bag) != 1) /* the results are there, and the bag is short */
        return 1;
    if (!said(s, "recording stops: ", false) || !said(s, "No space left", false) ||
        !said(s, "the others go on without it", false))
        return 2;
    if (bag_check(&n_faults, bag, NULL, NULL) || n_faults ||
        bag_catalog_open(&c, bag, NULL))
        return 3;
    bool whole = !c->scanned && c->n_messages > 0;
    bag_catalog_close(c);
    return whole ? 0 : 4;
}

static void a_full_disk_stops_the_recording_and_nothing_else(void **state)
{
    struct scratch *s = *state;
    int status;
    pid_t pid;

    write_launch(s);
    pid = fork();
    assert_true(pid >= 0);
    if (!pid)
        _exit(record_onto_a_small_disk(s));
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    if (WEXITSTATUS(status) == 77) {
        print_message("mounting is not allowed here\n");
        skip();
    }
    if (WEXITSTATUS(status))
        said(s, "", true);
    assert_int_equal(WEXITSTATUS(status), 0);
    assert_int_equal(access(scratch_path(s, "out/detections.json"), F_OK), 0);
}

#define SCRATCH_TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        SCRATCH_TEST(a_system_that_records_itself_has_every_message_from_the_first),
        SCRATCH_TEST(a_full_disk_stops_the_recording_and_nothing_else),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
