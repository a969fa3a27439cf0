/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "recon/tracking/track.h"
#include "tests/recon/dice.h"

#define FRAME_NS 250000000
#define PING_NS  24000000

struct rig {
    struct track_config cfg;
    struct tracker *tracker;
    struct track_detection detections[TRACK_DETECTIONS];
    struct track_scan scan;
    struct track_report reports[TRACKS_MAX];
    size_t n;
    unsigned long long seed;
};

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r)
        return -1;
    track_config_default(&r->cfg);
    r->scan = (struct track_scan){
        .detections = r->detections, .fresh = 1.0, .clutter_m2 = 0.01, .ego_known = true};
    r->seed = 9;
    *state = r;
    return tracker_create(&r->tracker, &r->cfg);
}

static int teardown(void **state)
{
    struct rig *r = *state;

    tracker_destroy(r->tracker);
    free(r);
    return 0;
}

static void use(struct rig *r)
{
    tracker_destroy(r->tracker);
    r->tracker = NULL;
    assert_int_equal(tracker_create(&r->tracker, &r->cfg), 0);
}

static struct track_detection *see(struct rig *r, double x, double y, double sigma)
{
    struct track_detection *d = &r->detections[r->scan.n++];

    *d = (struct track_detection){.position_m = {x, y, 0.5},
                                  .existence = 1.0,
                                  .power = 1.0,
                                  .height_assumed = true};
    d->covariance_m2[0] = d->covariance_m2[3] = sigma * sigma;
    d->covariance_m2[5] = 0.25;
    return d;
}

static void step_after(struct rig *r, int64_t after_ns)
{
    r->scan.stamp_ns += after_ns;
    assert_int_equal(tracker_step(r->tracker, &r->scan), 0);
    r->scan.n = 0;
    r->n = tracker_report(r->tracker, r->reports);
}

static void step(struct rig *r)
{
    step_after(r, FRAME_NS);
}

static const struct track_report *report_of(const struct rig *r, unsigned id)
{
    for (size_t i = 0; i < r->n; i++)
        if (r->reports[i].id == id)
            return &r->reports[i];
    fail_msg("there is no track %u", id);
    return NULL;
}

/* -- one object -------------------------------------------------------------------------
 */

static void the_third_look_confirms(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 5; k++) {
        see(r, 2.0, 1.0, 0.03);
        step(r);
        assert_int_equal(r->n, k >= 2);
        if (k >= 2)
            assert_int_equal(r->reports[0].state, k == 2 ? TRACK_NEW : TRACK_MEASURED);
    }
    assert_int_equal(r->reports[0].id, 1);
    assert_near(r->reports[0].position_m[0], 2.0, 1e-6);
    assert_near(r->reports[0].age_s, 1.0, 1e-9);
    assert_near(r->reports[0].unseen_s, 0.0, 1e-9);
    assert_int_equal(r->reports[0].detection, 0);
    assert_true(r->reports[0].existence > 0.99);
}

static void walk(struct rig *r, int k, double speed)
{
    see(r, 2.0, -2.0 + speed * 0.25 * k, 0.03);
    step(r);
}

static void what_is_not_seen_coasts_and_grows_uncertain_and_ends(void **state)
{
    struct rig *r = *state;
    double before_m2 = 0.0;
    int k = 0;

    r->cfg.life.delete_existence = 0.0;
    use(r);
    for (; k < 12; k++)
        walk(r, k, 1.2);
    for (; k < 30; k++) {
        step(r);
        assert_int_equal(r->n, 1);
        if (r->reports[0].state == TRACK_DELETED)
            break;
        assert_int_equal(r->reports[0].state, TRACK_PREDICTED);
        assert_near(r->reports[0].position_m[1], -2.0 + 1.2 * 0.25 * k, 0.02);
        assert_true(r->reports[0].covariance_m2[3] > before_m2);
        assert_near(r->reports[0].unseen_s, 0.25 * (k - 11), 1e-9);
        before_m2 = r->reports[0].covariance_m2[3];
    }
    assert_int_equal(k, 11 + 7); /* the first after 1.5 s */
    step(r);
    assert_int_equal(r->n, 0); /* told once */
}

static bool shows_nothing(const void *context, const double p_m[3])
{
    (void)context;
    (void)p_m;
    return false;
}

static void nothing_is_held_against_what_the_image_does_not_show(void **state)
{
    struct rig *r = *state;
    int k = 0;

    for (; k < 8; k++)
        walk(r, k, 1.2);
    double existence = r->reports[0].existence;
    r->scan.shows = shows_nothing;
    step(r);
    assert_near(r->reports[0].existence, existence * exp(-0.25 / r->cfg.life.survival_s),
                1e-6);
}

/* Eight in ten looks would show him, and behind a corner none. */
static void who_is_not_heard_in_view_is_rather_hidden_than_gone(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 20; k++)
        walk(r, k, 1.2);
    double existence = r->reports[0].existence;
    for (int k = 0; k < 4; k++)
        step(r);
    assert_below(r->reports[0].existence,
                 existence * exp(-4.0 * 0.25 / r->cfg.life.survival_s));
    assert_below(0.75, r->reports[0].existence);
}

static void something_comes_back_under_its_id(void **state)
{
    struct rig *r = *state;
    int k = 0;

    for (; k < 8; k++)
        walk(r, k, 1.2);
    for (; k < 12; k++)
        step(r);
    walk(r, k, 1.2);
    assert_int_equal(r->n, 1);
    assert_int_equal(r->reports[0].id, 1);
    assert_int_equal(r->reports[0].state, TRACK_MEASURED);
}

static void standing_and_moving_are_told_apart(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 12; k++) {
        see(r, 2.0, -2.0 + 0.3 * k + 0.05 * dice_normal(&r->seed), 0.05);
        see(r, 4.0 + 0.05 * dice_normal(&r->seed), 0.0, 0.05);
        step(r);
    }
    assert_int_equal(r->n, 2);
    for (size_t i = 0; i < 2; i++)
        assert_int_equal(r->reports[i].motion, r->reports[i].position_m[0] < 3.0
                                                   ? TRACK_MOVING
                                                   : TRACK_STANDING);
}

/* The squared error over its covariance of one who walks 3 m before the array, after 4 s.
 * His height is not as it was assumed, and he is heard at another depth than most: all
 * looks at him are wrong alike, by 0.16 m2 over 2 x 3 m and by 3 cm.  Beside that each
 * look is 7 cm off. */
static double nees_of_a_walker(struct rig *r)
{
    const double single_m = 0.64 / 6.0; /* of an echo that may come from any height */
    double shared_m = 0.16 / 6.0 * dice_normal(&r->seed) + 0.03 * dice_normal(&r->seed);
    double y_m = 0.0;

    use(r);
    for (int k = 0; k < 20; k++) {
        y_m = -2.0 + 1.2 * 0.2 * k;
        struct track_detection *d = see(r, 4.0 - 0.09 + shared_m, y_m, 0.005);
        for (int a = 0; a < 2; a++)
            d->position_m[a] += 0.07 * dice_normal(&r->seed);
        d->covariance_m2[0] += single_m * single_m;
        d->height_m2[0] = single_m * single_m;
        d->sight[0] = 1.0;
        step(r);
    }
    assert_int_equal(r->n, 1);
    const struct track_report *t = &r->reports[0];
    double x = t->position_m[0] - 4.0, y = t->position_m[1] - y_m;
    const double *c = t->covariance_m2;
    return (c[3] * x * x - 2.0 * c[1] * x * y + c[0] * y * y) /
           (c[0] * c[3] - c[1] * c[1]);
}

/* 2 is right.  He might turn or stop, so it may be less, by a half. */
static void a_walker_is_as_far_off_as_his_covariance_says(void **state)
{
    enum { WALKERS = 300 };
    struct rig *r = *state;
    double sum = 0.0;

    for (int i = 0; i < WALKERS; i++)
        sum += nees_of_a_walker(r);
    assert_true(sum / WALKERS > 1.0);
    assert_true(sum / WALKERS < 2.0 + 4.0 * 2.0 / sqrt(WALKERS));
}

/* -- several ----------------------------------------------------------------------------
 */

/* Two persons pass each other half a metre apart. */
/* Where he is not seen any more he may have stopped: existence is that of him within a
 * metre. */
static void who_walks_on_unseen_is_told_as_sure_as_he_is_near(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 100; k++) {
        see(r, 4.0, -2.0 + 1.3 * k * 1e-9 * (double)PING_NS, 0.03);
        step_after(r, PING_NS);
    }
    double seen = r->reports[0].existence;
    r->scan.shows = shows_nothing;
    for (int k = 1; k <= 50; k++) {
        step_after(r, PING_NS);
        const struct track_report *p = &r->reports[0];
        double near = 1.0 - exp(-1.0 / (p->covariance_m2[0] + p->covariance_m2[3]));
        double stays = exp(-k * 1e-9 * (double)PING_NS / r->cfg.life.survival_s);
        assert_int_equal(p->state, TRACK_PREDICTED);
        assert_near(p->existence, seen * stays * near, 0.01);
    }
    assert_below(r->reports[0].existence, 0.92);
}

/* He walks for 4 s; then what is heard of him stays where he was for half a second, with
 * this power at its end.  How far he is told to have come since, of the 0.65 m that he
 * would have gone. */
static double told_way_m(struct rig *r, double last_power)
{
    const double dt_s = 1e-9 * (double)PING_NS;
    double edge_m = -2.0 + 1.3 * 165 * dt_s;

    r->scan.fresh = 0.125;
    for (int k = 0; k <= 186; k++) {
        double part = k > 165 ? (k - 165) / 21.0 : 0.0;
        see(r, 4.0, fmin(-2.0 + 1.3 * k * dt_s, edge_m), 0.05)->power =
            pow(last_power, part);
        step_after(r, PING_NS);
    }
    assert_int_equal(r->n, 1);
    return r->reports[0].position_m[1] - edge_m;
}

static void who_fades_behind_an_edge_has_gone_on(void **state)
{
    double way_m = told_way_m(*state, 0.003);

    assert_in_range(1e3 * way_m, 500, 750);
}

static void who_stops_is_told_to_have_stopped(void **state)
{
    double way_m = told_way_m(*state, 1.0);

    assert_below(way_m, 0.25);
}

/* One proven ping by ping, at (x, y). */
static void see_proven(struct rig *r, double x, double y, double proven)
{
    see(r, x, y, 0.03)->proven = proven;
}

static void who_is_proven_ping_by_ping_is_told_at_once(void **state)
{
    struct rig *r = *state;

    see_proven(r, 3.0, 1.0, 0.9);
    see_proven(r, 3.0, -1.0, 0.97);
    step(r);
    assert_int_equal(r->n, 1);
    assert_near(r->reports[0].position_m[1], -1.0, 1e-9);
    assert_near(r->reports[0].existence, 0.97, 1e-9);
}

/* Somebody drives past with 4 m/s and is not heard any more; then something is, 2 m
 * behind him or 2 m beside. */
static size_t told_after(struct rig *r, double behind_m, double beside_m)
{
    double y_m = 3.0;

    for (int k = 0; k < 60; k++, y_m -= 4.0 * 1e-9 * (double)PING_NS) {
        see(r, 4.0, y_m, 0.03);
        step_after(r, PING_NS);
    }
    assert_int_equal(r->n, 1);
    see_proven(r, 4.0 + beside_m, y_m + behind_m, 0.98);
    step_after(r, PING_NS);
    return r->n;
}

static void what_echoes_behind_who_has_passed_is_not_told_at_once(void **state)
{
    assert_int_equal(told_after(*state, 2.0, 0.0), 1);
}

static void who_comes_beside_him_is(void **state)
{
    assert_int_equal(told_after(*state, 0.0, 2.0), 2);
}

static void who_comes_far_behind_him_is(void **state)
{
    assert_int_equal(told_after(*state, 4.0, 0.0), 2);
}

static void crossing_objects_keep_their_ids(void **state)
{
    struct rig *r = *state;
    unsigned up = 0, down = 0;

    for (int k = 0; k < 20; k++) {
        double y = -2.4 + 1.0 * 0.25 * k;
        see(r, 2.0 + 0.03 * dice_normal(&r->seed), y, 0.03);
        see(r, 2.5 + 0.03 * dice_normal(&r->seed), -y, 0.03);
        step(r);
        for (size_t i = 0; k == 5 && i < r->n; i++)
            *(r->reports[i].velocity_m_s[1] > 0.0 ? &up : &down) = r->reports[i].id;
    }
    assert_int_equal(r->n, 2);
    assert_near(report_of(r, up)->velocity_m_s[1], 1.0, 0.3);
    assert_near(report_of(r, down)->velocity_m_s[1], -1.0, 0.3);
}

/* A thing that stood 0.7 m aside, and is seen to come nearer than 0.5 m before it is
 * told, was taken along. */
static void what_stood_beside_its_way_becomes_no_double(void **state)
{
    static const double aside_m[] = {0.7, 0.55, 0.4, 0.3};
    struct rig *r = *state;

    for (int k = 0; k < 16; k++) {
        double y = -2.0 + 1.0 * 0.25 * k;
        see(r, 2.0, y, 0.03);
        if (k >= 6)
            see(r, 2.0 + aside_m[k < 9 ? k - 6 : 3], y, 0.03);
        r->scan.standing_left = k >= 6 && k < 10;
        step(r);
        assert_int_equal(r->n, k >= 2);
    }
}

/* Two who walk abreast, farther from each other than one thing reaches: the second came
 * while what stands was in the image, and is told as soon as it is taken away. */
static void who_walks_beside_it_is_told_too(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 11; k++) {
        double y = -2.0 + 1.0 * 0.25 * k;
        see(r, 2.0, y, 0.03);
        if (k >= 6)
            see(r, 2.7, y, 0.03);
        r->scan.standing_left = k >= 6 && k < 10;
        step(r);
    }
    assert_int_equal(r->n, 2);
}

/* Something is heard 0.7 m behind him for a moment, and 0.1 s later he by two of his
 * parts: nobody came that far so fast. */
static void of_what_is_heard_beside_a_walker_no_other_begins(void **state)
{
    struct rig *r = *state;

    r->scan.fresh = 0.12;
    for (int k = 0; k < 100; k++) {
        double y = -2.0 + 1.2 * 1e-9 * (double)PING_NS * k;
        see(r, 2.0, y, 0.03);
        if (k >= 50 && k < 54)
            see_proven(r, 2.2, y - 0.7, 0.9);
        if (k > 58)
            see_proven(r, 2.3, y, 0.9);
        step_after(r, PING_NS);
        if (k >= 50)
            assert_int_equal(r->n, 1);
    }
}

/* A cyclist overtakes him, 0.6 m beside, and is confirmed by his third look. */
static void who_is_fast_is_told_beside_a_walker(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 8; k++) {
        double y = -2.0 + 1.0 * 0.25 * k;
        see(r, 2.0, y, 0.03);
        if (k >= 5)
            see(r, 2.6, -1.75 + 4.2 * 0.25 * (k - 5), 0.03);
        step(r);
        assert_int_equal(r->n, (k >= 2) + (k >= 7));
    }
    assert_near(report_of(r, 2)->velocity_m_s[1], 4.2, 0.3);
}

/* Told as two, until they have gone as one for a while: the arm was taken for somebody.
 */
static void two_who_go_as_one_become_one(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 20; k++) {
        double y = -2.0 + 1.0 * 0.25 * k;
        see(r, 2.0, y, 0.03);
        if (k >= 6)
            see(r, k < 10 ? 2.7 : 2.4, y, 0.1);
        step(r);
        if (k >= 8 && k < 12) /* two looks at most */
            assert_int_equal(r->n, 2);
        if (k >= 16) /* five at least */
            assert_int_equal(r->n, 1);
    }
    assert_true(report_of(r, 1)->existence > 0.95);
}

/* While they are one in the image, one of them coasts, and both go on as they came. */
static void two_that_merge_and_part_stay_two(void **state)
{
    struct rig *r = *state;
    unsigned up = 0, down = 0;

    for (int k = 0; k < 24; k++) {
        double y = -3.0 + 1.0 * 0.25 * k;
        if (fabs(y) < 0.3) {
            see(r, 2.15, 0.0, 0.1);
        } else {
            see(r, 2.0, y, 0.03);
            see(r, 2.3, -y, 0.03);
        }
        step(r);
        for (size_t i = 0; k == 6 && i < r->n; i++)
            *(r->reports[i].velocity_m_s[1] > 0.0 ? &up : &down) = r->reports[i].id;
    }
    assert_int_equal(r->n, 2);
    assert_near(report_of(r, up)->position_m[1], 2.75, 0.1);
    assert_near(report_of(r, down)->position_m[1], -2.75, 0.1);
}

/* Of a cyclist who rides to the left 0.3 m are heard, before a vehicle that has turned:
 * the front of 1 m, of which 0.7 m may be anywhere behind.  He has come too far to be a
 * car of which no more is heard. */
static void what_is_told_of_something_fast_is_its_middle(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 16; k++) {
        struct track_detection *d = see(r, 4.0, -7.0 + 0.25 * 3.0 * k, 0.01);
        d->extent_m[0] = 0.2;
        d->extent_m[1] = 0.3;
        r->scan.ego = (struct ego_step){.dyaw = k ? 0.0 : 0.6};
        step(r);
    }
    const struct track_report *k = &r->reports[0];
    assert_int_equal(r->n, 1);
    assert_near(k->heard_m[0], 4.0, 0.02);
    assert_near(k->heard_m[1], 4.25, 0.02);
    assert_near(k->position_m[0], 4.0, 0.02);
    assert_near(k->position_m[1], 4.25 - 0.35, 0.03);
    assert_near(k->extent_m[0], 0.2, 0.02);
    assert_near(k->extent_m[1], 1.0, 0.02);
    assert_near(k->covariance_m2[3] - k->covariance_m2[0], 0.7 * 0.7 / 12.0, 0.003);
}

/* A car's side shows as two or three bright places; it rolls. */
static void an_extended_object_is_one_track_in_its_middle(void **state)
{
    struct rig *r = *state;

    r->cfg.join_m = 1.0;
    use(r);
    for (int k = 0; k < 12; k++) {
        double x = 1.0 + 0.25 * 1.6 * k;
        see(r, x - 0.4, 2.0, 0.03);
        if (k % 3)
            see(r, x, 2.0, 0.03);
        see(r, x + 0.4, 2.0, 0.03)->extent_m[0] = 0.2;
        step(r);
        assert_true(r->n <= 1);
    }
    assert_near(r->reports[0].position_m[0], 5.4, 0.05);
    assert_near(r->reports[0].extent_m[0], 0.9, 0.02); /* -0.4 to 0.5 */
}

/* -- false tracks -----------------------------------------------------------------------
 */

/* Tracks that stand still (no process noise, no speed): after n hits the residual's
 * covariance is (1 + 1/n) sigma^2, so that clutter of density rho falls into the gate
 * with p = 1 - exp(-rho pi gate2 (1 + 1/n) sigma^2), and every detection that is nobody's
 * starts a track. */
static double false_rate(double cell, int hits, int looks)
{
    if (hits == 3)
        return 1.0;
    if (looks - hits > 2)
        return 0.0;
    double p = 1.0 - exp(-cell * (1.0 + 1.0 / hits));
    return p * false_rate(cell, hits + 1, looks + 1) +
           (1.0 - p) * false_rate(cell, hits, looks + 1);
}

static void clutter_makes_as_many_false_tracks_as_m_of_n_says(void **state)
{
    struct rig *r = *state;
    const double side_m = 10.0, rho = 0.1, sigma = 0.1;
    enum { FRAMES = 15000 };
    size_t confirmed = 0, started = 0;

    r->cfg.acceleration_psd_m2_s3 = 1e-9;
    r->cfg.new_speed_m_s = 1e-6;
    r->cfg.wander_m = r->cfg.join_m = 0.0;
    r->cfg.gate2 = 3.0;
    r->cfg.new_existence = 0.9; /* likelier than clutter all over the gate */
    r->cfg.life.confirm_hits = 3;
    r->cfg.life.confirm_of = 5;
    r->cfg.life.confirm_existence = r->cfg.life.delete_existence = 0.0;
    r->cfg.life.survival_s = 1e9;
    r->cfg.coast_s = 0.8; /* a false track does not stay to catch clutter */
    use(r);
    r->scan.clutter_m2 = rho;
    for (int k = 0; k < FRAMES; k++) {
        unsigned n = dice_poisson(rho * side_m * side_m, &r->seed);
        for (unsigned i = 0; i < n && i < TRACK_DETECTIONS; i++)
            see(r, side_m * reference_random(&r->seed),
                side_m * reference_random(&r->seed), sigma);
        started += n;
        step(r);
        for (size_t i = 0; i < r->n; i++)
            confirmed += r->reports[i].state == TRACK_NEW;
    }
    assert_int_equal(tracker_counts(r->tracker).crowded, 0);
    double expected = (double)started *
                      false_rate(rho * M_PI * 3.0 * sigma * sigma, 1, 1);
    /* A hit of one track starts no other: one in ten is used up so. */
    assert_true((double)confirmed > 0.6 * expected);
    assert_true((double)confirmed < 1.1 * expected);
}

/* One that has hardly begun is likelier not to be there at all than the object of eight
 * looks is to be missed.  The detection is 2.4 sigma from where the object is (in whose
 * innovation are 1.125 sigma^2), and just where the other began (2 sigma^2): it is 6.6
 * times as likely there, but 0.2 x 0.24 against 0.8 x 0.76 for who is there and is seen
 * says 12.7 times the other. */
static void what_hardly_exists_does_not_take_an_objects_only_detection(void **state)
{
    struct rig *r = *state;
    const double sigma = 0.1, away_m = 0.236;

    r->cfg.acceleration_psd_m2_s3 = 1e-9;
    r->cfg.new_speed_m_s = 1e-6;
    r->cfg.wander_m = r->cfg.join_m = 0.0;
    r->cfg.life.survival_s = 1e9;
    use(r);
    for (int k = 0; k < 8; k++) {
        see(r, 3.0, 1.0, sigma);
        if (k == 7)
            see(r, 3.0 + away_m, 1.0, sigma);
        step(r);
    }
    see(r, 3.0 + away_m, 1.0, sigma);
    step(r);
    assert_int_equal(r->n, 1);
    assert_int_equal(r->reports[0].state, TRACK_MEASURED);
}

/* join_m, 0.5 m, and half of what is seen of it. */
static void what_comes_up_beside_an_object_is_its_own_within_its_reach(void **state)
{
    struct rig *r = *state;
    static const struct {
        double extent_m, away_m;
        size_t n;
    } cases[] = {{0.0, 0.45, 1}, {0.0, 0.55, 2}, {0.6, 0.75, 1}, {0.6, 0.85, 2}};

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        use(r);
        for (int k = 0; k < 12; k++) {
            see(r, 3.0, 1.0, 0.03)->extent_m[1] = cases[i].extent_m;
            if (k >= 6)
                see(r, 3.0, 1.0 + cases[i].away_m, 0.03)->extent_m[1] = cases[i].extent_m;
            step(r);
        }
        assert_int_equal(r->n, cases[i].n);
    }
}

/* -- a vehicle that moves ---------------------------------------------------------------
 */

/* On an arc; something stands, something walks over ground. */
static void what_stands_stands_still_while_the_vehicle_turns(void **state)
{
    struct rig *r = *state;
    const struct ego_motion motion = {2.0, 0.3};
    struct ego_step pose = {0}, one;
    double post_m[3] = {8.0, 1.0, 0.5}, seen_m[3];

    ego_motion_step(&motion, 0.25, &one);
    for (int k = 0; k < 16; k++) {
        if (k)
            ego_step_join(&pose, &one, &pose);
        r->scan.ego = k ? one : (struct ego_step){0};
        ego_step_point(&pose, post_m, seen_m);
        see(r, seen_m[0], seen_m[1], 0.03);
        const double person_m[3] = {5.0, -4.0 + 0.35 * k, 0.5};
        ego_step_point(&pose, person_m, seen_m);
        see(r, seen_m[0], seen_m[1], 0.03);
        step(r);
    }
    assert_int_equal(r->n, 2);
    const struct track_report *post = &r->reports[0], *person = &r->reports[1];
    if (post->motion == TRACK_MOVING) {
        post = &r->reports[1];
        person = &r->reports[0];
    }
    assert_int_equal(post->motion, TRACK_STANDING);
    assert_int_equal(person->motion, TRACK_MOVING);
    ego_step_point(&pose, post_m, seen_m);
    assert_near(post->position_m[0], seen_m[0], 0.01);
    assert_near(post->position_m[1], seen_m[1], 0.01);
    assert_near(hypot(post->velocity_m_s[0], post->velocity_m_s[1]), 0.0, 0.05);
    /* 1.4 m/s along ground's y: turned into the vehicle, which looks to 1.125 rad. */
    assert_near(person->velocity_m_s[0], 1.4 * sin(pose.dyaw), 0.05);
    assert_near(person->velocity_m_s[1], 1.4 * cos(pose.dyaw), 0.05);
}

/* A wall that stands over ground, 9 m ahead of the first place and turned by 0.3 rad, and
 * a post before it: of a vehicle on an arc. */
static void the_mirror_of_a_track_is_told_where_the_vehicle_sees_it(void **state)
{
    struct rig *r = *state;
    const struct ego_motion motion = {2.0, 0.3};
    struct ego_step pose = {0}, one;
    double post_m[3] = {6.0, 1.0, 0.5}, seen_m[3];

    ego_motion_step(&motion, 0.25, &one);
    r->scan.n_mirrors = 1;
    for (int k = 0; k < 8; k++) {
        if (k)
            ego_step_join(&pose, &one, &pose);
        r->scan.ego = k ? one : (struct ego_step){0};
        r->scan.mirrors[0] = (struct track_mirror){
            .id = 3,
            .normal = {cos(0.3 - pose.dyaw), sin(0.3 - pose.dyaw), 0.0},
            .distance_m = 9.0 - cos(0.3) * pose.dx_m - sin(0.3) * pose.dy_m,
            .sigma_m = 0.01,
            .sigma_rad = 0.01};
        ego_step_point(&pose, post_m, seen_m);
        see(r, seen_m[0], seen_m[1], 0.03)->mirror = 3;
        step(r);
    }
    assert_int_equal(r->n, 1);
    assert_true(r->reports[0].placed);
    assert_int_equal(r->reports[0].mirror.id, 3);
    assert_near(r->reports[0].mirror.distance_m, r->scan.mirrors[0].distance_m, 1e-9);
    for (int a = 0; a < 2; a++)
        assert_near(r->reports[0].mirror.normal[a], r->scan.mirrors[0].normal[a], 1e-9);
    assert_near(r->reports[0].position_m[0], seen_m[0], 0.01);
}

static double spread_after(struct rig *r, bool known)
{
    use(r);
    r->scan.ego_known = true;
    for (int k = 0; k < 8; k++)
        walk(r, k, 0.0);
    r->scan.ego_known = known;
    r->scan.fresh = 0.4; /* not long enough for looks to be taken back */
    step(r);
    r->scan.fresh = 1.0;
    return r->reports[0].covariance_m2[0];
}

static void know_two_walls(struct rig *r)
{
    r->scan.n_mirrors = 2;
    r->scan.mirrors[0] =
        (struct track_mirror){.id = 3, .normal = {1.0, 0.0, 0.0}, .distance_m = 6.0};
    r->scan.mirrors[1] =
        (struct track_mirror){.id = 8, .normal = {0.8, 0.6, 0.0}, .distance_m = 6.0};
}

static struct track_detection *see_by(struct rig *r, uint32_t wall, double x, double y,
                                      double sigma)
{
    struct track_detection *d = see(r, x, y, sigma);

    d->mirror = wall;
    d->power = wall == 3 ? 1.0 : 0.5;
    return d;
}

/* Twice as surely: of two places with errors of their own the mean has half the variance.
 * And what is imaged by both at its first look is there, and is told. */
static void who_is_shown_by_two_walls_is_one_and_surer(void **state)
{
    struct rig *r = *state;
    double m2[2];

    for (int both = 0; both < 2; both++) {
        use(r);
        know_two_walls(r);
        for (int k = 0; k < 8; k++) {
            see_by(r, 3, 2.0, 1.0, 0.2);
            if (both)
                see_by(r, 8, 2.1, 1.0, 0.2);
            step(r);
            assert_int_equal(r->n, both || k >= 2);
        }
        assert_near(r->reports[0].position_m[0], both ? 2.05 : 2.0, 0.002);
        m2[both] = r->reports[0].covariance_m2[0];
    }
    assert_true(m2[1] < 0.65 * m2[0]);
}

/* 0.35 m from who is heard, and 0.45 m from who is not, whose place is known to 0.2 m. */
static void what_two_walls_show_of_one_is_nobody_elses(void **state)
{
    struct rig *r = *state;

    know_two_walls(r);
    for (int k = 0; k < 8; k++) {
        see_by(r, 3, 2.0, 1.0, 0.2);
        see_by(r, 3, 2.0, 1.8, 0.2);
        step(r);
    }
    assert_int_equal(r->n, 2);
    for (int k = 0; k < 2; k++) {
        see_by(r, 3, 2.0, 1.0, 0.2);
        see_by(r, 8, 2.0, 1.35, 0.2);
        step(r);
        assert_int_equal(r->n, 2);
        for (size_t i = 0; i < 2; i++)
            assert_int_equal(r->reports[i].state, r->reports[i].position_m[1] < 1.4
                                                      ? TRACK_MEASURED
                                                      : TRACK_PREDICTED);
    }
}

static void a_track_stays_with_its_wall_until_another_is_far_louder(void **state)
{
    struct rig *r = *state;
    static const double power[6] = {0.5, 0.5, 0.5, 3.0, 3.0, 5.0};

    know_two_walls(r);
    for (int k = 0; k < 6; k++) {
        see_by(r, 3, 2.0, 1.0, 0.1);
        see_by(r, 8, 2.0, 1.0, 0.1)->power = power[k];
        step(r);
        assert_int_equal(r->n, 1);
        assert_int_equal(r->reports[0].mirror.id, k < 5 ? 3 : 8);
    }
    see_by(r, 3, 2.0, 1.0, 0.1);
    step(r); /* and is heard by the one that is left */
    assert_int_equal(r->reports[0].mirror.id, 3);
}

static void unknown_ego_motion_widens_tracks(void **state)
{
    struct rig *r = *state;
    double usual_m2 = spread_after(r, true), lost_m2 = spread_after(r, false);

    /* 9 m2/s3 more for a quarter of a second: 9 t^3 / 3 */
    assert_near(lost_m2 - usual_m2, 9.0 * 0.25 * 0.25 * 0.25 / 3.0, 1e-9);
}

/* The image shows what was 0.3 s ago. */
static void the_images_age_is_taken_out(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 16; k++) {
        double x = 6.0 - 1.4 * (0.25 * k - 0.3);
        struct track_detection *d = see(r, x, 1.0, 0.02);
        d->lag_s = -0.3;
        step(r);
    }
    assert_near(r->reports[0].position_m[0], 6.0 - 1.4 * 0.25 * 15, 0.01);
    assert_near(r->reports[0].velocity_m_s[0], -1.4, 0.02);
}

/* Two spots of one object, each as it was at its own time: their middle is where it was
 * at the middle of these times, weighted alike. */
static void the_age_of_an_objects_middle_is_the_middle_of_the_ages(void **state)
{
    struct rig *r = *state;
    static const double lag_s[2] = {-0.3, -0.1}, power[2] = {3.0, 1.0};

    for (int k = 0; k < 16; k++) {
        for (int i = 0; i < 2; i++) {
            struct track_detection *d =
                see(r, 6.0 - 1.4 * (0.25 * k + lag_s[i]), 1.0, 0.02);
            d->lag_s = lag_s[i];
            d->power = power[i];
        }
        step(r);
    }
    assert_int_equal(r->n, 1);
    assert_near(r->reports[0].position_m[0], 6.0 - 1.4 * 0.25 * 15, 0.02);
    assert_near(r->reports[0].velocity_m_s[0], -1.4, 0.02);
}

/* -- time and names ---------------------------------------------------------------------
 */

static void older_scans_are_ignored_and_counted(void **state)
{
    struct rig *r = *state;

    walk(r, 0, 0.0);
    r->scan.stamp_ns -= FRAME_NS / 2;
    assert_int_equal(tracker_step(r->tracker, &r->scan), -ESTALE);
    r->scan.stamp_ns += FRAME_NS / 2;
    assert_int_equal(tracker_step(r->tracker, &r->scan), -ESTALE);
    assert_int_equal(tracker_counts(r->tracker).late, 2);
    for (int k = 1; k < 4; k++)
        walk(r, k, 0.0);
    assert_int_equal(r->n, 1);
}

static void a_clock_that_jumps_back_begins_anew_with_other_ids(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 4; k++)
        walk(r, k, 0.0);
    assert_int_equal(r->reports[0].id, 1);
    r->scan.stamp_ns -= INT64_C(3600) * 1000000000;
    step(r);
    assert_int_equal(r->n, 0);
    assert_int_equal(tracker_counts(r->tracker).resets, 1);
    for (int k = 0; k < 4; k++)
        walk(r, k, 0.0);
    assert_int_equal(r->reports[0].id, 2);
}

/* Its receivers may still mean something else by the ids that it gave before. */
static void a_tracker_that_is_started_again_begins_with_other_ids(void **state)
{
    struct rig *r = *state;
    bool given[255] = {false};

    for (int start = 0; start < 20; start++) {
        use(r);
        for (int k = 0; k < 4; k++) {
            for (int i = 0; i < 5; i++)
                see(r, 3.0 * i, 4.0, 0.02);
            step(r);
        }
        assert_int_equal(r->n, 5);
        for (size_t i = 0; i < r->n; i++) {
            assert_in_range(r->reports[i].id, 1, 254);
            assert_false(given[r->reports[i].id]);
            given[r->reports[i].id] = true;
        }
        r->scan.stamp_ns += INT64_C(5000000000);
    }
}

static void a_gap_ends_what_may_be_anywhere_by_now(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 8; k++)
        walk(r, k, 0.0);
    r->scan.stamp_ns += 20 * (int64_t)FRAME_NS;
    step(r);
    assert_int_equal(r->n, 1);
    assert_int_equal(r->reports[0].state, TRACK_DELETED);
    assert_true(isfinite(r->reports[0].covariance_m2[0]));
}

/* One object after the other for some minutes. */
static void an_id_is_not_given_again_for_half_a_minute(void **state)
{
    struct rig *r = *state;
    int64_t seen_ns[TRACK_DETECTIONS * 4 + 1] = {0};
    size_t named = 0;

    for (int k = 0; k < 4000; k++) {
        for (int i = 0; i < 25; i++) { /* three looks of a new one in each column */
            if ((k + i) % 12 < 3)
                see(r, 3.0 * i, 40.0 * ((k + i) / 12 % 3), 0.02);
        }
        step(r);
        for (size_t i = 0; i < r->n; i++) {
            unsigned id = r->reports[i].id;
            assert_in_range(id, 1, 254);
            if (r->reports[i].state == TRACK_NEW) {
                named++;
                assert_true(!seen_ns[id] ||
                            r->scan.stamp_ns - seen_ns[id] >= INT64_C(30000000000));
            }
            seen_ns[id] = r->scan.stamp_ns;
        }
    }
    assert_true(named > 1000);
    assert_true(tracker_counts(r->tracker).crowded > 0); /* more than 254 in 30 s */
}

static void as_many_as_there_can_be(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < TRACK_DETECTIONS; i++)
            see(r, 2.0 * (i % 8), 2.0 * (i / 8), 0.02);
        step(r);
    }
    assert_int_equal(r->n, TRACKS_MAX);
    for (int i = 0; i < TRACK_DETECTIONS; i++)
        see(r, 1.0 + 2.0 * (i % 8), 1.0 + 2.0 * (i / 8), 0.02);
    step(r);
    assert_int_equal(r->n, TRACKS_MAX);
    assert_int_equal(tracker_counts(r->tracker).crowded, TRACK_DETECTIONS);
}

static void expect_refused(size_t offset, double value)
{
    struct track_config cfg;
    struct tracker *t = NULL;

    track_config_default(&cfg);
    memcpy((char *)&cfg + offset, &value, sizeof value);
    if (tracker_create(&t, &cfg) != -EINVAL)
        fail_msg("%g at byte %zu is taken", value, offset);
    assert_null(t);
}

/* What has to be above 0, what may be 0, and what has to be below 1. */
static void values_out_of_range_are_refused(void **state)
{
    struct rig *r = *state;
    struct tracker *t = NULL;
#define AT(field) offsetof(struct track_config, field)
    static const size_t above[] = {
        AT(acceleration_psd_m2_s3), AT(new_speed_m_s), AT(gate2),
        AT(detection_probability),  AT(new_existence), AT(coast_s),
        AT(life.survival_s),        AT(rest_m),        AT(rest_s),
        AT(life.hidden_s)};
    static const size_t least[] = {AT(lost_ego_psd_m2_s3), AT(wander_m),    AT(join_m),
                                   AT(id_rest_s),          AT(place_looks), AT(reset_s),
                                   AT(life.hides_s)};
    static const size_t below_one[] = {AT(detection_probability), AT(new_existence),
                                       AT(life.confirm_existence),
                                       AT(life.delete_existence)};

    for (size_t i = 0; i < sizeof above / sizeof *above; i++) {
        expect_refused(above[i], 0.0);
        expect_refused(above[i], NAN);
    }
    for (size_t i = 0; i < sizeof least / sizeof *least; i++)
        expect_refused(least[i], -1e-9);
    for (size_t i = 0; i < sizeof below_one / sizeof *below_one; i++)
        expect_refused(below_one[i], 1.0);
    for (int k = 0; k < 3; k++) {
        track_config_default(&r->cfg);
        r->cfg.life.confirm_hits = k == 0 ? 6 : k == 1 ? 0 : 3; /* of 5 */
        r->cfg.life.confirm_of = k == 2 ? TRACK_LOOKS_MAX + 1 : 5;
        assert_int_equal(tracker_create(&t, &r->cfg), -EINVAL);
    }
    assert_null(t);
}

/* -- images with what stands in them ----------------------------------------------------
 */

/* Seen from an array at the vehicle's origin that looks along x. */
static void see_heard(struct rig *r, double x, double y)
{
    struct track_detection *d = see(r, x, y, 0.02);

    d->along_m = y;
    d->range_m = hypot(x, y);
}

static void begin_with_what_stands(struct rig *r)
{
    r->scan.standing_left = true;
    r->scan.array = (struct track_array){.axis = {0.0, 1.0}};
}

static void what_stands_in_the_image_is_not_told(void **state)
{
    struct rig *r = *state;

    begin_with_what_stands(r);
    for (int k = 0; k < 20; k++) {
        see_heard(r, 4.0, 2.0);
        see_heard(r, 5.0, -2.0 + 0.3 * k);
        step(r);
        for (size_t i = 0; i < r->n; i++)
            assert_near(r->reports[i].position_m[0], 5.0, 0.1);
    }
    assert_int_equal(r->n, 1);
    assert_near(r->reports[0].velocity_m_s[1], 1.2, 0.1);
}

static void see_may_go(struct rig *r, double x, double y, double vx, double vy)
{
    see_heard(r, x, y);
    struct track_detection *d = &r->detections[r->scan.n - 1];
    d->has_course = true;
    d->course_m_s[0] = vx;
    d->course_m_s[1] = vy;
    d->sight[0] = 1.0;
}

/* Told at once, of one detection and of two: as fast as its course says, as far as that
 * is likely to be right. */
static void a_course_that_may_be_wrong_is_believed_as_much(void **state)
{
    struct rig *r = *state;

    for (int parts = 1; parts <= 2; parts++) {
        double speed_m_s[3];
        for (int i = 0; i < 3; i++) {
            use(r);
            for (int part = 0; part < parts; part++) {
                see_may_go(r, 3.0, 1.0 + 0.1 * part, 0.0, 2.0);
                r->detections[r->scan.n - 1].course_doubt = 0.5 * i;
                r->detections[r->scan.n - 1].proven = 0.97;
            }
            step(r);
            assert_int_equal(r->n, 1);
            speed_m_s[i] = r->reports[0].velocity_m_s[1];
        }
        assert_true(speed_m_s[0] > 1.5);
        assert_true(speed_m_s[1] > 0.5 && speed_m_s[1] < speed_m_s[0] - 0.2);
        assert_near(speed_m_s[2], 0.0, 1e-9);
    }
}

static void see_go(struct rig *r, double x, double y, double vx, double vy)
{
    see_may_go(r, x, y, vx, vy);
    r->detections[r->scan.n - 1].moves = true;
}

/* Images until it is told, where every second one shows it go along a course, but for
 * those of `without`. */
static int images_until_it_goes(struct rig *r, unsigned without)
{
    use(r);
    r->scan.stamp_ns = 0;
    begin_with_what_stands(r);
    r->scan.fresh = 0.125;
    for (int k = 0; k < 12; k++) {
        double x = 5.0 - 0.015 * k, y = -2.0 + 0.03 * k;
        see_heard(r, 4.0, 2.0);
        if (k % 2 || (without >> k & 1u))
            see_heard(r, x, y);
        else
            see_go(r, x, y, -0.6, 1.2);
        step_after(r, PING_NS);
        if (r->n)
            return k + 1;
    }
    return INT_MAX;
}

/* Far sooner than by its places: with its second course, of which the image between may
 * lack one; two of long ago and of now are no two in a row. */
static void whose_phases_go_along_a_course_is_told_beside_what_stands(void **state)
{
    struct rig *r = *state;

    assert_int_equal(images_until_it_goes(r, 0), 3);
    assert_near(r->reports[0].position_m[0], 4.97 + 0.09, 0.1); /* his front is heard */
    assert_near(r->reports[0].velocity_m_s[0], -0.6, 0.3);
    assert_near(r->reports[0].velocity_m_s[1], 1.2, 0.6);
    assert_true(r->reports[0].existence > 0.95);
    assert_int_equal(images_until_it_goes(r, 1u << 2), 5);
    assert_int_equal(images_until_it_goes(r, 1u << 2 | 1u << 4), 9);
}

/* Noise: each time another way, along the sight of it or across. */
static void whose_courses_do_not_agree_is_not_told(void **state)
{
    struct rig *r = *state;

    begin_with_what_stands(r);
    for (int k = 0; k < 8; k++) {
        see_go(r, 5.0, -2.0, k % 2 ? 1.0 : 0.0, 0.5);
        see_go(r, 5.0, 2.0, 0.8, k % 2 ? -1.0 : 1.0);
        step_after(r, 2 * PING_NS);
        assert_int_equal(r->n, 0);
    }
}

/* Images of one that crosses until it is told, where what rests glides at so many m/s. */
static int images_among_rest(struct rig *r, double glides_x, double glides_y)
{
    use(r);
    r->scan.stamp_ns = 0;
    begin_with_what_stands(r);
    for (int k = 1; k < 20; k++) {
        see_may_go(r, 5.0, -2.0 + 1.4 * 2e-9 * PING_NS * k, 0.0, 1.4);
        r->detections[0].gliding_m_s[0] = glides_x;
        r->detections[0].gliding_m_s[1] = glides_y;
        step_after(r, 2 * PING_NS);
        if (r->n)
            return k;
    }
    return INT_MAX;
}

/* At four in a row; what rests may show 0 to 2 times what it glides at, the same way. */
static void whose_course_is_none_of_rest_is_told_once_velocities_agree(void **state)
{
    struct rig *r = *state;

    assert_int_equal(images_among_rest(r, 0.0, 0.0), 4);
    assert_int_equal(images_among_rest(r, 1.0, 0.0), 4);
    assert_int_equal(images_among_rest(r, 0.0, -1.0), 4);
    assert_int_equal(images_among_rest(r, 0.0, 0.1), 4);
    assert_in_range(images_among_rest(r, 0.0, 0.7), 5, 9);
    assert_in_range(images_among_rest(r, 0.0, 2.0), 5, 9);
}

/* Its places have to tell, as they do of who shows no velocity, but sooner: the image
 * after which it is told. */
static int images_until_told(struct rig *r, bool has_course)
{
    use(r);
    r->scan.stamp_ns = 0;
    begin_with_what_stands(r);
    r->scan.fresh = 0.25;
    for (int k = 0; k < 60; k++) {
        double x = 5.0 - 0.03 * k, y = -2.0 + 0.06 * k, off = 0.1 * (k % 3 - 1);
        see_may_go(r, x, y + off, -0.6, 1.2);
        r->detections[0].has_course = has_course;
        r->detections[0].gliding_m_s[0] = -0.4; /* it may rest */
        r->detections[0].gliding_m_s[1] = 0.8;
        step_after(r, 2 * PING_NS);
        if (r->n)
            return k;
    }
    return INT_MAX;
}

static void whose_course_may_be_one_of_rest_is_told_by_places_and_sooner(void **state)
{
    struct rig *r = *state;
    int with_phases = images_until_told(r, true), without = images_until_told(r, false);

    assert_in_range(with_phases, 4, 10);
    assert_in_range(without, with_phases + 2, 59);
}

/* Images with it before it is told, of which 16 come before a gap of so many without. */
static int seen_until_told(struct rig *r, int gap, bool has_course)
{
    int seen = 0;

    use(r);
    r->scan.stamp_ns = 0;
    begin_with_what_stands(r);
    r->scan.fresh = 0.12;
    for (int k = 0; k < 100 && !r->n; k++) {
        if (k < 16 || k >= 16 + gap) {
            see_may_go(r, 5.0, -2.0 + 1.2 * 1e-9 * PING_NS * k, 0.0, 1.2);
            r->detections[0].has_course = has_course;
            r->detections[0].gliding_m_s[1] = 1.0; /* it may rest */
            seen++;
        }
        step_after(r, PING_NS);
    }
    r->n = 0;
    return seen;
}

/* A look; after more of them, or where no phases have it go as it went, it may be another
 * one. */
static void what_moves_is_known_over_a_gap(void **state)
{
    struct rig *r = *state;

    assert_in_range(seen_until_told(r, 0, false), 17, 24);
    assert_in_range(seen_until_told(r, 8, false), 16 + 12, 99);
    assert_in_range(seen_until_told(r, 8, true), 17, 24);
    assert_in_range(seen_until_told(r, 19, true), 16 + 12, 99);
}

static void once_a_background_is_taken_away_it_is_told(void **state)
{
    struct rig *r = *state;

    begin_with_what_stands(r);
    for (int k = 0; k < 8; k++) {
        see_heard(r, 4.0, 2.0);
        step(r);
        assert_int_equal(r->n, 0);
    }
    r->scan.standing_left = false;
    see_heard(r, 4.0, 2.0);
    step(r);
    assert_int_equal(r->n, 1);
}

/* What was never told is forgotten after two looks: what comes up there when a vehicle
 * sets off or stops is something new, which needs looks of its own. */
static void what_has_no_name_is_forgotten_sooner(void **state)
{
    struct rig *r = *state;

    for (int unseen = 2; unseen <= 3; unseen++) {
        use(r);
        begin_with_what_stands(r);
        for (int k = 0; k < 8; k++) {
            see_heard(r, 4.0, 2.0);
            step(r);
        }
        r->scan.shows = shows_nothing;
        for (int k = 0; k < unseen; k++)
            step(r);
        r->scan.shows = NULL;
        r->scan.standing_left = false;
        see_heard(r, 4.0, 2.0);
        step(r);
        assert_int_equal(r->n, unseen == 2);
    }
}

/* Who walks past a thing as the vehicle stops: what is known of it is too near to be told
 * beside him, though its newest echo is not. */
static void what_is_beside_somebody_is_not_told_as_a_background_begins(void **state)
{
    struct rig *r = *state;

    for (int settling = 0; settling < 2; settling++) {
        use(r);
        begin_with_what_stands(r);
        for (int k = 0; k < 11; k++) {
            see_heard(r, 5.0, -3.0 + 0.25 * k);
            see_heard(r, 5.4, 0.0);
            step(r);
        }
        assert_int_equal(r->n, 1);
        r->scan.standing_left = false;
        r->scan.settling = settling;
        see_heard(r, 5.0, -0.25);
        see_heard(r, 5.46, 0.0);
        step(r);
        assert_int_equal(r->n, 2 - settling);
        r->scan.settling = false;
    }
}

/* Two holes, one of them where somebody passed, who is fainter than what may be left. */
static void what_a_background_leaves_has_to_move(void **state)
{
    struct rig *r = *state;

    begin_with_what_stands(r);
    r->scan.standing_left = false;
    for (int k = 0; k < 30; k++) {
        see_heard(r, 4.0, 2.0);
        see_heard(r, 4.0, -3.0);
        see_heard(r, 5.0, -2.0 + 0.3 * (k < 20 ? k : 20));
        for (int i = 0; i < 3; i++)
            r->detections[i].remains = 2.0;
        step(r);
        for (size_t i = 0; i < r->n; i++)
            assert_near(r->reports[i].position_m[0], 5.0, 0.1);
        assert_true(k < 10 || r->n == 1); /* who stops stays told */
    }
}

/* Brighter than what is left of any. */
static void what_a_background_cannot_have_left_is_told_at_rest(void **state)
{
    struct rig *r = *state;

    begin_with_what_stands(r);
    r->scan.standing_left = false;
    for (int k = 0; k < 8; k++) {
        see_heard(r, 4.0, 2.0);
        r->detections[0].power = 3.0;
        r->detections[0].remains = 2.0;
        step(r);
    }
    assert_int_equal(r->n, 1);
}

static void what_comes_to_rest_there_ends_as_if_unseen(void **state)
{
    struct rig *r = *state;
    int k = 0;

    begin_with_what_stands(r);
    for (; k < 8; k++) {
        see_heard(r, 5.0, -2.0 + 0.3 * k);
        step(r);
    }
    assert_int_equal(r->n, 1);
    for (; k < 80 && r->reports[0].state != TRACK_DELETED; k++) {
        see_heard(r, 5.0, 0.4);
        step(r);
        assert_int_equal(r->n, 1);
    }
    assert_true(k > 8 + 6); /* not before coast_s */
    assert_true(k < 80);
}

/* To and fro, two seconds each way, in images that are told to be new by an eighth. */
static void what_turns_round_keeps_its_name(void **state)
{
    enum { WAY = 83 };
    struct rig *r = *state;
    unsigned id = 0;

    begin_with_what_stands(r);
    r->scan.fresh = 0.12;
    for (int k = 0; k < 6 * WAY; k++) {
        int back = k / WAY % 2, at = back ? WAY - k % WAY : k % WAY;
        see_heard(r, 5.0, -1.2 + 1.2 * 0.024 * at);
        step_after(r, 24000000);
        if (!id && r->n)
            id = r->reports[0].id;
        assert_int_equal(r->n, id > 0);
        assert_true(k < WAY / 2 || id);
        if (id)
            assert_int_equal(report_of(r, id)->state != TRACK_DELETED, 1);
    }
}

/* It moved, and comes to rest before it is confirmed. */
static void what_has_come_to_rest_gets_no_name(void **state)
{
    struct rig *r = *state;

    r->cfg.life.confirm_hits = r->cfg.life.confirm_of = 24;
    use(r);
    begin_with_what_stands(r);
    for (int k = 0; k < 30; k++) {
        see_heard(r, 5.0, -2.0 + 0.3 * (k < 6 ? k : 6));
        step(r);
        assert_int_equal(r->n, 0);
    }
}

/* Where it passes, what rests there does not follow it. */
static void what_passes_by_is_not_taken_for_what_rests(void **state)
{
    struct rig *r = *state;
    unsigned id = 0;

    begin_with_what_stands(r);
    for (int k = 0; k < 40; k++) {
        double y = -3.0 + 0.15 * k;
        if (k < 18 || k > 22)
            see_heard(r, 4.0, 0.0);
        if (k > 6)
            see_heard(r, 4.2, y);
        step(r);
        if (r->n && !id)
            id = r->reports[0].id;
        assert_true(r->n <= 1);
        if (r->n) {
            assert_int_equal(r->reports[0].id, id);
            assert_near(r->reports[0].position_m[1], y, 0.2);
        }
    }
    assert_int_equal(r->n, 1);
}

/* An image for each ping, of the newest eight. */
static void begin_with_each_ping(struct rig *r)
{
    begin_with_what_stands(r);
    r->scan.fresh = 0.12;
}

/* Two that rest, one behind the other, are seen in turn; then what rests beside them. */
static void things_at_rest_that_are_seen_one_after_another_have_not_moved(void **state)
{
    struct rig *r = *state;

    begin_with_each_ping(r);
    for (int k = 0; k < 80; k++) {
        see_heard(r, k % 2 ? 4.15 : 3.85, k < 16 ? 0.0 : 0.55);
        step_after(r, PING_NS);
        assert_int_equal(r->n, 0);
    }
}

/* One thing at rest, half a look without it, then another that is farther by what five
 * looks would take for motion: too few to tell a jump. */
static void another_thing_at_rest_after_a_gap_has_not_moved(void **state)
{
    struct rig *r = *state;

    r->cfg.new_speed_m_s = 5.0;
    r->cfg.gate2 = 40.0;
    r->cfg.life.confirm_hits = r->cfg.life.confirm_of = 1;
    r->cfg.life.confirm_existence = 0.1;
    use(r);
    begin_with_each_ping(r);
    for (int k = 0; k < 40; k++) {
        if (k < 3 || k >= 3 + 5) /* 5 times 0.12 of a look */
            see_heard(r, 4.0, k < 3 ? 0.0 : 0.8);
        step_after(r, PING_NS);
        assert_int_equal(r->n, 0);
    }
}

/* In every fifth ping: 4 times 0.12 of a look are missed, less than half of one. */
static void a_walker_who_is_heard_now_and_then_is_told(void **state)
{
    struct rig *r = *state;

    r->cfg.detection_probability = 0.2;
    r->cfg.life.confirm_hits = r->cfg.life.confirm_of = 1;
    r->cfg.life.confirm_existence = 0.1;
    use(r);
    begin_with_each_ping(r);
    for (int k = 0; k <= 60; k++) {
        if (k % 5 == 0)
            see_heard(r, 4.0, -0.6 + 1.2 * 0.024 * k);
        step_after(r, PING_NS);
    }
    assert_int_equal(r->n, 1);
}

/* It is heard now from one limb, now from another. */
static void a_walker_is_told_whichever_limb_is_heard(void **state)
{
    struct rig *r = *state;

    begin_with_each_ping(r);
    for (int k = 0; k < 42; k++) {
        see_heard(r, 4.0, -0.6 + 1.2 * 0.024 * k + (k % 2 ? 0.15 : -0.15));
        step_after(r, PING_NS);
    }
    assert_int_equal(r->n, 1); /* within a second */
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(the_third_look_confirms),
        TEST(what_is_not_seen_coasts_and_grows_uncertain_and_ends),
        TEST(nothing_is_held_against_what_the_image_does_not_show),
        TEST(who_is_not_heard_in_view_is_rather_hidden_than_gone),
        TEST(something_comes_back_under_its_id),
        TEST(standing_and_moving_are_told_apart),
        TEST(a_walker_is_as_far_off_as_his_covariance_says),
        TEST(who_walks_on_unseen_is_told_as_sure_as_he_is_near),
        TEST(who_fades_behind_an_edge_has_gone_on),
        TEST(who_stops_is_told_to_have_stopped),
        TEST(who_is_proven_ping_by_ping_is_told_at_once),
        TEST(what_echoes_behind_who_has_passed_is_not_told_at_once),
        TEST(who_comes_beside_him_is),
        TEST(who_comes_far_behind_him_is),
        TEST(crossing_objects_keep_their_ids),
        TEST(what_stood_beside_its_way_becomes_no_double),
        TEST(who_walks_beside_it_is_told_too),
        TEST(two_that_merge_and_part_stay_two),
        TEST(of_what_is_heard_beside_a_walker_no_other_begins),
        TEST(who_is_fast_is_told_beside_a_walker),
        TEST(two_who_go_as_one_become_one),
        TEST(what_is_told_of_something_fast_is_its_middle),
        TEST(an_extended_object_is_one_track_in_its_middle),
        TEST(clutter_makes_as_many_false_tracks_as_m_of_n_says),
        TEST(what_hardly_exists_does_not_take_an_objects_only_detection),
        TEST(what_comes_up_beside_an_object_is_its_own_within_its_reach),
        TEST(what_stands_stands_still_while_the_vehicle_turns),
        TEST(the_mirror_of_a_track_is_told_where_the_vehicle_sees_it),
        TEST(who_is_shown_by_two_walls_is_one_and_surer),
        TEST(what_two_walls_show_of_one_is_nobody_elses),
        TEST(a_track_stays_with_its_wall_until_another_is_far_louder),
        TEST(unknown_ego_motion_widens_tracks),
        TEST(the_images_age_is_taken_out),
        TEST(the_age_of_an_objects_middle_is_the_middle_of_the_ages),
        TEST(older_scans_are_ignored_and_counted),
        TEST(a_clock_that_jumps_back_begins_anew_with_other_ids),
        TEST(a_tracker_that_is_started_again_begins_with_other_ids),
        TEST(a_gap_ends_what_may_be_anywhere_by_now),
        TEST(an_id_is_not_given_again_for_half_a_minute),
        TEST(as_many_as_there_can_be),
        TEST(values_out_of_range_are_refused),
        TEST(what_stands_in_the_image_is_not_told),
        TEST(a_course_that_may_be_wrong_is_believed_as_much),
        TEST(whose_phases_go_along_a_course_is_told_beside_what_stands),
        TEST(whose_courses_do_not_agree_is_not_told),
        TEST(whose_course_is_none_of_rest_is_told_once_velocities_agree),
        TEST(whose_course_may_be_one_of_rest_is_told_by_places_and_sooner),
        TEST(what_moves_is_known_over_a_gap),
        TEST(once_a_background_is_taken_away_it_is_told),
        TEST(what_has_no_name_is_forgotten_sooner),
        TEST(what_is_beside_somebody_is_not_told_as_a_background_begins),
        TEST(what_a_background_leaves_has_to_move),
        TEST(what_a_background_cannot_have_left_is_told_at_rest),
        TEST(what_comes_to_rest_there_ends_as_if_unseen),
        TEST(what_turns_round_keeps_its_name),
        TEST(what_has_come_to_rest_gets_no_name),
        TEST(what_passes_by_is_not_taken_for_what_rests),
        TEST(things_at_rest_that_are_seen_one_after_another_have_not_moved),
        TEST(another_thing_at_rest_after_a_gap_has_not_moved),
        TEST(a_walker_who_is_heard_now_and_then_is_told),
        TEST(a_walker_is_told_whichever_limb_is_heard),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
