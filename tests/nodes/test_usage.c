#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "nodes/anlos/usage.h"

static void a_name_that_is_nearly_one_is_found_and_others_are_not(void **state)
{
    static const char *const names[] = {"launch", "topic", "top", "view", NULL};

    (void)state;
    assert_string_equal(usage_nearest("tpoic", names), "topic"); /* two changes */
    assert_string_equal(usage_nearest("launhc", names), "launch");
    assert_string_equal(usage_nearest("to", names), "top");
    assert_null(usage_nearest("xyzzy", names));
    assert_null(usage_nearest("v", names)); /* a letter is near to everything */
    assert_null(usage_nearest("", names));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_name_that_is_nearly_one_is_found_and_others_are_not),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
