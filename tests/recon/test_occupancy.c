/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/detection/occupancy.h"
#include "tests/recon/dice.h"

enum { NX = 64, NZ = 24, BLOCKS = NX * NZ, LOOKS = 4 };

#define PING_NS 24000000LL
#define SURE    0.95

/* 8 cm, from 2.3 m on. */
static const struct grid blocks = {{-2.56, 0, 2.3}, {0.08, 0.1, 0.08}, {NX, 1, NZ}};
static const struct sidelobe_array array = {.half_m = {0.5, 0, 0}, .gate_m = 6.0};

struct rig {
    struct occupancy *o;
    unsigned long long seed;
    int64_t stamp_ns;
    float power[BLOCKS];
};

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || occupancy_create(&r->o, &blocks, &array))
        return -1;
    r->seed = 20261126;
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    occupancy_destroy(r->o);
    free(r);
    return 0;
}

/* Gamma distributed of shape LOOKS and mean 1: a mean of that many exponential powers. */
static float noise(struct rig *r)
{
    double sum = 0.0;

    for (int k = 0; k < LOOKS; k++)
        sum -= log(1.0 - reference_random(&r->seed));
    return (float)(sum / LOOKS);
}

static void noise_image(struct rig *r)
{
    for (int i = 0; i < BLOCKS; i++)
        r->power[i] = noise(r);
}

/* Scales what is within 12 cm, as an echo in noise does, which is as noise of more power.
 */
static void show(struct rig *r, double x_m, double z_m, float times)
{
    for (int i = 0; i < BLOCKS; i++) {
        double x = blocks.origin_m[0] + blocks.step_m[0] * (i % NX);
        double z = blocks.origin_m[2] + blocks.step_m[2] * (double)(i / NX);
        if (hypot(x - x_m, z - z_m) < 0.12)
            r->power[i] *= times;
    }
}

static void step(struct rig *r)
{
    r->stamp_ns += PING_NS;
    occupancy_step(r->o, r->power, r->stamp_ns);
}

/* A minute, of which nobody tells in advance how noise is distributed. */
static void hear_noise(struct rig *r, int pings)
{
    for (int k = 0; k < pings; k++) {
        noise_image(r);
        step(r);
        occupancy_learn(r->o, NULL, 0, 0.0);
    }
}

static double at(const struct rig *r, double x_m, double z_m)
{
    return occupancy_near(r->o, (const double[3]){x_m, 0, z_m}, 0.5);
}

/* One comes in ten seconds, as far as it knows, and one of twenty that it is sure of is
 * none: in five minutes one or two. */
static void noise_seldom_looks_like_somebody(void **state)
{
    struct rig *r = *state;
    struct occupancy_spot spots[4];
    int taken_for_somebody = 0;
    bool before = false;

    hear_noise(r, 100);
    for (int k = 0; k < 12500; k++) {
        hear_noise(r, 1);
        bool now = occupancy_spots(r->o, SURE, 1.0, spots, 4) > 0;
        taken_for_somebody += now && !before;
        before = now;
    }
    assert_true(taken_for_somebody <= 3);
}

/* By three pings of sixteen, as of an array of which most stands behind a corner. */
static void who_is_heard_by_few_pings_is_seen_within_two_rounds(void **state)
{
    struct rig *r = *state;
    struct occupancy_spot spots[4];
    int pings = 0;

    hear_noise(r, 400);
    assert_true(at(r, 0.8, 3.3) < 0.2);
    for (; pings < 32 && at(r, 0.8, 3.3) < SURE; pings++) {
        noise_image(r);
        if (pings % 16 < 3)
            show(r, 0.8, 3.3, 12.0f);
        step(r);
    }
    assert_true(pings <= 19);
    assert_int_equal(occupancy_spots(r->o, SURE, 1.0, spots, 4), 1);
    assert_near(spots[0].at_m[0], 0.8, 0.12);
    assert_near(spots[0].at_m[2], 3.3, 0.12);
    assert_true(spots[0].probability >= SURE && spots[0].probability < 1.0);
}

static void who_walks_stays_seen_and_leaves_nobody_behind(void **state)
{
    struct rig *r = *state;
    const double speed_m_s = 2.0;

    hear_noise(r, 400);
    for (int k = 0; k < 60; k++) {
        double x_m = -1.5 + speed_m_s * 1e-9 * PING_NS * k;
        noise_image(r);
        if (k % 5 < 2)
            show(r, x_m, 3.0, 30.0f);
        step(r);
        if (k > 20) {
            assert_true(at(r, x_m, 3.0) > 0.9);
            assert_true(at(r, x_m - 1.5, 3.0) < 0.5);
        }
    }
}

/* A second after he was heard last nobody knows any more. */
static void who_is_not_heard_any_more_is_forgotten(void **state)
{
    struct rig *r = *state;

    hear_noise(r, 400);
    for (int k = 0; k < 20; k++) {
        noise_image(r);
        show(r, 0.0, 3.0, 30.0f);
        step(r);
    }
    assert_true(at(r, 0.0, 3.0) > 0.99);
    hear_noise(r, 40);
    assert_true(at(r, 0.0, 3.0) < 0.2);
}

static void what_is_always_there_is_nobody_new(void **state)
{
    struct rig *r = *state;
    const double held[1][3] = {{1.5, 0, 3.5}};

    hear_noise(r, 400);
    for (int k = 0; k < 1500; k++) {
        noise_image(r);
        show(r, -1.0, 3.2, 6.0f);
        show(r, 1.5, 3.5, 6.0f);
        step(r);
        occupancy_learn(r->o, held, 1, 0.6);
    }
    assert_true(at(r, -1.0, 3.2) < 0.2);
    assert_true(at(r, 1.5, 3.5) > SURE); /* that one was known to be somebody */
}

/* What is as far away is fainter by 9 dB, and what is as far for some elements by 20. */
static void what_looks_like_somebody_else_is_nobody(void **state)
{
    struct rig *r = *state;
    struct occupancy_spot spots[4];

    hear_noise(r, 400);
    for (int k = 0; k < 60; k++) {
        noise_image(r);
        show(r, 0.0, 3.0, 1000.0f);
        show(r, 1.5, 2.6, 120.0f);
        show(r, -1.5, 3.0, 10.0f);
        step(r);
        size_t n = occupancy_spots(r->o, SURE, 1.0, spots, 4);
        assert_true(n <= 1);
        if (n)
            assert_near(spots[0].at_m[0], 0.0, 0.3);
    }
    assert_true(at(r, 0.0, 3.0) > SURE);
}

/* The mean of ten seconds, or of all since it began, over what is there now: of who
 * passed within a second a tenth of his own power. */
static void it_knows_how_bright_it_was_there_lately(void **state)
{
    struct rig *r = *state;
    const double at_m[3] = {0.0, 0.0, 3.0};

    hear_noise(r, 400);
    for (int k = 0; k < 42; k++) {
        for (int i = 0; i < BLOCKS; i++)
            r->power[i] = 1.0f;
        show(r, at_m[0], at_m[2], 100.0f);
        step(r);
    }
    double past = exp(-42 * 1e-9 * PING_NS / OCCUPANCY_LATELY_S);
    double before = exp(-441 * 1e-9 * PING_NS / OCCUPANCY_LATELY_S);
    double mean = (1.0 - past + (past - before) * 0.01) / (1.0 - before);
    assert_near(occupancy_lately(r->o, at_m, 0.2), mean, 0.01);
}

/* One ping may be anything: of a mean of a tenth of a second it is a fifth. */
static void one_ping_alone_is_not_what_is_there(void **state)
{
    struct rig *r = *state;
    const double at_m[3] = {0.0, 0.0, 3.0};
    double ping_s = 1e-9 * PING_NS, now = exp(-ping_s / 0.1);
    double past = exp(-ping_s / OCCUPANCY_LATELY_S);

    hear_noise(r, 400);
    for (int k = 0; k < 2000; k++) {
        for (int i = 0; i < BLOCKS; i++)
            r->power[i] = 1.0f;
        if (k == 1999)
            show(r, at_m[0], at_m[2], 100.0f);
        step(r);
    }
    double lately = past + (1.0 - past) * 100.0, is = now + (1.0 - now) * 100.0;
    assert_near(occupancy_lately(r->o, at_m, 0.2), lately / is, 0.1 * lately / is);
}

static void what_is_not_newer_restarts_it(void **state)
{
    struct rig *r = *state;
    static const int64_t gaps_ns[] = {0, -PING_NS, 1100000000LL};

    for (size_t i = 0; i < sizeof gaps_ns / sizeof *gaps_ns; i++) {
        hear_noise(r, 200);
        for (int k = 0; k < 20; k++) {
            noise_image(r);
            show(r, 0.0, 3.0, 30.0f);
            step(r);
        }
        assert_true(at(r, 0.0, 3.0) > SURE);
        r->stamp_ns += gaps_ns[i] - PING_NS;
        step(r);
        assert_true(at(r, 0.0, 3.0) < 0.5);
        r->stamp_ns += 10 * PING_NS;
    }
}

/* Beyond the gate, or all of it. */
static void what_was_not_imaged_tells_nothing(void **state)
{
    struct rig *r = *state;

    hear_noise(r, 400);
    for (int k = 0; k < 20; k++) {
        noise_image(r);
        for (int i = 0; i < BLOCKS / 2; i++)
            r->power[i] = 0.0f;
        step(r);
    }
    assert_true(at(r, 0.0, 2.6) < 0.2);
    memset(r->power, 0, sizeof r->power);
    step(r);
    assert_true(at(r, 0.0, 3.8) < 0.2);
}

static void most_likely_comes_first_and_no_more_than_asked_for(void **state)
{
    struct rig *r = *state;
    struct occupancy_spot spots[3];

    hear_noise(r, 400);
    for (int k = 0; k < 4; k++) {
        noise_image(r);
        show(r, -1.6, 2.6, 30.0f);
        if (k < 3)
            show(r, 1.6, 3.9, 30.0f);
        step(r);
    }
    size_t n = occupancy_spots(r->o, 0.5, 1.0, spots, 3);
    assert_int_equal(n, 2);
    assert_true(spots[0].probability >= spots[1].probability);
    assert_near(spots[0].at_m[0], -1.6, 0.15);
    assert_int_equal(occupancy_spots(r->o, 0.5, 1.0, spots, 1), 1);
    assert_near(spots[0].at_m[0], -1.6, 0.15);
    occupancy_reset(r->o);
    assert_int_equal(occupancy_spots(r->o, 0.5, 1.0, spots, 3), 0);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)
    const struct CMUnitTest tests[] = {
        TEST(noise_seldom_looks_like_somebody),
        TEST(who_is_heard_by_few_pings_is_seen_within_two_rounds),
        TEST(who_walks_stays_seen_and_leaves_nobody_behind),
        TEST(who_is_not_heard_any_more_is_forgotten),
        TEST(what_is_always_there_is_nobody_new),
        TEST(what_looks_like_somebody_else_is_nobody),
        TEST(it_knows_how_bright_it_was_there_lately),
        TEST(one_ping_alone_is_not_what_is_there),
        TEST(what_is_not_newer_restarts_it),
        TEST(what_was_not_imaged_tells_nothing),
        TEST(most_likely_comes_first_and_no_more_than_asked_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
