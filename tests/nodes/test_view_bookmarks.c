/* SPDX-License-Identifier: MIT */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <math.h>
#include <unistd.h>

#include "nodes/view/bookmarks.h"
#include "tests/nodes/near.h"

static const char *bag_of(struct scratch *s)
{
    return scratch_path(s, "a.mcap");
}

static void assert_file(struct scratch *s, const char *expected)
{
    char text[1000] = "";
    FILE *f = fopen(scratch_path(s, "a.mcap.bookmarks"), "r");

    assert_non_null(f);
    assert_true(fread(text, 1, sizeof text - 1, f) > 0);
    fclose(f);
    assert_string_equal(text, expected);
}

static void assert_bookmark(const struct bookmarks *b, size_t i, double at_s,
                            const char *name)
{
    assert_true(i < b->n);
    assert_near(b->list[i].at_s, at_s, 1e-9);
    assert_string_equal(b->list[i].name, name);
}

static void what_a_person_wrote_is_read_in_the_order_of_its_times(void **state)
{
    struct scratch *s = *state;
    struct bookmarks b = {0};
    struct error why = {""};

    assert_int_equal(bookmarks_read(&b, bag_of(s), &why), 0);
    assert_int_equal(b.n, 0);
    scratch_write(s, "a.mcap.bookmarks",
                  "12.5 cyclist behind the bus\r\n\n  3\tB\xc3\xa4r\n12.5 again");
    if (bookmarks_read(&b, bag_of(s), &why))
        fail_msg("%s", why.text);
    assert_int_equal(b.n, 3);
    assert_bookmark(&b, 0, 3.0, "B\xc3\xa4r");
    assert_bookmark(&b, 1, 12.5, "cyclist behind the bus");
    assert_bookmark(&b, 2, 12.5, "again");
    bookmarks_clear(&b);
}

static void what_is_added_and_removed_is_in_the_file(void **state)
{
    struct scratch *s = *state;
    struct bookmarks b = {0}, read = {0};
    struct error why = {""};

    assert_int_equal(bookmarks_read(&b, bag_of(s), &why), 0);
    assert_int_equal(bookmarks_add(&b, 20.0004, "later", &why), 0);
    assert_int_equal(bookmarks_add(&b, 1.5, "sooner", &why), 0);
    assert_int_equal(bookmarks_add(&b, 3.0, "between", &why), 0);
    assert_file(s, "1.500 sooner\n3.000 between\n20.000 later\n");
    assert_int_equal(bookmarks_remove(&b, 3.0004, &why), 0);
    assert_int_equal(bookmarks_remove(&b, 3.0, &why), -ENOENT);
    assert_int_equal(bookmarks_remove(&b, NAN, &why), -ENOENT);
    assert_int_equal(bookmarks_read(&read, bag_of(s), &why), 0);
    assert_int_equal(read.n, 2);
    assert_bookmark(&read, 0, 1.5, "sooner");
    assert_bookmark(&read, 1, 20.0, "later");
    bookmarks_clear(&read);
    bookmarks_clear(&b);
}

static void what_is_no_bookmark_is_refused_and_the_file_left_alone(void **state)
{
    struct scratch *s = *state;
    static const char *const wrong[] = {
        "x",
        "12.5",
        "12.5 ",
        "-1 early",
        "nan never",
        "1e300 late",
        "1 a\x01b",
        "1 B\xe4r", /* Latin 1 */
        ("1 0123456789012345678901234567890123456789012345678901234567890123456789"
         "0123456789x")};
    char long_line[400];

    memset(long_line, 'a', sizeof long_line);
    long_line[0] = '1';
    long_line[1] = ' ';
    long_line[sizeof long_line - 1] = '\0';
    for (size_t i = 0; i <= sizeof wrong / sizeof *wrong; i++) {
        struct bookmarks b = {0};
        struct error why = {""};
        bool last = i == sizeof wrong / sizeof *wrong;
        char text[500];
        snprintf(text, sizeof text, "1 good\n%s\n", last ? long_line : wrong[i]);
        scratch_write(s, "a.mcap.bookmarks", text);
        assert_int_equal(bookmarks_read(&b, bag_of(s), &why), -EINVAL);
        assert_non_null(strstr(why.text, "a.mcap.bookmarks:2: "));
        assert_int_equal(b.n, 0);
        assert_file(s, text);
        bookmarks_clear(&b);
    }
}

static void a_name_or_time_that_is_none_is_not_added(void **state)
{
    struct scratch *s = *state;
    struct bookmarks b = {0};
    struct error why = {""};
    char name[BOOKMARK_NAME_SIZE + 1];

    assert_int_equal(bookmarks_read(&b, bag_of(s), &why), 0);
    memset(name, 'n', sizeof name);
    name[BOOKMARK_NAME_SIZE] = '\0';
    assert_int_equal(bookmarks_add(&b, 1.0, name, &why), -EINVAL);
    assert_int_equal(bookmarks_add(&b, 1.0, "", &why), -EINVAL);
    assert_int_equal(bookmarks_add(&b, 1.0, "two\nlines", &why), -EINVAL);
    assert_int_equal(bookmarks_add(&b, 1.0, "B\xe4r", &why), -EINVAL);
    assert_int_equal(bookmarks_add(&b, -1.0, "early", &why), -EINVAL);
    assert_int_equal(bookmarks_add(&b, NAN, "never", &why), -EINVAL);
    assert_int_equal(access(b.path, F_OK), -1);
    name[BOOKMARK_NAME_SIZE - 1] = '\0';
    for (int i = 0; i < BOOKMARKS_MOST; i++)
        assert_int_equal(bookmarks_add(&b, 0.5 * i, i ? "x" : name, &why), 0);
    assert_int_equal(bookmarks_add(&b, 1.0, "one too many", &why), -ENOSPC);
    assert_int_equal(b.n, BOOKMARKS_MOST);
    bookmarks_clear(&b);
}

/* A folder that nobody may write into, also where the tests are root's: it is gone. */
static void where_nothing_can_be_written_all_is_as_before(void **state)
{
    struct scratch *s = *state;
    struct bookmarks b = {0};
    struct error why = {""};
    char bag[200];

    snprintf(bag, sizeof bag, "%s/gone/a.mcap", s->folder);
    assert_int_equal(bookmarks_read(&b, bag, &why), 0);
    assert_int_not_equal(bookmarks_add(&b, 1.0, "lost", &why), 0);
    assert_true(why.text[0]);
    assert_int_equal(b.n, 0);
    bookmarks_clear(&b);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_a_person_wrote_is_read_in_the_order_of_its_times),
        TEST(what_is_added_and_removed_is_in_the_file),
        TEST(what_is_no_bookmark_is_refused_and_the_file_left_alone),
        TEST(a_name_or_time_that_is_none_is_not_added),
        TEST(where_nothing_can_be_written_all_is_as_before),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
