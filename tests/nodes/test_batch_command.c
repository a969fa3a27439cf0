/* SPDX-License-Identifier: MIT */
/* `anlos batch` on small scans of the scene point.yaml, and on a simulated drive. */
#include "tests/hal/scratch.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <math.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/bag/topic_message.h"
#include "msgs/topics.h"
#include "nodes/anlos/batch/batch.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/doctor/drive_pipe.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"
#include "tests/nodes/scene.h"

#define SECOND 1000000000LL
#define START  (1700000000 * SECOND)

/* -- a bag that hangs
 * ---------------------------------------------------------------------
 */
int __real_command_recon(int argc, char **argv);
int __wrap_command_recon(int argc, char **argv);

/* Its process begins one without end, deaf to all that it can be deaf to. */
int __wrap_command_recon(int argc, char **argv)
{
    const char *bag = argc > 2 ? argv[2] : "";
    size_t n = strlen(bag);

    if (n < 10 || strcmp(bag + n - 10, "hangs.mcap"))
        return __real_command_recon(argc, argv);
    signal(SIGTERM, SIG_IGN);
    fprintf(stderr, "anlos recon: half of it is read\n");
    for (;;)
        pause();
}

/* -- bags -------------------------------------------------------------------------------
 */
struct writing {
    struct bag_writer *writer;
    struct bag_topics *topics;
    uint64_t sequence;
};

static void begin_bag(struct writing *w, const char *path)
{
    const struct bag_writer_config cfg = {
        .profile = "anlos", .library = "test", .chunk_size = 1 << 20};
    struct error why = {""};

    *w = (struct writing){.writer = NULL};
    if (bag_writer_create(&w->writer, path, &cfg, &why))
        fail_msg("%s", why.text);
    assert_int_equal(bag_topics_create(&w->topics, w->writer), 0);
}

static void put(struct writing *w, const struct topic *t, int64_t capture_ns,
                int64_t publish_ns, const ProtobufCMessage *m)
{
    struct error why = {""};
    struct envelope e = {.epoch_ns = 1,
                         .sequence = w->sequence++,
                         .capture_ns = capture_ns,
                         .publish_ns = publish_ns,
                         .payload_size = (uint32_t)protobuf_c_message_get_packed_size(m)};
    uint8_t *payload = malloc(e.payload_size);

    assert_non_null(payload);
    protobuf_c_message_pack(m, payload);
    snprintf(e.topic, sizeof e.topic, "%s", t->name);
    snprintf(e.node, sizeof e.node, "array");
    if (bag_topics_put(w->topics, &e, payload, NULL, &why))
        fail_msg("%s", why.text);
    free(payload);
}

static void end_bag(struct writing *w)
{
    bag_topics_destroy(w->topics);
    assert_int_equal(bag_writer_close(w->writer, NULL), 0);
}

static char one_scan[] = "/tmp/anlos-batch-XXXXXX/scan.mcap";

/* A scan without a background, of which the others are links. */
static int make_scan(void **state)
{
    char *slash = strrchr(one_scan, '/');
    struct scene scene;
    struct writing w;
    Anlos__Ping ping;
    int64_t now_ns = START;

    (void)state;
    *slash = '\0';
    char *folder = mkdtemp(one_scan);
    *slash = '/';
    if (!folder || scene_open(&scene, SOURCE_DIR "/tests/nodes/point.yaml"))
        return -1;
    begin_bag(&w, one_scan);
    put(&w, topic_survey(), 0, now_ns, &scene.survey->base);
    for (uint32_t i = 0; i < scene.survey->n_stage_positions_m; i++)
        for (uint32_t j = 0; j < scene.survey->n_speakers_m; j++) {
            scene_ping(&scene, ANLOS__PASS__SCENE, i, j, &ping);
            now_ns += SECOND;
            put(&w, topic_ping(), now_ns - SECOND / 10, now_ns, &ping.base);
        }
    end_bag(&w);
    scene_close(&scene);
    return 0;
}

static int remove_scan(void **state)
{
    (void)state;
    unlink(one_scan);
    *strrchr(one_scan, '/') = '\0';
    return rmdir(one_scan);
}

static void write_scan(const char *path)
{
    assert_int_equal(link(one_scan, path), 0);
}

struct rig {
    struct scratch *scratch;
    char manifest[96], out[96];
    struct command_result r;
};

static int setup(void **state)
{
    struct rig *g = calloc(1, sizeof *g);
    void *scratch = NULL;

    if (!g || scratch_open(&scratch))
        return -1;
    g->scratch = scratch;
    snprintf(g->manifest, sizeof g->manifest, "%s/bags.txt", g->scratch->folder);
    snprintf(g->out, sizeof g->out, "%s/out", g->scratch->folder);
    *state = g;
    return 0;
}

static int teardown(void **state)
{
    struct rig *g = *state;
    void *scratch = g->scratch;

    free(g);
    return scratch_close(&scratch);
}

/* a.mcap, b.mcap, c.mcap: the same scan. */
static void make_bags(struct rig *g)
{
    for (const char *const *p = (const char *const[]){"a.mcap", "b.mcap", "c.mcap", NULL};
         *p; p++)
        write_scan(scratch_path(g->scratch, *p));
}

static int run_words(struct rig *g, const char *const words[])
{
    command_run(&g->r, command_batch, (char *const *)words);
    return g->r.code;
}

/* `anlos batch` on the manifest into the folder, and these words. */
#define batch(g, ...)                                                                    \
    run_words(g, (const char *const[]){"batch", (g)->manifest, "--out", (g)->out,        \
                                       __VA_ARGS__, NULL})

/* The result of a bag; NULL: there is none. */
static json_t *result_of(const struct rig *g, const char *bag)
{
    DIR *d = opendir(g->out);
    json_t *found = NULL;

    if (!d)
        return NULL;
    for (struct dirent *e = readdir(d); e; e = readdir(d)) {
        char path[512];
        if (e->d_name[0] == '.')
            continue;
        snprintf(path, sizeof path, "%s/%s", g->out, e->d_name);
        json_t *line = json_load_file(path, 0, NULL);
        if (!line)
            fail_msg("%s is no whole result", path);
        if (!strcmp(json_string_value(json_object_get(line, "job")), bag)) {
            assert_null(found);
            found = line;
        } else {
            json_decref(line);
        }
    }
    closedir(d);
    return found;
}

static const char *text(const json_t *o, const char *key)
{
    const char *value = json_string_value(json_object_get(o, key));

    if (!value)
        fail_msg("%s is no text", key);
    return value;
}

static double figure(const json_t *line, const char *key)
{
    const json_t *x = json_object_get(json_object_get(line, "figures"), key);

    if (!json_is_number(x))
        fail_msg("%s is not a number", key);
    return json_number_value(x);
}

static const char *started(const json_t *line)
{
    return text(json_object_get(line, "run"), "started");
}

static size_t lines_in(const char *s)
{
    size_t n = 0;

    for (; (s = strchr(s, '\n')); s++)
        n++;
    return n;
}

static void assert_no_leftovers(const struct rig *g)
{
    DIR *d = opendir(g->out);

    assert_non_null(d);
    for (struct dirent *e = readdir(d); e; e = readdir(d))
        if (!strncmp(e->d_name, ".work", 5) || strstr(e->d_name, "XXXX"))
            fail_msg("%s was left", e->d_name);
    closedir(d);
}

/* -- what it does -----------------------------------------------------------------------
 */
static void each_bag_gets_one_line_and_a_second_run_does_nothing(void **state)
{
    static const char *const bags[] = {"a.mcap", "b.mcap", "c.mcap"};
    struct rig *g = *state;
    char when[3][64];

    make_bags(g);
    scratch_write(g->scratch, "bags.txt",
                  "# three\na.mcap\ttag=lab\ttag=rain\n\nb.mcap\r\nc.mcap\n");
    assert_int_equal(batch(g, "-j", "2"), 0);
    assert_int_equal(lines_in(g->r.out), 3);
    assert_contains(g->r.err, "3 bags: 3 done now, 0 before, 0 failed\n");
    for (int i = 0; i < 3; i++) {
        json_t *line = result_of(g, bags[i]);
        assert_non_null(line);
        assert_string_equal(text(line, "outcome"), "done");
        assert_near(figure(line, "objects"), 1.0, 0.0);
        assert_near(figure(line, "pings_used"), 24.0, 0.0);
        assert_int_equal(json_array_size(json_object_get(line, "tags")), i ? 0 : 2);
        snprintf(when[i], sizeof when[i], "%s", started(line));
        json_decref(line);
    }
    assert_no_leftovers(g);
    assert_int_equal(batch(g, "-j", "2"), 0);
    assert_string_equal(g->r.out, "");
    assert_contains(g->r.err, "3 bags: 0 done now, 3 before, 0 failed\n");
    for (int i = 0; i < 3; i++) {
        json_t *line = result_of(g, bags[i]);
        assert_string_equal(started(line), when[i]);
        json_decref(line);
    }
}

/* The bag's date, its launch file, but not its tags. */
static void what_depends_on_a_change_is_processed_again(void **state)
{
    struct rig *g = *state;
    const struct timespec later[2] = {{.tv_sec = 1800000000}, {.tv_sec = 1800000000}};

    write_scan(scratch_path(g->scratch, "a.mcap"));
    scratch_write(g->scratch, "l.yaml",
                  "nodes: [dsp, recon, track, can]\n"
                  "array: {uri: \"sim:none.yaml\"}\n");
    scratch_write(g->scratch, "bags.txt", "a.mcap\na.mcap\tlaunch=l.yaml\n");
    assert_int_equal(batch(g, "-j", "1"), 0);
    assert_contains(g->r.err, "2 done now, 0 before");
    scratch_write(g->scratch, "bags.txt", "a.mcap\ttag=new\na.mcap\tlaunch=l.yaml\n");
    assert_int_equal(batch(g, "-j", "1"), 0);
    assert_contains(g->r.err, "0 done now, 2 before");
    json_t *line = result_of(g, "a.mcap");
    assert_int_equal(json_array_size(json_object_get(line, "tags")), 1);
    json_decref(line);
    scratch_write(g->scratch, "l.yaml",
                  "nodes: [dsp, recon, track, can]\n"
                  "array: {uri: \"sim:none.yaml\"}\n"
                  "can: {base_id: 0x500}\n");
    assert_int_equal(batch(g, "-j", "1"), 0);
    assert_contains(g->r.err, "1 done now, 1 before");
    assert_int_equal(utimensat(AT_FDCWD, scratch_path(g->scratch, "a.mcap"), later, 0),
                     0);
    assert_int_equal(batch(g, "-j", "1"), 0);
    assert_contains(g->r.err, "2 done now, 0 before");
}

static void a_bag_that_fails_costs_itself_alone_and_is_tried_again(void **state)
{
    struct rig *g = *state;

    write_scan(scratch_path(g->scratch, "a.mcap"));
    scratch_write(g->scratch, "damaged.mcap", "no bag at all");
    scratch_write(g->scratch, "bags.txt",
                  "missing.mcap\ndamaged.mcap\na.mcap\na.mcap\tlaunch=gone.yaml\n");
    assert_int_equal(batch(g, "-j", "2"), 1);
    assert_int_equal(lines_in(g->r.out), 4);
    assert_contains(g->r.err, "4 bags: 1 done now, 0 before, 3 failed");
    assert_contains(g->r.err, "missing.mcap failed: recon: ");
    assert_contains(g->r.err, "No such file");
    assert_contains(g->r.err, "damaged.mcap failed: recon: ");
    assert_contains(g->r.err, "gone.yaml failed: recon: ");
    json_t *line = result_of(g, "damaged.mcap");
    assert_string_equal(text(line, "outcome"), "failed");
    assert_contains(text(line, "error"), "damaged.mcap");
    assert_null(json_object_get(line, "figures"));
    json_decref(line);
    write_scan(scratch_path(g->scratch, "missing.mcap"));
    assert_int_equal(batch(g, "-j", "2"), 1);
    assert_contains(g->r.err, "4 bags: 1 done now, 1 before, 2 failed");
    line = result_of(g, "missing.mcap");
    assert_string_equal(text(line, "outcome"), "done");
    json_decref(line);
}

static void a_process_that_is_killed_is_a_line_with_its_reason(void **state)
{
    struct rig *g = *state;
    char name[] = "a.mcap", path[] = "/nowhere/a.mcap", tags[] = "x";
    const struct manifest_bag bag = {
        .job = name, .name = name, .path = path, .tags = tags};
    const struct result_place place = {.folder = g->scratch->folder};
    const struct result_run run = {
        .status = SIGKILL, .said = "anlos recon: half way", .shard = "1-of-1"};
    json_t *line = result_make(&place, &bag, 0, g->scratch->folder, &run);

    assert_true(result_is_failure(line));
    assert_contains(text(line, "error"),
                    "killed by signal 9 (Killed): out of memory, or");
    assert_contains(text(line, "error"), "recon: half way");
    json_decref(line);
}

static void a_bag_that_hangs_is_ended_and_costs_itself_alone(void **state)
{
    struct rig *g = *state;

    scratch_write(g->scratch, "bags.txt", "hangs.mcap\nmissing.mcap\n");
    assert_int_equal(batch(g, "-j", "1", "--timeout", "1"), 1);
    assert_contains(g->r.err, "2 bags: 0 done now, 0 before, 2 failed");
    json_t *line = result_of(g, "hangs.mcap");
    assert_non_null(line);
    assert_string_equal(text(line, "outcome"), "failed");
    assert_string_equal(text(line, "error"),
                        "it took longer than 1 s (--timeout) and was "
                        "ended: recon: half of it is read");
    json_decref(line);
    line = result_of(g, "missing.mcap");
    assert_non_null(line);
    json_decref(line);
    assert_no_leftovers(g);
    assert_int_equal(batch(g, "--timeout", "-1"), 2);
    assert_contains(g->r.err, "anlos batch: --timeout -1: expected a number from 0");
}

static void what_goes_with_a_bag_and_is_a_pipe_is_not_waited_for(void **state)
{
    struct rig *g = *state;

    write_scan(scratch_path(g->scratch, "a.mcap"));
    assert_int_equal(mkfifo(scratch_path(g->scratch, "pipe"), 0600), 0);
    scratch_write(g->scratch, "bags.txt",
                  "a.mcap\tlaunch=pipe\npipe\na.mcap\ttruth=pipe\n");
    assert_int_equal(batch(g, "-j", "1"), 1);
    assert_contains(g->r.err, "3 bags: 0 done now, 0 before, 3 failed");
}

/* -- manifests --------------------------------------------------------------------------
 */
static void what_is_wrong_with_a_manifest_is_said_with_its_line(void **state)
{
    static const struct {
        const char *text, *said;
    } wrong[] = {
        {"", "bags.txt: no bag is in it; expected the path of one on each line"},
        {"# nothing\n\n", "bags.txt: no bag is in it"},
        {"a\nb\n./a\n", "bags.txt:3: a is in line 1 already"},
        {"a\ttrut=b\n", "bags.txt:1: trut: no such key; expected truth, scene, tag"},
        {"a\tb\n", "bags.txt:1: \"b\": expected key=value after the path, with tabs"},
        {"a\n\nb\ttruth=x\ttruth=y\n", "bags.txt:3: truth= is there twice"},
        {"a\ttruth=x\tscene=y\n", "bags.txt:1: expected one of truth= and scene="},
        {"a\tbytes=-1\n", "bags.txt:1: bytes=-1: expected a number of bytes"},
        {"\ttag=x\n", "bags.txt:1: expected a path before the first tab"},
    };
    struct rig *g = *state;

    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        scratch_write(g->scratch, "bags.txt", wrong[i].text);
        assert_int_equal(batch(g, "-j", "1"), 2);
        assert_contains(g->r.err, wrong[i].said);
        assert_int_equal(access(g->out, F_OK), -1);
    }
    unlink(g->manifest);
    assert_int_equal(batch(g, "-j", "1"), 2);
    assert_contains(g->r.err, "bags.txt: No such file or directory");
}

static void a_shard_out_of_range_is_refused(void **state)
{
    static const char *const wrong[] = {"9/8", "0/8",  "8",    "1/0",
                                        "/8",  "1/8x", "-1/8", ""};
    struct rig *g = *state;

    scratch_write(g->scratch, "bags.txt", "a\n");
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_int_equal(batch(g, "--shard", wrong[i]), 2);
        assert_contains(g->r.err, "expected I/N, 1 <= I <= N");
    }
}

/* Graham's bound: the fullest has at most 4/3 of what the best division gives it, which
 * has at least a fair share, and the largest bag. */
static void shards_are_all_bags_once_and_about_as_large(void **state)
{
    enum { BAGS = 60, SHARDS = 7 };
    struct rig *g = *state;
    bool seen[BAGS] = {false};
    uint64_t total = 0, largest = 0, fullest = 0, random = 1;
    FILE *f = fopen(g->manifest, "w");

    assert_non_null(f);
    for (int i = 0; i < BAGS; i++) {
        random = random * 6364136223846793005u + 1442695040888963407u;
        uint64_t bytes = 1000000 + (random >> 33) % 100000000;
        fprintf(f, "%d\tbytes=%llu\n", i, (unsigned long long)bytes);
        total += bytes;
        largest = bytes > largest ? bytes : largest;
    }
    assert_int_equal(fclose(f), 0);
    for (size_t s = 1; s <= SHARDS; s++) {
        struct manifest m;
        uint64_t load = 0;
        assert_int_equal(manifest_load(&m, g->manifest, NULL), 0);
        assert_int_equal(manifest_shard(&m, s, SHARDS), 0);
        for (size_t i = 0; i < m.n; i++) {
            int k = atoi(m.bags[i].name);
            assert_false(seen[k]);
            seen[k] = true;
            load += m.bags[i].bytes;
            assert_true(!i || m.bags[i].bytes <= m.bags[i - 1].bytes);
        }
        fullest = load > fullest ? load : fullest;
        manifest_clear(&m);
    }
    for (int i = 0; i < BAGS; i++)
        assert_true(seen[i]);
    uint64_t best = total / SHARDS > largest ? total / SHARDS : largest;
    assert_true(3 * fullest <= 4 * best);
}

static void shards_fill_one_folder_with_what_one_run_makes(void **state)
{
    struct rig *g = *state;
    char shard[16];

    make_bags(g);
    scratch_write(g->scratch, "bags.txt", "a.mcap\nb.mcap\nc.mcap\n");
    for (int i = 1; i <= 5; i++) { /* two of them are empty */
        snprintf(shard, sizeof shard, "%d/5", i);
        assert_int_equal(batch(g, "-j", "1", "--shard", shard), 0);
        assert_int_equal(lines_in(g->r.out), i <= 3);
    }
    assert_int_equal(batch(g, "-j", "1"), 0);
    assert_contains(g->r.err, "0 done now, 3 before");
}

/* -- what comes between -----------------------------------------------------------------
 */
static int hold(struct rig *g, const char *name, int operation)
{
    char path[256];

    mkdir(g->out, 0777);
    snprintf(path, sizeof path, "%s/%s", g->out, name);
    int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    assert_int_equal(flock(fd, operation | LOCK_NB), 0);
    return fd;
}

static void two_batches_in_one_folder_are_refused_but_two_shards_are_not(void **state)
{
    struct rig *g = *state;

    make_bags(g);
    scratch_write(g->scratch, "bags.txt", "a.mcap\nb.mcap\n");
    int all = hold(g, ".batch.lock", LOCK_EX);
    assert_int_equal(batch(g, "-j", "1"), 1);
    assert_contains(g->r.err, "another batch is at work there; wait for it, or name");
    assert_int_equal(batch(g, "-j", "1", "--shard", "1/2"), 1);
    assert_contains(g->r.err, "another batch is at work there without --shard");
    close(all);
    all = hold(g, ".batch.lock", LOCK_SH);
    int second = hold(g, ".shard-2-of-2.lock", LOCK_EX);
    assert_int_equal(batch(g, "-j", "1"), 1);
    assert_int_equal(batch(g, "-j", "1", "--shard", "2/2"), 1);
    assert_contains(g->r.err, "another batch is at work on shard 2/2 there");
    assert_null(result_of(g, "a.mcap"));
    assert_int_equal(batch(g, "-j", "1", "--shard", "1/2"), 0);
    close(second);
    assert_int_equal(batch(g, "-j", "1", "--shard", "2/2"), 0);
    close(all);
}

static int with_small_files(int argc, char **argv)
{
    const struct rlimit limit = {100, 100}; /* bytes of a file */

    if (setrlimit(RLIMIT_FSIZE, &limit))
        return -1;
    return command_batch(argc, argv);
}

static void where_no_result_can_be_written_it_ends_and_goes_on_later(void **state)
{
    struct rig *g = *state;
    const char *const words[] = {"batch", g->manifest, "--out", g->out, "-j", "1", NULL};

    make_bags(g);
    scratch_write(g->scratch, "bags.txt", "a.mcap\nb.mcap\nc.mcap\n");
    command_run(&g->r, with_small_files, (char *const *)words);
    assert_int_equal(g->r.code, 1);
    assert_contains(g->r.err, "cannot be written: File too large");
    assert_contains(g->r.err, "3 left; the same command goes on with them");
    assert_null(result_of(g, "a.mcap"));
    assert_no_leftovers(g);
    assert_int_equal(batch(g, "-j", "1"), 0);
    assert_contains(g->r.err, "3 done now");
}

/* A line is made whole where it is to be, so that it gets there by its name alone. */
static void what_is_not_done_may_be_on_another_disk(void **state)
{
    struct rig *g = *state;
    char scratch[96];

    make_bags(g);
    scratch_write(g->scratch, "bags.txt", "a.mcap\n");
    snprintf(scratch, sizeof scratch, "%s/fast", g->scratch->folder);
    assert_int_equal(batch(g, "--scratch", scratch), 2);
    assert_contains(g->r.err, "/fast: cannot be written: No such file");
    scratch_folder(g->scratch, "fast");
    assert_int_equal(batch(g, "--scratch", scratch), 0);
    assert_int_equal(rmdir(scratch), 0); /* nothing was left */
    assert_no_leftovers(g);
}

/* Nobody reads what it says after the first line, so it cannot come to its end. */
static pid_t start_and_hold(struct rig *g, int *out_fd, int *err_fd)
{
    const char *const words[] = {"batch", g->manifest, "--out", g->out, "-j", "1", NULL};
    FILE *f = fopen(g->manifest, "w");
    char one;

    assert_non_null(f);
    for (int i = 0; i < 30; i++)
        fprintf(f, "missing%d.mcap\n", i);
    assert_int_equal(fclose(f), 0);
    pid_t pid = command_start(command_batch, (char *const *)words, out_fd, err_fd);
    assert_true(fcntl(*out_fd, F_SETPIPE_SZ, 4096) == 4096);
    do
        assert_int_equal(read(*out_fd, &one, 1), 1);
    while (one != '\n');
    return pid;
}

static void ctrl_c_keeps_what_was_done(void **state)
{
    struct rig *g = *state;
    int out, err, status;
    char said[4096] = "";
    pid_t pid = start_and_hold(g, &out, &err);

    kill(pid, SIGINT);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 130);
    assert_true(read(err, said, sizeof said - 1) > 0);
    assert_contains(said, "left; the same command goes on with them\n");
    assert_contains(said, "anlos batch: interrupted\n");
    close(out);
    close(err);
    json_t *line = result_of(g, "missing0.mcap");
    assert_non_null(line);
    json_decref(line);
    assert_null(result_of(g, "missing29.mcap"));
    assert_no_leftovers(g);
}

static void ctrl_c_ends_a_bag_that_hangs(void **state)
{
    struct rig *g = *state;
    const char *const words[] = {"batch", g->manifest, "--out", g->out, "-j", "1", NULL};
    int out, err, status;
    char one;

    scratch_write(g->scratch, "bags.txt", "missing.mcap\nhangs.mcap\n");
    pid_t pid = command_start(command_batch, (char *const *)words, &out, &err);
    do
        assert_int_equal(read(out, &one, 1), 1);
    while (one != '\n');
    kill(pid, SIGINT);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 130);
    close(out);
    close(err);
    assert_null(result_of(g, "hangs.mcap"));
    assert_no_leftovers(g);
}

static void after_a_kill_the_same_command_goes_on(void **state)
{
    struct rig *g = *state;
    int out, err, status;
    pid_t pid = start_and_hold(g, &out, &err);

    kill(pid, SIGKILL);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    close(out);
    close(err);
    write_scan(scratch_path(g->scratch, "missing0.mcap"));
    assert_int_equal(batch(g, "-j", "2"), 1);
    assert_contains(g->r.err, "30 bags: 1 done now, 0 before, 29 failed");
    json_t *line = result_of(g, "missing29.mcap");
    assert_non_null(line);
    json_decref(line);
    assert_no_leftovers(g);
}

/* -- against who was there --------------------------------------------------------------
 */
#define WALKER  SOURCE_DIR "/tests/nodes/walker.yaml"
#define DRIVE_S 4.0
#define ZERO_NS (INT64_C(200000000) * 8 * SECOND) /* time 0 of one of its periods */

static void write_drive(const char *path)
{
    struct drive_world world;
    struct error why = {""};
    struct writing w;
    Anlos__Ping ping;
    int64_t capture_ns, at_ns = ZERO_NS;

    if (drive_world_create(&world, &(struct drive_world_config){.scene = WALKER}, &why) ||
        drive_world_shoot(&world, PASS_SCENE, &why))
        fail_msg("%s", why.text);
    begin_bag(&w, path);
    put(&w, topic_survey(), 0, at_ns, &world.survey->base);
    while (at_ns < ZERO_NS + llround(1e9 * DRIVE_S)) {
        assert_int_equal(drive_world_ping(&world, PASS_SCENE, &ping, &capture_ns), 0);
        at_ns = ZERO_NS + llround(1e9 * drive_world_s(capture_ns));
        put(&w, topic_ping(), at_ns, at_ns + SECOND / 50, &ping.base);
    }
    end_bag(&w);
    drive_world_clear(&world);
}

/* The bag has no lists: those that are scored are of now.  From 2 s on somebody walks. */
static void lists_as_they_are_now_are_held_against_who_was_there(void **state)
{
    struct rig *g = *state;

    write_drive(scratch_path(g->scratch, "drive.mcap"));
    scratch_write(g->scratch, "l.yaml",
                  "nodes: [array, scan, dsp, recon, track, can]\n"
                  "array: {uri: \"sim:none.yaml\"}\n"
                  "scan: {mode: fixed}\n"
                  "dsp: {background: adaptive, background_s: 1}\n"
                  "recon: {frames: {pings: 8, sum: power, every: ping}}\n"
                  "track: {cfar: ordered}\n");
    scratch_write(g->scratch, "bags.txt",
                  "drive.mcap\tlaunch=l.yaml\tscene=" WALKER "\n");
    assert_int_equal(batch(g, "-j", "1"), 0);
    json_t *line = result_of(g, "drive.mcap with l.yaml");
    assert_near(figure(line, "objects_entered"), 1.0, 0.0);
    assert_true(figure(line, "detection_probability") > 0.3);
    assert_true(figure(line, "position_rms_m") < 0.5);
    assert_true(figure(line, "seconds") > DRIVE_S - 1.0);
    json_decref(line);
}

/* -- merge ------------------------------------------------------------------------------
 */
static void write_result(const struct rig *g, const char *folder, const char *job,
                         const char *program, const char *rest)
{
    char path[256];

    snprintf(path, sizeof path, "%s/%s", g->scratch->folder, folder);
    mkdir(path, 0777);
    snprintf(path, sizeof path, "%s/%s/%s-%s.json", g->scratch->folder, folder, job,
             program);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f,
            "{\"format\":1,\"job\":\"%s\",\"revision\":\"r%s\",\"program\":\"%s\",%s}\n",
            job, program, program, rest);
    assert_int_equal(fclose(f), 0);
}

#define DONE(tags, rms, rate, seconds)                                                   \
    "\"tags\":" tags ",\"outcome\":\"done\",\"error\":null,\"figures\":{"                \
    "\"position_rms_m\":" rms ",\"false_tracks_per_hour\":" rate ",\"seconds\":" seconds \
    "},\"run\":{\"cpu_s\":2}"

/* Two bags of 100 and 300 s; the newer version is exacter, and fails at a third. */
static void make_results(struct rig *g)
{
    write_result(g, "old", "a", "1", DONE("[\"rain\"]", "0.1", "36", "100"));
    write_result(g, "old", "b", "1", DONE("[]", "0.2", "0", "300"));
    write_result(g, "old", "c", "1", DONE("[\"rain\"]", "0.3", "0", "100"));
    write_result(g, "new", "a", "2", DONE("[\"rain\"]", "0.05", "0", "100"));
    write_result(g, "new", "b", "2", DONE("[]", "0.1", "0", "300"));
    write_result(g, "new", "c", "2",
                 "\"tags\":[\"rain\"],\"outcome\":\"failed\",\"error\":\"a, \\\"b\\\"\"");
}

static int run_merge(struct rig *g, const char *const words[])
{
    char here[512];

    assert_non_null(getcwd(here, sizeof here));
    assert_int_equal(chdir(g->scratch->folder), 0);
    int code = run_words(g, words);
    assert_int_equal(chdir(here), 0);
    return code;
}

#define merge(g, ...)                                                                    \
    run_merge(g, (const char *const[]){"batch", "merge", __VA_ARGS__, NULL})

static const json_t *mean_of(const json_t *all, const char *tag, const char *version)
{
    const json_t *o;
    size_t i;

    json_array_foreach(json_object_get(all, "means"), i, o)
    {
        const char *own = json_string_value(json_object_get(o, "tag"));
        if (!strcmp(text(o, "version"), version) && !strcmp(own ? own : "", tag))
            return o;
    }
    fail_msg("no means of %s %s", tag, version);
    return NULL;
}

static double number(const json_t *o, const char *key)
{
    if (!json_is_number(json_object_get(o, key)))
        fail_msg("%s is not a number", key);
    return json_number_value(json_object_get(o, key));
}

static void two_versions_stand_side_by_side_all_and_by_tag(void **state)
{
    struct rig *g = *state;

    make_results(g);
    assert_int_equal(merge(g, "old", "new", "--out", "t.json", "--plots", "plots"), 0);
    assert_contains(g->r.out, "old: revision r1, program 1\n");
    assert_contains(g->r.out, "\nnew over old, bag by bag:\n"
                              "Error of place, m        "
                              "lower in 2 of 2, the same in 0, higher in 0\n");
    assert_contains(g->r.out, "\nFalse tracks an hour     "
                              "lower in 1 of 2, the same in 1, higher in 0\n");
    assert_null(strstr(g->r.out, "Detection probability")); /* no bag has one */
    json_t *all = json_load_file(scratch_path(g->scratch, "t.json"), 0, NULL);
    assert_non_null(all);
    const json_t *m = mean_of(all, "", "old");
    assert_near(number(m, "bags"), 3.0, 0.0);
    assert_near(number(m, "position_rms_m"), 0.2, 1e-9);
    assert_near(number(m, "false_tracks_per_hour"), 36.0 * 100 / 500, 1e-9);
    m = mean_of(all, "rain", "old");
    assert_near(number(m, "bags"), 2.0, 0.0);
    assert_near(number(m, "position_rms_m"), 0.2, 1e-9);
    assert_near(number(m, "false_tracks_per_hour"), 36.0 * 100 / 200, 1e-9);
    m = mean_of(all, "", "new");
    assert_near(number(m, "failed"), 1.0, 0.0);
    assert_near(number(m, "position_rms_m"), 0.075, 1e-9);
    assert_int_equal(json_array_size(json_object_get(all, "bags")), 6);
    const json_t *by_bag = json_array_get(json_object_get(all, "comparisons"), 0);
    assert_string_equal(json_string_value(json_object_get(by_bag, "figure")),
                        "position_rms_m");
    assert_near(number(by_bag, "bags"), 2.0, 0.0);
    assert_near(number(by_bag, "lower"), 2.0, 0.0);
    assert_near(number(by_bag, "higher"), 0.0, 0.0);
    json_decref(all);
    for (const char *const *p =
             (const char *const[]){"error", "false_tracks", "time", NULL};
         *p; p++) {
        char name[64];
        snprintf(name, sizeof name, "plots/%s.svg", *p);
        assert_int_equal(access(scratch_path(g->scratch, name), R_OK), 0);
    }
    assert_int_not_equal(access(scratch_path(g->scratch, "plots/pd.svg"), F_OK), 0);
    assert_contains(g->r.err, "pd: no bag has it in both versions, it is not drawn");
    assert_int_equal(merge(g, "old", "--plots", "plots"), 2);
    assert_contains(g->r.err, "--plots: only one version is there");
}

static void a_table_has_a_line_for_each_bag_and_version_in_their_order(void **state)
{
    struct rig *g = *state;
    char line[256];

    make_results(g);
    assert_int_equal(merge(g, "old", "new", "--out", "t.csv"), 0);
    FILE *f = fopen(scratch_path(g->scratch, "t.csv"), "r");
    assert_non_null(f);
    static const char *const lines[] = {
        ("job,tags,version,revision,program,outcome,error,bag_bytes,wall_s,cpu_s,"
         "peak_memory_bytes,position_rms_m,false_tracks_per_hour,seconds\n"),
        "a,rain,old,r1,1,done,,,,2,,0.1,36,100\n",
        "a,rain,new,r2,2,done,,,,2,,0.05,0,100\n",
        "b,,old,r1,1,done,,,,2,,0.2,0,300\n",
        "b,,new,r2,2,done,,,,2,,0.1,0,300\n",
        "c,rain,old,r1,1,done,,,,2,,0.3,0,100\n",
        "c,rain,new,r2,2,failed,\"a, \"\"b\"\"\",,,,,,,\n",
    };
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        assert_non_null(fgets(line, sizeof line, f));
        assert_string_equal(line, lines[i]);
    }
    assert_null(fgets(line, sizeof line, f));
    fclose(f);
}

/* Of one folder too: another program is another version. */
static void a_manifest_tells_what_is_missing_and_what_is_not_wanted(void **state)
{
    struct rig *g = *state;

    make_results(g);
    write_result(g, "old", "a", "3", DONE("[]", "0.4", "0", "100"));
    scratch_write(g->scratch, "bags.txt", "a\nb\nd\n");
    assert_int_equal(merge(g, "old", "new", "--manifest", "bags.txt", "--out", "t.json"),
                     1);
    assert_contains(g->r.err, "4 results of bags.txt are missing"); /* d, d, d, and b */
    json_t *all = json_load_file(scratch_path(g->scratch, "t.json"), 0, NULL);
    assert_int_equal(json_array_size(json_object_get(all, "bags")), 9);
    assert_near(number(mean_of(all, "", "old r3"), "missing"), 2.0, 0.0);
    assert_near(number(mean_of(all, "", "old r1"), "missing"), 1.0, 0.0);
    assert_near(number(mean_of(all, "", "new"), "failed"), 0.0, 0.0); /* not c's */
    json_decref(all);
    scratch_write(g->scratch, "bags.txt", "a\nb\n");
    assert_int_equal(merge(g, "new", "--manifest", "bags.txt"), 0);
}

static void what_cannot_be_merged_is_named(void **state)
{
    struct rig *g = *state;

    make_results(g);
    assert_int_equal(merge(g, "--out", "t.csv"), 2);
    assert_contains(g->r.err, "expected a DIR with results");
    assert_int_equal(merge(g, "old", "--out", "t.txt"), 2);
    assert_contains(g->r.err, "expected FILE.csv or FILE.json");
    assert_int_equal(merge(g, "nowhere"), 2);
    assert_contains(g->r.err, "nowhere: No such file or directory");
    scratch_folder(g->scratch, "empty");
    assert_int_equal(merge(g, "empty"), 2);
    assert_contains(g->r.err, "empty: no results of `anlos batch`");
    scratch_write(g->scratch, "old/half.json", "{\"format\":1,");
    assert_int_equal(merge(g, "old"), 2);
    assert_contains(g->r.err, "old/half.json: not a result: ");
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(each_bag_gets_one_line_and_a_second_run_does_nothing),
        TEST(what_depends_on_a_change_is_processed_again),
        TEST(a_bag_that_fails_costs_itself_alone_and_is_tried_again),
        TEST(a_bag_that_hangs_is_ended_and_costs_itself_alone),
        TEST(what_goes_with_a_bag_and_is_a_pipe_is_not_waited_for),
        TEST(a_process_that_is_killed_is_a_line_with_its_reason),
        TEST(what_is_wrong_with_a_manifest_is_said_with_its_line),
        TEST(a_shard_out_of_range_is_refused),
        TEST(shards_are_all_bags_once_and_about_as_large),
        TEST(shards_fill_one_folder_with_what_one_run_makes),
        TEST(two_batches_in_one_folder_are_refused_but_two_shards_are_not),
        TEST(where_no_result_can_be_written_it_ends_and_goes_on_later),
        TEST(what_is_not_done_may_be_on_another_disk),
        TEST(ctrl_c_keeps_what_was_done),
        TEST(ctrl_c_ends_a_bag_that_hangs),
        TEST(after_a_kill_the_same_command_goes_on),
        TEST(lists_as_they_are_now_are_held_against_who_was_there),
        TEST(two_versions_stand_side_by_side_all_and_by_tag),
        TEST(a_table_has_a_line_for_each_bag_and_version_in_their_order),
        TEST(a_manifest_tells_what_is_missing_and_what_is_not_wanted),
        TEST(what_cannot_be_merged_is_named),
    };
    return cmocka_run_group_tests(tests, make_scan, remove_scan);
}
