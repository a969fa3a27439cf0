/* SPDX-License-Identifier: MIT */
/* What `anlos top` draws for a width and a height. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "nodes/anlos/text.h"
#include "nodes/anlos/top/screen.h"

struct rig {
    struct table table;
    struct look look;
    struct page page;
};

static struct table_node *add_node(struct table *t, const char *name)
{
    struct table_node *n = &t->nodes[t->n_nodes++];
    *n = (struct table_node){.state = TABLE_READY,
                             .pid = 42,
                             .uptime_s = 75,
                             .cpu = 0.125,
                             .rss_bytes = 45000000,
                             .rate_hz = 15.96,
                             .expected_hz = 16,
                             .in_hz = 1,
                             .out_hz = 17,
                             .latency = {.n = 9, .median_s = 0.0621, .p99_s = 0.0712}};
    snprintf(n->name, sizeof n->name, "%s", name);
    snprintf(n->text, sizeof n->text, "at work");
    return n;
}

static void add_log(struct table *t, const char *level, const char *text)
{
    struct table_log *l = &t->logs[t->n_logs++];
    l->stamp_ns = 3723000000000; /* 01:02:03 */
    snprintf(l->level, sizeof l->level, "%s", level);
    snprintf(l->node, sizeof l->node, "dsp");
    snprintf(l->text, sizeof l->text, "%s", text);
}

/* The eight nodes of the demo, of which "array" has a link and counts; every topic. */
static int set_up(void **state)
{
    static const char *const names[] = {"stage", "array", "scan", "dsp",
                                        "recon", "track", "can",  "report"};
    struct rig *r = calloc(1, sizeof *r);
    if (!r)
        return -1;
    for (size_t i = 0; i < 8; i++)
        add_node(&r->table, names[i]);
    struct table_node *array = &r->table.nodes[1];
    array->links[array->n_links++] = (struct table_link){
        .topic = topic_ping(), .published = true, .rate_hz = 16, .bytes_s = 3.04e6};
    array->n_device = 2;
    array->device[0] = (struct table_device){"overruns", 3};
    array->device[1] = (struct table_device){"retries", 0};
    table_fill_topics(&r->table);
    snprintf(r->table.run_dir, sizeof r->table.run_dir, "/run/anlos");
    r->table.own_cpu = 0.004;
    r->table.scan = (struct table_scan){.known = true,
                                        .state = ANLOS__SCAN_STATUS__STATE__RUNNING,
                                        .pass = ANLOS__PASS__SCENE,
                                        .scan = 1,
                                        .position = 12,
                                        .done = 234,
                                        .expected = 512,
                                        .retaken = 1,
                                        .left_s = 17.4};
    add_log(&r->table, "info", "first");
    add_log(&r->table, "error", "second");
    setenv("TZ", "UTC", 1);
    tzset();
    *state = r;
    return 0;
}

static int tear_down(void **state)
{
    free(*state);
    return 0;
}

static void draw(struct rig *r, int width, int height)
{
    screen_draw(&r->page, width, height, &r->table, &r->look);
}

static const struct page_line *find(const struct rig *r, const char *start)
{
    for (int i = 0; i < r->page.n_lines; i++)
        if (!strncmp(r->page.lines[i].text, start, strlen(start)))
            return &r->page.lines[i];
    return NULL;
}

static void assert_line(const struct rig *r, int i, const char *text)
{
    assert_true(i < r->page.n_lines);
    assert_string_equal(r->page.lines[i].text, text);
}

static void the_usual_terminal_shows_all_panels(void **state)
{
    struct rig *r = *state;

    draw(r, 80, 24);
    assert_int_equal(r->page.n_lines, 24);
    assert_line(
        r, 0, "/run/anlos: 8 of 8 nodes alive, 0 messages lost  (top itself: 0.4% CPU)");
    assert_line(
        r, 1,
        "[####      ]  46% 234/512 pings, position 12, 17s left, scene, 1 retaken, "
        "0 give");
    assert_line(r, 2,
                " NODE     STATE     CPU%   MEM HZ/EXPECTED LATENCY ms QUEUE DROPS  GAPS "
                "REFUSED");
    assert_line(r, 3,
                ">stage    ready     12.5   45M     16.0/16      62/71     0     0     0 "
                "      0");
    assert_non_null(find(r, " report   ready"));
    assert_non_null(find(r, " TOPIC         STATE"));
    assert_non_null(find(r, " stage"));
    assert_non_null(find(r, " LOG"));
    assert_line(r, 20, " 01:02:03 info    dsp      first");
    assert_line(r, 21, " 01:02:03 error   dsp      second");
    assert_int_equal(strncmp(r->page.lines[23].text, "q quit", 6), 0);
}

static void every_size_is_kept_to(void **state)
{
    struct rig *r = *state;

    snprintf(r->table.nodes[0].text, TABLE_TEXT_SIZE,
             "gr\xc3\xb6\xc3\x9f"
             "er \xe2\x82\xac");
    for (int help = 0; help < 2; help++)
        for (int focus = 0; focus < LOOK_PANELS; focus++)
            for (int height = 1; height < 60; height++)
                for (int width = 1; width < 200; width += 7) {
                    r->look.focus = (enum look_panel)focus;
                    r->look.help = help;
                    draw(r, width, height);
                    assert_int_equal(r->page.n_lines, height);
                    for (int i = 0; i < height; i++)
                        assert_true(text_columns(r->page.lines[i].text) <= (size_t)width);
                }
}

static void add_object(struct table *t, uint32_t id, Anlos__Measurement measurement)
{
    t->objects.known = true;
    t->objects.list[t->objects.n++] =
        (struct table_object){.id = id,
                              .measurement = measurement,
                              .shape = ANLOS__SHAPE__EXTENDED,
                              .in_vehicle_frame = true,
                              .mirrored = true,
                              .at_m = {4.861, -0.912, 0.4},
                              .velocity_m_s = {-0.024, 1.26},
                              .existence = 0.987,
                              .age_s = 1.53,
                              .unseen_s = 0.04};
}

static void hidden_objects_have_a_panel_when_there_is_a_list(void **state)
{
    struct rig *r = *state;

    draw(r, 100, 40);
    assert_null(find(r, " OBJECT"));
    r->table.objects.known = true;
    draw(r, 100, 40);
    assert_non_null(find(r, " OBJECTS (none now)"));
    add_object(&r->table, 7, ANLOS__MEASUREMENT__MEASURED);
    add_object(&r->table, 12, ANLOS__MEASUREMENT__PREDICTED);
    draw(r, 100, 40);
    assert_non_null(find(r,
                         " OBJECT STATE        X m    Y m VX m/s VY m/s EXISTS%  AGE s "
                         "UNSEEN CLASS       Z m FRAME"));
    const struct page_line *line =
        find(r, " 7      measured    4.86  -0.91  -0.02   1.26      99    1.5    0.0 "
                "extended   0.40 vehicle");
    assert_non_null(line);
    assert_int_equal(line->tone, PAGE_GOOD);
    assert_int_equal(find(r, " 12     predicted")->tone, PAGE_NOTE);
    draw(r, 40, 40); /* what matters least goes first */
    assert_non_null(find(r, " OBJECT STATE        X m    Y m"));
    r->table.objects.over = true;
    draw(r, 100, 40);
    assert_non_null(find(r, " OBJECTS (those of the last list"));
}

static void an_object_in_a_state_of_a_later_version_is_drawn(void **state)
{
    struct rig *r = *state;

    add_object(&r->table, 7, (Anlos__Measurement)99);
    draw(r, 100, 40);
    assert_non_null(find(r, " 7      ?           4.86"));
}

static void more_objects_than_lines_are_scrolled(void **state)
{
    struct rig *r = *state;

    for (uint32_t id = 1; id <= 40; id++)
        add_object(&r->table, id, ANLOS__MEASUREMENT__MEASURED);
    draw(r, 80, 24);
    assert_non_null(find(r, " 1  "));
    assert_null(find(r, " 40 "));
    r->look.focus = LOOK_OBJECTS;
    r->look.object_line = 1000;
    draw(r, 80, 24);
    assert_non_null(find(r, " 40 "));
    assert_true(r->look.object_line < 40);
}

static void narrow_terminals_leave_out_the_least_important_columns(void **state)
{
    struct rig *r = *state;

    draw(r, 40, 24);
    assert_line(r, 2, " NODE     STATE     CPU% DROPS  GAPS");
    draw(r, 24, 24);
    assert_line(r, 2, " NODE     STATE     CPU%");
    draw(r, 18, 24);
    assert_line(r, 2, " NODE     STATE");
    draw(r, 160, 24);
    assert_non_null(strstr(r->page.lines[2].text, "SAYS"));
    assert_non_null(strstr(r->page.lines[3].text, "1m15s"));
    assert_non_null(strstr(r->page.lines[3].text, "at work"));
}

/* Topics that nobody publishes give way to the detail and the log. */
static void what_is_absent_comes_last(void **state)
{
    struct rig *r = *state;

    draw(r, 80,
         30); /* 27 for the panels: nodes 9, detail 4, log 6, topics what is left */
    assert_non_null(find(r, " process 42"));
    assert_non_null(find(r, " TOPIC"));
    int log_title = (int)(find(r, " LOG") - r->page.lines);
    assert_int_equal(log_title, 2 + 27 - 6);
}

static void a_low_terminal_keeps_what_is_in_focus(void **state)
{
    struct rig *r = *state;

    draw(r, 80, 8);
    assert_non_null(find(r, " NODE"));
    assert_null(find(r, " TOPIC"));
    r->look.focus = LOOK_TOPICS;
    draw(r, 80, 8);
    assert_non_null(find(r, " TOPIC"));
    assert_null(find(r, " NODE"));
}

static void the_selected_row_is_marked_and_always_seen(void **state)
{
    struct rig *r = *state;

    snprintf(r->look.node, sizeof r->look.node, "report");
    draw(r, 80, 9); /* room for three of the eight */
    const struct page_line *line = find(r, ">report");
    assert_non_null(line);
    assert_true(line->selected);
    assert_null(find(r, " stage    ready"));
    assert_int_equal(find(r, " NODE")->kind, PAGE_FOCUSED_TITLE);
}

static void a_state_is_a_word_and_its_tone_covers_that_word(void **state)
{
    static const struct {
        enum table_node_state state;
        const char *word;
        enum page_tone tone;
    } cases[] = {
        {TABLE_OFF, "off", PAGE_FAINT},    {TABLE_STARTING, "starting", PAGE_NOTE},
        {TABLE_READY, "ready", PAGE_GOOD}, {TABLE_DEGRADED, "degraded", PAGE_NOTE},
        {TABLE_FAULT, "fault", PAGE_BAD},  {TABLE_SILENT, "silent", PAGE_NOTE},
        {TABLE_DEAD, "dead", PAGE_BAD}};
    struct rig *r = *state;

    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        r->table.nodes[0].state = cases[i].state;
        draw(r, 80, 24);
        const struct page_line *line = &r->page.lines[3];
        assert_int_equal(line->tone, cases[i].tone);
        assert_int_equal(
            strncmp(line->text + line->tone_at, cases[i].word, strlen(cases[i].word)), 0);
        assert_int_equal(line->tone_n, 8);
    }
    assert_non_null(strstr(r->page.lines[0].text, "7 of 8 nodes alive"));
}

static void the_detail_tells_device_counts_and_topics(void **state)
{
    struct rig *r = *state;

    snprintf(r->look.node, sizeof r->look.node, "array");
    draw(r, 80, 40);
    assert_non_null(find(r, " device: overruns 3, retries 0"));
    assert_non_null(find(r, " process 42, up 1m15s, started again 0 times"));
    assert_non_null(find(r, " ping          out         16.0/- "));
    r->look.focus = LOOK_TOPICS;
    r->look.detail_of_topic = true;
    r->look.topic = topic_ping();
    draw(r, 80, 44);
    assert_non_null(find(r, " anlos.Ping; a queue keeps all up to 64; at most 8.4M"));
    assert_non_null(find(r, " array         out         16.0/-    3.0M"));
}

static void the_detail_scrolls_to_its_last_line_and_no_further(void **state)
{
    struct rig *r = *state;

    snprintf(r->look.node, sizeof r->look.node, "array");
    r->look.focus = LOOK_DETAIL;
    r->look.detail_line = 1000;
    draw(r, 80, 7); /* title and three of five lines */
    assert_int_equal(r->look.detail_line, 2);
    assert_non_null(find(r, " ping          out"));
}

static void the_log_shows_its_newest_lines(void **state)
{
    struct rig *r = *state;
    char text[32];

    for (int i = 0; i < 40; i++) {
        snprintf(text, sizeof text, "line %d", i);
        add_log(&r->table, "warning", text);
    }
    draw(r, 80, 24);
    assert_non_null(strstr(r->page.lines[22].text, "line 39"));
    assert_int_equal(r->page.lines[22].tone, PAGE_NOTE);
    r->look.log_line = 5;
    draw(r, 80, 24);
    assert_non_null(strstr(r->page.lines[22].text, "line 34"));
    r->look.log_line = 1000;
    draw(r, 80, 24);
    assert_int_equal(r->look.log_line, 39); /* of 42, three are seen */
    assert_non_null(strstr(r->page.lines[20].text, "first"));
}

static void on_a_narrow_screen_a_line_of_the_log_goes_on_below(void **state)
{
    struct rig *r = *state;

    add_log(&r->table, "warning", "channel 7 clips: turn its gain down by 6 dB or more");
    draw(r, 40, 40);
    int at = (int)(find(r, " LOG") - r->page.lines);
    assert_line(r, at + 2, " 01:02:03 E dsp: second");
    assert_line(r, at + 3, " 01:02:03 W dsp: channel 7 clips: turn");
    assert_line(r, at + 4, "   its gain down by 6 dB or more");
    assert_int_equal(r->page.lines[at + 3].tone, PAGE_NOTE);
    assert_int_equal(r->page.lines[at + 4].tone, PAGE_NOTE);
    r->look.log_line = 1;
    draw(r, 40, 40);
    assert_int_equal(r->look.log_line, 0); /* all are seen */
    r->table.logs[0] = r->table.logs[2];
    r->look.focus = LOOK_LOG;
    r->look.log_line = 1000;
    draw(r, 40, 7);                        /* three lines of log below its title */
    assert_int_equal(r->look.log_line, 1); /* the oldest takes two of them */
    assert_line(r, 3, " 01:02:03 W dsp: channel 7 clips: turn");
    assert_line(r, 5, " 01:02:03 E dsp: second");
    r->look.log_line = 0;
    draw(r, 40, 7);
    assert_line(r, 3, " 01:02:03 E dsp: second");
    assert_line(r, 5, "   its gain down by 6 dB or more");
    draw(r, 60, 40);
    assert_non_null(
        find(r, " 01:02:03 warning dsp      channel 7 clips: turn its gain do"));
}

static void a_repeated_line_says_how_often(void **state)
{
    struct rig *r = *state;

    r->table.logs[1].repeats = 37;
    r->table.logs[1].left_out = 5;
    draw(r, 80, 24);
    assert_line(
        r, 21,
        " 01:02:03 error   dsp      second (37 times more) (5 lines before it left "
        "out)");
}

static void what_a_process_says_cannot_steer_the_terminal(void **state)
{
    struct rig *r = *state;

    snprintf(r->table.nodes[0].text, TABLE_TEXT_SIZE,
             "a\x1b[2J\n\x7f\xc2\x9b\xff"
             "b");
    snprintf(r->table.scan.text, TABLE_TEXT_SIZE, "\x1b]0;x\a");
    add_log(&r->table, "info", "\x1b[31mred");
    draw(r, 200, 60);
    for (int i = 0; i < r->page.n_lines; i++)
        for (const char *s = r->page.lines[i].text; *s; s++)
            assert_true((unsigned char)*s >= ' ' && *s != 0x7f);
    assert_non_null(find(r, " a [2J ???\?b"));
}

static void what_holds_and_filters_is_said(void **state)
{
    struct rig *r = *state;

    r->look.paused = true;
    r->look.sort = LOOK_BY_LOAD;
    snprintf(r->look.filter, sizeof r->look.filter, "ar");
    draw(r, 120, 24);
    assert_line(
        r, 0,
        "PAUSED  /run/anlos: 8 of 8 nodes alive, 0 messages lost  sorted by load  "
        "names with ar  (top itself: 0.4% CPU)");
    r->look.typing = true;
    draw(r, 120, 24);
    assert_int_equal(strncmp(r->page.lines[23].text, "/ar_", 4), 0);
}

static void nothing_running_is_said(void **state)
{
    struct rig *r = *state;

    r->table.n_nodes = 0;
    r->table.scan.known = false;
    r->table.own_cpu = NAN;
    draw(r, 80, 24);
    assert_line(r, 0, "/run/anlos: nothing is running  (top itself: -% CPU)");
    assert_line(r, 1, "no scan yet");
}

static void what_top_itself_cannot_read_is_counted(void **state)
{
    struct rig *r = *state;

    r->table.own_refused = 3;
    draw(r, 120, 24);
    assert_non_null(strstr(r->page.lines[0].text, "lost, 3 could not be read here"));
}

static void the_last_word_of_a_scan_that_is_gone_is_called_that(void **state)
{
    struct rig *r = *state;

    r->table.scan.over = true;
    draw(r, 80, 24);
    assert_non_null(find(r, "last heard: [####      ]  46% 234/512 pings"));
}

static void a_scan_without_end_has_no_bar(void **state)
{
    struct rig *r = *state;

    r->table.scan.expected = 0;
    r->table.scan.given_up = 3;
    snprintf(r->table.scan.text, TABLE_TEXT_SIZE, "2.6 frames/s, 41.7 pings/s");
    draw(r, 120, 24);
    assert_non_null(
        find(r, "234 pings, scene, 3 lost, scan 1: 2.6 frames/s, 41.7 pings/s"));
    assert_null(find(r, "234/0"));
}

static void the_help_names_every_key(void **state)
{
    struct rig *r = *state;
    char all[24 * 100] = "";

    r->look.help = true;
    draw(r, 80, 24);
    for (int i = 0; i < r->page.n_lines; i++)
        strcat(all, r->page.lines[i].text);
    static const char *const words[] = {"q ", "tab ",    "arrows",  "s ",     "p,",
                                        "/ ", "LATENCY", "REFUSED", "silent", "CPU%"};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        assert_non_null(strstr(all, words[i]));
}

static void a_plain_table_has_every_column_and_no_blanks_at_the_end(void **state)
{
    struct rig *r = *state;
    char *text = NULL;
    size_t size;
    FILE *f = open_memstream(&text, &size);

    assert_non_null(f);
    assert_int_equal(screen_print(f, &r->table), 0);
    fclose(f);
    static const char *const parts[] = {
        "/run/anlos: 8 of 8 nodes alive",
        "\nNODE     STATE     CPU%   MEM HZ/EXPECTED LATENCY ms QUEUE DROPS  GAPS "
        "REFUSED  "
        "   UP     PID  IN Hz OUT Hz SAYS\n",
        "\nstage    ready     12.5   45M     16.0/16      62/71     0     0     0       "
        "0  "
        "1m15s      42    1.0   17.0 at work\n",
        "\nping          ok ",
        "\narray device: overruns 3, retries 0\n",
        "01:02:03 error   dsp      second\n",
    };
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++)
        if (!strstr(text, parts[i]))
            fail_msg("\"%s\" is not in\n%s", parts[i], text);
    assert_null(strstr(text, " \n"));
    assert_null(strstr(text, "\nvolume ")); /* nobody publishes it */
    free(text);
}

static void a_full_disk_is_an_error(void **state)
{
    struct rig *r = *state;
    FILE *f = fopen("/dev/full", "w");

    assert_non_null(f);
    assert_true(screen_print(f, &r->table) < 0);
    fclose(f);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(the_usual_terminal_shows_all_panels),
        TEST(every_size_is_kept_to),
        TEST(hidden_objects_have_a_panel_when_there_is_a_list),
        TEST(an_object_in_a_state_of_a_later_version_is_drawn),
        TEST(more_objects_than_lines_are_scrolled),
        TEST(narrow_terminals_leave_out_the_least_important_columns),
        TEST(what_is_absent_comes_last),
        TEST(a_low_terminal_keeps_what_is_in_focus),
        TEST(the_selected_row_is_marked_and_always_seen),
        TEST(a_state_is_a_word_and_its_tone_covers_that_word),
        TEST(the_detail_tells_device_counts_and_topics),
        TEST(the_detail_scrolls_to_its_last_line_and_no_further),
        TEST(the_log_shows_its_newest_lines),
        TEST(on_a_narrow_screen_a_line_of_the_log_goes_on_below),
        TEST(a_repeated_line_says_how_often),
        TEST(what_a_process_says_cannot_steer_the_terminal),
        TEST(what_holds_and_filters_is_said),
        TEST(nothing_running_is_said),
        TEST(what_top_itself_cannot_read_is_counted),
        TEST(the_last_word_of_a_scan_that_is_gone_is_called_that),
        TEST(a_scan_without_end_has_no_bar),
        TEST(the_help_names_every_key),
        TEST(a_plain_table_has_every_column_and_no_blanks_at_the_end),
        TEST(a_full_disk_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
