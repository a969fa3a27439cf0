/* SPDX-License-Identifier: MIT */
/* "Save the last 30 s" of a system of real processes, asked for in each way, and what is
 * saved is imaged by itself. */
#include "snapshot_launch.h"

static void say_fault(struct system *y)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__Fault f = ANLOS__FAULT__INIT, *list[] = {&f};

    f.name = (char *)"channels_silent";
    f.count = f.of = 1;
    h.node = (char *)"stage";
    h.text = (char *)"";
    h.priority = (char *)"";
    h.faults = list;
    h.n_faults = 1;
    assert_int_equal(bus_publish_message(y->bus, topic_health(), 0, now_ns(), &h.base),
                     0);
}

/* Until so many bags are complete, the newest of that reason; its path.  What is missing
 * of it is told in the bag as well.  act is done until then, whenever the recorder
 * speaks; or NULL. */
static void await_bag(struct system *y, uint64_t n, void (*act)(struct system *y),
                      const char *reason, char path[512])
{
    uint64_t saved = 0;
    char text[256];

    while (saved < n) {
        if (act)
            act(y);
        Anlos__SaveStatus *t = (Anlos__SaveStatus *)hear(y, topic_save_status());
        saved = t->saved;
        assert_string_equal(t->error, "");
        snprintf(path, 512, "%s", t->path);
        if (saved == n) {
            assert_int_equal(t->missing - y->missing, count_lost(path));
            y->missing = t->missing;
        }
        anlos__save_status__free_unpacked(t, NULL);
    }
    assert_int_equal(saved, n);
    assert_true(find_metadata(path, MANIFEST_SNAPSHOT, 0, MANIFEST_REASON, text));
    assert_string_equal(text, reason);
}

static void a_command_a_message_and_a_fault_each_save_a_bag_that_images(void **state)
{
    struct system y = {.s = *state};
    char line[512], path[512];

    start(&y, false);
    await_frame(&y, 4);
    if (run(&y, line,
            (char *[]){"anlos", "bag", "save", "by command", "--run-dir", y.s->folder,
                       NULL}))
        fail_msg("%s", line);
    await_bag(&y, 1, NULL, "by command", path);
    assert_string_equal(path, line);
    check_image(&y, path, "one");
    assert_int_equal(
        run(&y, line,
            (char *[]){"anlos", "topic", "pub", "record/save",
                       "{\"reason\": \"by topic\"}", "--run-dir", y.s->folder, NULL}),
        0);
    await_bag(&y, 2, NULL, "by topic", path);
    check_image(&y, path, "two");
    await_bag(&y, 3, say_fault, "channels_silent", path);
    check_image(&y, path, "three");
    kill(y.pid, SIGINT);
    assert_int_equal(end_of(y.pid), 130);
    bus_destroy(y.bus);
}

/* A vehicle whose event never ends: its number stays the same. */
static void an_event_of_the_vehicle_saves_one_bag_however_long_it_says_so(void **state)
{
    struct system y = {.s = *state};
    char path[512];

    start_with(&y, "can: {uri: 'sim:" SCENE "?save=stuck'}\n", true, false);
    await_bag(&y, 1, NULL, "vehicle, test, 1", path);
    assert_contains(path, "_vehicle-test-1.mcap");
    for (int i = 0; i < 3; i++) {
        Anlos__SaveStatus *t = (Anlos__SaveStatus *)hear(&y, topic_save_status());
        assert_int_equal(t->saved, 1);
        assert_int_equal(t->joined, 0);
        assert_int_equal(t->state, ANLOS__SAVE_STATUS__STATE__KEEPS);
        anlos__save_status__free_unpacked(t, NULL);
    }
    kill(y.pid, SIGINT);
    assert_int_equal(end_of(y.pid), 130);
    bus_destroy(y.bus);
}

/* What a node says of itself. */
static void await_health(struct system *y, const char *node, const char *part)
{
    bool found = false;

    while (!found) {
        Anlos__Health *h = (Anlos__Health *)hear(y, topic_health());
        found = !strcmp(h->node, node) && strstr(h->text, part);
        anlos__health__free_unpacked(h, NULL);
    }
}

static void without_a_ring_the_log_and_the_status_of_can_say_so(void **state)
{
    struct system y = {.s = *state};
    char text[16384];

    start_with(&y, "can: {uri: 'sim:" SCENE "?save=on'}\n", false, false);
    await_health(&y, "can",
                 "not saved: the vehicle's request to save (vehicle, test, 1): "
                 "nobody keeps the last seconds");
    kill(y.pid, SIGINT);
    assert_int_equal(end_of(y.pid), 130);
    FILE *f = fopen(scratch_path(y.s, "says"), "r");
    assert_non_null(f);
    text[fread(text, 1, sizeof text - 1, f)] = '\0';
    fclose(f);
    assert_contains(text, "nobody keeps the last seconds (anlos launch --snapshot)");
    bus_destroy(y.bus);
}

static void without_a_recorder_that_keeps_something_it_is_told_what_to_start(void **state)
{
    struct system y = {.s = *state};
    char line[512];

    assert_int_equal(
        run(&y, line, (char *[]){"anlos", "bag", "save", "--run-dir", y.s->folder, NULL}),
        1);
    assert_contains(line, "nothing is running in");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        SCRATCH_TEST(a_command_a_message_and_a_fault_each_save_a_bag_that_images),
        SCRATCH_TEST(an_event_of_the_vehicle_saves_one_bag_however_long_it_says_so),
        SCRATCH_TEST(without_a_ring_the_log_and_the_status_of_can_say_so),
        SCRATCH_TEST(without_a_recorder_that_keeps_something_it_is_told_what_to_start),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
