/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>

#include "dsp/error.h"

static void what_is_said_is_kept_and_the_error_returned(void **state)
{
    struct error e = {""};

    (void)state;
    assert_int_equal(error_say(&e, -EINVAL, "%s:%d: wrong", "a.yaml", 3), -EINVAL);
    assert_string_equal(e.text, "a.yaml:3: wrong");
    assert_int_equal(error_say(NULL, -ENOMEM, "out of memory"), -ENOMEM);
}

static void a_separator_stands_between_words_alone(void **state)
{
    char text[32] = "";

    (void)state;
    text_add(text, sizeof text, ", ", "%s", "one");
    assert_string_equal(text, "one");
    text_add(text, sizeof text, ", ", "%s %d", "two", 2);
    text_add(text, sizeof text, " or ", "three");
    assert_string_equal(text, "one, two 2 or three");
}

/* Nothing is written behind the end, wherever it is. */
static void what_there_is_no_room_for_is_cut(void **state)
{
    (void)state;
    for (size_t size = 1; size < 9; size++) {
        char text[10] = "", whole[] = "ab, cd, cd";
        text[size] = '#';
        for (int i = 0; i < 3; i++)
            text_add(text, size, ", ", "%s", i ? "cd" : "ab");
        assert_int_equal(text[size], '#');
        whole[size - 1] = 0;
        assert_string_equal(text, whole);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_said_is_kept_and_the_error_returned),
        cmocka_unit_test(a_separator_stands_between_words_alone),
        cmocka_unit_test(what_there_is_no_room_for_is_cut),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
