/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/pool.h"
#include "recon/planning/scan_plan.h"
#include "recon/tail.h"
#include "tests/recon/planned.h"

/* Sidelobes are sought around the array. */
static struct survey with_volume(void)
{
    struct survey s = planned_survey();
    s.has_volume = true;
    memcpy(s.volume_m,
           (double[3][3]){{-0.1, 0.5, 0.02}, {0.0, 0.6, 0.02}, {1.0, 1.8, 0.01}},
           sizeof s.volume_m);
    return s;
}

static struct scan_plan_config any(const struct survey *s)
{
    return (struct scan_plan_config){
        .survey = s,
        .stage = {.speed_m_s = 0.4, .acceleration_m_s2 = 0.5, .settle_s = 0.15},
        .time_s = INFINITY,
        .snr_db = INFINITY,
        .at_m = {0.2, 0.3, 1.4}};
}

static struct scan_plan *plan(struct scan_plan_config cfg)
{
    struct scan_plan *p = malloc(sizeof *p);
    struct error why = {""};
    assert_non_null(p);
    assert_int_equal(pool_create(&cfg.pool, 2), 0);
    if (scan_plan(p, &cfg, &why))
        fail_msg("%s", why.text);
    pool_destroy(cfg.pool);
    return p;
}

static const struct scan_way *find(const struct scan_plan *p, bool continuous,
                                   size_t slot_samples, size_t together,
                                   size_t n_positions)
{
    for (size_t i = 0; i < p->n_ways; i++) {
        const struct scan_way *w = &p->ways[i];
        if (w->continuous == continuous && w->slot_samples == slot_samples &&
            w->together == together && w->n_positions == n_positions)
            return w;
    }
    fail_msg("there is no such way");
    return p->ways;
}

/* 3 cm at 0.5 m/s2 take 2 sqrt(0.03 / 0.5) s.  At 6 cm/s the run-up is 0.3 s and the
 * 0.12 s to get there, 2.16 cm in all. */
static void a_way_takes_its_pings_and_what_the_stage_takes(void **state)
{
    (void)state;
    struct survey s = with_volume();
    struct scan_plan *p = plan(any(&s));
    double tail_s = (double)tail_samples(&s) / 48000;
    assert_near(find(p, false, 3000, 1, 12)->time_s,
                12 * (0.5 + tail_s) + 11 * (2 * sqrt(0.03 / 0.5) + 0.15), 1e-9);
    assert_near(find(p, true, 3000, 1, 12)->time_s,
                2 * sqrt(0.0216 / 0.5) + 0.15 + 0.12 + 0.3 + 6 + tail_s, 1e-9);
    assert_near(find(p, true, 3000, 1, 12)->speed_m_s, 0.06, 1e-12);
    free(p);
}

static void the_shortest_slot_is_as_long_as_the_gate(void **state)
{
    (void)state;
    struct survey s = with_volume(), shorter;
    struct scan_plan *p = plan(any(&s));
    struct scan_way w = *find(p, false, 608, 1, 12);
    struct error why;
    assert_int_equal(scan_way_survey(&shorter, &s, &w, &why), 0);
    assert_true(survey_gate_limit_m(&shorter) >= 2);
    survey_clear(&shorter);
    w.slot_samples -= 16;
    assert_int_equal(scan_way_survey(&shorter, &s, &w, &why), -EINVAL);
    free(p);
}

static void without_need_nothing_changes(void **state)
{
    (void)state;
    struct survey s = with_volume();
    struct scan_plan *p = plan(any(&s));
    assert_non_null(p->best);
    assert_true(p->best == find(p, false, 3000, 1, 12));
    free(p);
}

static void within_a_time_as_much_is_heard_as_can_be(void **state)
{
    (void)state;
    struct survey s = with_volume();
    struct scan_plan_config cfg = any(&s);
    cfg.time_s = 7.5;
    struct scan_plan *p = plan(cfg);
    assert_non_null(p->best);
    assert_true(p->best == find(p, true, 3000, 1, 12));
    free(p);
    cfg.time_s = 4.5; /* two together, 12 cm/s: 3 s and 1 */
    p = plan(cfg);
    assert_non_null(p->best);
    assert_true(p->best->time_s <= 4.5 && p->best->n_positions == 12);
    assert_true(p->best->continuous);
    free(p);
}

/* The image of the whole survey is 17 dB above noise: 3 sigma are a third of it. */
static void for_an_error_the_quickest_is_taken(void **state)
{
    (void)state;
    struct survey s = with_volume();
    struct scan_plan_config cfg = any(&s);
    cfg.snr_db = -30;
    struct scan_plan *p = plan(cfg);
    double all_m = find(p, false, 3000, 1, 12)->error_m;
    double most_m = find(p, true, 3000, 1, 9)->error_m;
    assert_true(most_m > 1.02 * all_m);
    free(p);
    cfg.error_m = 0.5 * (all_m + most_m);
    p = plan(cfg);
    assert_non_null(p->best);
    assert_true(p->best->error_m <= cfg.error_m);
    assert_int_equal(p->best->n_positions, 12);
    for (size_t i = 0; i < p->n_ways; i++)
        if (!p->ways[i].why_not[0])
            assert_true(p->best->time_s < 1.02 * p->ways[i].time_s);
    free(p);
    cfg.error_m = 0.5 * all_m;
    p = plan(cfg);
    assert_null(p->best);
    free(p);
}

/* Cramer and Rao: as the root of how much is heard. */
static void half_the_positions_have_a_root_of_two_more_noise(void **state)
{
    (void)state;
    struct survey s = with_volume();
    struct scan_plan_config cfg = any(&s);
    cfg.snr_db = -20;
    struct scan_plan *p = plan(cfg);
    const struct scan_way *all = find(p, true, 3000, 1, 12);
    const struct scan_way *half = find(p, true, 3000, 1, 6);
    double wider = hypot(half->image.width_m[0], half->image.width_m[1]) /
                   hypot(all->image.width_m[0], all->image.width_m[1]);
    assert_near(half->noise_m / all->noise_m / wider, sqrt(2), 1e-6);
    free(p);
}

static void a_stage_is_not_asked_for_more_than_it_can_do(void **state)
{
    (void)state;
    struct survey s = with_volume();
    struct scan_plan_config cfg = any(&s);
    cfg.stage.speed_m_s = 0.2; /* eight slots of 12.7 ms: 30 cm/s */
    struct scan_plan *p = plan(cfg);
    const struct scan_way *w = find(p, true, 608, 1, 12);
    assert_non_null(strstr(w->why_not, "0.296 m/s"));
    assert_true(w->image.traces == 0.0);
    free(p);
}

/* At 6 cm/s 2.16 cm before the first position, 0.96 cm behind where the last round ends;
 * at 30 cm/s 17.6 cm. */
static void a_stage_that_goes_on_has_room_to_get_up_to_speed(void **state)
{
    (void)state;
    struct survey s = with_volume();
    struct scan_plan_config cfg = any(&s);
    cfg.stage.reach_m[0] = -0.05;
    cfg.stage.reach_m[1] = 0.5;
    struct scan_plan *p = plan(cfg);
    const struct scan_way *slow = find(p, true, 3000, 1, 12);
    assert_string_equal(slow->why_not, "");
    assert_near(slow->room_m[0], -0.0216, 1e-9);
    assert_near(slow->room_m[1], 0.36 + 0.0096, 1e-9);
    const struct scan_way *quick = find(p, true, 608, 1, 12);
    assert_non_null(strstr(quick->why_not, "would have to go from -0.176 to"));
    assert_string_equal(find(p, false, 608, 1, 12)->why_not, "");
    free(p);
}

/* 6 cm/s take 4.5 cm at 0.04 m/s2 and 1.2 to be sure: 2.16 and 3.9 are too little, and
 * 7.0 will do.  At 1 mm/s2 1.8 m would have to. */
static void a_slow_stage_begins_farther_off_or_cannot_go_on(void **state)
{
    (void)state;
    struct survey s = with_volume();
    struct scan_plan_config cfg = any(&s);
    cfg.stage.acceleration_m_s2 = 0.04;
    struct scan_plan *p = plan(cfg);
    const struct scan_way *w = find(p, true, 3000, 1, 12);
    assert_string_equal(w->why_not, "");
    assert_near(w->room_m[0], -0.0216 * 1.8 * 1.8, 1e-9);
    assert_near(w->room_m[1], 0.36 - 0.2 * 0.06 + 0.0216 * 1.8 * 1.8, 1e-9);
    free(p);
    cfg.stage.acceleration_m_s2 = 0.001;
    p = plan(cfg);
    assert_non_null(
        strstr(find(p, true, 3000, 1, 12)->why_not, "would not be at 0.060 m/s in time"));
    free(p);
}

static void where_there_is_no_time_nothing_will_do(void **state)
{
    (void)state;
    struct survey s = with_volume();
    struct scan_plan_config cfg = any(&s);
    cfg.time_s = 0.4;
    struct scan_plan *p = plan(cfg);
    assert_null(p->best);
    free(p);
}

static void an_array_that_stands_still_has_no_plan(void **state)
{
    (void)state;
    struct survey s = with_volume();
    struct scan_plan_config cfg = any(&s);
    struct error why;
    struct scan_plan p;
    s.n_positions = 1;
    assert_int_equal(scan_plan(&p, &cfg, &why), -EINVAL);
    assert_non_null(strstr(why.text, "one position"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_way_takes_its_pings_and_what_the_stage_takes),
        cmocka_unit_test(the_shortest_slot_is_as_long_as_the_gate),
        cmocka_unit_test(without_need_nothing_changes),
        cmocka_unit_test(within_a_time_as_much_is_heard_as_can_be),
        cmocka_unit_test(for_an_error_the_quickest_is_taken),
        cmocka_unit_test(half_the_positions_have_a_root_of_two_more_noise),
        cmocka_unit_test(a_stage_is_not_asked_for_more_than_it_can_do),
        cmocka_unit_test(a_stage_that_goes_on_has_room_to_get_up_to_speed),
        cmocka_unit_test(a_slow_stage_begins_farther_off_or_cannot_go_on),
        cmocka_unit_test(where_there_is_no_time_nothing_will_do),
        cmocka_unit_test(an_array_that_stands_still_has_no_plan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
