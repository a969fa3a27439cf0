/* SPDX-License-Identifier: MIT */
/* Cells that stay, flicker and are passed by, an image each 24 ms. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "dsp/cfar_map.h"

#define STEP_NS INT64_C(24000000)
#define STEP_S  0.024

enum { CELLS = 9, MIDDLE = 4 };

struct rig {
    struct cfar_map *map;
    int64_t now_ns;
};

static int setup(void **state)
{
    static struct rig r;

    r = (struct rig){.now_ns = 1};
    *state = &r;
    return cfar_map_create(&r.map, CELLS);
}

static int teardown(void **state)
{
    cfar_map_destroy(((struct rig *)*state)->map);
    return 0;
}

/* The middle cell shows this, the others 1. */
static void image(struct rig *r, double middle, const bool *held)
{
    float x[CELLS];

    for (int i = 0; i < CELLS; i++)
        x[i] = i == MIDDLE ? (float)middle : 1.0f;
    cfar_map_learn(r->map, x, held, r->now_ns += STEP_NS);
}

static double level_db(const struct rig *r)
{
    return 10.0 * log10(cfar_map_at(r->map, MIDDLE));
}

/* 6 dB a second: 60 dB take 10 s, and 0.024 s of that is a step. */
static void what_is_always_there_becomes_known(void **state)
{
    struct rig *r = *state;

    image(r, 1e6, NULL);
    assert_true(fabs(level_db(r)) < 1e-6); /* it may be new */
    for (double t = 0.0; t < 5.0; t += STEP_S)
        image(r, 1e6, NULL);
    assert_true(fabs(level_db(r) - 30.0) < 0.2);
    for (double t = 0.0; t < 6.0; t += STEP_S)
        image(r, 1e6, NULL);
    assert_true(fabs(level_db(r) - 60.0) < 1e-3);
    assert_true(cfar_map_at(r->map, 0) == 1.0);
}

static void what_passes_leaves_little_however_bright_it_is(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 100; k++)
        image(r, 1.0, NULL);
    for (double t = 0.0; t < 0.5 - STEP_S; t += STEP_S)
        image(r, 1e8, NULL);
    assert_true(level_db(r) <= 3.0 && level_db(r) > 2.7);
    for (double t = 0.0; t < 2.0; t += STEP_S)
        image(r, 1.0, NULL);
    assert_true(fabs(level_db(r)) < 1e-3);
}

/* Of sin^2, a fifth of the time is over sin^2(0.8 pi / 2) = 0.905; in half a period of
 * 1.3 Hz a level moves by 1.2 dB at most. */
static void what_rocks_is_known_by_what_it_mostly_stays_under(void **state)
{
    struct rig *r = *state;

    for (double t = 0.0; t < 20.0; t += STEP_S)
        image(r, 1.0 + 100.0 * pow(sin(2.0 * M_PI * 0.65 * t), 2.0), NULL);
    for (double t = 20.0; t < 25.0; t += STEP_S) {
        image(r, 1.0 + 100.0 * pow(sin(2.0 * M_PI * 0.65 * t), 2.0), NULL);
        assert_true(fabs(level_db(r) - 10.0 * log10(91.5)) < 1.2);
    }
}

static void what_is_held_or_not_imaged_or_long_ago_is_left_as_it_was(void **state)
{
    static const bool held[CELLS] = {[MIDDLE] = true};
    struct rig *r = *state;

    image(r, 1.0, NULL);
    for (int k = 0; k < 100; k++)
        image(r, 1e4, held);
    assert_true(level_db(r) == 0.0);
    image(r, 0.0, NULL);
    assert_true(level_db(r) == 0.0);
    r->now_ns += 50 * STEP_NS;
    image(r, 1e4, NULL);
    assert_true(level_db(r) == 0.0);
    cfar_map_reset(r->map);
    assert_true(cfar_map_at(r->map, MIDDLE) == 0.0);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_is_always_there_becomes_known),
        TEST(what_passes_leaves_little_however_bright_it_is),
        TEST(what_rocks_is_known_by_what_it_mostly_stays_under),
        TEST(what_is_held_or_not_imaged_or_long_ago_is_left_as_it_was),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
