/* SPDX-License-Identifier: MIT */
/* The table of what was tracked, from reports made by hand. */
#include "nodes/launcher/truth.h"

#include "tests/hal/scratch.h"

#include <errno.h>

#define TRACK(id)                                                                        \
    "{\"id\": " #id ", \"class\": \"extended\", \"first_s\": 0.648, \"last_s\": 5.928, " \
    "\"from_m\": [6.653, -1.879, 0.4], \"to_m\": [5.2, 4.371, 0.4], "                    \
    "\"mean_speed_m_s\": 1.237, \"greatest_existence\": 0.998}"

/* free() it; NULL: the error. */
static char *print(struct scratch *s, const char *report, int expected)
{
    struct error why = {""};
    char *text = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);

    if (report)
        scratch_write(s, "report.json", report);
    assert_int_equal(tracks_print(s->folder, f, &why), expected);
    assert_int_equal(fclose(f), 0);
    if (expected)
        assert_contains(why.text, "report.json");
    for (const char *line = text; line && *line; line = strchr(line + 1, '\n'))
        assert_true(strcspn(line + 1, "\n") <= 90);
    return text;
}

static void a_track_is_a_line_of_when_where_and_what_it_was(void **state)
{
    char *text = print(*state,
                       "{\"drive\": {\"frame\": \"vehicle\", \"seconds\": 24.4, "
                       "\"tracks\": [" TRACK(7) "]}}",
                       0);

    assert_contains(text, "tracked in 24 s: 1\n");
    assert_contains(text,
                    "\ntrack       tracked (s)  "); /* the vehicle may be told less */
    assert_contains(text, "\n    7     0.6 to    5.9     6.65  -1.88     5.20   4.37    "
                          "1.2  extended    100 %\n");
    assert_contains(text, "vehicle frame");
    free(text);
}

static void of_many_the_newest_are_shown_and_the_others_counted(void **state)
{
    char report[16384] = "{\"drive\": {\"tracks\": [" TRACK(1) "," TRACK(2);

    for (int i = 1; i < TRACKS_SHOWN; i++)
        strcat(report, "," TRACK(3));
    strcat(report, "]}}");
    char *text = print(*state, report, 0);
    assert_contains(text, ": 21\n");
    assert_contains(text, "... 1 before these");
    assert_null(strstr(text, "\n    1 "));
    assert_contains(text, "\n    2 ");
    free(text);
}

static void nothing_tracked_is_said_so(void **state)
{
    char *text = print(*state, "{\"drive\": {\"seconds\": 20, \"tracks\": []}}", 0);

    assert_contains(text, "tracked in 20 s: 0\n");
    assert_null(strstr(text, "class"));
    free(text);
}

static void a_report_without_tracks_prints_nothing(void **state)
{
    free(print(*state, NULL, -ENOENT));
    free(print(*state, "{\"drive\": ", -EINVAL));
    char *text = print(*state, "{\"pings\": {}}", -ENODATA);
    assert_string_equal(text, "");
    free(text);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_track_is_a_line_of_when_where_and_what_it_was),
        TEST(of_many_the_newest_are_shown_and_the_others_counted),
        TEST(nothing_tracked_is_said_so),
        TEST(a_report_without_tracks_prints_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
