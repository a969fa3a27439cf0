/* SPDX-License-Identifier: MIT */
#include "tests/hal/scratch.h"

#include <errno.h>

#include "nodes/launcher/truth.h"
#include "tests/nodes/near.h"

static void hide(struct truth *t, double x, double y, double z)
{
    t->objects[t->n_objects++] =
        (struct truth_object){.name = "thing", .position_m = {x, y, z}, .found = -1};
}

static void find(struct truth *t, double x, double y, double z)
{
    t->detections[t->n_detections++] =
        (struct truth_detection){.position_m = {x, y, z}, .existence = 0.9, .object = -1};
}

static void the_nearest_pairs_match_whatever_their_order(void **state)
{
    struct truth t = {0};

    (void)state;
    hide(&t, 0.0, 0, 0);
    hide(&t, 0.3, 0, 0);
    find(&t, 0.29, 0, 0); /* near both, nearest to the second */
    find(&t, 0.10, 0, 0);
    truth_match(&t);
    assert_int_equal(t.objects[0].found, 1);
    assert_int_equal(t.objects[1].found, 0);
}

static void what_is_too_far_matches_nothing(void **state)
{
    struct truth t = {0};

    (void)state;
    hide(&t, 0, 0, 0);
    find(&t, 0, 0, 0.51);
    truth_match(&t);
    assert_int_equal(t.objects[0].found, -1);
    assert_int_equal(t.detections[0].object, -1);
}

static void each_is_matched_once(void **state)
{
    struct truth t = {0};

    (void)state;
    hide(&t, 0, 0, 0);
    find(&t, 0.02, 0, 0);
    find(&t, 0.01, 0, 0);
    truth_match(&t);
    assert_int_equal(t.objects[0].found, 1);
    assert_int_equal(t.detections[0].object, -1);
}

static void detections_and_scene_are_read_in_the_same_frame(void **state)
{
    struct scratch *s = *state;
    struct truth t = {0};
    struct error why = {""};

    scratch_write(s, "detections.json",
                  "{\"frame\": \"vehicle\", \"mirrored_at_wall\": true, \"detections\": "
                  "[{\"position_m\": [0.4, 0.2, 0.44], \"existence\": 0.8}]}");
    if (truth_read_detections(&t, s->folder, &why) ||
        truth_read_scene(&t, SOURCE_DIR "/tests/nodes/point.yaml", &why))
        fail_msg("%s", why.text);
    assert_int_equal(t.n_detections, 1);
    assert_near(t.detections[0].existence, 0.8, 0.0);
    /* (0.13, 0.11, 0.4) in the array frame; the mount turns x y z to y z x, 0.3 m up. */
    assert_int_equal(t.n_objects, 1);
    assert_near(t.objects[0].position_m[0], 0.4, 1e-12);
    assert_near(t.objects[0].position_m[1], 0.13, 1e-12);
    assert_near(t.objects[0].position_m[2], 0.41, 1e-12);
    assert_string_equal(t.objects[0].name, "point (point)");
    truth_match(&t);
    assert_int_equal(t.objects[0].found, 0);
}

static void without_a_wall_the_images_are_compared(void **state)
{
    struct scratch *s = *state;
    struct truth t = {0};

    scratch_write(s, "detections.json",
                  "{\"frame\": \"array\", \"mirrored_at_wall\": false, "
                  "\"detections\": []}");
    assert_int_equal(truth_read_detections(&t, s->folder, NULL), 0);
    assert_int_equal(truth_read_scene(&t, SOURCE_DIR "/tests/nodes/point.yaml", NULL), 0);
    assert_near(t.objects[0].position_m[2], 1.2, 1e-12);
}

/* The last list of a drive belongs to a moment that nobody noted. */
static void what_moves_is_not_compared_with_where_it_began(void **state)
{
    struct scratch *s = *state;
    struct truth t = {0};
    char text[512] = "";
    FILE *f = fmemopen(text, sizeof text - 1, "w");

    assert_non_null(f);
    scratch_write(s, "detections.json",
                  "{\"frame\": \"vehicle\", \"mirrored_at_wall\": true, "
                  "\"detections\": []}");
    assert_int_equal(truth_read_detections(&t, s->folder, NULL), 0);
    assert_int_equal(
        truth_read_scene(&t, SOURCE_DIR "/launch/scenes/drive-person.yaml", NULL), 0);
    assert_true(t.moving && t.n_objects == 0);
    truth_print(&t, f);
    fclose(f);
    assert_contains(text, "what is hidden moves");
}

static void a_file_that_is_missing_or_broken_is_named(void **state)
{
    struct scratch *s = *state;
    struct truth t = {0};
    struct error why = {""};

    assert_int_equal(truth_read_detections(&t, s->folder, &why), -ENOENT);
    assert_contains(why.text, "detections.json");
    scratch_write(s, "detections.json", "{\"frame\": \"array\", \"detections\": [{}]}");
    assert_int_equal(truth_read_detections(&t, s->folder, &why), -EINVAL);
    assert_contains(why.text, "is not a list of detections");
}

static void the_table_names_what_was_found_missed_and_made_up(void **state)
{
    struct truth t = {.frame = "vehicle", .mirrored = 1};
    char *text = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);

    (void)state;
    hide(&t, 1, 0, 0);
    hide(&t, 5, 0, 0);
    find(&t, 1, 0, 0.02);
    find(&t, 3, 0, 0);
    truth_match(&t);
    truth_print(&t, f);
    assert_int_equal(fclose(f), 0);
    assert_contains(text, "2.0 cm      90 %");
    assert_contains(text, "not found");
    for (const char *line = text; line; line = strchr(line + 1, '\n'))
        assert_true(strcspn(line + 1, "\n") <= 80); /* on any terminal */
    assert_contains(text, "nothing there");
    assert_contains(text, "vehicle frame");
    free(text);
}

/* A recording: what is found is listed, and nothing is said about what is not known. */
static void without_a_truth_the_table_lists_what_was_found(void **state)
{
    struct truth t = {.frame = "array", .mirrored = 1};
    char *text = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);

    (void)state;
    find(&t, 1, 0, 0.02);
    truth_match(&t);
    truth_print(&t, f);
    assert_int_equal(fclose(f), 0);
    assert_contains(text, "reported at (m)");
    assert_contains(text, "  1.000  0.000  0.020");
    assert_contains(text, "90 %");
    assert_null(strstr(text, "really"));
    assert_null(strstr(text, "error"));
    assert_null(strstr(text, "nothing there"));
    free(text);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_nearest_pairs_match_whatever_their_order),
        cmocka_unit_test(what_is_too_far_matches_nothing),
        cmocka_unit_test(each_is_matched_once),
        TEST(detections_and_scene_are_read_in_the_same_frame),
        TEST(without_a_wall_the_images_are_compared),
        TEST(what_moves_is_not_compared_with_where_it_began),
        TEST(a_file_that_is_missing_or_broken_is_named),
        cmocka_unit_test(without_a_truth_the_table_lists_what_was_found),
        cmocka_unit_test(the_table_names_what_was_found_missed_and_made_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
