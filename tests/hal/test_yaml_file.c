/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>
#include <math.h>
#include <unistd.h>

#include "hal/yaml_file.h"

struct part {
    double start_hz;
    int phase;
};

struct item {
    char name[8];
    double position_m[3];
};

struct root {
    double rate_hz;
    uint32_t slot;
    struct part *part;
    double (*points_m)[3];
    unsigned n_points;
    struct item *items;
    unsigned n_items;
    double *wish;
};

static const cyaml_strval_t phases[] = {{"cosine", 0}, {"sine", 1}};
static const cyaml_schema_value_t number = {
    CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)};
static const cyaml_schema_value_t point = {
    CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number, 3)};
static const cyaml_schema_field_t part_fields[] = {
    CYAML_FIELD_FLOAT("start_hz", CYAML_FLAG_DEFAULT, struct part, start_hz),
    CYAML_FIELD_ENUM("phase", CYAML_FLAG_STRICT | CYAML_FLAG_OPTIONAL, struct part, phase,
                     phases, 2),
    CYAML_FIELD_END};
static const cyaml_schema_field_t item_fields[] = {
    CYAML_FIELD_STRING("name", CYAML_FLAG_DEFAULT, struct item, name, 1),
    CYAML_FIELD_SEQUENCE_FIXED("position_m", CYAML_FLAG_OPTIONAL, struct item, position_m,
                               &number, 3),
    CYAML_FIELD_END};
static const cyaml_schema_value_t item = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct item, item_fields)};
static const cyaml_schema_field_t root_fields[] = {
    CYAML_FIELD_FLOAT("rate_hz", CYAML_FLAG_DEFAULT, struct root, rate_hz),
    CYAML_FIELD_UINT("slot", CYAML_FLAG_OPTIONAL, struct root, slot),
    CYAML_FIELD_MAPPING_PTR("part", CYAML_FLAG_OPTIONAL, struct root, part, part_fields),
    CYAML_FIELD_SEQUENCE_COUNT("points_m", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL,
                               struct root, points_m, n_points, &point, 1, 3),
    CYAML_FIELD_SEQUENCE_COUNT("items", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL,
                               struct root, items, n_items, &item, 0, 9),
    CYAML_FIELD_FLOAT_PTR("wish", CYAML_FLAG_OPTIONAL, struct root, wish),
    CYAML_FIELD_END};
static const cyaml_schema_value_t schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct root, root_fields)};

static const cyaml_schema_field_t wish_fields[] = {
    CYAML_FIELD_FLOAT_PTR("wish", CYAML_FLAG_OPTIONAL, struct root, wish),
    CYAML_FIELD_END};
static const cyaml_schema_value_t wish_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct root, wish_fields)};

static void what_the_schema_says_is_read(void **state)
{
    struct error why = {.text = ""};
    void *data;
    const char *path = scratch_write(*state, "a.yaml",
                                     "rate_hz: 48e3\n"
                                     "part: {start_hz: 2000, phase: sine}\n"
                                     "points_m: [[1, 2, 3], [4, 5, 6.5]]\n"
                                     "items:\n"
                                     "  - name: one\n"
                                     "  - {name: two, position_m: [7, 8, 9]}\n");
    assert_int_equal(yaml_load(path, &schema, &data, &why), 0);
    const struct root *r = data;
    assert_true(r->rate_hz == 48000);
    assert_true(r->part->start_hz == 2000);
    assert_int_equal(r->part->phase, 1);
    assert_int_equal(r->n_points, 2);
    assert_true(r->points_m[1][2] == 6.5);
    assert_int_equal(r->n_items, 2);
    assert_string_equal(r->items[1].name, "two");
    assert_true(r->items[1].position_m[2] == 9);
    assert_null(r->wish);
    yaml_unload(&schema, data);
}

static void wrong_contents_are_named_with_line_and_key(void **state)
{
    static const struct {
        const char *text, *error;
    } cases[] = {
        {"rate_hz: 1\nrate: 2\n",
         ":2: rate: no such key; expected one of rate_hz, slot, part, points_m, items, "
         "wish"},
        {"rate_hz: 1\n\npart:\n  start_hz: 1\n  stop_hz: 2\n",
         ":5: part.stop_hz: no such key; expected one of start_hz, phase"},
        {"slot: 1\n", ":1: the key \"rate_hz\" is missing"},
        {"rate_hz: 1\npart:\n  phase: sine\n",
         ":3: part: the key \"start_hz\" is missing"},
        {"rate_hz: fast\n", ":1: rate_hz: expected a number, found \"fast\""},
        {"rate_hz: 1.5q\n", ":1: rate_hz: expected a number, found \"1.5q\""},
        {"rate_hz:\n", ":1: rate_hz: expected a number, found nothing"},
        {"rate_hz: [1]\n", ":1: rate_hz: expected a number, found a list"},
        {"rate_hz: nan\n", ":1: rate_hz: expected a finite number, found \"nan\""},
        {"rate_hz: 1e999\n", ":1: rate_hz: expected a finite number, found \"1e999\""},
        {"rate_hz: 1\nslot: 2.5\n", ":2: slot: expected a whole number, found \"2.5\""},
        {"rate_hz: 1\nslot: -2\n", ":2: slot: expected 0 or more, not -2"},
        {"rate_hz: 1\nslot: 4294967296\n",
         ":2: slot: 4294967296 is outside 0..4294967295"},
        {"rate_hz: 1\nrate_hz: 2\n", ":2: rate_hz: stands here a second time"},
        {"rate_hz: 1\npart: 3\n", ":2: part: expected keys and values, found \"3\""},
        {"rate_hz: 1\npart: {start_hz: 1, phase: tangent}\n",
         ":2: part.phase: expected one of cosine, sine, found \"tangent\""},
        {"rate_hz: 1\npoints_m: 3\n", ":2: points_m: expected a list, found \"3\""},
        {"rate_hz: 1\npoints_m:\n  - [1, 2, 3]\n  - [1, 2]\n",
         ":4: points_m[1]: expected 3 entries, found 2"},
        {"rate_hz: 1\npoints_m:\n  - [1, 2,\n     up]\n",
         ":4: points_m[0][2]: expected a number, found \"up\""},
        {"rate_hz: 1\npoints_m: []\n",
         ":2: points_m: expected at least 1 entries, found 0"},
        {"rate_hz: 1\nitems:\n  - name: ninetimes\n",
         ":3: items[0].name: \"ninetimes\" is longer than 7 characters"},
        {"rate_hz: 1\nitems:\n  - {name: a}\n  - {position_m: [1, 2, 3]}\n",
         ":4: items[1]: the key \"name\" is missing"},
        {"- 1\n", ":1: expected keys and values, found a list"},
        {"", ":1: the file is empty"},
        {"rate_hz: 1\n---\nrate_hz: 2\n",
         ":3: expected one document, here begins another"},
        {"rate_hz: 1\nslot: [1\npart: 2\n",
         ":3: not YAML: did not find expected ',' or ']'"},
        {"rate_hz: 1\n\tslot: 1\n",
         ":2: not YAML: found a tab character that violates indentation"},
        {"rate_hz: &a 1\nwish: *a\n", ":2: YAML alias unsupported"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {.text = ""};
        void *data = &why;
        const char *path = scratch_write(*state, "bad.yaml", cases[i].text);
        assert_int_equal(yaml_load(path, &schema, &data, &why), -EINVAL);
        assert_null(data);
        assert_error(why.text, path, cases[i].error);
    }
}

static void a_document_that_contains_itself_is_refused(void **state)
{
    struct error why = {.text = ""};
    void *data;
    const char *path =
        scratch_write(*state, "loop.yaml", "rate_hz: 1\npoints_m: &a [*a, *a]\n");
    assert_int_equal(yaml_load(path, &schema, &data, &why), -EINVAL);
    assert_contains(why.text, "loop.yaml:2: points_m");
}

static void files_that_cannot_be_read_say_why(void **state)
{
    struct error why = {.text = ""};
    void *data;
    const char *path = scratch_path(*state, "absent.yaml");
    assert_int_equal(yaml_load(path, &schema, &data, &why), -ENOENT);
    assert_error(why.text, path, ": No such file or directory");
    path = ((struct scratch *)*state)->folder;
    assert_int_equal(yaml_load(path, &schema, &data, &why), -EISDIR);
    assert_error(why.text, path, ": Is a directory");
}

static void a_mapping_without_any_key_is_all_defaults(void **state)
{
    struct error why = {.text = ""};
    void *data;
    const char *path = scratch_write(*state, "none.yaml", "{}\n");
    assert_int_equal(yaml_load(path, &wish_schema, &data, &why), 0);
    assert_non_null(data);
    assert_null(((const struct root *)data)->wish);
    yaml_unload(&wish_schema, data);
}

static void a_place_is_the_line_of_the_key(void **state)
{
    const char *path = scratch_write(*state, "p.yaml",
                                     "a: 1\n"
                                     "b:\n"
                                     "  c: 2\n"
                                     "  d:\n"
                                     "    - 3\n"
                                     "    - e: 4\n");
    assert_int_equal(yaml_line(path, "a"), 1);
    assert_int_equal(yaml_line(path, "b"), 2);
    assert_int_equal(yaml_line(path, "b.c"), 3);
    assert_int_equal(yaml_line(path, "b.d[0]"), 5);
    assert_int_equal(yaml_line(path, "b.d[1].e"), 6);
    assert_int_equal(yaml_line(path, "b.x"), 2);
    assert_int_equal(yaml_line(path, "x"), 0);
    assert_int_equal(yaml_line(path, "b.d[7]"), 4);
    assert_int_equal(yaml_line(path, "b.d[1"), 4);
}

static void complaints_get_the_place_of_the_key_they_speak_of(void **state)
{
    static const struct {
        const char *before, *after;
    } cases[] = {
        {"rate_hz is 480", ":1: rate_hz is 480"},
        {"chirp start_hz is 0", ":3: chirp start_hz is 0"},
        {"chirp_stop_hz is 0", ":4: chirp_stop_hz is 0"},
        {"points_m[1] is far", ":7: points_m[1] is far"},
        {"the weather is bad", ": the weather is bad"},
    };
    const char *path = scratch_write(*state, "c.yaml",
                                     "rate_hz: 480\n"
                                     "chirp:\n"
                                     "  start_hz: 0\n"
                                     "  stop_hz: 0\n"
                                     "points_m:\n"
                                     "  - 1\n"
                                     "  - 2\n");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why;
        error_say(&why, 0, "%s", cases[i].before);
        yaml_place_error(&why, path);
        assert_error(why.text, path, cases[i].after);
    }
}

static void numbers_out_of_their_range_are_named_with_it(void **state)
{
    static const double wrong[] = {0.4, 2.6, -INFINITY, INFINITY, NAN};
    static const char *const words[] = {"0.4", "2.6", "-inf", "inf", "nan"};
    const char *path = scratch_write(*state, "r.yaml", "a: 1\nb:\n  c: 2\n");
    struct error why = {""};
    for (int i = 0; i < 5; i++) {
        char rest[64];
        snprintf(rest, sizeof rest, ":3: b.c: expected 0.5 to 2.5, not %s", words[i]);
        assert_int_equal(yaml_check_range(path, "b.c", wrong[i], 0.5, 2.5, &why),
                         -EINVAL);
        assert_error(why.text, path, rest);
    }
    assert_int_equal(yaml_check_range(path, "b.c", 0.5, 0.5, 2.5, NULL), 0);
    assert_int_equal(yaml_check_range(path, "b.c", 2.5, 0.5, 2.5, NULL), 0);
}

static void siblings_are_relative_to_the_file(void **state)
{
    static const char *const cases[][3] = {{"a/b.yaml", "c", "a/c"},
                                           {"b.yaml", "c/d", "c/d"},
                                           {"a/b.yaml", "/c", "/c"},
                                           {"/b.yaml", "c", "/c"}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char *path = yaml_sibling(cases[i][0], cases[i][1]);
        assert_string_equal(path, cases[i][2]);
        free(path);
    }
}

static void what_is_no_settings_file_by_its_size_is_told_so(void **state)
{
    const char *path = scratch_write(*state, "a.mcap", "");
    struct error why = {""};
    void *data;

    assert_int_equal(truncate(path, YAML_FILE_MAX_SIZE + 1), 0);
    assert_int_equal(yaml_load(path, &schema, &data, &why), -EINVAL);
    assert_non_null(strstr(why.text, "a.mcap: larger than 4 MiB; expected a YAML file"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_the_schema_says_is_read),
        TEST(wrong_contents_are_named_with_line_and_key),
        TEST(a_document_that_contains_itself_is_refused),
        TEST(files_that_cannot_be_read_say_why),
        TEST(what_is_no_settings_file_by_its_size_is_told_so),
        TEST(a_mapping_without_any_key_is_all_defaults),
        TEST(a_place_is_the_line_of_the_key),
        TEST(complaints_get_the_place_of_the_key_they_speak_of),
        TEST(numbers_out_of_their_range_are_named_with_it),
        TEST(siblings_are_relative_to_the_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
