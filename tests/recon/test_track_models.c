/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <string.h>

#include "recon/tracking/track_models.h"
#include "tests/recon/dice.h"

#define SIGMA_M 0.1
#define DT_S    0.1
#define DT_NS   100000000

static const double psd[TRACK_MODELS] = {0.002, 1.0}, same[TRACK_MODELS] = {0.1, 0.1};

static struct track_position measured(double x, double y, double sigma)
{
    return (struct track_position){
        .at_m = {x, y}, .covariance_m2 = {{sigma * sigma, 0.0}, {0.0, sigma * sigma}}};
}

static struct track_filter at_rest(double speed_m_s)
{
    const struct track_position p = measured(0.0, 0.0, SIGMA_M);
    struct track_filter f;

    track_filter_start(&f, &p, speed_m_s);
    return f;
}

static void of_two_models_that_are_one_nothing_is_left_but_that(void **state)
{
    struct track_filter one = at_rest(1.0), out;
    struct track_models m = {.begun = false};

    (void)state;
    track_models_begin(&m, &one);
    for (int k = 1; k < 30; k++) {
        const struct track_position p = measured(0.1 * k, 0.05 * k * k, SIGMA_M);
        track_filter_predict(&one, DT_S, same[0]);
        track_models_predict(&m, DT_S, false, same, &out);
        assert_near(out.state[1], one.state[1], 1e-9);
        track_filter_update(&one, &p);
        track_models_update(&m, &p, &out);
        for (int i = 0; i < 4; i++) {
            assert_near(out.state[i], one.state[i], 1e-9);
            for (int j = 0; j < 4; j++)
                assert_near(out.covariance[i][j], one.covariance[i][j], 1e-9);
        }
    }
}

/* Of a mixture: the mean of the means, and of the covariances with p (1 - p) times the
 * square of what the means are apart. */
static void what_the_models_disagree_by_is_in_the_covariance(void **state)
{
    struct track_filter f = at_rest(1.0), out;
    struct track_models m = {.begun = false};

    (void)state;
    track_models_begin(&m, &f);
    m.share[TRACK_KEEPS_PACE] = 0.75;
    m.share[TRACK_CHANGES_PACE] = 0.25;
    m.of[TRACK_CHANGES_PACE].state[0] = 0.4;
    m.of[TRACK_CHANGES_PACE].state[2] = -1.0;
    m.of[TRACK_CHANGES_PACE].covariance[0][0] += 0.08;
    track_models_predict(&m, 0.0, false, psd, &out);
    assert_near(out.state[0], 0.1, 1e-12);
    assert_near(out.state[2], -0.25, 1e-12);
    assert_near(out.covariance[0][0],
                f.covariance[0][0] + 0.25 * 0.08 + 0.1875 * 0.4 * 0.4, 1e-12);
    assert_near(out.covariance[0][2], -0.1875 * 0.4, 1e-12);
    assert_near(out.covariance[1][1], f.covariance[1][1], 1e-12);
}

/* Unseen, whatever it was is forgotten: what is left is how long each lasts. */
static void in_the_long_run_the_models_are_as_likely_as_they_last(void **state)
{
    struct track_filter f = at_rest(1.0), out;
    struct track_models m = {.begun = false}, other;

    (void)state;
    track_models_begin(&m, &f);
    other = m;
    other.share[TRACK_KEEPS_PACE] = 0.0;
    other.share[TRACK_CHANGES_PACE] = 1.0;
    for (int k = 0; k < 200; k++)
        track_models_predict(&other, DT_S, false, psd, &out);
    for (int i = 0; i < TRACK_MODELS; i++)
        assert_near(other.share[i], m.share[i], 1e-6);
    assert_below(m.share[TRACK_CHANGES_PACE], 0.5);
}

/* -- somebody who walks, and stops ------------------------------------------------------
 */

struct walk {
    struct track_models models;
    struct track_filter told, single; /* one model between the two */
    unsigned long long seed;
    double x_m, doubt; /* by so much more than it is its error may be */
    int k;
};

static void set_off(struct walk *w, unsigned long long seed)
{
    struct track_filter f = at_rest(2.0);

    *w = (struct walk){.seed = seed, .single = f, .doubt = 1.0};
    track_models_begin(&w->models, &f);
}

static void go_on(struct walk *w, double speed_m_s)
{
    w->x_m += DT_S * speed_m_s;
    const struct track_position p = measured(w->x_m + SIGMA_M * dice_normal(&w->seed),
                                             SIGMA_M * dice_normal(&w->seed),
                                             w->doubt * SIGMA_M);
    track_filter_predict(&w->single, DT_S, 0.15);
    track_filter_update(&w->single, &p);
    track_models_predict(&w->models, DT_S, false, psd, &w->told);
    track_models_update(&w->models, &p, &w->told);
    w->k++;
}

static void who_keeps_his_pace_is_known_better_than_by_one_model(void **state)
{
    double ours = 0.0, single = 0.0, nees = 0.0;
    int n = 0;

    (void)state;
    for (unsigned long long seed = 1; seed <= 20; seed++) {
        struct walk w;
        set_off(&w, seed);
        while (w.k < 60) {
            go_on(&w, 1.3);
            const struct track_filter *f = &w.told;
            const double off[2] = {f->state[0] - w.x_m, f->state[1]};
            const double c[2][2] = {{f->covariance[0][0], f->covariance[0][1]},
                                    {f->covariance[1][0], f->covariance[1][1]}};
            if (w.k < 20)
                continue;
            ours += off[0] * off[0];
            single += pow(w.single.state[0] - w.x_m, 2.0);
            nees += track_filter_distance2(off, c);
            n++;
        }
    }
    assert_below(ours, 0.7 * single);
    assert_below(nees / n, 2.5); /* 2 is right; he keeps it better than the model says */
}

/* A model of one who keeps his pace alone would be a metre off by then. */
static void who_stops_is_followed_within_half_a_second(void **state)
{
    (void)state;
    for (unsigned long long seed = 1; seed <= 20; seed++) {
        struct walk w;
        set_off(&w, seed);
        while (w.k < 40)
            go_on(&w, 1.3);
        while (w.k < 45)
            go_on(&w, 0.0);
        assert_near(w.told.state[0], w.x_m, 0.3);
        while (w.k < 55)
            go_on(&w, 0.0);
        assert_near(w.told.state[0], w.x_m, 0.2);
        assert_near(w.told.state[2], 0.0, 0.5);
    }
}

/* -- looks that are taken back ----------------------------------------------------------
 */

/* Of one who walks on, the last looks show what stays where it was: faint, and doubted.
 */
static void lose(struct walk *w, struct track_past *past, int stays)
{
    memset(past, 0, sizeof *past);
    set_off(w, 3);
    while (w->k < 40) {
        bool on = w->k < 40 - stays;
        w->doubt = on ? 1.0 : 2.0; /* 8 dB fainter */
        go_on(w, on ? 1.3 : 0.0);
        track_past_keep(past, &w->models, (int64_t)w->k * DT_NS);
    }
    w->x_m += stays * 1.3 * DT_S;
}

static void the_last_looks_before_a_loss_are_taken_back(void **state)
{
    struct track_past past;
    struct walk w;

    (void)state;
    lose(&w, &past, 4);
    int64_t seen_ns = (int64_t)w.k * DT_NS;
    track_models_predict(&w.models, DT_S, false, psd, &w.told);
    double before_m = fabs(w.told.state[0] - (w.x_m + 1.3 * DT_S));
    track_past_restore(&past, seen_ns, seen_ns + DT_NS, psd, &w.models, &w.told);
    assert_near(w.told.state[0], w.x_m + 1.3 * DT_S, 0.1);
    assert_below(0.15, before_m);
    assert_near(w.told.state[2], 1.3, 0.15);
}

/* Heard as clearly as before. */
static void the_last_looks_before_a_loss_tell_that_somebody_stopped(void **state)
{
    struct track_past past = {.n = 0};
    struct walk w;

    (void)state;
    set_off(&w, 3);
    while (w.k < 40) {
        go_on(&w, w.k < 32 ? 1.3 : 0.0);
        track_past_keep(&past, &w.models, (int64_t)w.k * DT_NS);
    }
    int64_t seen_ns = (int64_t)w.k * DT_NS;
    track_models_predict(&w.models, DT_S, false, psd, &w.told);
    track_past_restore(&past, seen_ns, seen_ns + DT_NS, psd, &w.models, &w.told);
    assert_near(w.told.state[0], w.x_m, 0.15);
    assert_near(w.told.state[2], 0.0, 0.3);
}

static void they_are_taken_back_once(void **state)
{
    struct track_past past;
    struct walk w;

    (void)state;
    lose(&w, &past, 0);
    int64_t seen_ns = (int64_t)w.k * DT_NS;
    for (int k = 1; k <= 2; k++) {
        track_models_predict(&w.models, DT_S, false, psd, &w.told);
        struct track_models was = w.models;
        track_past_restore(&past, seen_ns, seen_ns + k * DT_NS, psd, &w.models, &w.told);
        assert_int_equal(memcmp(&was, &w.models, sizeof was) == 0, k == 2);
    }
}

/* Of one who was heard for a moment only, less would be known. */
static void where_little_is_known_before_they_stay(void **state)
{
    struct track_past past = {.n = 0};
    struct walk w;

    (void)state;
    set_off(&w, 5);
    while (w.k < 6) {
        go_on(&w, 1.3);
        track_past_keep(&past, &w.models, (int64_t)w.k * DT_NS);
    }
    struct track_models was = w.models;
    track_past_restore(&past, 6 * (int64_t)DT_NS, 7 * (int64_t)DT_NS, psd, &w.models,
                       &w.told);
    assert_memory_equal(&was, &w.models, sizeof was);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(of_two_models_that_are_one_nothing_is_left_but_that),
        cmocka_unit_test(what_the_models_disagree_by_is_in_the_covariance),
        cmocka_unit_test(in_the_long_run_the_models_are_as_likely_as_they_last),
        cmocka_unit_test(who_keeps_his_pace_is_known_better_than_by_one_model),
        cmocka_unit_test(who_stops_is_followed_within_half_a_second),
        cmocka_unit_test(the_last_looks_before_a_loss_are_taken_back),
        cmocka_unit_test(the_last_looks_before_a_loss_tell_that_somebody_stopped),
        cmocka_unit_test(they_are_taken_back_once),
        cmocka_unit_test(where_little_is_known_before_they_stay),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
