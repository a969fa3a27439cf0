/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include "recon/tracking/track_life.h"
#include "tests/recon/dice.h"

static const struct track_life_config three_of_five = {
    .confirm_hits = 3, .confirm_of = 5, .survival_s = 10.0};

static bool is_confirmed(double p, unsigned long long *seed)
{
    struct track_life l;

    track_life_start(&l, &three_of_five, 0.5);
    while (!l.confirmed && !track_life_is_over(&l, &three_of_five))
        track_life_update(&l, &three_of_five, reference_random(seed) < p, 1.0, 1.0);
    return l.confirmed;
}

/* After the first hit at least two of the next four: the binomial tail. */
static void false_starts_are_confirmed_as_often_as_m_of_n_says(void **state)
{
    enum { TRIALS = 40000 };
    unsigned long long seed = 3;

    (void)state;
    for (double p = 0.05; p < 0.9; p += 0.25) {
        double q = 1.0 - p, expected = 1.0 - q * q * q * q - 4.0 * p * q * q * q;
        double n = 0.0;
        for (int k = 0; k < TRIALS; k++)
            n += is_confirmed(p, &seed);
        assert_near(n / TRIALS, expected,
                    4.0 * sqrt(expected * (1.0 - expected) / TRIALS));
    }
}

/* Bayes: 0.3 and a ratio of 4 are odds of 12 to 7. */
static void existence_follows_bayes(void **state)
{
    struct track_life l;

    (void)state;
    track_life_start(&l, &three_of_five, 0.3);
    track_life_update(&l, &three_of_five, true, 4.0, 1.0);
    assert_near(l.existence, 12.0 / 19.0, 1e-12);
    track_life_predict(&l, &three_of_five, 10.0);
    assert_near(l.existence, 12.0 / 19.0 * exp(-1.0), 1e-12);
}

enum { HEARD, HIDDEN, GONE, STATES };

/* Rates of one into another, in small steps: three states of a Markov chain. */
static void pass(double p[STATES], const struct track_life_config *c, double dt_s)
{
    enum { STEPS = 20000 };

    for (int k = 0; k < STEPS; k++) {
        double t = dt_s / STEPS, heard = p[HEARD], hidden = p[HIDDEN];
        p[HEARD] += t *
                    (hidden / c->hidden_s - heard / c->hides_s - heard / c->survival_s);
        p[HIDDEN] += t *
                     (heard / c->hides_s - hidden / c->hidden_s - hidden / c->survival_s);
    }
    p[GONE] = 1.0 - p[HEARD] - p[HIDDEN];
}

static void look(double p[STATES], double ratio)
{
    p[HEARD] *= ratio;
    double all = p[HEARD] + p[HIDDEN] + p[GONE];
    for (int i = 0; i < STATES; i++)
        p[i] /= all;
}

/* What was heard for a second is not heard for two, and then again. */
static void who_is_not_heard_is_hidden_or_gone(void **state)
{
    struct track_life_config cfg = three_of_five;
    struct track_life l;
    double p[STATES] = {0.9, 0.0, 0.1};

    (void)state;
    cfg.survival_s = 30.0;
    cfg.hides_s = 3.0;
    cfg.hidden_s = 1.5;
    track_life_start(&l, &cfg, 0.9);
    for (int k = 0; k < 20; k++) {
        double ratio = k < 5 || k >= 15 ? 3.0 : 0.2;
        pass(p, &cfg, 0.2);
        look(p, ratio);
        track_life_predict(&l, &cfg, 0.2);
        track_life_update(&l, &cfg, ratio > 1.0, ratio, 1.0);
        assert_near(l.existence, 1.0 - p[GONE], 1e-5);
        assert_near(l.hidden, p[HIDDEN], 1e-5);
    }
}

/* Four images with a quarter of news each say as much as one that is all new. */
static void overlapping_images_say_it_once(void **state)
{
    struct track_life once, often;

    (void)state;
    track_life_start(&once, &three_of_five, 0.3);
    often = once;
    track_life_update(&once, &three_of_five, true, 50.0, 1.0);
    for (int k = 0; k < 4; k++)
        track_life_update(&often, &three_of_five, true, 50.0, 0.25);
    assert_near(often.existence, once.existence, 1e-12);
    assert_int_equal(often.hits, once.hits);
    assert_int_equal(often.looks, once.looks);
}

static void a_look_counts_when_half_of_it_saw(void **state)
{
    struct track_life l;

    (void)state;
    track_life_start(&l, &three_of_five, 0.5);
    for (int k = 0; k < 4; k++)
        track_life_update(&l, &three_of_five, k == 0, 1.0, 0.25);
    assert_int_equal(l.hits, 2); /* 10 */
    for (int k = 0; k < 4; k++)
        track_life_update(&l, &three_of_five, k < 2, 1.0, 0.25);
    assert_int_equal(l.hits, 5); /* 101 */
}

static void existence_can_be_asked_for_too(void **state)
{
    struct track_life_config cfg = three_of_five;
    struct track_life l;

    (void)state;
    cfg.confirm_existence = 0.9;
    track_life_start(&l, &cfg, 0.1);
    for (int k = 0; k < 5; k++)
        track_life_update(&l, &cfg, true, 1.0, 1.0);
    assert_false(l.confirmed);
    track_life_update(&l, &cfg, true, 1000.0, 1.0);
    assert_true(l.confirmed);
}

/* As surely as is asked for; where M of N decides alone it decides. */
static void who_was_proven_elsewhere_is_confirmed(void **state)
{
    struct track_life_config asks = three_of_five;
    struct track_life l;

    (void)state;
    asks.confirm_existence = 0.95;
    track_life_start(&l, &asks, 0.3);
    track_life_prove(&l, &asks, 0.94);
    assert_near(l.existence, 0.94, 1e-12);
    assert_false(l.confirmed);
    track_life_prove(&l, &asks, 0.95);
    assert_true(l.confirmed);
    track_life_prove(&l, &asks, 0.5); /* known better already */
    assert_near(l.existence, 0.95, 1e-12);
    track_life_start(&l, &three_of_five, 0.3);
    track_life_prove(&l, &three_of_five, 0.99);
    assert_false(l.confirmed);
}

static void what_becomes_unlikely_is_over(void **state)
{
    struct track_life_config cfg = three_of_five;
    struct track_life l;
    int misses = 0;

    (void)state;
    cfg.delete_existence = 0.05;
    track_life_start(&l, &cfg, 0.9);
    for (int k = 0; k < 3; k++)
        track_life_update(&l, &cfg, true, 100.0, 1.0);
    assert_true(l.confirmed);
    /* Never surer than 0.999: odds of 999 fall below 1 / 19 after 7 misses of a quarter
     * each, 999 / 4^7 = 0.061, 8: 0.015. */
    for (; !track_life_is_over(&l, &cfg); misses++)
        track_life_update(&l, &cfg, false, 0.25, 1.0);
    assert_int_equal(misses, 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(false_starts_are_confirmed_as_often_as_m_of_n_says),
        cmocka_unit_test(existence_follows_bayes),
        cmocka_unit_test(who_is_not_heard_is_hidden_or_gone),
        cmocka_unit_test(overlapping_images_say_it_once),
        cmocka_unit_test(a_look_counts_when_half_of_it_saw),
        cmocka_unit_test(existence_can_be_asked_for_too),
        cmocka_unit_test(who_was_proven_elsewhere_is_confirmed),
        cmocka_unit_test(what_becomes_unlikely_is_over),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
