/* SPDX-License-Identifier: MIT */
/* Keys and rows of `anlos top`. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <curses.h>

#include "nodes/anlos/top/screen.h"

struct rig {
    struct table table;
    struct look look;
};

static void add_node(struct table *t, const char *name, double cpu, double rate_hz,
                     unsigned n_latency, double median_s, uint64_t gaps)
{
    struct table_node *n = &t->nodes[t->n_nodes++];
    snprintf(n->name, sizeof n->name, "%s", name);
    n->state = TABLE_READY;
    n->cpu = cpu;
    n->rate_hz = rate_hz;
    n->latency = (struct table_latency){.n = n_latency, .median_s = median_s};
    n->gaps = gaps;
}

/* Three nodes; "ping" with 3 MB/s, "traces" with 6, "volume" absent. */
static int set_up(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    if (!r)
        return -1;
    struct table *t = &r->table;
    add_node(t, "stage", 0.01, 2, 0, 0, 5);
    add_node(t, "array", 0.30, NAN, 9, 0.1, 0);
    add_node(t, "dsp", NAN, 16, 9, 0.2, 7);
    t->topics[0] = (struct table_topic){
        .topic = topic_volume(), .state = TABLE_ABSENT, .bytes_s = NAN, .rate_hz = NAN};
    t->topics[1] = (struct table_topic){
        .topic = topic_ping(), .state = TABLE_OK, .bytes_s = 3e6, .rate_hz = 16};
    t->topics[2] = (struct table_topic){
        .topic = topic_traces(), .state = TABLE_OK, .bytes_s = 6e6, .rate_hz = 15};
    t->n_topics = 3;
    *state = r;
    return 0;
}

static int tear_down(void **state)
{
    free(*state);
    return 0;
}

static void press(struct rig *r, int key)
{
    assert_false(look_key(&r->look, &r->table, key));
}

static void type(struct rig *r, const char *text)
{
    for (; *text; text++)
        press(r, *text);
}

/* The names in the order shown, with blanks between. */
static const char *nodes(const struct rig *r)
{
    static char text[256];
    size_t order[LOOK_MAX_ROWS], at;
    size_t n = look_rows(&r->look, &r->table, LOOK_NODES, order, &at);
    *text = '\0';
    for (size_t i = 0; i < n; i++) {
        strcat(text, r->table.nodes[order[i]].name);
        strcat(text, i + 1 < n ? " " : "");
    }
    return text;
}

static const char *topics(const struct rig *r)
{
    static char text[256];
    size_t order[LOOK_MAX_ROWS], at;
    size_t n = look_rows(&r->look, &r->table, LOOK_TOPICS, order, &at);
    *text = '\0';
    for (size_t i = 0; i < n; i++) {
        strcat(text, r->table.topics[order[i]].topic->name);
        strcat(text, i + 1 < n ? " " : "");
    }
    return text;
}

static const char *selected_node(const struct rig *r)
{
    size_t order[LOOK_MAX_ROWS], at;
    look_rows(&r->look, &r->table, LOOK_NODES, order, &at);
    return r->table.nodes[order[at]].name;
}

static const char *selected_topic(const struct rig *r)
{
    size_t order[LOOK_MAX_ROWS], at;
    look_rows(&r->look, &r->table, LOOK_TOPICS, order, &at);
    return r->table.topics[order[at]].topic->name;
}

static void s_sorts_by_one_thing_after_the_other(void **state)
{
    static const struct {
        enum look_sort by;
        const char *nodes, *topics;
    } cases[] = {
        {LOOK_BY_ORDER, "stage array dsp", "ping traces volume"},
        {LOOK_BY_LOAD, "array stage dsp", "traces ping volume"},
        {LOOK_BY_RATE, "dsp stage array", "ping traces volume"},
        {LOOK_BY_LATENCY, "dsp array stage", "ping traces volume"},
        {LOOK_BY_LOSSES, "dsp stage array", "ping traces volume"},
        {LOOK_BY_NAME, "array dsp stage", "ping traces volume"},
        {LOOK_BY_ORDER, "stage array dsp", "ping traces volume"},
    };
    struct rig *r = *state;

    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_int_equal(r->look.sort, cases[i].by);
        assert_string_equal(nodes(r), cases[i].nodes);
        assert_string_equal(topics(r), cases[i].topics);
        press(r, 's');
    }
}

static void the_selection_stays_with_its_node_when_the_order_changes(void **state)
{
    struct rig *r = *state;

    assert_string_equal(selected_node(r), "stage");
    press(r, KEY_DOWN);
    assert_string_equal(selected_node(r), "array");
    press(r, 's'); /* by load: array stage dsp */
    assert_string_equal(selected_node(r), "array");
    press(r, KEY_DOWN);
    assert_string_equal(selected_node(r), "stage");
    press(r, KEY_END);
    assert_string_equal(selected_node(r), "dsp");
    press(r, KEY_DOWN); /* there is no further */
    assert_string_equal(selected_node(r), "dsp");
    press(r, KEY_PPAGE);
    assert_string_equal(selected_node(r), "array");
    press(r, KEY_UP);
    assert_string_equal(selected_node(r), "array");
}

static void tab_goes_round_the_panels(void **state)
{
    struct rig *r = *state;

    press(r, '\t');
    assert_int_equal(r->look.focus, LOOK_TOPICS);
    assert_true(r->look.detail_of_topic);
    press(r, KEY_DOWN);
    assert_string_equal(selected_topic(r), "traces");
    press(r, '\t');
    assert_int_equal(r->look.focus, LOOK_DETAIL);
    assert_true(r->look.detail_of_topic); /* still of what was selected */
    press(r, '\t');
    assert_int_equal(r->look.focus, LOOK_LOG);
    press(r, '\t');
    assert_int_equal(r->look.focus, LOOK_NODES);
    assert_false(r->look.detail_of_topic);
    press(r, KEY_BTAB);
    assert_int_equal(r->look.focus, LOOK_LOG);
    r->table.objects.known = true; /* another panel is there */
    press(r, '\t');
    assert_int_equal(r->look.focus, LOOK_OBJECTS);
    press(r, '\t');
    assert_int_equal(r->look.focus, LOOK_NODES);
}

static void the_log_scrolls_back_from_its_end(void **state)
{
    struct rig *r = *state;

    r->table.n_logs = 3;
    press(r, KEY_BTAB);
    press(r, KEY_DOWN);
    assert_int_equal(r->look.log_line, 0);
    press(r, KEY_UP);
    assert_int_equal(r->look.log_line, 1);
    press(r, KEY_HOME);
    assert_int_equal(r->look.log_line, 2);
    press(r, KEY_END);
    assert_int_equal(r->look.log_line, 0);
}

static void a_filter_shows_the_names_with_that_part(void **state)
{
    struct rig *r = *state;

    type(r, "/a");
    assert_true(r->look.typing);
    assert_string_equal(nodes(r), "stage array");
    assert_string_equal(topics(r), "traces");
    type(r, "rs");
    assert_string_equal(nodes(r), "");
    press(r, KEY_BACKSPACE);
    assert_string_equal(nodes(r), "array");
    type(r, "q"); /* a letter now, no command */
    press(r, KEY_BACKSPACE);
    press(r, '\n');
    assert_false(r->look.typing);
    assert_string_equal(nodes(r), "array");
    press(r, '\033');
    assert_string_equal(nodes(r), "stage array dsp");
    type(r, "/dsp");
    press(r, '\033');
    assert_false(r->look.typing);
    assert_string_equal(nodes(r), "stage array dsp");
}

static void a_filter_does_not_outgrow_its_room(void **state)
{
    struct rig *r = *state;

    press(r, '/');
    for (int i = 0; i < 100; i++)
        press(r, 'x');
    assert_int_equal(strlen(r->look.filter), sizeof r->look.filter - 1);
    press(r, KEY_DOWN); /* nothing is left to select */
    press(r, '\n');
    press(r, KEY_DOWN);
    assert_string_equal(nodes(r), "");
}

static void p_holds_and_h_helps_until_any_key(void **state)
{
    struct rig *r = *state;

    press(r, 'p');
    assert_true(r->look.paused);
    press(r, ' ');
    assert_false(r->look.paused);
    press(r, '?');
    assert_true(r->look.help);
    press(r, 's');
    assert_false(r->look.help);
    assert_int_equal(r->look.sort, LOOK_BY_ORDER); /* it only closed the help */
    press(r, 0); /* a new size, or a key of no meaning */
    assert_true(look_key(&r->look, &r->table, 'q'));
    r->look.help = true;
    assert_true(look_key(&r->look, &r->table, 'q'));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(s_sorts_by_one_thing_after_the_other),
        TEST(the_selection_stays_with_its_node_when_the_order_changes),
        TEST(tab_goes_round_the_panels),
        TEST(the_log_scrolls_back_from_its_end),
        TEST(a_filter_shows_the_names_with_that_part),
        TEST(a_filter_does_not_outgrow_its_room),
        TEST(p_holds_and_h_helps_until_any_key),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
