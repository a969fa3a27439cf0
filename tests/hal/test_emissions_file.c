/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/recording/recording.h"

static double elements[4][3] = {{0.0}, {0.1}, {0.2}, {0.3}};
static double position;

static struct survey survey_of(size_t n_speakers)
{
    return (struct survey){.slot_samples = 100,
                           .n_speakers = n_speakers,
                           .n_positions = 1,
                           .speakers_m = elements,
                           .stage_positions_m = &position,
                           .temperature_c = NAN};
}

static int load(struct scratch *s, const struct survey *v, const char *text,
                struct emission **list, size_t *n, struct error *why)
{
    why->text[0] = '\0';
    return emissions_load(list, n, scratch_write(s, EMISSIONS_FILE, text), v, why);
}

static void what_is_printed_is_read_back(void **state)
{
    static const struct emission written[] = {
        {7, 3, 2, true, true, true, 1795393947812990809, 20.1},
        {7, 1, 2, false, false, true, 1795393947812990809, -3},
        {9000000000, 0, 5, true, true, true, 1795393999000000000, 20.1}};
    struct survey v = survey_of(4);
    struct scratch *s = *state;
    struct error why;
    struct emission *list;
    char *text = NULL;
    size_t size, n;
    FILE *f = open_memstream(&text, &size);

    assert_non_null(f);
    emission_print(f, NULL);
    for (size_t i = 0; i < 3; i++)
        emission_print(f, &written[i]);
    fclose(f);
    v.chirp_alternates = true;
    if (load(s, &v, text, &list, &n, &why))
        fail_msg("%s", why.text);
    assert_int_equal(n, 3);
    for (size_t i = 0; i < 3; i++) {
        assert_true(list[i].sample == written[i].sample);
        assert_true(list[i].time_ns == written[i].time_ns && list[i].has_time);
        assert_int_equal(list[i].speaker, written[i].speaker);
        assert_int_equal(list[i].frame, written[i].frame);
        assert_int_equal(list[i].down, written[i].down);
        assert_int_equal(list[i].valid, written[i].valid);
        assert_true(list[i].temperature_c == written[i].temperature_c);
    }
    free(list);
    free(text);
}

static void a_frame_is_over_when_a_speakers_turn_comes_again(void **state)
{
    static const uint32_t frames[] = {1, 1, 2, 2, 3, 4, 4};
    static const bool down[] = {0, 1, 0, 1, 0, 0, 1};
    struct survey v = survey_of(4);
    struct error why;
    struct emission *list;
    size_t n;

    v.chirp_alternates = true;
    if (load(*state, &v, "speaker,sample\n2,0\n0,1\n2,2\n0,3\n2,4\n2,5\n0,6\n", &list, &n,
             &why))
        fail_msg("%s", why.text);
    assert_int_equal(n, 7);
    for (size_t i = 0; i < 7; i++) {
        assert_int_equal(list[i].frame, frames[i]);
        assert_int_equal(list[i].down, down[i]);
        assert_true(list[i].valid && !list[i].has_time && isnan(list[i].temperature_c));
    }
    free(list);
}

static void without_a_table_the_speakers_take_turns_to_the_end(void **state)
{
    struct survey v = survey_of(3);
    struct emission *list;
    size_t n;

    (void)state;
    assert_int_equal(emissions_in_turn(&list, &n, &v, 1099), 0);
    assert_int_equal(n, 10); /* whole slots */
    for (size_t i = 0; i < n; i++) {
        assert_int_equal(list[i].sample, 100 * i);
        assert_int_equal(list[i].speaker, i % 3);
        assert_int_equal(list[i].frame, i / 3 + 1);
    }
    free(list);
    v = survey_of(4);
    v.together = 2;
    v.chirp_alternates = true;
    assert_int_equal(emissions_in_turn(&list, &n, &v, 650), 0);
    assert_int_equal(n, 12); /* two in each of six slots */
    for (size_t i = 0; i < n; i++) {
        assert_int_equal(list[i].sample, 100 * (i / 2));
        assert_int_equal(list[i].speaker, i % 4);
        assert_int_equal(list[i].down, i % 2);
    }
    free(list);
}

static void what_is_wrong_is_named_with_its_line(void **state)
{
    static const struct {
        const char *text, *says;
    } cases[] = {
        {"", "empty; its first line names the columns"},
        {"sample,speaker\n", "found none"},
        {"sample,frame\n1,1\n", ":1: the column speaker is missing"},
        {"sample,speaker,sample\n1,1,1\n", ":1: the column sample is named twice"},
        {"sample,speaker\n1\n", ":2: 1 columns, expected 2"},
        {"sample,speaker\n\n1,4\n", ":3: speaker: expected a whole number from 0"},
        {"sample,speaker\n-1,0\n", ":2: sample: expected"},
        {"sample,speaker\n5,0\n4,0\n", ":3: sample: before that of the line above"},
        {"sample,speaker,frame\n5,0,0\n", ":2: frame: expected a whole number from 1"},
        {"sample,speaker,down\n5,0,1\n", "the survey's chirps do not alternate"},
        {"sample,speaker,valid\n5,0,2\n", ":2: valid: expected 0 or 1"},
        {"sample,speaker,time_s\n5,0,yesterday\n", ":2: time_s: expected seconds"},
        {"sample,speaker,temperature_c\n5,0,warm\n", ":2: temperature_c: expected"},
    };
    struct survey v = survey_of(4);
    struct error why;
    struct emission *list;
    size_t n;

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(load(*state, &v, cases[i].text, &list, &n, &why), -EINVAL);
        if (!strstr(why.text, cases[i].says) || !strstr(why.text, EMISSIONS_FILE))
            fail_msg("\"%s\" does not say \"%s\"", why.text, cases[i].says);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_is_printed_is_read_back),
        TEST(a_frame_is_over_when_a_speakers_turn_comes_again),
        TEST(without_a_table_the_speakers_take_turns_to_the_end),
        TEST(what_is_wrong_is_named_with_its_line),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
