/* SPDX-License-Identifier: MIT */
/* What a recording carries beside its messages. */
#include "recorder_rig.h"

#include <errno.h>
#include <unistd.h>

#include "hal/survey/file.h"
#include "msgs/bag/manifest.h"

/* What was written into a folder of its own is the same survey. */
static void check_survey(struct rig *g, const char *bag, const struct bus_message *sent)
{
    Anlos__Survey *message = (Anlos__Survey *)bus_message_unpack(sent);
    struct error why = {""};
    char text[256], id[24], path[600];
    struct survey s;

    mkdir(scratch_path(g->scratch, "out"), 0777);
    mkdir(scratch_path(g->scratch, "out/calibration"), 0777);
    assert_true(save_attachment(bag, "calibration/15454.txt",
                                scratch_path(g->scratch, "out/calibration/15454.txt")));
    assert_true(save_attachment(bag, "calibration/15715.txt",
                                scratch_path(g->scratch, "out/calibration/15715.txt")));
    snprintf(path, sizeof path, "%s", scratch_path(g->scratch, "out/survey.yaml"));
    assert_true(save_attachment(bag, MANIFEST_SURVEY, path));
    if (survey_load(&s, path, &why))
        fail_msg("%s", why.text);
    assert_true(survey_id(&s) == message->id);
    survey_clear(&s);
    snprintf(id, sizeof id, "%016llx", (unsigned long long)message->id);
    assert_true(find_metadata(bag, MANIFEST_GEOMETRY, 0, MANIFEST_SURVEY_ID, text));
    assert_string_equal(text, id);
    assert_true(find_metadata(bag, MANIFEST_GEOMETRY, 0, MANIFEST_TEMPERATURE, text));
    assert_string_equal(text, "21.5");
    assert_true(find_metadata(bag, MANIFEST_GEOMETRY, 0, MANIFEST_POSITIONS, text));
    assert_string_equal(text, "2");
    assert_true(find_metadata(bag, MANIFEST_GEOMETRY, 0, MANIFEST_STAGE_LAST, text));
    assert_string_equal(text, "0.25");
    anlos__survey__free_unpacked(message, NULL);
}

static void the_survey_goes_into_each_part_and_a_part_begins_with_one(void **state)
{
    struct rig *g = *state;
    struct recorder_config cfg = config(g);
    struct error why = {""};
    struct recorder_totals t;
    uint8_t *payload;
    struct bus_message survey = survey_message(g, &payload, 0);

    cfg.split_ns = 2000 * MS;
    struct recorder *r = start(&cfg);
    for (int64_t k = 0; k < 60; k++) {
        survey.envelope.sequence = (uint64_t)k / 10;
        survey.envelope.publish_ns = EPOCH_NS + k * 100 * MS;
        if (k % 10 == 5 && recorder_put(r, &survey, k * 100 * MS, &why))
            fail_msg("%s", why.text);
        put_at(r, (size_t)k, k * 100 * MS);
    }
    end_at(r, 6000 * MS);
    recorder_sum(r, &t);
    recorder_destroy(r);
    assert_int_equal(t.n_files, 3);
    check_survey(g, part_path(g, 1), &survey);
    check_survey(g, part_path(g, 2), &survey);
    check_survey(g, part_path(g, 3), &survey);
    /* 2 s over at k 20, so the second part begins with the survey of k 25. */
    struct bag_catalog *c = open_catalog(part_path(g, 1));
    assert_int_equal(c->n_messages, 25 + 2);
    bag_catalog_close(c);
    free(payload);
}

static bool begins_with_a_survey(const char *path, uint64_t *n)
{
    struct bag_catalog *c = open_catalog(path);
    struct error why = {""};
    struct bag_cursor *cursor;
    struct bag_message m;
    struct bag_source of;

    assert_int_equal(bag_cursor_create(&cursor, c), 0);
    assert_int_equal(bag_cursor_next(cursor, &m, &why), 0);
    assert_int_equal(bag_source_of(&of, bag_catalog_channel(c, m.channel_id)), 0);
    *n = c->n_messages;
    bag_cursor_destroy(cursor);
    bag_catalog_close(c);
    return of.topic == topic_survey();
}

static void a_part_that_cannot_wait_for_a_survey_has_the_last_one_again(void **state)
{
    struct rig *g = *state;
    struct recorder_config cfg = config(g);
    struct recorder_totals t;
    uint8_t *payload;
    struct bus_message survey = survey_message(g, &payload, 0);
    uint64_t n, sum = 0;

    cfg.split_bytes = 20000;
    struct recorder *r = start(&cfg);
    assert_int_equal(recorder_put(r, &survey, 0, NULL), 0);
    for (size_t i = 0; i < 300; i++)
        put_at(r, i, 0);
    end_at(r, 0);
    recorder_sum(r, &t);
    recorder_destroy(r);
    free(payload);
    assert_in_range(t.n_files, 3, 15);
    for (unsigned k = 1; k <= t.n_files; k++) {
        assert_true(begins_with_a_survey(part_path(g, k), &n));
        sum += n;
    }
    assert_int_equal(sum, 300 + t.n_files);
    assert_int_equal(t.messages, 301);
    assert_int_equal(t.unwritten, 0);
}

static void the_launch_file_is_kept_with_what_its_uri_names(void **state)
{
    struct rig *g = *state;
    const struct recorder_config cfg = config(g);
    struct error left_out = {""}, why = {""};
    struct launchfile *l;
    char text[256], path[600];

    scratch_folder(g->scratch, "scenes");
    scratch_write(g->scratch, "scenes/room.yaml", "a: room\n");
    scratch_write(g->scratch, "cal.yaml", "a: calibration\n");
    snprintf(path, sizeof path, "%s",
             scratch_write(g->scratch, "my.yaml",
                           "nodes: [array]\narray:\n"
                           "  uri: \"sim:scenes/room.yaml?calibrated=cal.yaml\"\n"));
    if (launchfile_load(&l, path, NULL, &why) ||
        session_add_launch(&g->session, l, &left_out, &why))
        fail_msg("%s", why.text);
    launchfile_destroy(l);
    assert_string_equal(left_out.text, "");
    struct recorder *r = start(&cfg);
    put_at(r, 0, 0);
    end_at(r, 0);
    recorder_destroy(r);
    assert_true(find_metadata(g->bag, MANIFEST_SESSION, 0, MANIFEST_LAUNCH, text));
    assert_string_equal(text, "launch/my.yaml");
    const char *out = scratch_path(g->scratch, "out.yaml");
    assert_true(save_attachment(g->bag, "launch/my.yaml", out));
    assert_true(save_attachment(g->bag, "launch/cal.yaml", out));
    assert_true(save_attachment(g->bag, "launch/scenes/room.yaml", out));
    FILE *f = fopen(out, "r");
    assert_non_null(f);
    assert_non_null(fgets(text, sizeof text, f));
    fclose(f);
    assert_string_equal(text, "a: room\n");
}

static void the_session_says_when_and_with_what_it_was_made(void **state)
{
    struct rig *g = *state;
    const struct recorder_config cfg = config(g);
    char text[256], host[256] = "";

    recorder_destroy(start(&cfg));
    assert_true(find_metadata(g->bag, MANIFEST_SESSION, 0, MANIFEST_STARTED, text));
    assert_string_equal(text, "2023-11-14T22:13:20.123456789Z");
    assert_true(find_metadata(g->bag, MANIFEST_SESSION, 0, MANIFEST_START_NS, text));
    assert_string_equal(text, "1700000000123456789");
    assert_true(find_metadata(g->bag, MANIFEST_SESSION, 0, MANIFEST_VERSION, text));
    assert_string_equal(text, ANLOS_VERSION);
    assert_true(find_metadata(g->bag, MANIFEST_SESSION, 0, MANIFEST_REVISION, text));
    assert_true(text[0] != '\0');
    gethostname(host, sizeof host - 1);
    assert_true(find_metadata(g->bag, MANIFEST_SESSION, 0, MANIFEST_HOST, text));
    assert_string_equal(text, host);
    assert_false(find_metadata(g->bag, MANIFEST_SESSION, 0, MANIFEST_LAUNCH, text));
}

static void topics_are_chosen_by_patterns_and_exclusions(void **state)
{
    struct error why = {""};
    struct choice c;

    (void)state;
    assert_int_equal(choice_make(&c, "ping,scan/*,survey", "scan/st*", &why), 0);
    assert_int_equal(c.n, 2);
    assert_ptr_equal(c.topics[0], topic_survey());
    assert_ptr_equal(c.topics[1], topic_ping());
    choice_clear(&c);
    assert_int_equal(choice_make(&c, "pings", NULL, &why), -EINVAL);
    assert_contains(why.text, "\"pings\"");
    assert_int_equal(choice_make(&c, "*", "foo*", &why), -EINVAL);
    assert_contains(why.text, "\"foo*\"");
    assert_int_equal(choice_make(&c, "ping", "*", &why), -EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        RIG_TEST(the_survey_goes_into_each_part_and_a_part_begins_with_one),
        RIG_TEST(a_part_that_cannot_wait_for_a_survey_has_the_last_one_again),
        RIG_TEST(the_launch_file_is_kept_with_what_its_uri_names),
        RIG_TEST(the_session_says_when_and_with_what_it_was_made),
        cmocka_unit_test(topics_are_chosen_by_patterns_and_exclusions),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
