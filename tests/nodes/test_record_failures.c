/* SPDX-License-Identifier: MIT */
/* Recorders while memory, disk or file give out, at every place where they may: what is
 * in no file is counted and told, and each file that has its end is whole. */
#include "recorder_rig.h"

#include <dirent.h>
#include <errno.h>
#include <unistd.h>

#include "msgs/array.pb-c.h"
#include "msgs/bag/reader.h"
#include "msgs/health.pb-c.h"
#include "msgs/save.pb-c.h"
#include "nodes/record/record.h"
#include "nodes/record/session.h"
#include "nodes/record/snapshot.h"
#include "nodes/rt/node.h"
#include "tests/failing.h"

enum { N = 40, SURVEYS = 4, BACKGROUNDS = 3, BACKGROUND = 1000 /* its first sequence */ };

struct found { /* in one file or more */
    size_t n_files, n_whole, n_messages, n_surveys, n_backgrounds, n_attached;
    bool message[N], survey[SURVEYS];
};

/* -- what is in the files
 * ----------------------------------------------------------------
 */

/* What the messages of a channel are. */
enum kind { OTHER, SURVEY, RIG };

static enum kind kind_of(struct bytes topic)
{
    const struct topic *const rig[] = {topic_of(0), topic_of(1), topic_of(2)};
    enum kind kind = bytes_equal(topic, bytes_of("survey")) ? SURVEY : OTHER;

    for (size_t i = 0; i < 3; i++)
        if (bytes_equal(topic, bytes_of(rig[i]->name)))
            kind = RIG;
    return kind;
}

static void find_message(struct found *f, const struct bag_message *m, enum kind kind)
{
    size_t i;

    if (kind == OTHER)
        return;
    if (kind == SURVEY) {
        assert_true(m->sequence < SURVEYS);
        f->n_surveys += !f->survey[m->sequence];
        f->survey[m->sequence] = true;
        return;
    }
    if (m->sequence >= BACKGROUND) {
        f->n_backgrounds++;
        return;
    }
    memcpy(&i, m->data.data, sizeof i);
    assert_true(i < N && m->data.size == payload_size(i));
    f->n_messages += !f->message[i];
    f->message[i] = true;
}

static void find_record(struct found *f, enum kind kinds[64], const struct bag_record *r)
{
    if (r->opcode == BAG_ATTACHMENT)
        f->n_attached += bytes_equal(r->attachment.name, bytes_of("survey.yaml"));
    if (r->opcode == BAG_CHANNEL && r->channel.id < 64)
        kinds[r->channel.id] = kind_of(r->channel.topic);
    if (r->opcode == BAG_MESSAGE)
        find_message(f, &r->message, kinds[r->message.channel_id % 64]);
}

static void tell_fault(void *context, uint64_t offset, const char *what)
{
    print_error("%s, byte %zu: %s\n", (const char *)context, (size_t)offset, what);
}

static void look_into(struct found *f, const char *path)
{
    const struct bag_check_watch watch = {.fault = tell_fault, .context = (void *)path};
    enum kind kinds[64] = {OTHER};
    struct bag_record record;
    struct bag_reader *r;
    uint64_t n_faults = 0;

    f->n_files++;
    f->n_whole += !bag_check(&n_faults, path, &watch, NULL) && !n_faults;
    if (bag_reader_open(&r, path, NULL))
        return;
    while (!bag_reader_next(r, &record, NULL))
        find_record(f, kinds, &record);
    bag_reader_close(r);
}

/* Looks into all bags with such a name, which go. */
static struct found take_bags(struct rig *g, const char *name)
{
    struct found f = {0};
    DIR *d = opendir(g->scratch->folder);

    assert_non_null(d);
    for (const struct dirent *e; (e = readdir(d));) {
        if (!strstr(e->d_name, name))
            continue;
        look_into(&f, scratch_path(g->scratch, e->d_name));
        assert_int_equal(unlink(scratch_path(g->scratch, e->d_name)), 0);
    }
    closedir(d);
    return f;
}

/* -- a recorder
 * --------------------------------------------------------------------------
 */

struct job {
    struct rig *g;
    struct recorder_config cfg;
    struct bus_message survey;
    bool made;
    int ended;
    struct recorder_totals totals;
};

static int put(struct recorder *r, const struct job *j, size_t i, struct error *why)
{
    uint8_t payload[PAYLOAD_MAX];
    struct bus_message m = make_message(i, payload), survey = j->survey;
    int64_t now_ns = (int64_t)i * 100 * MS, due_ns;
    int err = 0;

    survey.envelope.sequence = i / 10;
    if (i % 10 == 3)
        err = recorder_put(r, &survey, now_ns, why);
    if (!err)
        err = recorder_put(r, &m, now_ns, why);
    return err ? err : recorder_tick(r, now_ns, &due_ns, why);
}

static int record_work(void *context, struct error *why)
{
    struct job *j = context;
    struct pairs p = {0};
    struct recorder *r;
    int err = recorder_create(&r, &j->cfg, 0, why);

    j->g->said[0] = '\0';
    j->made = !err;
    if (err)
        return err;
    pairs_text(&p, "who", "a test");
    err = recorder_pairs(r, "note", &p, why);
    pairs_clear(&p);
    for (size_t i = 0; !err && i < N; i++)
        err = put(r, j, i, why);
    recorder_lost(r, topic_ping(), 3);
    j->ended = recorder_end(r, (int64_t)N * 100 * MS, err ? NULL : why);
    recorder_sum(r, &j->totals);
    recorder_destroy(r);
    return err ? err : j->ended;
}

static void check_recording(void *context, int err)
{
    const struct job *j = context;
    struct found f = take_bags(j->g, ".mcap");

    if (!j->made || j->ended)
        return;
    /* A part whose end the disk did not take is recovered. */
    bool cut = err == -ENOSPC || err == -EIO;
    assert_in_range(f.n_whole, f.n_files - cut, f.n_files);
    assert_int_equal(f.n_messages + f.n_surveys,
                     j->totals.messages - j->totals.unwritten);
    if (err)
        return;
    assert_int_equal(f.n_messages, N);
    assert_int_equal(f.n_surveys, SURVEYS);
    if (!strstr(j->g->said, "the survey is not attached"))
        assert_int_equal(f.n_attached, f.n_files);
}

static void what_is_in_no_file_is_told(void **state)
{
    struct rig *g = *state;
    uint8_t *payload;
    struct job j = {.g = g, .survey = survey_message(g, &payload, 0)};
    const struct failing_work work = {
        .name = "recording", .run = record_work, .check = check_recording, .context = &j};

    for (int i = 0; i < 3; i++) {
        j.cfg = config(g);
        j.cfg.compression = (enum bag_compression)i;
        j.cfg.free_name = i == 1;
        j.cfg.split_ns = i ? 700 * MS : 0;
        assert_true(failing_each(&work) > 100);
    }
    free(payload);
}

/* -- the last seconds
 * --------------------------------------------------------------------
 */

#define START 1772366400000000000LL

struct ring_job {
    struct rig *g;
    struct snapshot_config cfg;
    struct bus_message survey;
    uint8_t payloads[N][PAYLOAD_MAX];
    Anlos__SaveStatus status;
};

static int64_t time_of(size_t i)
{
    return START + (int64_t)i * 100 * MS;
}

static struct bus_message head_of(const struct topic *t, const uint8_t *payload,
                                  size_t size)
{
    struct bus_message m = {.topic = t, .payload = payload};

    snprintf(m.envelope.topic, sizeof m.envelope.topic, "%s", t->name);
    snprintf(m.envelope.node, sizeof m.envelope.node, "%s", topic_publisher(t, 0));
    m.envelope.epoch_ns = EPOCH_NS;
    m.envelope.payload_size = (uint32_t)size;
    return m;
}

static void put_backgrounds(struct snapshot *s)
{
    static uint8_t room[64];
    Anlos__Ping ping = ANLOS__PING__INIT;

    ping.pass = ANLOS__PASS__BACKGROUND;
    ping.scan = 1;
    size_t size = anlos__ping__pack(&ping, room);
    for (uint64_t i = 0; i < BACKGROUNDS; i++) {
        struct bus_message m = head_of(topic_ping(), room, size);
        m.envelope.sequence = BACKGROUND + i;
        snapshot_put(s, &m, time_of(0));
    }
}

static void ask(struct snapshot *s, int64_t now_ns)
{
    static uint8_t room[64];
    Anlos__SaveRequest r = ANLOS__SAVE_REQUEST__INIT;

    r.id = 7;
    r.reason = (char *)"hand";
    size_t size = anlos__save_request__pack(&r, room);
    struct bus_message m = head_of(topic_save(), room, size);
    snapshot_put(s, &m, now_ns);
}

/* Nodes say each second what is wrong. */
static void state_fault(struct snapshot *s, int64_t now_ns)
{
    static uint8_t room[64];
    Anlos__Fault f = ANLOS__FAULT__INIT, *list[] = {&f};
    Anlos__Health h = ANLOS__HEALTH__INIT;

    f.name = (char *)"deaf";
    f.count = 1;
    h.node = (char *)"dsp";
    h.faults = list;
    h.n_faults = 1;
    size_t size = anlos__health__pack(&h, room);
    struct bus_message m = head_of(topic_health(), room, size);
    snapshot_put(s, &m, now_ns);
}

static void let_come(struct snapshot *s, struct ring_job *j)
{
    struct bus_message survey = j->survey;

    snapshot_put(s, &survey, time_of(0));
    put_backgrounds(s);
    for (size_t i = 0; i < N; i++) {
        struct bus_message m = make_message(i, j->payloads[i]);
        snapshot_put(s, &m, time_of(i));
        if (i == 20)
            ask(s, time_of(i));
        if (i == 35 || i == 36)
            state_fault(s, time_of(i));
        while (snapshot_due_ns(s) <= time_of(i))
            snapshot_step(s, time_of(i));
    }
    snapshot_end(s, time_of(N));
}

/* What it tells is its error. */
static int snapshot_work(void *context, struct error *why)
{
    struct ring_job *j = context;
    struct snapshot *s;

    j->g->said[0] = '\0';
    int err = snapshot_create(&s, &j->cfg, why);
    if (err)
        return err;
    let_come(s, j);
    snapshot_status(s, time_of(N), &j->status);
    j->status.path = j->status.error = NULL;
    snapshot_destroy(s);
    if (j->status.failed || j->status.refused || j->status.missing)
        return error_say(why, -EIO, "%s", j->g->said);
    return 0;
}

static void check_range(struct rig *g, const char *name, size_t first, size_t last)
{
    struct found f = take_bags(g, name);

    assert_int_equal(f.n_files, 1);
    assert_int_equal(f.n_whole, 1);
    for (size_t i = first; i <= last; i++)
        if (!f.message[i])
            fail_msg("message %zu is not in the bag, and that is not told: %s", i,
                     g->said);
    assert_true(f.survey[0]);
    if (!strstr(g->said, "has none to subtract"))
        assert_int_equal(f.n_backgrounds, BACKGROUNDS);
}

static void check_snapshots(void *context, int err)
{
    const struct ring_job *j = context;

    if (!err) {
        check_range(j->g, "_hand.mcap", 10, 25);
        check_range(j->g, "_deaf.mcap", 26, N - 1);
    }
    take_bags(j->g, ".mcap");
}

static void what_is_not_saved_of_the_last_seconds_is_told(void **state)
{
    struct rig *g = *state;
    uint8_t *payload;
    static struct ring_job j;
    const struct failing_work work = {
        .name = "saving", .run = snapshot_work, .check = check_snapshots, .context = &j};

    j.g = g;
    j.survey = survey_message(g, &payload, 0);
    for (int i = 0; i < 3; i++) {
        j.cfg = (struct snapshot_config){.folder = g->scratch->folder,
                                         .before_ns = 1000 * MS,
                                         .after_ns = 500 * MS,
                                         .max_bytes = 10000000,
                                         .on_faults = true,
                                         .topics = g->choice.topics,
                                         .n_topics = g->choice.n,
                                         .compression = (enum bag_compression)i,
                                         .session = &g->session,
                                         .say = hear,
                                         .context = g};
        assert_true(failing_each(&work) > 100);
    }
    free(payload);
}

/* -- what a recording says of itself, and the node
 * ---------------------------------------------------------------------------------------
 */

struct node_job {
    struct rig *g;
    struct launchfile *launch;
    struct arguments arguments;
    char launch_path[512], saved[512];
};

static int session_work(void *context, struct error *why)
{
    const struct node_job *j = context;
    struct error left_out = {""};
    struct session s = {.topics = "*"};
    struct choice c;
    int err = choice_make(&c, "*", "health,log", why);

    if (err)
        return err;
    err = session_add_launch(&s, j->launch, &left_out, why);
    if (!err) /* the launch file, its scene and the rig that it names */
        assert_true(s.attachments.n == 3 || strchr(left_out.text, ' '));
    session_clear(&s);
    choice_clear(&c);
    return err;
}

static int node_work(void *context, struct error *why)
{
    const struct node_job *j = context;
    struct record *r = NULL;
    struct node *n;
    int err = node_start(&n, "record", &j->arguments, why);

    if (err)
        return err;
    err = record_open(&r, n, why);
    for (const struct loop_timer *t = record_loop.timers; !err && t->run; t++)
        err = t->run(r);
    if (!err && record_loop.end(r, -ESHUTDOWN) == NODE_TOLD)
        err = error_say(why, -EIO, "as logged");
    record_loop.close(r);
    node_finish(n, NODE_TOLD);
    return err;
}

/* Of a node that has recorded nothing the bag is whole all the same. */
static void check_node(void *context, int err)
{
    const struct node_job *j = context;
    struct found f = take_bags(j->g, ".mcap");

    if (!err)
        assert_int_equal(f.n_whole, 1);
}

static void open_launch(struct node_job *j, struct rig *g)
{
    struct launchfile_options options = {.record = g->bag, .snapshot = j->saved};
    struct error why = {""};

    j->g = g;
    snprintf(j->saved, sizeof j->saved, "%s", scratch_path(g->scratch, "saved"));
    scratch_write(g->scratch, "scene.yaml", "objects: []\n");
    scratch_write(g->scratch, "rig.yaml", "cards: []\n");
    snprintf(
        j->launch_path, sizeof j->launch_path, "%s",
        scratch_write(g->scratch, "launch.yaml",
                      "nodes: [record]\narray: {uri: 'sim:scene.yaml?rig=rig.yaml'}\n"
                      "record: {topics: 'ping,survey'}\n"));
    if (launchfile_load(&j->launch, j->launch_path, &options, &why))
        fail_msg("%s", why.text);
    j->arguments = (struct arguments){.launch = j->launch_path,
                                      .record = g->bag,
                                      .snapshot = j->saved,
                                      .run_dir = g->scratch->folder,
                                      .log_level = LOG_LEVEL_ERROR};
}

static void what_a_recording_cannot_say_of_itself_is_told(void **state)
{
    struct node_job j;
    const struct failing_work work = {
        .name = "a session", .run = session_work, .context = &j};

    open_launch(&j, *state);
    assert_true(failing_each(&work) > 10);
    launchfile_destroy(j.launch);
}

static void a_recorder_that_cannot_start_says_why(void **state)
{
    struct node_job j;
    const struct failing_work work = {
        .name = "the node record", .run = node_work, .check = check_node, .context = &j};

    open_launch(&j, *state);
    assert_true(failing_each(&work) > 50);
    launchfile_destroy(j.launch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        RIG_TEST(what_is_in_no_file_is_told),
        RIG_TEST(what_is_not_saved_of_the_last_seconds_is_told),
        RIG_TEST(what_a_recording_cannot_say_of_itself_is_told),
        RIG_TEST(a_recorder_that_cannot_start_says_why),
    };
    return cmocka_run_group_tests(tests, scratch_in_memory, NULL);
}
