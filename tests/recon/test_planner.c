/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <string.h>

#include "recon/planning/planner.h"
#include "tests/recon/rig.h"

/* The paper's array, and a point at 2.6 m of which everything is known. */
struct scene {
    struct rig rig;
    struct trace_set set;
    struct probe probe, unknown;
    struct grid grid;
    struct planner_config cfg;
    struct plan plan;
};

/* Its object stands ahead, as far away as this. */
static void place(struct scene *s, double z_m)
{
    struct probe_object *o = &s->probe.objects[0];
    o->position_m[2] = z_m;
    geometry_resolution_at(&s->rig.geometry, s->rig.band_hz, o->position_m, o->width_m);
}

static void lay_out(struct scene *s)
{
    static const double gate_m[2] = {1.0, 4.0};
    struct rig *r = &s->rig;
    memset(s, 0, sizeof *s);
    rig_default(r);
    r->geometry.n_speakers = r->geometry.n_microphones = 16;
    r->geometry.n_positions = 32;
    for (int i = 0; i < 16; i++) {
        memset(r->speakers_m[i], 0, sizeof r->speakers_m[i]);
        memset(r->microphones_m[i], 0, sizeof r->microphones_m[i]);
        r->speakers_m[i][1] = r->microphones_m[i][1] = i / 15.0;
    }
    for (int k = 0; k < 32; k++)
        r->positions_m[k] = k / 31.0;
    rig_listen(r, gate_m[0], gate_m[1]);
    grid_default(&s->grid, &r->geometry, gate_m, r->band_hz);
    s->set = (struct trace_set){.geometry = &r->geometry,
                                .format = r->format,
                                .band_hz = {r->band_hz[0], r->band_hz[1]},
                                .gate_m = {gate_m[0], gate_m[1]}};
    assert_int_equal(probe_assume(&s->unknown, &s->set, &s->grid), 0);
    s->probe = (struct probe){.imaged = true,
                              .snr_db = 40.0,
                              .n_objects = 1,
                              .depth_m = {2.5, 2.7},
                              .coherence = {0.0, 1.0, 0.01}};
    s->probe.objects[0] = (struct probe_object){
        .position_m = {0.5, 0.5, 2.6}, .level_db = 40.0, .noise_m = {1e-4, 1e-4, 1e-4}};
    place(s, 2.6);
    s->cfg = (struct planner_config){.set = &s->set,
                                     .probe = &s->probe,
                                     .grid = &s->grid,
                                     .n_threads = 2,
                                     .slowness = 1.0,
                                     .least_stride = 1,
                                     .budget_s = INFINITY};
}

static void decide(struct scene *s)
{
    size_t taken = 0;
    planner_decide(&s->plan, &s->cfg);
    assert_true(s->plan.n_candidates > 0);
    for (size_t i = 0; i < s->plan.n_candidates; i++)
        taken += !s->plan.candidates[i].why_not[0];
    assert_int_equal(taken, 1); /* of all others it says why not */
    assert_true(s->plan.because[0]);
    assert_true(isfinite(s->plan.time_s) && s->plan.time_s > 0.0);
    assert_true(isfinite(s->plan.error_m) && s->plan.error_m > 0.0);
}

static void an_ordinary_scene_takes_the_fast_way_with_all_pairs(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    decide(&s);
    assert_string_equal(s.plan.method, "fast");
    assert_int_equal(s.plan.stride, 1);
    assert_near(s.plan.band_hz[1], s.set.band_hz[1], 0.0);
    assert_near(s.plan.grid.step_m[1], s.grid.step_m[1], 0.0);
}

static void depth_that_holds_nothing_is_not_imaged(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    decide(&s);
    const struct grid *g = &s.plan.grid;
    double last_m = g->origin_m[2] + g->step_m[2] * (double)(g->n[2] - 1);
    assert_true(g->origin_m[2] <= 2.5 && g->origin_m[2] > 2.5 - 2.0 * g->step_m[2]);
    assert_true(last_m >= 2.7 - 1e-9 && last_m < 2.7 + 2.0 * g->step_m[2]);
    /* Its planes are planes of the whole image. */
    double planes = (g->origin_m[2] - s.grid.origin_m[2]) / s.grid.step_m[2];
    assert_near(planes, rint(planes), 1e-6);
}

static void a_volume_that_was_asked_for_is_kept(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.cfg.keep_grid = true;
    s.cfg.error_m = 0.1;
    decide(&s);
    assert_memory_equal(&s.plan.grid, &s.grid, sizeof s.grid);
}

static void positions_lost_to_a_centimetre_leave_power_alone(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.probe.coherence.element_m = 0.010;
    decide(&s);
    assert_string_equal(s.plan.method, "incoherent");
    assert_near(s.plan.band_hz[1], s.set.band_hz[1], 0.0);
}

/* No budget makes power forgo speakers, or steps half as wide again; where the scene
 * mirrors no step is given up, for none saves anything. */
static void power_keeps_all_speakers_and_moderate_steps(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.probe.coherence.element_m = 0.010;
    s.cfg.budget_s = 1e-6;
    decide(&s);
    assert_string_equal(s.plan.method, "incoherent");
    assert_int_equal(s.plan.stride, 1);
    assert_near(s.plan.grid.step_m[1], 1.5 * s.grid.step_m[1], 1e-9);
    double scattered_s = s.plan.time_s;
    s.probe.specular = true;
    decide(&s);
    assert_int_equal(s.plan.stride, 1);
    assert_near(s.plan.grid.step_m[1], s.grid.step_m[1], 1e-9);
    assert_below(s.plan.time_s, scattered_s);
}

/* Planes and dip moveout are for what stands aside. */
static void mirrors_are_not_paid_what_leaning_points_need(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.probe.objects[0].extent_m = 0.8;
    s.probe.objects[0].tilt[0] = -0.7;
    s.probe.objects[0].moveout_m[0] = 0.02;
    decide(&s);
    assert_true(s.plan.dip);
    s.probe.specular = true;
    decide(&s);
    assert_false(s.plan.dip);
    assert_near(s.plan.grid.step_m[2], s.grid.step_m[2], 1e-12);
}

/* lambda = 5 sigma is 25 mm: 13.6 kHz at 340 m/s. */
static void positions_less_certain_narrow_the_band(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.probe.coherence.element_m = 0.005;
    decide(&s);
    assert_string_equal(s.plan.method, "fast");
    assert_near(s.plan.band_hz[1], s.rig.geometry.sound_speed_m_s / 0.025, 1.0);
    assert_near(s.plan.band_hz[0], s.set.band_hz[0], 0.0);
}

static void positions_that_cannot_be_told_change_nothing(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.probe.coherence.element_m = NAN;
    decide(&s);
    assert_string_equal(s.plan.method, "fast");
}

static void moveout_that_tears_the_image_apart_asks_for_dip_moveout(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    decide(&s);
    assert_false(s.plan.dip);
    s.probe.objects[0].moveout_rad = 2.0;
    decide(&s);
    assert_string_equal(s.plan.method, "fast");
    assert_true(s.plan.dip);
}

static void pairs_on_no_lattice_ask_for_back_projection(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.probe = s.unknown;
    s.probe.imaged = false;
    decide(&s);
    assert_string_equal(s.plan.method, "backprojection");
    assert_near(s.plan.grid.step_m[1], s.grid.step_m[1], 0.0);
}

static void an_error_that_is_allowed_buys_time(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    decide(&s);
    double exact_s = s.plan.time_s;
    s.cfg.error_m = 0.01;
    decide(&s);
    assert_true(s.plan.error_m <= 0.01);
    assert_below(s.plan.time_s, exact_s);
    assert_true(s.plan.grid.step_m[1] > s.grid.step_m[1]);
}

static void an_error_out_of_reach_is_said_to_be(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.cfg.error_m = 1e-6;
    decide(&s);
    assert_true(s.plan.error_m > 1e-6);
    assert_non_null(strstr(s.plan.because, "no way is exact"));
}

static void a_budget_is_kept_and_an_impossible_one_named(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    decide(&s);
    s.cfg.budget_s = 0.95 * s.plan.time_s;
    decide(&s);
    assert_true(s.plan.time_s <= s.cfg.budget_s);
    s.cfg.budget_s = 1e-9;
    decide(&s);
    assert_non_null(strstr(s.plan.because, "nothing fits the budget"));
    for (size_t i = 0; i < s.plan.n_candidates; i++)
        assert_true(s.plan.time_s <= s.plan.candidates[i].time_s);
}

static void time_to_spare_sharpens_a_shape(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.probe.objects[0].extent_m = 0.8;
    s.cfg.budget_s = 60.0;
    decide(&s);
    assert_string_equal(s.plan.method, "iterative");
    s.probe.objects[0].extent_m = 0.0; /* a point has no shape */
    decide(&s);
    assert_string_equal(s.plan.method, "fast");
}

static const struct planner_candidate *iterative(const struct scene *s)
{
    for (size_t i = 0; i < s->plan.n_candidates; i++)
        if (!strcmp(s->plan.candidates[i].method, "iterative"))
            return &s->plan.candidates[i];
    fail_msg("iterative is no candidate");
    return NULL;
}

/* Eight per cent of a budget are not counted on. */
static void as_many_iterations_are_allowed_as_there_is_time_for(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.probe.objects[0].extent_m = 0.8;
    s.cfg.budget_s = 1e-6;
    decide(&s);
    const struct planner_candidate few = *iterative(&s);
    assert_int_equal(few.iterations, 10);
    assert_true(few.why_not[0]);
    s.cfg.budget_s = 60.0;
    decide(&s);
    const struct planner_candidate many = *iterative(&s);
    assert_int_equal(many.iterations, 200);
    assert_int_equal(s.plan.iterations, 200);
    /* Most of 200 are not needed, and no time is predicted for them. */
    double each_s = (many.time_s - few.time_s) / 20.0;
    assert_true(each_s > 0.0);
    for (size_t n = 11; n < 200; n += 27) {
        s.cfg.budget_s = (few.time_s + each_s * ((double)n - 10 + 0.5)) / 0.92;
        decide(&s);
        assert_string_equal(s.plan.method, "iterative");
        assert_int_equal(s.plan.iterations, n);
        assert_true(s.plan.time_s <= 0.92 * s.cfg.budget_s);
    }
    s.probe.objects[0].extent_m = 0.0;
    decide(&s);
    assert_int_equal(s.plan.iterations, 0);
}

static void lay_out_near(struct scene *s)
{
    lay_out(s);
    place(s, 1.05);
    s->probe.depth_m[0] = 1.0;
    s->probe.depth_m[1] = 1.2;
}

static void what_is_near_gets_finer_steps(void **state)
{
    (void)state;
    struct scene s;
    lay_out_near(&s);
    decide(&s);
    assert_near(s.plan.grid.step_m[1], 0.5 * s.grid.step_m[1], 1e-12);
    /* What is near is narrower, but no less deep. */
    assert_near(s.plan.grid.step_m[2], s.grid.step_m[2], 1e-12);
}

/* Steps half as wide and the whole image's are not all that a budget can buy. */
static void where_time_presses_steps_are_somewhat_finer(void **state)
{
    (void)state;
    struct scene s;
    lay_out_near(&s);
    decide(&s);
    s.cfg.budget_s = 0.9 * s.plan.time_s;
    decide(&s);
    assert_int_equal(s.plan.stride, 1);
    assert_true(s.plan.grid.step_m[1] > 0.6 * s.grid.step_m[1]);
    assert_true(s.plan.grid.step_m[1] < 0.9 * s.grid.step_m[1]);
}

static const struct planner_candidate *find(const struct scene *s, double deeper,
                                            bool dip)
{
    for (size_t i = 0; i < s->plan.n_candidates; i++) {
        const struct planner_candidate *c = &s->plan.candidates[i];
        if (!strcmp(c->method, "fast") && c->dip == dip && c->coarser == 1.0 &&
            c->deeper == deeper && c->stride == s->cfg.least_stride)
            return c;
    }
    fail_msg("no candidate with planes %g times as far apart", deeper);
    return NULL;
}

/* A plane misses the point by up to half a step, by step / sqrt(12) in the mean. */
static void planes_are_nearer_to_each_other_where_points_lean(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    decide(&s);
    assert_near(s.plan.grid.step_m[2], s.grid.step_m[2], 1e-12);
    s.probe.objects[0].tilt[0] = -0.7;
    s.probe.objects[0].tilt[1] = 0.4;
    decide(&s);
    assert_below(s.plan.grid.step_m[2], 0.6 * s.grid.step_m[2]);
    double wide = find(&s, 1.0, false)->error_m, narrow = find(&s, 0.5, false)->error_m;
    double lean2 = 0.7 * 0.7 + 0.4 * 0.4, step2 = pow(s.grid.step_m[2], 2.0);
    assert_near((wide * wide - narrow * narrow) / (lean2 * step2 / 12.0 * 0.75), 1.0,
                1e-6);
}

/* By fewer speakers a point is imaged beside itself.  Dip moveout helps where it has
 * little to do. */
static void
fewer_speakers_of_what_is_near_are_less_exact_for_all_dip_moveout(void **state)
{
    (void)state;
    static const double moveout_rad[3] = {0.3, 0.02, 0.3};
    struct scene s;
    double error_m[3];
    for (int i = 0; i < 3; i++) {
        lay_out(&s);
        s.probe.objects[0].moveout_rad = moveout_rad[i];
        s.probe.objects[0].fewer_m[1][1] = 0.008;
        s.cfg.least_stride = i < 2 ? 4 : 1;
        s.cfg.budget_s = 60.0;
        decide(&s);
        error_m[i] = find(&s, 1.0, true)->error_m;
    }
    assert_true(error_m[0] > 0.008);
    assert_below(error_m[1], 0.002);
    assert_below(error_m[2], 0.002);
}

/* Nothing is known yet but how long all pings would take to compress. */
static void fewer_speakers_are_compressed_when_time_presses(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.probe = s.unknown;
    s.cfg.compress_s = 1.0;
    decide(&s);
    assert_int_equal(s.plan.stride, 1);
    s.cfg.budget_s = 1.0;
    decide(&s);
    assert_true(s.plan.stride > 1);
    assert_true(s.plan.time_s <= 1.0);
    s.cfg.budget_s = 60.0;
    decide(&s);
    assert_int_equal(s.plan.stride, 1);
}

static void speakers_that_were_not_compressed_stay_out(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.cfg.least_stride = 2;
    s.cfg.budget_s = 60.0;
    decide(&s);
    assert_int_equal(s.plan.stride, 2);
    for (size_t i = 0; i < s.plan.n_candidates; i++)
        assert_true(s.plan.candidates[i].stride >= 2);
}

/* Where there are no fewer pairs to choose from, and few voxels in each wave. */
static void the_top_of_the_band_goes_before_the_steps_do_by_much(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    for (int a = 0; a < 3; a++) {
        s.grid.step_m[a] *= 1.5;
        s.grid.n[a] = s.grid.n[a] * 2 / 3;
    }
    assert_int_equal(probe_assume(&s.probe, &s.set, &s.grid), 0);
    s.cfg.budget_s = 60.0;
    s.cfg.least_stride = 4;
    decide(&s);
    assert_near(s.plan.band_hz[1], s.set.band_hz[1], 1e-6);
    s.cfg.budget_s = find(&s, 1.0, false)->time_s;
    decide(&s);
    assert_below(s.plan.band_hz[1], 0.9 * s.set.band_hz[1]);
    assert_below(s.plan.grid.step_m[1], 1.21 * s.grid.step_m[1]);
}

/* Sharpening helps what leans and what has edges, and harms what is read between voxels
 * straight ahead.  Who knows of nothing is to expect the former. */
static void what_stands_aside_is_sharpened_and_what_is_ahead_is_not(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    decide(&s);
    assert_near(s.plan.sharpen, 0.0, 0.0);
    s.probe.objects[0].tilt[0] = 0.5;
    decide(&s);
    assert_true(s.plan.sharpen > 0.0);
    s.probe.objects[0].tilt[0] = 0.0;
    s.probe.objects[0].extent_m = 0.8;
    decide(&s);
    assert_true(s.plan.sharpen > 0.0);
    s.probe = s.unknown;
    decide(&s);
    assert_true(s.plan.sharpen > 0.0);
}

static void elements_that_are_off_are_not_sharpened(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.probe.objects[0].tilt[0] = 0.5;
    s.probe.coherence.element_m = 0.004;
    decide(&s);
    assert_near(s.plan.sharpen, 0.0, 0.0);
}

/* Dip moveout wants lines that are even. */
static void uneven_lines_leave_dip_moveout_out(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    s.probe.objects[0].moveout_rad = 2.0;
    s.probe.uneven = true;
    decide(&s);
    assert_string_equal(s.plan.method, "backprojection");
    assert_non_null(strstr(s.plan.because, "moveout without dip does not suffice"));
    for (size_t i = 0; i < s.plan.n_candidates; i++)
        assert_false(s.plan.candidates[i].dip);
}

/* The waves of f-k migration are as many, whatever the steps: measured on the paper's
 * array, 0.93 million voxels take 81 ms of one core, twice the steps 47 (0.58), not 1/8.
 */
static void coarser_steps_save_less_than_their_voxels(void **state)
{
    (void)state;
    struct scene s;
    lay_out(&s);
    const struct grid fine = {.origin_m = {0.0, 0.0, 2.37},
                              .step_m = {0.0161, 0.0137, 0.0053},
                              .n = {69, 74, 186}};
    struct grid coarse = fine;
    for (int a = 0; a < 3; a++) {
        coarse.step_m[a] *= 2.0;
        coarse.n[a] = (coarse.n[a] + 1) / 2;
    }
    double stack_s = planner_image_s(&s.set, &(struct grid){.step_m = {1.0, 1.0, 1.0}},
                                     "backprojection", false, 1, 2);
    double fine_s = planner_image_s(&s.set, &fine, "fast", false, 1, 2) - stack_s;
    double coarse_s = planner_image_s(&s.set, &coarse, "fast", false, 1, 2) - stack_s;
    assert_near(coarse_s / fine_s, 0.58, 0.1);
}

static void twice_the_pings_take_twice_the_time_to_compress(void **state)
{
    (void)state;
    assert_near(planner_compress_s(1024, 16, 2) / planner_compress_s(512, 16, 2), 2.0,
                1e-9);
    assert_near(planner_compress_s(512, 16, 1) / planner_compress_s(512, 16, 2), 2.0,
                1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_ordinary_scene_takes_the_fast_way_with_all_pairs),
        cmocka_unit_test(depth_that_holds_nothing_is_not_imaged),
        cmocka_unit_test(a_volume_that_was_asked_for_is_kept),
        cmocka_unit_test(positions_lost_to_a_centimetre_leave_power_alone),
        cmocka_unit_test(power_keeps_all_speakers_and_moderate_steps),
        cmocka_unit_test(mirrors_are_not_paid_what_leaning_points_need),
        cmocka_unit_test(positions_less_certain_narrow_the_band),
        cmocka_unit_test(positions_that_cannot_be_told_change_nothing),
        cmocka_unit_test(moveout_that_tears_the_image_apart_asks_for_dip_moveout),
        cmocka_unit_test(pairs_on_no_lattice_ask_for_back_projection),
        cmocka_unit_test(an_error_that_is_allowed_buys_time),
        cmocka_unit_test(an_error_out_of_reach_is_said_to_be),
        cmocka_unit_test(a_budget_is_kept_and_an_impossible_one_named),
        cmocka_unit_test(time_to_spare_sharpens_a_shape),
        cmocka_unit_test(as_many_iterations_are_allowed_as_there_is_time_for),
        cmocka_unit_test(what_is_near_gets_finer_steps),
        cmocka_unit_test(where_time_presses_steps_are_somewhat_finer),
        cmocka_unit_test(planes_are_nearer_to_each_other_where_points_lean),
        cmocka_unit_test(
            fewer_speakers_of_what_is_near_are_less_exact_for_all_dip_moveout),
        cmocka_unit_test(fewer_speakers_are_compressed_when_time_presses),
        cmocka_unit_test(speakers_that_were_not_compressed_stay_out),
        cmocka_unit_test(the_top_of_the_band_goes_before_the_steps_do_by_much),
        cmocka_unit_test(what_stands_aside_is_sharpened_and_what_is_ahead_is_not),
        cmocka_unit_test(elements_that_are_off_are_not_sharpened),
        cmocka_unit_test(uneven_lines_leave_dip_moveout_out),
        cmocka_unit_test(coarser_steps_save_less_than_their_voxels),
        cmocka_unit_test(twice_the_pings_take_twice_the_time_to_compress),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
