/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "dsp/list.h"

static void what_is_in_a_list_stays_while_it_grows(void **state)
{
    struct pair {
        size_t a;
        char b;
    } *list = NULL;
    size_t room = 0, moved = 0;

    (void)state;
    for (size_t n = 0; n < 1000; n++) {
        size_t before = room;
        assert_int_equal(list_grow(&list, n, &room, sizeof *list), 0);
        assert_true(room > n);
        moved += room != before;
        list[n] = (struct pair){n, (char)(n % 100)};
    }
    for (size_t n = 0; n < 1000; n++) {
        assert_int_equal(list[n].a, n);
        assert_int_equal(list[n].b, n % 100);
    }
    assert_in_range(moved, 1, 10);
    free(list);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_in_a_list_stays_while_it_grows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
