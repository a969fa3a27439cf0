/* SPDX-License-Identifier: MIT */
/* A scan whose nodes fall silent, end, and begin again. */
#include "tests/nodes/scan_world.h"

/* Runs until n scene pings are imaged. */
static void run_until_imaged(struct world *w, unsigned n)
{
    for (unsigned have = 0; have < n;) {
        step(w);
        if (w->n_queue)
            process_one(w);
        have = 0;
        for (int p = 0; p < N_POSITIONS; p++)
            for (int s = 0; s < N_SPEAKERS; s++)
                have += w->imaged[p][s];
        w->now_ns += 1 * MS;
    }
}

static void a_restarted_dsp_gets_its_background_again(void **state)
{
    struct world w;

    (void)state;
    setup(&w, true, 0, 8);
    start(&w);
    run_until_imaged(&w, 5);
    w.n_queue = 0;
    w.epoch.dsp = 2;
    hear(&w, "dsp", 2, ANLOS__HEALTH__STATE__STARTING);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__WAITING);
    assert_string_equal(status(&w).text, "waits for dsp");
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_lost, 0);
    assert_int_equal(fired_total(&w, ANLOS__PASS__BACKGROUND), 12 + 7);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

static void a_restarted_recon_gets_the_whole_scene_again(void **state)
{
    struct world w;

    (void)state;
    setup(&w, true, 0, 8);
    start(&w);
    run_until_imaged(&w, 5);
    w.n_queue = 0;
    memset(w.imaged, 0, sizeof w.imaged);
    w.epoch.recon = 2;
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_lost, 0);
    assert_int_equal(fired_total(&w, ANLOS__PASS__BACKGROUND), 12);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

static void a_recon_that_dies_after_the_end_begins_the_scene_anew(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    memset(w.imaged, 0, sizeof w.imaged);
    w.epoch.recon = 2;
    all_healthy(&w);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__RUNNING);
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

static void a_restarted_array_or_stage_is_commanded_again(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    step(&w);
    step(&w);
    assert_int_equal(w.n_queue, 4);
    w.n_queue = 0; /* dies with its shot */
    w.epoch.array = 2;
    w.epoch.stage = 2;
    w.command_id = 0;
    w.position_m = w.target_m = 0.7;
    hear(&w, "stage", 2, ANLOS__HEALTH__STATE__READY);
    tell_stage(&w);
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_lost, 0);
    assert_int_equal(status(&w).pings_retaken, 4);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

static void receipts_of_a_former_process_are_void(void **state)
{
    struct world w;
    const struct ping p = {ANLOS__PASS__SCENE, 1, 0, 0, 0.0};

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    step(&w);
    step(&w);
    hear(&w, "recon", 5, ANLOS__HEALTH__STATE__READY);
    tell_receipt(&w, "recon", 1, &p, ANLOS__PASS__SCENE, true);
    assert_int_equal(status(&w).pings_done, 0);
    tell_receipt(&w, "recon", 5, &p, ANLOS__PASS__SCENE, true);
    assert_int_equal(status(&w).pings_done, 1);
    scan_destroy(w.scan);
}

/* The link between array and dsp, say: what it holds back comes later. */
static void a_link_that_is_cut_for_longer_than_the_time_out_costs_no_ping(void **state)
{
    struct world w;

    (void)state;
    setup_patient(&w, false, 0, N_SPEAKERS, 2.5);
    start(&w);
    step(&w);
    step(&w);
    assert_int_equal(w.n_queue, N_SPEAKERS);
    for (size_t i = 0; i < w.n_queue; i++)
        tell_ping(&w, &w.queue[i]);
    for (int i = 0; i < 80; i++) { /* 4 s without a word */
        w.now_ns += 50 * MS;
        step(&w);
    }
    assert_int_equal(status(&w).pings_lost, 0);
    assert_int_equal(fired_total(&w, ANLOS__PASS__SCENE), N_SPEAKERS);
    all_healthy(&w);
    step(&w);
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_lost, 0);
    assert_int_equal(status(&w).pings_retaken, 0);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

/* Four pings are fired; then recon is gone, and nothing comes back. */
static void lose_recon(struct world *w)
{
    setup(w, false, 0, 8);
    start(w);
    step(w);
    step(w);
    w->n_queue = 0;
    for (int i = 0; i < 4; i++)
        tell_ping(w, &(struct ping){ANLOS__PASS__SCENE, 1, 0, (uint32_t)i, 0.0});
    w->now_ns += 900 * MS;
    step(w);
    w->now_ns += 5000 * MS;
    hear(w, "stage", 1, ANLOS__HEALTH__STATE__READY);
    hear(w, "array", 1, ANLOS__HEALTH__STATE__READY);
    hear(w, "dsp", 1, ANLOS__HEALTH__STATE__READY);
    step(w);
    assert_string_equal(status(w).text, "waits for recon");
}

static void a_silent_node_is_waited_for_and_nothing_times_out(void **state)
{
    struct world w;

    (void)state;
    lose_recon(&w);
    assert_int_equal(status(&w).pings_lost, 0);
    w.epoch.recon = 2;
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_lost, 0);
    scan_destroy(w.scan);
}

/* Its machine has no battery, say, and stamps its start with an earlier time. */
static void a_node_that_comes_back_with_its_clock_behind_is_taken_as_new(void **state)
{
    struct world w;

    (void)state;
    lose_recon(&w);
    w.epoch.recon = -3600000 * MS;
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_lost, 0);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

static void a_node_that_cannot_go_on_ends_the_scan(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    step(&w);
    hear(&w, "dsp", 1, ANLOS__HEALTH__STATE__FAULT);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__FAILED);
    assert_string_equal(status(&w).text, "dsp: text of health");
    scan_destroy(w.scan);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_restarted_dsp_gets_its_background_again),
        cmocka_unit_test(a_restarted_recon_gets_the_whole_scene_again),
        cmocka_unit_test(a_recon_that_dies_after_the_end_begins_the_scene_anew),
        cmocka_unit_test(a_restarted_array_or_stage_is_commanded_again),
        cmocka_unit_test(receipts_of_a_former_process_are_void),
        cmocka_unit_test(a_link_that_is_cut_for_longer_than_the_time_out_costs_no_ping),
        cmocka_unit_test(a_silent_node_is_waited_for_and_nothing_times_out),
        cmocka_unit_test(a_node_that_comes_back_with_its_clock_behind_is_taken_as_new),
        cmocka_unit_test(a_node_that_cannot_go_on_ends_the_scan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
