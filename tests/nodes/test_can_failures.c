/* SPDX-License-Identifier: MIT */
/* The vehicle's frames while memory, disk or file give out, at every place where they
 * may; and what says where they go. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <unistd.h>

#include "msgs/detections.pb-c.h"
#include "msgs/health.pb-c.h"
#include "msgs/save.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/can/outbox.h"
#include "nodes/can/sender.h"
#include "nodes/can/vehicle.h"
#include "tests/failing.h"

enum { LISTS = 3, LINES = 2 }; /* a header and a time to each list */

struct rig {
    struct scratch *scratch;
    struct launchfile launch;
    char uri[1024], launch_path[1024];
    struct fake_clock clock;
    uint64_t sent, dropped;
};

static void put_list(struct rig *r, struct sender *s, struct outbox *o, uint32_t counter)
{
    Anlos__DetectionList message = ANLOS__DETECTION_LIST__INIT;
    struct sender_list list;

    message.counter = counter;
    sender_list(s, &message, r->clock.now_ns, &list);
    outbox_put_list(o, &list);
}

/* Each list until it is out or dropped; what was not written is tried again. */
static int send_lists(struct rig *r, struct canbus *bus, struct error *why)
{
    struct sender_config cfg;
    static struct sender s;
    static struct outbox o;
    char text[320];
    int err = 0;

    sender_config_set(&cfg, NULL);
    sender_init(&s, &cfg);
    outbox_init(&o, bus, &r->clock.source, &s);
    for (uint32_t i = 0; i < LISTS; i++) {
        put_list(r, &s, &o, i);
        for (int k = 0; k < 20; k++, r->clock.now_ns += 50000000) {
            outbox_step(&o);
            if (!outbox_well(&o, text, sizeof text))
                err = error_say(why, -EIO, "%s", text);
        }
    }
    r->sent = o.sent;
    r->dropped = o.dropped;
    return err;
}

static int can_work(void *context, struct error *why)
{
    struct rig *r = context;
    struct canbus *bus;

    r->sent = r->dropped = 0;
    int err = vehicle_bus_open(&bus, &r->launch, why);
    if (err)
        return err;
    err = send_lists(r, bus, why);
    canbus_close(bus);
    return err;
}

/* Whole lines, and of every list that went out all of them: nothing is lost untold. */
static void check_log(void *context, int err)
{
    const struct rig *r = context;
    FILE *f = fopen(scratch_path(r->scratch, "x.candump"), "r");
    char line[256];
    size_t n = 0;

    for (; f && fgets(line, sizeof line, f); n++) {
        assert_non_null(strchr(line, '\n'));
        assert_int_equal(line[0], '(');
        assert_contains(line, n % LINES ? ") can0 403#" : ") can0 402#");
    }
    if (f)
        fclose(f);
    assert_int_equal(n, LINES * r->sent);
    if (!err)
        assert_int_equal(r->sent, LISTS);
    else if (r->sent + r->dropped)
        assert_int_equal(r->sent + r->dropped, LISTS);
    unlink(r->scratch->path);
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scratch_open((void **)&r->scratch))
        return -1;
    fake_clock_set(&r->clock, 1000000000);
    snprintf(r->uri, sizeof r->uri, "log:%s", scratch_path(r->scratch, "x.candump"));
    r->launch.can.uri = r->uri;
    r->launch.report.folder = r->scratch->folder;
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

static void no_frame_is_lost_untold_in_a_log(void **state)
{
    struct rig *r = *state;
    const struct failing_work work = {
        .name = "a log of frames", .run = can_work, .check = check_log, .context = r};

    assert_true(failing_each(&work) > 10);
}

static int launch_work(void *context, struct error *why)
{
    const struct rig *r = context;
    bool plays = strstr(r->launch_path, "play.yaml");
    const struct launchfile_options options = {.out = "/tmp/out",
                                               .bag = plays ? "a.mcap" : NULL,
                                               .rate = plays ? "2" : NULL,
                                               .record = "b.mcap"};
    struct launchfile *l = NULL;
    int err = launchfile_load(&l, r->launch_path, &options, why);

    if (!err) {
        assert_string_equal(l->report.folder, "/tmp/out");
        assert_string_equal(l->record.path, "b.mcap");
        assert_true(launchfile_has_node(l, "record"));
    }
    launchfile_destroy(l);
    assert_int_not_equal(err, -EINVAL); /* the file is as it should be */
    return err;
}

static void every_failure_while_a_launch_file_is_read_is_told(void **state)
{
    static const char *const files[] = {"demo.yaml", "drive.yaml", "play.yaml",
                                        "two-hosts.yaml"};
    struct rig *r = *state;

    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        const struct failing_work work = {
            .name = files[i], .run = launch_work, .context = r};
        snprintf(r->launch_path, sizeof r->launch_path, "%s/launch/%s", SOURCE_DIR,
                 files[i]);
        assert_true(failing_each(&work) > 5);
    }
}

/* -- the node
 * -------------------------------------------------------------------------------
 */

struct node_job {
    struct arguments arguments;
    char launch_path[512], log_path[512];
    bool has_run;
    struct detection_list {
        Anlos__DetectionList list;
        Anlos__Detection detection, *all[1];
        Anlos__Vec3 at;
    } said;
};

/* Each kind of message once, and a list; then its end, which does not wait. */
static int take_all(struct vehicle *v, struct node_job *j)
{
    Anlos__ScanStatus status = ANLOS__SCAN_STATUS__INIT;
    Anlos__Survey survey = ANLOS__SURVEY__INIT;
    Anlos__Health health = ANLOS__HEALTH__INIT;
    Anlos__WallList walls = ANLOS__WALL_LIST__INIT;
    Anlos__SaveStatus saved = ANLOS__SAVE_STATUS__INIT;
    const ProtobufCMessage *const contents[] = {&j->said.list.base, &status.base,
                                                &survey.base,       &health.base,
                                                &walls.base,        &saved.base};
    int err = 0;

    for (size_t i = 0; !err && vehicle_loop.inputs[i].topic; i++) {
        struct node_message in = {.topic = vehicle_loop.inputs[i].topic(),
                                  .content = contents[i],
                                  .epoch_ns = 5,
                                  .capture_ns = 1000,
                                  .publish_ns = 2000};
        strcpy(in.from, topic_publisher(in.topic, 0));
        assert_ptr_equal(contents[i]->descriptor, in.topic->schema);
        err = vehicle_loop.inputs[i].take(v, &in);
        if (!err)
            err = vehicle_loop.timers[0].run(v);
    }
    vehicle_loop.end(v, -EIO);
    return err;
}

static int node_work(void *context, struct error *why)
{
    struct node_job *j = context;
    struct vehicle *v = NULL;
    struct node *n;
    int err = node_start(&n, "can", &j->arguments, why);

    if (err)
        return err;
    err = vehicle_open(&v, n, why);
    if (!err)
        err = take_all(v, j);
    vehicle_loop.close(v);
    node_finish(n, NODE_TOLD);
    return err;
}

/* Whole lines; the list is in there once where nothing fails, and never twice. */
static void check_node(void *context, int err)
{
    struct node_job *j = context;
    FILE *f = fopen(j->log_path, "r");
    size_t headers = 0;
    char line[256];

    while (f && fgets(line, sizeof line, f)) {
        assert_non_null(strchr(line, '\n'));
        headers += strstr(line, " 402#") != NULL;
    }
    if (f)
        fclose(f);
    assert_in_range(headers, !err && !j->has_run, 1);
    j->has_run = true;
    unlink(j->log_path);
}

static void prepare_node(struct node_job *j, struct rig *r, const char *uri)
{
    char text[700];

    *j = (struct node_job){.said = {.list = ANLOS__DETECTION_LIST__INIT,
                                    .detection = ANLOS__DETECTION__INIT,
                                    .at = ANLOS__VEC3__INIT}};
    snprintf(j->log_path, sizeof j->log_path, "%s",
             scratch_path(r->scratch, "can.candump"));
    snprintf(text, sizeof text,
             "nodes: [track, can]\ncan: {uri: '%s'}\nreport: {folder: %s}\n", uri,
             r->scratch->folder);
    snprintf(j->launch_path, sizeof j->launch_path, "%s",
             scratch_write(r->scratch, "can.yaml", text));
    j->arguments = (struct arguments){.launch = j->launch_path,
                                      .run_dir = r->scratch->folder,
                                      .log_level = LOG_LEVEL_ERROR};
    j->said.all[0] = &j->said.detection;
    j->said.at.x = 3.0;
    j->said.detection.position_m = &j->said.at;
    j->said.detection.existence = 0.9;
    j->said.list.counter = 1;
    j->said.list.in_vehicle_frame = true;
    j->said.list.detections = j->said.all;
    j->said.list.n_detections = 1;
}

static void a_node_that_cannot_start_says_why(void **state)
{
    static const char *const uris[] = {
        "log:can.candump",
        "sim:" SOURCE_DIR "/launch/scenes/drive-person.yaml?log=can.candump"};
    static struct node_job j;
    const struct failing_work work = {
        .name = "the node can", .run = node_work, .check = check_node, .context = &j};

    for (size_t i = 0; i < 2; i++) {
        prepare_node(&j, *state, uris[i]);
        assert_true(failing_each(&work) > 50);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(no_frame_is_lost_untold_in_a_log),
        TEST(every_failure_while_a_launch_file_is_read_is_told),
        TEST(a_node_that_cannot_start_says_why),
    };
    return cmocka_run_group_tests(tests, scratch_in_memory, NULL);
}
