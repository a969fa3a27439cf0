/* SPDX-License-Identifier: MIT */
/* Which faults of the nodes' health messages are new: each once while it lasts. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "nodes/record/snapshot.h"

#define S     1000000000LL
#define AGAIN (3600 * S)

struct said { /* by one node; names NULL: not that many */
    const char *node;
    Anlos__Health__State state;
    const char *names[3];
    uint32_t counts[3];
};

static const char *next(struct new_faults *f, const struct said *said, int64_t now_ns)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__Fault faults[3], *list[3];

    h.state = said->state;
    h.faults = list;
    for (; h.n_faults < 3 && said->names[h.n_faults]; h.n_faults++) {
        Anlos__Fault *fault = list[h.n_faults] = &faults[h.n_faults];
        anlos__fault__init(fault);
        fault->name = (char *)said->names[h.n_faults];
        fault->count = said->counts[h.n_faults];
    }
    return new_faults_next(f, said->node, &h, now_ns);
}

static void assert_next(struct new_faults *f, const struct said *said, int64_t now_ns,
                        const char *expected)
{
    const char *name = next(f, said, now_ns);

    if (expected) {
        assert_non_null(name);
        assert_string_equal(name, expected);
    } else {
        assert_null(name);
    }
}

static void each_of_several_is_new_once_while_it_lasts(void **state)
{
    struct new_faults f = {.again_ns = AGAIN};
    const struct said both = {
        "dsp", ANLOS__HEALTH__STATE__READY, {"deaf", "mute", "well"}, {1, 2, 0}};
    const struct said other = {"array", ANLOS__HEALTH__STATE__READY, {"deaf"}, {1}};

    (void)state;
    assert_next(&f, &both, 1 * S, "deaf");
    assert_next(&f, &both, 1 * S, "mute");
    assert_next(&f, &both, 1 * S, NULL);
    assert_next(&f, &both, 2 * S, NULL);
    assert_next(&f, &other, 2 * S, "deaf"); /* of another node */
    assert_next(&f, &other, 3 * S, NULL);
    assert_int_equal(f.again, 0);
}

static void what_comes_again_is_new_after_an_hour_and_counted_before(void **state)
{
    struct new_faults f = {.again_ns = AGAIN};
    const struct said deaf = {"dsp", ANLOS__HEALTH__STATE__READY, {"deaf"}, {1}};
    const struct said mute = {"dsp", ANLOS__HEALTH__STATE__READY, {"mute"}, {1}};
    const struct said well = {"dsp", ANLOS__HEALTH__STATE__READY, {NULL}, {0}};

    (void)state;
    assert_next(&f, &deaf, 0, "deaf");
    assert_next(&f, &mute, S, "mute"); /* it is not deaf any more */
    assert_next(&f, &well, 2 * S, NULL);
    assert_next(&f, &mute, 3 * S, NULL);
    assert_int_equal(f.again, 1);
    assert_next(&f, &deaf, AGAIN - 1, NULL);
    assert_int_equal(f.again, 2);
    assert_next(&f, &well, AGAIN, NULL);
    assert_next(&f, &deaf, AGAIN, "deaf");
    assert_int_equal(f.again, 2);
}

static void a_node_that_is_faulty_without_saying_why_is_a_fault(void **state)
{
    struct new_faults f = {.again_ns = AGAIN};
    const struct said named = {"can", ANLOS__HEALTH__STATE__FAULT, {"deaf"}, {1}};
    const struct said bare = {"can", ANLOS__HEALTH__STATE__FAULT, {NULL}, {0}};
    const struct said well = {"can", ANLOS__HEALTH__STATE__READY, {NULL}, {0}};

    (void)state;
    assert_next(&f, &well, 0, NULL);
    assert_next(&f, &named, 0, "deaf");
    assert_next(&f, &named, 0, NULL);
    assert_next(&f, &bare, S, "fault");
    assert_next(&f, &bare, 2 * S, NULL);
    assert_int_equal(f.again, 0);
}

static void a_name_that_is_long_is_one_fault_too(void **state)
{
    struct new_faults f = {.again_ns = AGAIN};
    const struct said said = {"dsp",
                              ANLOS__HEALTH__STATE__READY,
                              {"a_name_of_forty_characters_that_says_all"},
                              {1}};

    (void)state;
    assert_next(&f, &said, 0, said.names[0]);
    assert_next(&f, &said, S, NULL);
    assert_next(&f, &said, 2 * S, NULL);
    assert_int_equal(f.again, 0); /* it lasts */
}

static void more_different_ones_than_are_kept_are_not_told(void **state)
{
    struct new_faults f = {.again_ns = AGAIN};
    char name[24];

    (void)state;
    for (int i = 0; i <= NEW_FAULTS_MAX; i++) {
        const struct said said = {"dsp", ANLOS__HEALTH__STATE__READY, {name}, {1}};
        snprintf(name, sizeof name, "fault %d", i);
        assert_next(&f, &said, 0, i < NEW_FAULTS_MAX ? name : NULL);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_of_several_is_new_once_while_it_lasts),
        cmocka_unit_test(what_comes_again_is_new_after_an_hour_and_counted_before),
        cmocka_unit_test(a_node_that_is_faulty_without_saying_why_is_a_fault),
        cmocka_unit_test(a_name_that_is_long_is_one_fault_too),
        cmocka_unit_test(more_different_ones_than_are_kept_are_not_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
