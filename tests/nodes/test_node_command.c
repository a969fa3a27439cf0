/* SPDX-License-Identifier: MIT */
/* `anlos node` on processes of a system that this test starts. */
#include "tests/hal/scratch.h"

#include <jansson.h>
#include <signal.h>
#include <unistd.h>

#include "msgs/topics.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/feed.h"
#include "tests/nodes/command.h"
#include "tests/nodes/living.h"

static struct scratch *scratch;
static char run_dir[128];

static int set_up(void **state)
{
    (void)state;
    if (scratch_open((void **)&scratch))
        return -1;
    snprintf(run_dir, sizeof run_dir, "%s/run", scratch->folder);
    return 0;
}

static int tear_down(void **state)
{
    void *s = scratch;

    (void)state;
    return scratch_close(&s);
}

static void run(struct command_result *r, const char *a, const char *b, const char *c)
{
    char *words[8] = {(char *)"node", (char *)"--run-dir", run_dir};
    const char *more[] = {a, b, c};
    int n = 3;

    for (int i = 0; i < 3 && more[i]; i++)
        words[n++] = (char *)more[i];
    command_run(r, command_node, words);
}

static json_t *parse(const struct command_result *r)
{
    json_error_t why;
    json_t *o = json_loads(r->out, 0, &why);

    if (!o)
        fail_msg("%s: %s", why.text, r->out);
    return o;
}

static const char *word(const json_t *list, const char *node, const char *key)
{
    const json_t *item;
    size_t i;

    json_array_foreach(list, i, item)
    {
        if (!strcmp(json_string_value(json_object_get(item, "node")), node))
            return json_string_value(json_object_get(item, key));
    }
    fail_msg("%s is not in the list", node);
    return NULL;
}

static Anlos__Health ready(const char *text)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;

    h.state = ANLOS__HEALTH__STATE__READY;
    h.text = (char *)text;
    h.rss_bytes = 12000000;
    return h;
}

static void an_empty_folder_has_no_nodes_and_stays_away(void **state)
{
    struct command_result r;

    (void)state;
    run(&r, "list", NULL, NULL);
    assert_int_equal(r.code, 1);
    assert_contains(r.err, "nothing is running in");
    for (const char *const *n = topics_nodes(); *n; n++)
        assert_contains(r.out, *n);
    assert_int_equal(access(run_dir, F_OK), -1);
}

static void the_living_the_dead_and_the_unborn_are_told_apart(void **state)
{
    Anlos__Health h = ready("512 pings imaged");
    struct command_result r;
    char pid_text[24];

    (void)state;
    living_end(living_start(run_dir, "dsp", LIVING, &h), SIGKILL);
    living_end(living_start(run_dir, "track", LIVING, &h), SIGTERM);
    pid_t recon = living_start(run_dir, "recon", LIVING, &h);
    pid_t can = living_start(run_dir, "can", LIVING_SILENT, &h);
    run(&r, "list", "--json", NULL);
    assert_int_equal(r.code, 0);
    json_t *list = parse(&r);
    assert_string_equal(word(list, "recon", "process"), "alive");
    assert_string_equal(word(list, "recon", "state"), "ready");
    assert_string_equal(word(list, "recon", "text"), "512 pings imaged");
    assert_string_equal(word(list, "can", "process"), "silent");
    assert_string_equal(word(list, "dsp", "process"), "died");
    assert_string_equal(word(list, "track", "process"), "ended");
    assert_string_equal(word(list, "scan", "process"), "never");
    json_decref(list);
    living_end(can, SIGKILL);
    run(&r, "list", NULL, NULL);
    assert_int_equal(r.code, 0);
    snprintf(pid_text, sizeof pid_text, " %d ", (int)recon);
    assert_contains(r.out, pid_text);
    assert_contains(r.out, "512 pings imaged");
    assert_contains(r.out, "killed or crashed");
    assert_contains(r.out, "`anlos view` that looks on is not listed");
    living_end(recon, SIGTERM);
}

static void info_has_topics_losses_queue_device_and_endpoints(void **state)
{
    Anlos__Health h = ready("all is well");
    Anlos__TopicCount in = ANLOS__TOPIC_COUNT__INIT, out = in, idle = in;
    Anlos__TopicCount *topics[] = {&in, &out, &idle};
    Anlos__DeviceCount overruns = ANLOS__DEVICE_COUNT__INIT, *device[] = {&overruns};
    struct command_result r;
    char endpoint[256];

    (void)state;
    in.topic = (char *)"ping";
    in.messages = 700;
    in.gaps = 5;
    in.dropped = 11;
    in.queued = 13;
    out.topic = (char *)"traces";
    out.published = 1;
    out.messages = 684;
    idle.topic = (char *)"receipt"; /* of a scene: recon says it */
    idle.published = 1;
    overruns.name = (char *)"overruns";
    overruns.value = 17;
    h.topics = topics;
    h.n_topics = 3;
    h.device = device;
    h.n_device = 1;
    pid_t dsp = living_start(run_dir, "dsp", LIVING, &h);
    run(&r, "info", "dsp", NULL);
    assert_int_equal(r.code, 0);
    unsigned long messages, gaps, dropped;
    char rate[24], bytes[24], age[24], queue[24];
    const char *row = strstr(r.out, "\n  ping ");
    assert_non_null(row);
    assert_int_equal(sscanf(row, " ping %lu %23s %23s %23s %23s %lu %lu", &messages, rate,
                            bytes, age, queue, &gaps, &dropped),
                     7);
    assert_int_equal(messages, 700);
    assert_string_equal(queue, "13/64");
    assert_int_equal(gaps, 5);
    assert_int_equal(dropped, 11);
    row = strstr(r.out, "\n  receipt ");
    assert_non_null(row);
    assert_int_equal(sscanf(row, " receipt %lu %23s", &messages, rate), 2);
    assert_non_null(strstr(rate, "/-"));
    assert_contains(r.out, "all is well");
    assert_contains(r.out, "overruns");
    snprintf(endpoint, sizeof endpoint, "ipc://%s/dsp.traces.ipc\n", run_dir);
    assert_contains(r.out, endpoint);
    run(&r, "info", "dsp", "--json");
    json_t *o = parse(&r);
    assert_int_equal(json_integer_value(json_object_get(o, "pid")), dsp);
    assert_int_equal(json_integer_value(json_object_get(o, "dropped")), 11);
    const json_t *counts = json_object_get(o, "device");
    assert_int_equal(json_integer_value(json_object_get(counts, "overruns")), 17);
    const json_t *told = json_object_get(o, "topics");
    assert_int_equal(json_array_size(told), 3);
    for (size_t i = 0; i < 3; i++) {
        const json_t *t = json_array_get(told, i);
        bool idles = !strcmp(json_string_value(json_object_get(t, "topic")), "receipt");
        double hz = json_number_value(json_object_get(t, "expected_hz"));
        assert_true(idles ? hz == 0.0 : hz > 0.0);
    }
    json_decref(o);
    living_end(dsp, SIGTERM);
}

static void info_of_a_dead_node_says_so(void **state)
{
    Anlos__Health h = ready("");
    struct command_result r;
    char text[64];

    (void)state;
    pid_t stage = living_start(run_dir, "stage", LIVING, &h);
    living_end(stage, SIGKILL);
    run(&r, "info", "stage", NULL);
    assert_int_equal(r.code, 1);
    snprintf(text, sizeof text, "died, it was %d", (int)stage);
    assert_contains(r.out, text);
    assert_contains(r.err, "stage does not run");
}

static void wrong_arguments_are_refused(void **state)
{
    struct command_result r;
    static const char *const cases[][3] = {
        {"lists", NULL, "lists: expected list or info"},
        {"info", NULL, "expected one node"},
        {"info", "radar", "radar: no such node"},
        {"info", "recom", "did you mean recon?"},
        {"list", "--jsn", "did you mean --json"}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        run(&r, cases[i][0], cases[i][1], NULL);
        assert_int_equal(r.code, 2);
        assert_contains(r.err, cases[i][2]);
    }
}

static void of_one_that_is_to_run_on_another_host_it_is_said(void **state)
{
    struct census c = {.n = 2,
                       .nodes = {{.name = "dsp", .host = "computer"}, {.name = "can"}}};
    char *text = NULL;
    size_t size;
    FILE *f = open_memstream(&text, &size);

    (void)state;
    assert_non_null(f);
    node_list_print(&c, f);
    assert_int_equal(fclose(f), 0);
    assert_contains(text, "is to run on computer, and is not heard\n");
    assert_contains(text, "has not run in this folder\n");
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_empty_folder_has_no_nodes_and_stays_away),
        cmocka_unit_test(the_living_the_dead_and_the_unborn_are_told_apart),
        cmocka_unit_test(info_has_topics_losses_queue_device_and_endpoints),
        cmocka_unit_test(info_of_a_dead_node_says_so),
        cmocka_unit_test(of_one_that_is_to_run_on_another_host_it_is_said),
        cmocka_unit_test(wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
