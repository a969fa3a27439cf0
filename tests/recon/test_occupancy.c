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
    int looks;
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
    r->looks = LOOKS;
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

/* Gamma distributed of shape looks and mean 1: a mean of that many exponential powers. */
static float noise(struct rig *r)
{
    double sum = 0.0;

    for (int k = 0; k < r->looks; k++)
        sum -= log(1.0 - reference_random(&r->seed));
    return (float)(sum / r->looks);
}

static double x_of(int block)
{
    return blocks.origin_m[0] + blocks.step_m[0] * (block % NX);
}

static double z_of(int block)
{
    return blocks.origin_m[2] + blocks.step_m[2] * (double)(block / NX);
}

static void noise_image(struct rig *r)
{
    for (int i = 0; i < BLOCKS; i++)
        r->power[i] = noise(r);
}

static void flat_image(struct rig *r)
{
    for (int i = 0; i < BLOCKS; i++)
        r->power[i] = 1.0f;
}

/* What is no nearer than from_m. */
static void scale_from(struct rig *r, double from_m, float times)
{
    for (int i = 0; i < BLOCKS; i++)
        if (hypot(x_of(i), z_of(i)) >= from_m)
            r->power[i] *= times;
}

/* Scales what is within 12 cm, as an echo in noise does, which is as noise of more power.
 */
static void show(struct rig *r, double x_m, double z_m, float times)
{
    for (int i = 0; i < BLOCKS; i++)
        if (hypot(x_of(i) - x_m, z_of(i) - z_m) < 0.12)
            r->power[i] *= times;
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

static size_t count_spots(const struct rig *r)
{
    struct occupancy_spot spots[4];

    return occupancy_spots(r->o, SURE, 1.0, spots, 4);
}

/* anything: in each ping one block, another each time, is a hundred times as bright. */
static int count_sightings(struct rig *r, int pings, bool anything)
{
    int sightings = 0;
    bool before = false;

    for (int k = 0; k < pings; k++) {
        noise_image(r);
        if (anything)
            r->power[(int)(BLOCKS * reference_random(&r->seed))] = 100.0f;
        step(r);
        occupancy_learn(r->o, NULL, 0, 0.0);
        bool now = count_spots(r) > 0;
        sightings += now && !before;
        before = now;
    }
    return sightings;
}

/* One comes in ten seconds, as far as it knows, and one of twenty that it is sure of is
 * none: in five minutes one or two. */
static void noise_seldom_looks_like_somebody(void **state)
{
    struct rig *r = *state;

    hear_noise(r, 100);
    assert_true(count_sightings(r, 12500, false) <= 3);
}

/* As of a single frequency, whose powers are spread most, whether or not a block may be
 * anything: a quarter of a sighting is to be expected in the fifty seconds of both. */
static void nor_does_noise_of_another_distribution(void **state)
{
    struct rig *r = *state;

    r->looks = 1;
    assert_true(count_sightings(r, 1000, false) + count_sightings(r, 1000, true) <= 2);
}

/* Exponential powers, as noise's are taken to be until more is known: those of 1 + s
 * times the mean against it, for each s that the header lists. */
static double likelihood_ratio(double over_median)
{
    double x = over_median * log(2.0), sum = 0.0;

    for (double s = 4.0; s < 325.0; s *= 3.0)
        sum += exp(-x / (1.0 + s)) / (1.0 + s) / exp(-x) / 5.0;
    return 0.6 + 0.4 * sum;
}

static double odds_of_one(struct rig *r, float over_median)
{
    const int block = BLOCKS / 2 + NX / 2;
    const double at_m[3] = {x_of(block), 0.0, z_of(block)};

    occupancy_reset(r->o);
    flat_image(r);
    step(r);
    r->power[block] = over_median;
    step(r);
    double p = occupancy_near(r->o, at_m, 0.01);
    return p / (1.0 - p);
}

static void odds_grow_by_the_likelihood_ratio(void **state)
{
    struct rig *r = *state;
    static const float powers[] = {0.01f, 0.5f, 2.0f, 4.0f, 8.0f, 11.0f};
    double one = odds_of_one(r, 1.0f);

    for (size_t q = 0; q < sizeof powers / sizeof *powers; q++) {
        double expected = likelihood_ratio((double)powers[q]) / likelihood_ratio(1.0);
        assert_near(odds_of_one(r, powers[q]) / one / expected, 1.0, 1e-4);
    }
}

/* In any unit of power. */
static void how_loud_all_of_it_is_does_not_matter(void **state)
{
    struct rig *r = *state;
    static const float units[] = {1.0f, 0x1p-30f, 0x1p30f};
    double seen[3];

    for (int u = 0; u < 3; u++) {
        occupancy_destroy(r->o);
        r->o = NULL;
        assert_int_equal(occupancy_create(&r->o, &blocks, &array), 0);
        r->seed = 1;
        for (int k = 0; k < 20; k++) {
            noise_image(r);
            show(r, 0.8, 3.3, k < 10 ? 1.0f : 12.0f);
            scale_from(r, 0.0, units[u]);
            step(r);
        }
        seen[u] = at(r, 0.8, 3.3);
        assert_true(seen[u] > SURE);
        assert_true(seen[u] == seen[0]);
    }
}

/* A third of the ranges a hundred times as loud as the rest. */
static void noise_is_what_is_as_far_away(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 420; k++) {
        noise_image(r);
        if (k >= 400)
            show(r, 0.8, 3.9, 30.0f);
        scale_from(r, 3.2, 0.01f);
        scale_from(r, 0.0, 100.0f);
        step(r);
        if (k < 400)
            assert_int_equal(count_spots(r), 0);
    }
    assert_true(at(r, 0.8, 3.9) > SURE);
    assert_int_equal(count_spots(r), 1);
}

/* Two fifths of the ranges are not: what is no brighter there than noise elsewhere. */
static void nobody_stands_out_of_what_is_hardly_heard(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 40; k++) {
        flat_image(r);
        scale_from(r, 3.84, 0.05f);
        show(r, 0.0, 4.0, 1.5f / 0.05f);
        step(r);
    }
    assert_true(at(r, 0.0, 4.0) < 0.05);
}

/* Nine blocks are as far away, of which the last five are loud, and so noise is.  With
 * the first of the next nine it would not be. */
static void noise_of_a_range_is_that_of_its_own_blocks(void **state)
{
    static const struct grid rows = {{0.0, 0.0, 2.02}, {0.01, 0.1, 0.08}, {9, 1, 10}};
    float power[90];
    struct occupancy *o;
    (void)state;

    for (int i = 0; i < 90; i++)
        power[i] = i % 9 < 4 ? 1.0f : 16.0f;
    assert_int_equal(occupancy_create(&o, &rows, &array), 0);
    for (int k = 0; k < 20; k++)
        occupancy_step(o, power, k * PING_NS);
    assert_true(occupancy_near(o, (const double[3]){0.06, 0.0, 2.34}, 0.5) < 0.05);
    occupancy_destroy(o);
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

/* One is as soon known as if nobody were one and a half metres away: odds add. */
static void who_comes_near_another_is_himself(void **state)
{
    struct rig *r = *state;
    double alone[26];

    for (int both = 0; both < 2; both++) {
        occupancy_reset(r->o);
        for (int k = 0; k < 26; k++) {
            flat_image(r);
            if (both)
                show(r, -0.6, 2.5, 30.0f);
            if (k >= 20)
                show(r, 0.6, 3.46, 30.0f);
            step(r);
            double p = at(r, 0.6, 3.46);
            if (!both)
                alone[k] = p;
            else if (alone[k] > 0.5)
                assert_true(p > 0.999 * alone[k]);
        }
    }
    assert_true(alone[19] < 0.01 && alone[25] > 0.999);
    assert_int_equal(count_spots(r), 2);
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
    const double held[2][3] = {{0.0, 0, 3.9}, {1.5, 0, 3.5}};

    hear_noise(r, 400);
    for (int k = 0; k < 1500; k++) {
        noise_image(r);
        show(r, -1.0, 3.2, 6.0f);
        show(r, 1.5, 3.5, 6.0f);
        step(r);
        occupancy_learn(r->o, held, 2, 0.6);
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

/* By a metre, for no element of an array of one: what it hears from there is off by half
 * of the difference of the directions, 20 cm, and a person's depth. */
static void nobody_looks_like_him_at_another_range(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 20; k++) {
        flat_image(r);
        show(r, -0.6, 2.5, 1000.0f);
        show(r, 0.6, 3.46, 16.0f);
        step(r);
    }
    assert_int_equal(count_spots(r), 2);
    assert_true(at(r, 0.6, 3.46) > SURE);
}

/* One a third as bright is as far away for some elements only, of which the others cancel
 * the most; but not if these hear nothing from where the brighter one is. */
static void what_some_elements_hear_there_is_cancelled_by_all_others(void **state)
{
    struct rig *r = *state;

    for (int all_hear = 0; all_hear < 2; all_hear++) {
        struct sidelobe_array deep = {.half_m = {0.5, 0.1, 0.1}};
        deep.gate_m = all_hear ? 6.0 : 3.2;
        occupancy_destroy(r->o);
        r->o = NULL;
        assert_int_equal(occupancy_create(&r->o, &blocks, &deep), 0);
        for (int k = 0; k < 20; k++) {
            flat_image(r);
            show(r, -0.8, 3.0, 1000.0f);
            show(r, 0.8, 2.6, 300.0f);
            step(r);
        }
        assert_true(at(r, -0.8, 3.0) > SURE);
        assert_true(all_hear ? at(r, 0.8, 2.6) > SURE : at(r, 0.8, 2.6) < 0.05);
    }
}

/* The mean of ten seconds, or of all since it began, over what is there now: of who
 * passed within a second a tenth of his own power. */
static void it_knows_how_bright_it_was_there_lately(void **state)
{
    struct rig *r = *state;
    const double at_m[3] = {0.0, 0.0, 3.0};

    hear_noise(r, 400);
    for (int k = 0; k < 42; k++) {
        flat_image(r);
        show(r, at_m[0], at_m[2], 100.0f);
        step(r);
    }
    double past = exp(-42 * 1e-9 * PING_NS / OCCUPANCY_LATELY_S);
    double before = exp(-441 * 1e-9 * PING_NS / OCCUPANCY_LATELY_S);
    double mean = (1.0 - past + (past - before) * 0.01) / (1.0 - before);
    assert_near(occupancy_lately(r->o, at_m, 0.2), mean, 0.01);
}

/* Who passes for a second is 100 times as bright as all that he raises, and that 100
 * times as bright as it is afterwards; what he leaves, where he was, is 4 times as bright
 * as that.  By what is around he was 100 and is 4; as he is heard he was 10,000. */
static void what_who_was_bright_leaves_is_not_compared_by_what_he_raised(void **state)
{
    struct rig *r = *state;
    const double at_m[3] = {0.0, 0.0, 3.0};

    hear_noise(r, 400);
    for (int k = 0; k < 62; k++) {
        flat_image(r);
        for (int i = 0; i < BLOCKS && k < 42; i++)
            r->power[i] *= 100.0f;
        show(r, at_m[0], at_m[2], k < 42 ? 100.0f : 4.0f);
        step(r);
    }
    double ping_s = 1e-9 * PING_NS, all = 1.0 - exp(-462 * ping_s / OCCUPANCY_LATELY_S);
    double passed = (1.0 - exp(-42 * ping_s / OCCUPANCY_LATELY_S)) *
                    exp(-20 * ping_s / OCCUPANCY_LATELY_S);
    double is = 4.0 + 10000.0 * exp(-20 * ping_s / 0.1);
    double lately = 10000.0 * passed / all / is;
    assert_near(occupancy_lately(r->o, at_m, 0.2), pow(10.0, -0.5) * lately,
                0.01 * lately);
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
        flat_image(r);
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

static void a_gap_of_a_second_is_none_and_a_longer_one_restarts_it(void **state)
{
    struct rig *r = *state;
    static const int64_t gaps_ns[] = {500000000LL, 1000000000LL, 1100000000LL};

    for (size_t i = 0; i < sizeof gaps_ns / sizeof *gaps_ns; i++) {
        hear_noise(r, 50);
        r->stamp_ns += gaps_ns[i] - PING_NS;
        hear_noise(r, 1);
        double lately = occupancy_lately(r->o, (const double[3]){0.0, 0.0, 3.0}, 0.2);
        assert_true(gaps_ns[i] > 1000000000LL ? lately == 0.0 : lately > 0.0);
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

/* Not in the middle between two who are nearer to each other than that. */
static void a_place_is_that_of_what_is_within_half_the_distance(void **state)
{
    struct rig *r = *state;
    struct occupancy_spot spots[3];

    for (int k = 0; k < 20; k++) {
        flat_image(r);
        show(r, -0.32, 3.1, 30.0f);
        show(r, 0.32, 3.1, 29.0f);
        step(r);
    }
    assert_int_equal(occupancy_spots(r->o, SURE, 1.0, spots, 3), 1);
    assert_near(fabs(spots[0].at_m[0]), 0.32, 0.08);
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
        TEST(nor_does_noise_of_another_distribution),
        TEST(odds_grow_by_the_likelihood_ratio),
        TEST(how_loud_all_of_it_is_does_not_matter),
        TEST(noise_is_what_is_as_far_away),
        TEST(nobody_stands_out_of_what_is_hardly_heard),
        TEST(noise_of_a_range_is_that_of_its_own_blocks),
        TEST(who_comes_near_another_is_himself),
        TEST(who_is_heard_by_few_pings_is_seen_within_two_rounds),
        TEST(who_walks_stays_seen_and_leaves_nobody_behind),
        TEST(who_is_not_heard_any_more_is_forgotten),
        TEST(what_is_always_there_is_nobody_new),
        TEST(what_looks_like_somebody_else_is_nobody),
        TEST(nobody_looks_like_him_at_another_range),
        TEST(what_some_elements_hear_there_is_cancelled_by_all_others),
        TEST(it_knows_how_bright_it_was_there_lately),
        TEST(what_who_was_bright_leaves_is_not_compared_by_what_he_raised),
        TEST(one_ping_alone_is_not_what_is_there),
        TEST(what_is_not_newer_restarts_it),
        TEST(a_gap_of_a_second_is_none_and_a_longer_one_restarts_it),
        TEST(what_was_not_imaged_tells_nothing),
        TEST(a_place_is_that_of_what_is_within_half_the_distance),
        TEST(most_likely_comes_first_and_no_more_than_asked_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
