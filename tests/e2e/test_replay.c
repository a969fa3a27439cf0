/* SPDX-License-Identifier: MIT */
/* A scan of the real processes is recorded; the recording gives the same objects and the
 * same CAN frames at every pace, and in one process without the bus. */
#include "tests/hal/scratch.h"

#include <jansson.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/bag/cursor.h"

#define SCENE SOURCE_DIR "/launch/scenes/point.yaml"

static int run(struct scratch *s, char *const argv[])
{
    int status;
    pid_t pid = fork();

    assert_true(pid >= 0);
    if (!pid) {
        if (!freopen(scratch_path(s, "says"), "w", stdout) ||
            dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
            _exit(98);
        execv(BINARY_DIR "/bin/anlos", argv);
        _exit(99);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static char *slurp(struct scratch *s, const char *name)
{
    FILE *f = fopen(scratch_path(s, name), "rb");
    char *text = calloc(1, 1 << 20);

    assert_non_null(text);
    if (!f)
        fail_msg("%s is missing", s->path);
    assert_true(fread(text, 1, (1 << 20) - 1, f) > 0);
    fclose(f);
    return text;
}

/* Everything that was said counts: no process may have met a sanitizer's error. */
static void run_well(struct scratch *s, char *const argv[])
{
    int code = run(s, argv);
    char *said = slurp(s, "says");

    if (code || strstr(said, "Sanitizer") || strstr(said, "runtime error"))
        fail_msg("%s %s: exit code %d: %s", argv[1], argv[2], code, said);
    free(said);
}

static char *path_of(struct scratch *s, const char *name)
{
    return strdup(scratch_path(s, name));
}

static void launch(struct scratch *s, const char *file, const char *folder,
                   const char *option, const char *value, const char *option_2,
                   const char *value_2)
{
    char *path = path_of(s, file), *out = path_of(s, folder);
    char *argv[] = {(char *)"anlos",
                    (char *)"launch",
                    path,
                    (char *)"--run-dir",
                    s->folder,
                    (char *)"--out",
                    out,
                    (char *)option,
                    (char *)value,
                    (char *)option_2,
                    (char *)value_2,
                    NULL};

    run_well(s, argv);
    free(path);
    free(out);
}

/* For all tests: each has folders of its own beside it. */
static void record(struct scratch *s)
{
    char text[1024], *bag = path_of(s, "scan.mcap");

    snprintf(text, sizeof text,
             "nodes: [stage, array, scan, dsp, recon, track, can, report]\n"
             "array: {uri: 'sim:%s?pace=fast'}\n"
             "stage: {uri: 'sim:?pace=fast'}\n"
             "scan: {background: true}\n"
             "report: {folder: unused}\n",
             SCENE);
    scratch_write(s, "live.yaml", text);
    launch(s, "live.yaml", "live", "--record", bag, NULL, NULL);
    scratch_write(s, "play.yaml",
                  "nodes: [play, dsp, recon, track, can, report]\n"
                  "play: {bag: scan.mcap}\n"
                  "scan: {background: true}\n"
                  "report: {folder: unused}\n");
    free(bag);
}

struct frames {
    char lists[20000];   /* lines without their stamps, in their order */
    char states[10][64]; /* different contents of status frames, in the order of text */
    size_t n_states;
};

static int compare_states(const void *a, const void *b)
{
    return strcmp(a, b);
}

static void add_state(struct frames *f, const char *frame)
{
    for (size_t i = 0; i < f->n_states; i++)
        if (!strcmp(f->states[i], frame))
            return;
    assert_true(f->n_states < 10);
    snprintf(f->states[f->n_states++], sizeof *f->states, "%s", frame);
}

/* How often the state is told depends on time, what it says does not. */
static void read_frames(struct scratch *s, const char *name, struct frames *f)
{
    char *text = slurp(s, name), *rest = NULL, frame[64];

    memset(f, 0, sizeof *f);
    for (char *line = strtok_r(text, "\n", &rest); line;
         line = strtok_r(NULL, "\n", &rest)) {
        assert_int_equal(sscanf(line, "(%*f) can0 %63s", frame), 1);
        if (!strncmp(frame, "400#", 4)) {
            memcpy(frame + 4, "0000", 4); /* their count is protected too */
            add_state(f, frame);
            continue;
        }
        if (!strncmp(frame, "401#", 4)) /* of the machine */
            continue;
        size_t used = strlen(f->lists);
        assert_true(used + strlen(frame) + 2 < sizeof f->lists);
        sprintf(f->lists + used, "%s\n", frame);
    }
    qsort(f->states, f->n_states, sizeof *f->states, compare_states);
    free(text);
}

/* The source is bits 3 and 4 of the third byte: 1 is a replay. */
static void assert_says_replay(const struct frames *f)
{
    assert_true(f->n_states >= 2);
    for (size_t i = 0; i < f->n_states; i++) {
        unsigned byte;
        assert_int_equal(sscanf(f->states[i], "400#%*4x%2x", &byte), 1);
        assert_int_equal(byte >> 3 & 3, 1);
    }
}

static void assert_same_text(struct scratch *s, const char *a, const char *b)
{
    char *x = slurp(s, a), *y = slurp(s, b);

    assert_string_equal(x, y);
    free(x);
    free(y);
}

static void assert_result(struct scratch *s)
{
    json_t *o = json_load_file(scratch_path(s, "1/detections.json"), 0, NULL);

    assert_non_null(o);
    assert_string_equal(json_string_value(json_object_get(o, "source")), "replay");
    assert_int_equal(json_array_size(json_object_get(o, "detections")), 1);
    json_decref(o);
    o = json_load_file(scratch_path(s, "max/report.json"), 0, NULL);
    assert_non_null(o);
    const json_t *pings = json_object_get(o, "pings");
    assert_int_equal(json_integer_value(json_object_get(pings, "imaged")), 24);
    assert_int_equal(json_integer_value(json_object_get(pings, "imaged_of")), 24);
    json_decref(o);
}

static void every_pace_gives_the_same_objects_and_frames(void **state)
{
    static const char *const paces[] = {"1", "10", "max"};
    struct scratch *s = *state;
    struct frames first, other;
    char name[64], file[64];

    for (size_t i = 0; i < 3; i++)
        launch(s, "play.yaml", paces[i], "--rate", paces[i], NULL, NULL);
    assert_result(s);
    read_frames(s, "1/can.candump", &first);
    assert_true(strstr(first.lists, "402#") != NULL && strstr(first.lists, "406#"));
    assert_says_replay(&first);
    for (size_t i = 1; i < 3; i++) {
        snprintf(name, sizeof name, "%s/detections.json", paces[i]);
        assert_same_text(s, "1/detections.json", name);
        snprintf(file, sizeof file, "%s/can.candump", paces[i]);
        read_frames(s, file, &other);
        assert_string_equal(first.lists, other.lists);
        assert_says_replay(&other);
    }

    char *bag = path_of(s, "scan.mcap"), *out = path_of(s, "one");
    char *argv[] = {(char *)"anlos",
                    (char *)"recon",
                    (char *)"--bag",
                    bag,
                    (char *)"--out",
                    out,
                    NULL};
    run_well(s, argv);
    assert_same_text(s, "1/detections.json", "one/detections.json");
    read_frames(s, "one/can.candump", &other);
    assert_string_equal(first.lists, other.lists);
    free(bag);
    free(out);
}

static const char *state_of(struct scratch *s, const char *name, char out[16])
{
    json_t *o = json_load_file(scratch_path(s, name), 0, NULL);

    assert_non_null(o);
    snprintf(out, 16, "%s", json_string_value(json_object_get(o, "state")));
    json_decref(o);
    return out;
}

static void sound_alone_without_a_scan_beside_it_is_played_to_its_end(void **state)
{
    struct scratch *s = *state;
    char text[16];

    char *bag = path_of(s, "scan.mcap"), *sound = path_of(s, "sound.mcap");
    char *filter[] = {
        (char *)"anlos", (char *)"bag",      (char *)"filter",      bag, (char *)"-o",
        sound,           (char *)"--topics", (char *)"survey,ping", NULL};
    run_well(s, filter);
    launch(s, "play.yaml", "sound", "--bag", sound, "--rate", "max");
    assert_string_equal(state_of(s, "sound/report.json", text), "done");
    free(bag);
    free(sound);
}

/* The publish stamp of the last ping but some, after the first message of the bag. */
static double end_of_sound_s(struct scratch *s)
{
    struct bag_catalog *c = NULL;
    struct bag_cursor *cursor = NULL;
    struct bag_message m;
    uint64_t last = 0;
    size_t n = 0;

    assert_int_equal(bag_catalog_open(&c, scratch_path(s, "scan.mcap"), NULL), 0);
    assert_int_equal(bag_cursor_create(&cursor, c), 0);
    while (n < 40 && !bag_cursor_next(cursor, &m, NULL)) {
        const struct bag_channel *h = bag_catalog_channel(c, m.channel_id);
        n += bytes_equal(h->topic, bytes_of("ping"));
        last = m.log_time;
    }
    assert_int_equal(n, 40);
    double s_after = 1e-9 * (double)(last - c->start_time);
    bag_cursor_destroy(cursor);
    bag_catalog_close(c);
    return s_after;
}

static void a_recording_that_ends_too_soon_is_a_scan_that_failed(void **state)
{
    struct scratch *s = *state;
    char text[16];

    char *play = path_of(s, "play.yaml"), *out = path_of(s, "cut");
    char *bag = path_of(s, "scan.mcap"), *cut = path_of(s, "cut.mcap");
    /* A scan that begins and whose end is not there. */
    char *filter[] = {(char *)"anlos",
                      (char *)"bag",
                      (char *)"filter",
                      bag,
                      (char *)"-o",
                      cut,
                      (char *)"--end",
                      NULL,
                      NULL};
    double end_s = end_of_sound_s(s);
    snprintf(text, sizeof text, "%.6f", end_s);
    filter[7] = text;
    run_well(s, filter);
    char *argv[] = {(char *)"anlos",
                    (char *)"launch",
                    play,
                    (char *)"--bag",
                    cut,
                    (char *)"--out",
                    out,
                    (char *)"--run-dir",
                    s->folder,
                    (char *)"--rate",
                    (char *)"max",
                    NULL};
    assert_int_equal(run(s, argv), 1);
    assert_string_equal(state_of(s, "cut/report.json", text), "failed");
    free(play);
    free(out);
    free(bag);
    free(cut);
}

static void a_bag_that_is_not_there_is_said_at_once(void **state)
{
    struct scratch *s = *state;

    scratch_write(s, "nowhere.yaml", "nodes: [play, dsp]\nplay: {bag: nowhere.mcap}\n");
    char *play = path_of(s, "nowhere.yaml");
    char *argv[] = {(char *)"anlos",     (char *)"launch", play,
                    (char *)"--run-dir", s->folder,        NULL};
    assert_int_equal(run(s, argv), 2);
    char *said = slurp(s, "says");
    assert_contains(said, "nowhere.mcap");
    free(said);
    free(play);
}

static int record_once(void **state)
{
    int err = scratch_open(state);

    if (!err)
        record(*state);
    return err;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_pace_gives_the_same_objects_and_frames),
        cmocka_unit_test(sound_alone_without_a_scan_beside_it_is_played_to_its_end),
        cmocka_unit_test(a_recording_that_ends_too_soon_is_a_scan_that_failed),
        cmocka_unit_test(a_bag_that_is_not_there_is_said_at_once),
    };
    return cmocka_run_group_tests(tests, record_once, scratch_close);
}
