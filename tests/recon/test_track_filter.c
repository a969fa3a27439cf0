/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <string.h>

#include "recon/tracking/track_filter.h"
#include "tests/recon/dice.h"

static struct track_position measured(double x, double y, double sigma)
{
    return (struct track_position){
        .at_m = {x, y}, .covariance_m2 = {{sigma * sigma, 0.0}, {0.0, sigma * sigma}}};
}

/* n measurements of what stands still, with no process noise and a speed known to be 0,
 * are an average: variance sigma^2 / n. */
static void what_stands_is_averaged(void **state)
{
    struct track_filter f;
    struct track_position p = measured(1.0, 2.0, 0.1);
    double sum = 1.0;

    (void)state;
    p.height_m = 1.0;
    p.height_m2 = 0.04;
    track_filter_start(&f, &p, 0.0);
    for (int k = 2; k <= 10; k++) {
        p.at_m[0] = p.height_m = 1.0 + 0.01 * k;
        sum += p.at_m[0];
        track_filter_predict(&f, 0.25, 0.0);
        track_filter_update(&f, &p);
    }
    assert_near(f.state[0], sum / 10.0, 1e-6);
    assert_near(f.covariance[0][0], 0.001, 1e-7);
    assert_near(f.height_m, sum / 10.0, 1e-6);
    assert_near(f.height_m2, 0.004, 1e-7);
}

/* Two positions and no prior speed: the velocity is their difference over time, with
 * variance 2 sigma^2 / dt^2. */
static void two_positions_tell_the_velocity(void **state)
{
    struct track_filter f;
    struct track_position p = measured(1.0, 2.0, 0.1);

    (void)state;
    track_filter_start(&f, &p, 1000.0);
    track_filter_predict(&f, 0.5, 0.0);
    p.at_m[0] = 1.4;
    p.at_m[1] = 1.9;
    track_filter_update(&f, &p);
    assert_near(f.state[0], 1.4, 1e-6);
    assert_near(f.state[2], 0.8, 1e-6);
    assert_near(f.state[3], -0.2, 1e-6);
    assert_near(f.covariance[2][2], 0.08, 1e-6);
    assert_near(f.covariance[0][2], 0.02, 1e-6);
}

/* White noise acceleration: position variance q t^3 / 3, velocity q t, and the same in
 * one step or many. */
static void uncertainty_grows_as_it_should(void **state)
{
    struct track_filter once, often;
    struct track_position p = measured(0.0, 0.0, 0.0);

    (void)state;
    track_filter_start(&once, &p, 0.0);
    often = once;
    track_filter_predict(&once, 2.0, 0.6);
    for (int k = 0; k < 8; k++)
        track_filter_predict(&often, 0.25, 0.6);
    assert_near(once.covariance[0][0], 1.6, 1e-6);
    assert_near(once.covariance[0][2], 1.2, 1e-9);
    assert_near(once.covariance[3][3], 1.2, 1e-9);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            assert_near(often.covariance[i][j], once.covariance[i][j], 1e-9);
}

/* Measured 0.2 s before the stamp: known afterwards as if measured then. */
static void a_position_that_lags_is_taken_for_when_it_was(void **state)
{
    struct track_filter f;
    struct track_position p = measured(0.0, 0.0, 0.01);

    (void)state;
    p.lag_s = -0.2;
    for (int k = 0; k < 40; k++) { /* 1.5 m/s along x */
        p.at_m[0] = 1.5 * (0.1 * k - 0.2);
        if (!k)
            track_filter_start(&f, &p, 3.0);
        track_filter_predict(&f, k ? 0.1 : 0.0, 1e-4);
        if (k)
            track_filter_update(&f, &p);
    }
    assert_near(f.state[0], 1.5 * 3.9, 0.001);
    assert_near(f.state[1], 0.0, 0.001);
    assert_near(f.state[2], 1.5, 0.001);
}

static void invert(double a[4][4], double out[4][4])
{
    double w[4][8];

    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 8; j++)
            w[i][j] = j < 4 ? a[i][j] : j - 4 == i;
    for (int i = 0; i < 4; i++) {
        double pivot = w[i][i];
        for (int j = 0; j < 8; j++)
            w[i][j] /= pivot;
        for (int r = 0; r < 4; r++) {
            double factor = w[r][i];
            for (int j = 0; r != i && j < 8; j++)
                w[r][j] -= factor * w[i][j];
        }
    }
    for (int i = 0; i < 4; i++)
        memcpy(out[i], w[i] + 4, sizeof out[i]);
}

struct world { /* what really moves, by the model */
    double state[4];
    unsigned long long seed;
};

static void move(struct world *w, double dt, double q)
{
    for (int a = 0; a < 2; a++) { /* Cholesky factor of the process noise */
        double u = dice_normal(&w->seed), v = dice_normal(&w->seed);
        double velocity = sqrt(q * dt) * u;
        w->state[a] += dt * w->state[2 + a] + 0.5 * dt * velocity +
                       sqrt(q * dt * dt * dt / 12.0) * v;
        w->state[2 + a] += velocity;
    }
}

/* A correlated position, taken lag before the stamp. */
static void measure(struct world *w, struct track_position *p)
{
    double u = dice_normal(&w->seed), v = dice_normal(&w->seed);

    *p = (struct track_position){.covariance_m2 = {{0.01, 0.003}, {0.003, 0.0025}},
                                 .lag_s = -0.15};
    for (int a = 0; a < 2; a++)
        p->at_m[a] = w->state[a] + p->lag_s * w->state[2 + a];
    p->at_m[0] += 0.1 * u;
    p->at_m[1] += 0.03 * u + 0.04 * v;
}

static double squared_error(const struct track_filter *f, const struct world *w)
{
    double inverse[4][4], covariance[4][4], sum = 0.0;

    memcpy(covariance, f->covariance, sizeof covariance);
    invert(covariance, inverse);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            sum += (f->state[i] - w->state[i]) * inverse[i][j] *
                   (f->state[j] - w->state[j]);
    return sum;
}

/* NEES and NIS are chi-squared with 4 and 2 degrees of freedom: their means over 400 runs
 * are within 3 standard deviations, sqrt(2 n / runs), of 4 and 2 (Bar-Shalom 2001, 5.4).
 */
static void errors_are_as_large_as_the_covariance_says(void **state)
{
    enum { RUNS = 400, STEPS = 20 };
    double nees = 0.0, nis = 0.0;

    (void)state;
    for (int run = 0; run < RUNS; run++) {
        struct world w = {.seed = (unsigned long long)(run + 1)};
        struct track_filter f;
        struct track_position p;
        w.state[2] = 2.0 * dice_normal(&w.seed);
        w.state[3] = 2.0 * dice_normal(&w.seed);
        measure(&w, &p);
        track_filter_start(&f, &p, 2.0);
        for (int k = 1; k <= STEPS; k++) {
            double dt = k % 3 ? 0.2 : 0.5;
            move(&w, dt, 0.5);
            measure(&w, &p);
            p.height_assumed = true;
            track_filter_predict(&f, dt, 0.5);
            if (k == STEPS)
                nis += track_filter_match(&f, &p).distance2 / RUNS;
            track_filter_update(&f, &p);
        }
        nees += squared_error(&f, &w) / RUNS;
    }
    assert_near(nees, 4.0, 3.0 * sqrt(8.0 / RUNS));
    assert_near(nis, 2.0, 3.0 * sqrt(4.0 / RUNS));
}

/* On a fine grid the density of where a position may show adds up to 1. */
/* Beside a prior of 2 m/s one of 0.5 m/s weighs 16 to 17: 1.2 becomes 1.2 16 / 17, with
 * a variance of 1 / (1/4 + 1/0.25).  What is over 13.8 in chi-squared counts for
 * nothing. */
static void a_measured_velocity_is_weighed_against_what_is_known(void **state)
{
    struct track_filter f;
    struct track_position p = measured(1.0, 2.0, 0.1);

    (void)state;
    p.has_velocity = true;
    p.velocity_m_s[0] = 1.2;
    p.velocity_m2_s2[0][0] = p.velocity_m2_s2[1][1] = 0.25;
    track_filter_start(&f, &p, 2.0);
    assert_near(f.state[0], 1.0, 1e-12);
    assert_near(f.state[2], 1.2 * 16.0 / 17.0, 1e-12);
    assert_near(f.state[3], 0.0, 1e-12);
    assert_near(f.covariance[2][2], 1.0 / 4.25, 1e-12);
    assert_near(f.covariance[0][0], 0.01, 1e-7);
    const double limit_m_s = sqrt(13.8 * (1.0 / 4.25 + 0.25));
    for (int beyond = 0; beyond < 2; beyond++) {
        struct track_filter was = f;
        p.velocity_m_s[0] = f.state[2] + (beyond ? 1.001 : 0.999) * limit_m_s;
        p.velocity_m_s[1] = f.state[3];
        track_filter_update(&was, &p);
        assert_true((was.covariance[3][3] == f.covariance[3][3]) == beyond);
    }
}

/* One that may be wrong, then anywhere in 100 m2/s2: what both say weighs as their
 * likelihoods do, and the variance is that of a mixture of both.  Told four times in
 * parts, it weighs as much in all. */
static void a_velocity_that_may_be_wrong_weighs_as_much_as_it_is_likely(void **state)
{
    struct track_filter sure, f;
    struct track_position p = measured(1.0, 2.0, 0.1);
    const double told_m_s[] = {0.3, 2.0, 6.0};

    (void)state;
    p.velocity_m2_s2[0][0] = p.velocity_m2_s2[1][1] = 0.25;
    for (size_t i = 0; i < sizeof told_m_s / sizeof *told_m_s; i++)
        for (double doubt = 0.1; doubt < 1.05; doubt += 0.3) {
            p.has_velocity = true;
            p.velocity_m_s[0] = told_m_s[i];
            p.velocity_doubt = doubt;
            p.velocity_fresh = i == 1 ? 0.25 : 1.0;
            track_filter_start(&f, &p, 2.0);
            p.velocity_doubt = 0.0;
            track_filter_start(&sure, &p, 2.0);
            double likely = (1.0 - doubt) * exp(-0.5 * told_m_s[i] * told_m_s[i] / 4.25) /
                            (2.0 * M_PI * 4.25);
            double wrong = doubt / 100.0 / (likely + doubt / 100.0);
            double w = 1.0 - pow(wrong, p.velocity_fresh);
            assert_near(f.state[0], 1.0, 1e-12);
            assert_near(f.state[2], w * sure.state[2], 1e-9);
            assert_near(f.covariance[2][2],
                        w / 4.25 + (1.0 - w) * 4.0 +
                            w * (1.0 - w) * sure.state[2] * sure.state[2],
                        1e-9);
            assert_near(f.covariance[3][3], w / 4.25 + (1.0 - w) * 4.0, 1e-9);
        }
}

/* A place and a velocity at once know it as soon as two places do. */
static void with_its_velocity_it_is_known_where_it_will_be(void **state)
{
    struct track_filter f;
    struct track_position p = measured(1.0, 2.0, 0.1);

    (void)state;
    p.has_velocity = true;
    p.velocity_m_s[1] = -1.5;
    p.velocity_m2_s2[0][0] = p.velocity_m2_s2[1][1] = 1e-6;
    track_filter_start(&f, &p, 2.5);
    track_filter_predict(&f, 2.0, 0.0);
    assert_near(f.state[1], -1.0, 1e-5);
    assert_near(f.covariance[1][1], 0.01, 1e-4);
}

static void the_density_is_one_altogether(void **state)
{
    struct track_filter f;
    struct track_position p = measured(0.3, -0.2, 0.1);
    double sum = 0.0;

    (void)state;
    p.covariance_m2[0][1] = p.covariance_m2[1][0] = 0.006;
    track_filter_start(&f, &p, 0.0);
    for (double x = -1.2; x < 1.8; x += 0.01)
        for (double y = -1.7; y < 1.3; y += 0.01) {
            p.at_m[0] = x;
            p.at_m[1] = y;
            sum += 1e-4 * track_filter_match(&f, &p).density;
        }
    assert_near(sum, 1.0, 1e-3);
}

static void a_height_that_is_assumed_is_not_averaged(void **state)
{
    struct track_filter f;
    struct track_position p = measured(0.0, 0.0, 0.1);

    (void)state;
    p.height_m2 = 0.25;
    p.height_assumed = true;
    track_filter_start(&f, &p, 1.0);
    for (int k = 0; k < 50; k++)
        track_filter_update(&f, &p);
    assert_near(f.height_m2, 0.25, 1e-12);
    p.height_m = 2.0;
    assert_near(track_filter_match(&f, &p).distance2, 0.0, 1e-6);
    p.height_assumed = false; /* 2 m off, 0.25 + 0.25 m2 */
    assert_near(track_filter_match(&f, &p).distance2, 8.0, 1e-6);
}

static struct track_position walker(double x, double y, double x_m2, double y_m2)
{
    return (struct track_position){.at_m = {x, y},
                                   .middle_m = {0.5 * x, 0.0},
                                   .walker_m2 = {{x_m2, 0.0}, {0.0, y_m2}},
                                   .covariance_m2 = {{x_m2 + 0.05, 0.0}, {0.0, y_m2}}};
}

/* 0.04 and 0.01 m2 to 0.01 and 0.04: of x four fifths of the second, of y of the first,
 * 0.04 0.01 / 0.05 = 0.008 m2 are left; of x with 0.05 m2 more in both, (1/5)^2 0.05 +
 * (4/5)^2 0.05 = 0.034 m2 more. */
static void the_same_measured_twice_is_the_mean_by_how_sure_each_is(void **state)
{
    struct track_position p = walker(0.0, 0.0, 0.04, 0.01);
    const struct track_position other = walker(0.1, 0.2, 0.01, 0.04);

    (void)state;
    assert_true(track_position_join(&p, &other, 9.0));
    assert_near(p.at_m[0], 0.08, 1e-6);
    assert_near(p.at_m[1], 0.04, 1e-6);
    assert_near(p.middle_m[0], 0.04, 1e-6);
    assert_near(p.walker_m2[0][0], 0.008, 1e-6);
    assert_near(p.walker_m2[1][1], 0.008, 1e-6);
    assert_near(p.walker_m2[0][1], 0.0, 1e-9);
    assert_near(p.covariance_m2[0][0], 0.042, 1e-6);
}

/* 1 m in 0.1 m2 is 10. */
static void what_is_too_far_apart_is_not_the_same(void **state)
{
    struct track_position p = walker(0.0, 0.0, 0.05, 0.05);
    const struct track_position other = walker(1.0, 0.0, 0.05, 0.05);

    (void)state;
    assert_false(track_position_join(&p, &other, 9.9));
    assert_near(p.at_m[0], 0.0, 0.0);
    assert_near(p.walker_m2[0][0], 0.05, 0.0);
    assert_true(track_position_join(&p, &other, 10.1));
    assert_near(p.at_m[0], 0.5, 1e-6);
}

/* Each wall tells well how fast somebody goes along its own sight of him. */
static void velocities_along_two_sights_tell_all_of_it(void **state)
{
    struct track_position p = walker(0.0, 0.0, 0.01, 0.01), other = p;

    (void)state;
    p.has_velocity = other.has_velocity = true;
    p.velocity_m_s[0] = 1.0;
    other.velocity_m_s[1] = 0.5;
    p.velocity_m2_s2[0][0] = other.velocity_m2_s2[1][1] = 0.01;
    p.velocity_m2_s2[1][1] = other.velocity_m2_s2[0][0] = 0.99;
    struct track_position first = p;
    assert_true(track_position_join(&p, &other, 9.0));
    assert_near(p.velocity_m_s[0], 0.99, 1e-6);
    assert_near(p.velocity_m_s[1], 0.495, 1e-6);
    assert_near(p.velocity_m2_s2[0][0], 0.0099, 1e-6);
    other.velocity_doubt = 0.1; /* that one may be wrong: */
    assert_true(track_position_join(&first, &other, 9.0));
    assert_near(first.velocity_m_s[1], 0.0, 0.0);
    assert_near(first.velocity_m2_s2[1][1], 0.99, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_same_measured_twice_is_the_mean_by_how_sure_each_is),
        cmocka_unit_test(what_is_too_far_apart_is_not_the_same),
        cmocka_unit_test(velocities_along_two_sights_tell_all_of_it),
        cmocka_unit_test(what_stands_is_averaged),
        cmocka_unit_test(two_positions_tell_the_velocity),
        cmocka_unit_test(uncertainty_grows_as_it_should),
        cmocka_unit_test(a_position_that_lags_is_taken_for_when_it_was),
        cmocka_unit_test(errors_are_as_large_as_the_covariance_says),
        cmocka_unit_test(a_measured_velocity_is_weighed_against_what_is_known),
        cmocka_unit_test(a_velocity_that_may_be_wrong_weighs_as_much_as_it_is_likely),
        cmocka_unit_test(with_its_velocity_it_is_known_where_it_will_be),
        cmocka_unit_test(the_density_is_one_altogether),
        cmocka_unit_test(a_height_that_is_assumed_is_not_averaged),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
