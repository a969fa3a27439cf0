/* SPDX-License-Identifier: MIT */
/* `anlos bag export --format foxglove` on a bag of the samples. */
#include "tests/hal/folder.h"
#include "tests/hal/scratch.h"

#include <sched.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <unistd.h>

#include "msgs/array.pb-c.h"
#include "msgs/bag/topic_message.h"
#include "nodes/anlos/bag/stream.h"
#include "nodes/anlos/commands.h"
#include "nodes/foxglove/channels.h"
#include "tests/nodes/command.h"
#include "tests/nodes/foxglove_samples.h"

static struct command_result result;

struct rig {
    char folder[64], in[96], out[96];
    struct samples samples;
    int64_t t_ns;
    uint64_t n;
    struct bag_writer *writer;
    struct bag_topics *topics;
};

static void put(struct rig *r, const struct foxglove_message *m)
{
    size_t size = protobuf_c_message_get_packed_size(m->content);
    uint8_t *data = malloc(size + 1);
    struct envelope e = {.epoch_ns = 1,
                         .sequence = r->n++,
                         .capture_ns = m->capture_ns,
                         .publish_ns = r->t_ns++,
                         .payload_size = (uint32_t)size};
    struct error why;

    assert_non_null(data);
    snprintf(e.topic, sizeof e.topic, "%s", m->topic->name);
    snprintf(e.node, sizeof e.node, "%s", m->node);
    protobuf_c_message_pack(m->content, data);
    assert_int_equal(bag_topics_put(r->topics, &e, data, NULL, &why), 0);
    free(data);
}

/* An image that comes before its survey, as in a bag that was cut out of a longer one. */
static void write_samples(struct rig *r, bool survey)
{
    const struct bag_writer_config cfg = {.profile = "anlos", .library = "test"};
    const struct bag_attachment a = {.name = bytes_of("note"),
                                     .media_type = bytes_of("text/plain"),
                                     .data = bytes_of("kept")};
    struct error why;

    assert_int_equal(bag_writer_create(&r->writer, r->in, &cfg, &why), 0);
    assert_int_equal(bag_topics_create(&r->topics, r->writer), 0);
    assert_int_equal(bag_writer_attachment(r->writer, &a, &why), 0);
    r->t_ns = SAMPLE_PUBLISH_NS;
    struct foxglove_message all[] = {
        samples_volume(&r->samples), samples_survey(&r->samples),
        samples_stage(&r->samples),  samples_detections(&r->samples),
        samples_log(&r->samples),
    };
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (survey || all[i].topic != topic_survey())
            put(r, &all[i]);
    bag_topics_destroy(r->topics);
    assert_int_equal(bag_writer_close(r->writer, &why), 0);
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    struct scratch *s;

    if (!r || scratch_open(state) || !samples_open(&r->samples))
        return -1;
    s = *state;
    snprintf(r->folder, sizeof r->folder, "%s", s->folder);
    snprintf(r->in, sizeof r->in, "%s/in.mcap", r->folder);
    snprintf(r->out, sizeof r->out, "%s/out.mcap", r->folder);
    free(s);
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    samples_close(&r->samples);
    int err = folder_remove(r->folder);
    free(r);
    return err;
}

static int export_by(int (*command)(int, char **), const char *in, const char *out,
                     const char *option, const char *value)
{
    char *words[] = {(char *)"bag",      (char *)"export",
                     (char *)in,         (char *)"-o",
                     (char *)out,        (char *)"--format",
                     (char *)"foxglove", (char *)option,
                     (char *)value,      NULL};

    command_run(&result, command, words);
    return result.code;
}

static int export(const char *in, const char *out, const char *option, const char *value)
{
    return export_by(command_bag, in, out, option, value);
}

/* How many messages there are of a topic. */
static int count(const char *path, const char *topic)
{
    struct stream *s;
    struct stream_message m;
    struct error why;
    int n = 0;

    assert_int_equal(stream_open(&s, path, &why), 0);
    while (!stream_next(s, &m, &why))
        n += bytes_equal(m.channel->topic, bytes_of(topic));
    stream_close(s);
    return n;
}

static void everything_is_there_and_what_foxglove_draws(void **state)
{
    static const struct {
        const char *topic;
        int n;
    } cases[] = {
        {"survey", 1},      {"volume", 1},     {"detections", 1},   {"stage/state", 1},
        {"log", 1},         {"view/cloud", 1}, {"view/voxels", 1},  {"view/front", 1},
        {"view/top", 1},    {"view/side", 1},  {"view/objects", 1}, {"view/scene", 1},
        {"view/frames", 2}, {"view/log", 1},   {"view/figures", 1},
    };
    struct rig *r = *state;

    write_samples(r, true);
    if (export(r->in, r->out, NULL, NULL))
        fail_msg("%s", result.err);
    assert_non_null(strstr(result.out, "5 messages, and 11 made of them"));
    assert_string_equal(result.err, "");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        if (count(r->out, cases[i].topic) != cases[i].n)
            fail_msg("%s", cases[i].topic);
}

static void a_message_is_what_a_live_client_gets_with_its_sources_times(void **state)
{
    struct rig *r = *state;
    struct stream *s;
    struct stream_message m;
    struct error why;
    struct setting setting = {.has_survey = false};
    struct channel c;
    uint8_t *expected;
    size_t size, i = 0;

    write_samples(r, true);
    assert_int_equal(export(r->in, r->out, NULL, NULL), 0);
    const struct foxglove_message survey = samples_survey(&r->samples),
                                  volume = samples_volume(&r->samples);
    setting_take(&setting, &survey);
    do
        channel_get(i++, &c);
    while (strcmp(c.name, "view/cloud"));
    assert_int_equal(channel_pack(&c, &setting, &volume, &expected, &size), 0);

    assert_int_equal(stream_open(&s, r->out, &why), 0);
    stream_select(s, "view/cloud");
    assert_int_equal(stream_next(s, &m, &why), 0);
    assert_int_equal(m.payload.size, size);
    assert_memory_equal(m.payload.data, expected, size);
    assert_int_equal(m.raw.log_time, SAMPLE_PUBLISH_NS);
    assert_int_equal(m.raw.publish_time, SAMPLE_CAPTURE_NS);
    assert_int_equal(stream_catalog(s)->n_attachments, 1);
    stream_close(s);
    free(expected);
    setting_clear(&setting);
}

static void made_of_what_was_made_it_is_the_same(void **state)
{
    struct rig *r = *state;
    char command[256], again[96];

    write_samples(r, true);
    assert_int_equal(export(r->in, r->out, NULL, NULL), 0);
    snprintf(again, sizeof again, "%s/again.mcap", r->folder);
    assert_int_equal(export(r->out, again, NULL, NULL), 0);
    assert_non_null(strstr(result.out, "5 messages, and 11 made of them"));
    snprintf(command, sizeof command, "cmp '%s' '%s'", r->out, again);
    assert_int_equal(system(command), 0);
}

static void without_a_survey_there_is_nothing_to_draw(void **state)
{
    struct rig *r = *state;

    write_samples(r, false);
    assert_int_equal(export(r->in, r->out, NULL, NULL), 2);
    assert_non_null(strstr(result.err, "survey"));
    assert_int_equal(access(r->out, F_OK), -1);
}

/* The survey is there, and not that of the image. */
static void an_image_of_another_survey_is_left_out_and_said(void **state)
{
    struct rig *r = *state;

    r->samples.volume.survey_id++;
    write_samples(r, true);
    assert_int_equal(export(r->in, r->out, NULL, NULL), 0);
    assert_non_null(strstr(result.err, "2 could not be made")); /* cloud, voxels */
    assert_int_equal(count(r->out, "view/cloud"), 0);
    assert_int_equal(count(r->out, "view/front"), 1);
}

/* Of a bag that holds nothing else: what a recording's sound becomes. */
static void sound_comes_only_when_it_is_asked_for(void **state)
{
    struct rig *r = *state;
    const struct bag_writer_config cfg = {.profile = "anlos", .library = "test"};
    const struct foxglove_message survey = samples_survey(&r->samples);
    Anlos__Ping ping = ANLOS__PING__INIT;
    const struct foxglove_message sound = {
        .topic = topic_ping(), .node = "array", .content = &ping.base};
    struct error why;

    assert_int_equal(bag_writer_create(&r->writer, r->in, &cfg, &why), 0);
    assert_int_equal(bag_topics_create(&r->topics, r->writer), 0);
    put(r, &survey);
    put(r, &sound);
    put(r, &sound);
    bag_topics_destroy(r->topics);
    assert_int_equal(bag_writer_close(r->writer, &why), 0);
    assert_int_equal(export(r->in, r->out, NULL, NULL), 0);
    assert_non_null(strstr(result.out, "2 of sound are left out"));
    assert_int_equal(count(r->out, "ping"), 0);
    assert_int_equal(count(r->out, "survey"), 1);
    assert_int_equal(unlink(r->out), 0);
    assert_int_equal(export(r->in, r->out, "--full", NULL), 0);
    assert_null(strstr(result.out, "left out"));
    assert_int_equal(count(r->out, "ping"), 2);
}

static void options_that_mean_nothing_here_are_refused(void **state)
{
    struct rig *r = *state;

    write_samples(r, true);
    assert_int_equal(export(r->in, r->out, "--scan", "1"), 2);
    assert_int_equal(export(r->in, r->out, "--topic", "volume"), 2);
    assert_int_equal(access(r->out, F_OK), -1);
    assert_int_equal(export(r->in, r->in, NULL, NULL), 2);
    assert_non_null(strstr(result.err, "exists already"));
}

static bool holds_only(const char *folder, const char *name)
{
    char command[128];

    snprintf(command, sizeof command, "test \"$(ls '%s')\" = '%s'", folder, name);
    return !system(command);
}

/* The bag's command on a disk of 8 kB at disk/, in a process of its own, whose mounts
 * end with it. */
static int command_on_a_small_disk(int argc, char **argv)
{
    char disk[96];

    strcpy(disk, argv[4]);
    *strrchr(disk, '/') = '\0';
    if (mkdir(disk, 0777) || unshare(CLONE_NEWNS) ||
        mount(NULL, "/", NULL, MS_REC | MS_PRIVATE, NULL) ||
        mount("tmpfs", disk, "tmpfs", 0, "size=8k"))
        return 77;
    int code = command_bag(argc, argv);
    return holds_only(disk, "") ? code : 78;
}

static void a_full_disk_is_said_and_leaves_nothing(void **state)
{
    struct rig *r = *state;
    char out[128];

    write_samples(r, true);
    snprintf(out, sizeof out, "%s/disk/out.mcap", r->folder);
    int code = export_by(command_on_a_small_disk, r->in, out, NULL, NULL);
    if (code == 77) {
        print_message("mounting is not allowed here\n");
        skip();
    }
    assert_int_equal(code, 1);
    assert_contains(result.err, "No space left");
}

static void a_file_that_may_not_grow_is_said_and_leaves_nothing(void **state)
{
    struct rig *r = *state;
    struct rlimit old, tight = {.rlim_cur = 5000};

    write_samples(r, true);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    tight.rlim_max = old.rlim_max;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &tight), 0);
    int code = export(r->in, r->out, NULL, NULL);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
    signal(SIGXFSZ, SIG_DFL);
    assert_int_equal(code, 2);
    assert_contains(result.err, "File too large");
    assert_true(holds_only(r->folder, "in.mcap"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(everything_is_there_and_what_foxglove_draws),
        TEST(a_message_is_what_a_live_client_gets_with_its_sources_times),
        TEST(made_of_what_was_made_it_is_the_same),
        TEST(without_a_survey_there_is_nothing_to_draw),
        TEST(an_image_of_another_survey_is_left_out_and_said),
        TEST(options_that_mean_nothing_here_are_refused),
        TEST(sound_comes_only_when_it_is_asked_for),
        TEST(a_full_disk_is_said_and_leaves_nothing),
        TEST(a_file_that_may_not_grow_is_said_and_leaves_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
