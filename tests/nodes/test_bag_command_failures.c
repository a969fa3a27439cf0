/* SPDX-License-Identifier: MIT */
/* `anlos bag` while memory, disk or file give out, at every place where they may: each
 * verb makes what it makes when nothing fails, or says why not and leaves nothing behind.
 */
#include "msgs/survey.pb-c.h"
#include "tests/hal/scratch.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <unistd.h>

#include "msgs/bag/catalog.h"
#include "msgs/bag/topic_message.h"
#include "msgs/detections.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/volume.pb-c.h"
#include "nodes/anlos/commands.h"
#include "nodes/rt/json_whole.h"
#include "nodes/rt/stop.h"
#include "tests/failing.h"
#include "tests/nodes/command.h"

#define WORDS 12

struct rig {
    struct scratch *scratch;
    char recording[96], sound[96], bag[96], both[96], out[96]; /* paths */
    char said[96], told[96];                                   /* stdout, stderr */
};

struct job {
    const struct rig *rig;
    const char *words[WORDS]; /* after "bag" */
    bool varies;              /* what it makes, with what it could not read */
    uint64_t made, said;      /* hashes of what it makes and says when nothing fails */
    bool has_run;
};

/* -- what is there
 * -----------------------------------------------------------------------
 */

static uint64_t hash_bytes(uint64_t h, const char *data, size_t size)
{
    for (size_t i = 0; i < size; i++)
        h = (h ^ (uint8_t)data[i]) * 0x100000001b3u;
    return h;
}

/* Of a file, or of all in a folder; 0: it is not there.  They go. */
static uint64_t take_away(const char *path)
{
    struct stat st;
    uint64_t h = 1;

    if (lstat(path, &st))
        return 0;
    if (S_ISDIR(st.st_mode)) {
        struct dirent **list;
        int n = scandir(path, &list, NULL, alphasort);
        for (int i = 0; i < n; i++) {
            char inside[400];
            snprintf(inside, sizeof inside, "%s/%s", path, list[i]->d_name);
            if (list[i]->d_name[0] != '.')
                h = h * 31 + take_away(inside);
            free(list[i]);
        }
        free(list);
        assert_int_equal(rmdir(path), 0);
        return h;
    }
    char *data = malloc((size_t)st.st_size + 1);
    FILE *f = fopen(path, "rb");
    assert_true(data && f);
    assert_int_equal(fread(data, 1, (size_t)st.st_size, f), st.st_size);
    fclose(f);
    h = hash_bytes(h, data, (size_t)st.st_size);
    free(data);
    assert_int_equal(unlink(path), 0);
    return h;
}

/* What no test may leave behind: files of names that nobody gave. */
static void check_leftovers(const struct rig *r)
{
    static const char *const ours[] = {"scene.yaml", "r",    "sound.mcap", "b.mcap",
                                       "both.mcap",  "said", "told",       "out"};
    DIR *d = opendir(r->scratch->folder);

    assert_non_null(d);
    for (const struct dirent *e; (e = readdir(d));) {
        bool known = e->d_name[0] == '.' && (!e->d_name[1] || e->d_name[1] == '.');
        for (size_t i = 0; i < sizeof ours / sizeof *ours; i++)
            known = known || !strcmp(e->d_name, ours[i]);
        if (!known)
            fail_msg("%s is left behind", e->d_name);
    }
    closedir(d);
}

/* -- a verb in this process
 * -----------------------------------------------------------------------
 */

static int divert(int fd, const char *path)
{
    int saved = dup(fd);
    int to = openat(AT_FDCWD, path, O_CREAT | O_TRUNC | O_WRONLY, 0600);

    dup2(to, fd);
    close_range((unsigned)to, (unsigned)to, 0);
    return saved;
}

static void restore(int fd, int saved)
{
    dup2(saved, fd);
    close_range((unsigned)saved, (unsigned)saved, 0);
}

static void read_text(const char *path, struct error *why)
{
    int fd = openat(AT_FDCWD, path, O_RDONLY);
    ssize_t n = read(fd, why->text, sizeof why->text - 1);

    why->text[n > 0 ? n : 0] = '\0';
    close_range((unsigned)fd, (unsigned)fd, 0);
}

static int verb_work(void *context, struct error *why)
{
    struct job *j = context;
    const struct rig *r = j->rig;
    char *words[WORDS + 2] = {(char *)"bag"};
    int argc = 1;

    for (; argc <= WORDS && j->words[argc - 1]; argc++)
        words[argc] = (char *)j->words[argc - 1];
    int saved[2] = {divert(STDOUT_FILENO, r->said), divert(STDERR_FILENO, r->told)};
    json_whole(NULL); /* what was given up before does not count */
    int code = command_bag(argc, words);
    fflush_unlocked(stdout); /* not one of those that fail */
    clearerr(stdout);
    restore(STDOUT_FILENO, saved[0]);
    restore(STDERR_FILENO, saved[1]);
    read_text(r->told, why);
    if (!why->text[0] && j->varies) /* it prints what is lost */
        read_text(r->said, why);
    return -code;
}

/* What was made is what is made when nothing fails; of an error nothing is left, or,
 * where only what it says could not be written, all. */
static void check_made(void *context, int err)
{
    struct job *j = context;
    const struct rig *r = j->rig;
    uint64_t made = take_away(r->out), said = take_away(r->said);

    check_leftovers(r);
    if (!j->has_run) {
        j->made = made;
        j->said = said;
    }
    j->has_run = true;
    if (err) {
        assert_true(err == -EXIT_FAILED || err == -EXIT_BAD_INPUT);
        assert_true(!made || made == j->made || j->varies);
        return;
    }
    assert_true(made == j->made || (made && j->varies));
    assert_true(said == j->said);
}

static void try_verb(const struct job *of)
{
    struct job j = *of;

    /* A place of the disk that cannot be read is lost; what it recovers of the
     * definitions stands elsewhere then.  That it finds all messages:
     * test_bag_failures.c. */
    j.varies = !strcmp(j.words[0], "recover");
    char name[100] = "bag";
    const struct failing_work work = {
        .name = name, .run = verb_work, .check = check_made, .context = &j};

    for (size_t i = 0; i < WORDS && j.words[i]; i++)
        if (j.words[i][0] != '/')
            snprintf(name + strlen(name), sizeof name - strlen(name), " %s", j.words[i]);
    assert_true(failing_each(&work) > 5);
}

#define VERB(...) try_verb(&(const struct job){.rig = r, .words = {__VA_ARGS__}})

/* -- the bags
 * --------------------------------------------------------------------------------
 */

static const char scene[] =
    "sound_speed_m_s: 343\n"
    "sample_rate_hz: 48000\n"
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.005}\n"
    "slot_samples: 600\n"
    "speakers_m: [[0, 0, 0], [0, 0.08, 0]]\n"
    "microphones_m: [[0.04, 0, 0], [0.04, 0.08, 0]]\n"
    "stage: {axis: [1, 0, 0], positions_m: [0, 0.04]}\n"
    "wall: {normal: [0, 0, 1], distance_m: 0.8}\n"
    "gate_m: [0.5, 1.2]\n"
    "volume: {x_m: [0.02, 0.24, 0.02], y_m: [0, 0.22, 0.02], z_m: [0.9, 1.5, 0.01]}\n"
    "seed: 1\n"
    "level: 0.02\n"
    "objects:\n"
    "  - {name: point, kind: point, position_m: [0.13, 0.11, 0.4], "
    "scattering_length_m: 0.05}\n"
    "noise: {snr_db: 30}\n";

static struct command_result result;

static void make_sound(struct rig *r)
{
    char *sim[] = {(char *)"sim", (char *)scratch_write(r->scratch, "scene.yaml", scene),
                   (char *)"--out", r->recording, NULL};
    char *import[] = {(char *)"bag", (char *)"import", r->recording,
                      (char *)"-o",  r->sound,         NULL};

    command_run(&result, command_sim, sim);
    if (result.code)
        fail_msg("%s", result.err);
    command_run(&result, command_bag, import);
    if (result.code)
        fail_msg("%s", result.err);
}

static void put(struct bag_topics *t, const struct topic *topic,
                const ProtobufCMessage *m, int64_t now_ns)
{
    uint8_t data[1024];
    struct error why = {""};
    struct envelope e = {
        .node = "test", .epoch_ns = 1, .capture_ns = now_ns, .publish_ns = now_ns + 5};

    assert_true(protobuf_c_message_get_packed_size(m) <= sizeof data);
    e.payload_size = (uint32_t)protobuf_c_message_pack(m, data);
    snprintf(e.topic, sizeof e.topic, "%s", topic->name);
    if (bag_topics_put(t, &e, data, NULL, &why))
        fail_msg("%s", why.text);
}

static void put_volume(struct bag_topics *t)
{
    float voxels[24];
    struct tensor_view view;
    Anlos__Volume v = ANLOS__VOLUME__INIT;
    Anlos__Vec3 origin = ANLOS__VEC3__INIT, step = ANLOS__VEC3__INIT;

    for (int k = 0; k < 24; k++)
        voxels[k] = (float)k;
    step.x = step.y = step.z = 0.25;
    v.origin_m = &origin;
    v.step_m = &step;
    v.scan = 1;
    v.intensity = tensor_borrow_f32(&view, voxels, 3, (size_t)4, (size_t)3, (size_t)2);
    put(t, topic_volume(), &v.base, 2000000000);
}

static void put_detections(struct bag_topics *t, uint32_t i)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, *all[] = {&d};
    Anlos__Vec3 at = ANLOS__VEC3__INIT;
    double covariance[] = {1, 0, 0, 4, 0, 6}, velocity[2] = {0, 1},
           velocity_covariance[3] = {1, 0, 1};

    at.x = 1.5;
    d.id = 7;
    d.position_m = d.virtual_m = &at;
    d.covariance_m2 = covariance;
    d.n_covariance_m2 = 6;
    d.velocity_m_s = velocity;
    d.n_velocity_m_s = 2;
    d.velocity_covariance_m2_s2 = velocity_covariance;
    d.n_velocity_covariance_m2_s2 = 3;
    d.existence = 0.75;
    list.scan = 1;
    list.counter = i;
    list.tracked = list.mirrored = list.in_vehicle_frame = true;
    list.detections = all;
    list.n_detections = 1;
    put(t, topic_detections(), &list.base, 2000000000 + (int64_t)i * 100000000);
}

/* An image and lists, with an attachment. */
static void make_bag(struct rig *r)
{
    const struct bag_writer_config cfg = {
        .profile = "anlos", .library = "test", .chunk_size = 400, .compression = BAG_LZ4};
    const struct bag_attachment a = {.name = bytes_of("a.txt"),
                                     .media_type = bytes_of("text/plain"),
                                     .data = bytes_of("a")};
    struct error why = {""};
    struct bag_writer *w;
    struct bag_topics *t;

    if (bag_writer_create(&w, r->bag, &cfg, &why))
        fail_msg("%s", why.text);
    assert_int_equal(bag_topics_create(&t, w), 0);
    assert_int_equal(bag_writer_attachment(w, &a, &why), 0);
    put_volume(t);
    for (uint32_t i = 0; i < 5; i++)
        put_detections(t, i);
    bag_topics_destroy(t);
    assert_int_equal(bag_writer_close(w, &why), 0);
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scratch_in_memory(NULL) || scratch_open((void **)&r->scratch))
        return -1;
    snprintf(r->recording, sizeof r->recording, "%s/r", r->scratch->folder);
    snprintf(r->sound, sizeof r->sound, "%s/sound.mcap", r->scratch->folder);
    snprintf(r->bag, sizeof r->bag, "%s/b.mcap", r->scratch->folder);
    snprintf(r->both, sizeof r->both, "%s/both.mcap", r->scratch->folder);
    snprintf(r->out, sizeof r->out, "%s/out", r->scratch->folder);
    snprintf(r->said, sizeof r->said, "%s/said", r->scratch->folder);
    snprintf(r->told, sizeof r->told, "%s/told", r->scratch->folder);
    make_sound(r);
    make_bag(r);
    char *merge[] = {(char *)"bag", (char *)"merge", r->bag, r->sound,
                     (char *)"-o",  r->both,         NULL};
    command_run(&result, command_bag, merge);
    if (result.code)
        return -1;
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

static void a_bag_that_cannot_be_looked_at_is_told(void **state)
{
    const struct rig *r = *state;

    VERB("info", r->bag);
    VERB("info", r->bag, "--json");
    VERB("check", r->bag);
}

static void a_bag_that_cannot_be_copied_leaves_nothing(void **state)
{
    const struct rig *r = *state;

    VERB("filter", r->bag, "-o", r->out, "--topics", "detections", "--end", "1");
    VERB("merge", r->bag, r->sound, "-o", r->out, "--compression", "none");
    VERB("filter", r->bag, "-o", r->out, "--topics", "volume", "--shuffle");
    VERB("recover", r->bag, "-o", r->out);
}

static void an_export_that_fails_leaves_nothing(void **state)
{
    const struct rig *r = *state;

    VERB("export", r->bag, "-o", r->out, "--format", "json", "--full");
    VERB("export", r->bag, "-o", r->out, "--format", "csv");
    VERB("export", r->bag, "-o", r->out, "--format", "nrrd");
    VERB("export", r->bag, "-o", r->out, "--format", "png");
    VERB("export", r->both, "-o", r->out, "--format", "foxglove");
    VERB("export", r->bag, "-o", r->out, "--format", "osi");
    VERB("export", r->sound, "-o", r->out, "--format", "wav");
}

static void an_import_that_fails_leaves_nothing(void **state)
{
    const struct rig *r = *state;

    VERB("import", r->recording, "-o", r->out);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bag_that_cannot_be_looked_at_is_told),
        cmocka_unit_test(a_bag_that_cannot_be_copied_leaves_nothing),
        cmocka_unit_test(an_export_that_fails_leaves_nothing),
        cmocka_unit_test(an_import_that_fails_leaves_nothing),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
