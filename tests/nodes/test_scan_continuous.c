/* SPDX-License-Identifier: MIT */
/* A scan whose stage does not stop, in a world of its own: a stage that gets up to speed,
 * goes and says where it is every 50 ms, and an array that records slot after slot from
 * the time on that it is told. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "hal/stage/stepper.h"
#include "msgs/convert.h"
#include "nodes/scan/scan.h"

#define MS          1000000LL
#define N_POSITIONS 6
#define N_SPEAKERS  4
#define SLOT_S      0.05 /* a round of 0.2 s */
#define STEP_M      0.012
#define SPEED_M_S   (STEP_M / (N_SPEAKERS * SLOT_S))
#define RECEIPT_MS  200 /* from a slot's beginning to its receipt */

struct world {
    struct scan *scan;
    int64_t now_ns;
    double acceleration, jitter_m, min_m;
    struct trapezoid motion;
    int64_t set_off_ns, told_ns, stage_epoch_ns;
    uint32_t command_id;
    double target_m, speed_m_s;
    bool refused, held, deaf, moved;
    Anlos__FireCommand shot; /* under way */
    size_t next, told;       /* emissions that have begun, and have had their receipts */
    bool firing;
    unsigned commands, moves;
    int64_t lead_ns, began_ns; /* of the newest shot */
    double worst_m;            /* beside its place, of any ping */
    size_t lose[2];            /* emissions of the next shot that are lost */
    bool imaged[N_POSITIONS][N_SPEAKERS], kept[N_POSITIONS][N_SPEAKERS];
};

static const char *const needs[] = {"stage", "array", "dsp", "recon"};

static void tell_survey(struct world *w)
{
    double positions[N_POSITIONS], speakers[N_SPEAKERS][3] = {{0}};
    double microphones[1][3] = {{0.1, 0, 0}};
    uint8_t *bytes;
    size_t size;
    for (int k = 0; k < N_POSITIONS; k++)
        positions[k] = STEP_M * k;
    for (int j = 0; j < N_SPEAKERS; j++)
        speakers[j][1] = 0.1 * j;
    const struct survey s = {.source = SURVEY_SIMULATION,
                             .sound_speed_m_s = 343,
                             .temperature_c = 20,
                             .sample_rate_hz = 48000,
                             .chirp_start_hz = 2000,
                             .chirp_stop_hz = 20000,
                             .chirp_duration_s = 0.03,
                             .slot_samples = (size_t)(48000 * SLOT_S),
                             .n_speakers = N_SPEAKERS,
                             .n_microphones = 1,
                             .n_positions = N_POSITIONS,
                             .speakers_m = speakers,
                             .microphones_m = microphones,
                             .stage_axis = {1, 0, 0},
                             .stage_positions_m = positions,
                             .continuous = true};
    assert_int_equal(survey_pack(&s, &bytes, &size), 0);
    Anlos__Survey *m = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    assert_non_null(m);
    assert_int_equal(scan_survey(w->scan, m), 0);
    anlos__survey__free_unpacked(m, NULL);
}

static void tell_health(struct world *w)
{
    Anlos__Health health = ANLOS__HEALTH__INIT;
    health.state = ANLOS__HEALTH__STATE__READY;
    for (size_t i = 0; i < 4; i++)
        if (scan_hear(w->scan, needs[i], i ? 1 : w->stage_epoch_ns, w->now_ns))
            scan_health(w->scan, needs[i], &health);
}

static void setup(struct world *w, bool background)
{
    const struct scan_config cfg = {.background = background,
                                    .has_stage = true,
                                    .window = 4, /* of no use here */
                                    .retries = 3,
                                    .timeout_s = 1,
                                    .silence_s = 5,
                                    .needs = needs,
                                    .n_needs = 4};
    *w = (struct world){.now_ns = 1000000 * MS,
                        .stage_epoch_ns = 1,
                        .acceleration = 0.5,
                        .min_m = -0.05,
                        .lose = {9999, 0}};
    assert_int_equal(scan_create(&w->scan, &cfg), 0);
    tell_health(w);
    tell_survey(w);
}

static double place_m(const struct world *w, int64_t at_ns)
{
    double v;
    return trapezoid_at(&w->motion, 1e-9 * (double)(at_ns - w->set_off_ns), &v);
}

static bool moves(const struct world *w)
{
    return 1e-9 * (double)(w->now_ns - w->set_off_ns) < trapezoid_duration_s(&w->motion);
}

static void tell_stage(struct world *w)
{
    Anlos__StageState s = ANLOS__STAGE_STATE__INIT;
    double off_m = w->told_ns / (50 * MS) % 2 ? w->jitter_m : -w->jitter_m;
    w->told_ns = w->now_ns;
    w->moved = moves(w);
    s.state = w->refused ? ANLOS__STAGE_STATE__STATE__REFUSED
              : moves(w) ? ANLOS__STAGE_STATE__STATE__MOVING
                         : ANLOS__STAGE_STATE__STATE__IDLE;
    s.command_id = w->command_id;
    s.position_m = place_m(w, w->now_ns) + off_m;
    s.target_m = w->target_m;
    s.held = w->held;
    s.text = (char *)"cannot move that far";
    if (scan_hear(w->scan, "stage", w->stage_epoch_ns, w->now_ns))
        scan_stage(w->scan, &s, w->now_ns);
}

static void take_move(struct world *w, const Anlos__StageCommand *c)
{
    double x = place_m(w, w->now_ns), v, own = c->speed_m_s > 0 ? c->speed_m_s : 0.2;
    trapezoid_at(&w->motion, 1e-9 * (double)(w->now_ns - w->set_off_ns), &v);
    w->moves++;
    w->command_id = c->id;
    w->target_m = c->target_m;
    w->speed_m_s = c->speed_m_s;
    w->refused = c->target_m < w->min_m;
    if (!w->refused) {
        trapezoid_plan(&w->motion, x, v, c->target_m, own, w->acceleration);
        w->set_off_ns = w->now_ns;
    }
    tell_stage(w);
}

static void take_fire(struct world *w, const Anlos__FireCommand *c)
{
    w->commands++;
    assert_int_equal(c->n_speakers, N_SPEAKERS);
    for (uint32_t j = 0; j < N_SPEAKERS; j++)
        assert_int_equal(c->speakers[j], j);
    assert_true(fabs(c->speed_m_s - SPEED_M_S) < 1e-9);
    assert_true(fabs(c->stage_m - STEP_M * c->position) < 1e-9);
    w->lead_ns = c->start_ns - w->now_ns;
    if (w->deaf)
        return;
    w->shot = *c;
    w->firing = true;
    w->next = w->told = 0;
    w->began_ns = c->start_ns > w->now_ns ? c->start_ns : w->now_ns;
}

/* A ping is told of when its slot has begun, and has its receipt later. */
static void tell_emission(struct world *w, size_t k, bool receipt)
{
    uint32_t position = w->shot.position + (uint32_t)(k / N_SPEAKERS);
    uint32_t speaker = (uint32_t)(k % N_SPEAKERS);
    bool lost = k >= w->lose[0] && k < w->lose[0] + w->lose[1];
    Anlos__Ping ping = ANLOS__PING__INIT;
    Anlos__Receipt r = ANLOS__RECEIPT__INIT;
    bool scene = w->shot.pass == ANLOS__PASS__SCENE;
    ping.scan = r.scan = w->shot.scan;
    ping.pass = r.pass = w->shot.pass;
    ping.position = r.position = position;
    ping.speaker = r.speaker = speaker;
    r.usable = true;
    if (!receipt && scan_hear(w->scan, "array", 1, w->now_ns))
        scan_ping(w->scan, &ping, w->now_ns);
    if (!receipt || lost)
        return;
    (scene ? w->imaged : w->kept)[position][speaker] = true;
    if (scan_hear(w->scan, scene ? "recon" : "dsp", 1, w->now_ns))
        scan_receipt(w->scan, &r, w->now_ns);
}

static int64_t slot_ns(const struct world *w, size_t k)
{
    return w->began_ns + llrint(1e9 * SLOT_S * (double)k);
}

static void record(struct world *w)
{
    size_t n = w->shot.n_rounds * N_SPEAKERS;
    for (; w->firing && w->next < n && slot_ns(w, w->next) <= w->now_ns; w->next++) {
        double planned_m = STEP_M * w->shot.position +
                           SPEED_M_S * SLOT_S * (double)w->next;
        double off_m = fabs(place_m(w, slot_ns(w, w->next)) - planned_m);
        w->worst_m = fmax(w->worst_m, off_m);
        tell_emission(w, w->next, false);
    }
    for (; w->firing && w->told < w->next &&
           slot_ns(w, w->told) + RECEIPT_MS * MS <= w->now_ns;
         w->told++)
        tell_emission(w, w->told, true);
    if (w->firing && w->told == n) {
        w->firing = false;
        w->lose[0] = 9999;
    }
}

static Anlos__ScanStatus status(const struct world *w)
{
    Anlos__ScanStatus s;
    scan_status(w->scan, w->now_ns, &s);
    return s;
}

static void step(struct world *w)
{
    struct scan_action action;
    w->now_ns += 5 * MS;
    if (w->now_ns / (1000 * MS) != (w->now_ns - 5 * MS) / (1000 * MS))
        tell_health(w);
    if (w->now_ns - w->told_ns >= (moves(w) ? 50 : 500) * MS || moves(w) != w->moved)
        tell_stage(w);
    record(w);
    scan_step(w->scan, w->now_ns, &action);
    if (action.move)
        take_move(w, &action.stage_command);
    if (action.fire)
        take_fire(w, &action.fire_command);
}

static void run(struct world *w, double limit_s)
{
    int64_t end_ns = w->now_ns + llrint(1e9 * limit_s);
    while (w->now_ns < end_ns && status(w).state != ANLOS__SCAN_STATUS__STATE__DONE &&
           status(w).state != ANLOS__SCAN_STATUS__STATE__FAILED)
        step(w);
}

static void assert_all(const bool pings[N_POSITIONS][N_SPEAKERS])
{
    for (int k = 0; k < N_POSITIONS; k++)
        for (int j = 0; j < N_SPEAKERS; j++)
            assert_true(pings[k][j]);
}

static void every_ping_is_taken_on_the_way_from_its_place(void **state)
{
    struct world w;
    (void)state;
    setup(&w, true);
    run(&w, 60);
    Anlos__ScanStatus s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(s.pings_done, 2 * N_POSITIONS * N_SPEAKERS);
    assert_int_equal(s.pings_retaken, 0);
    assert_all(w.kept);
    assert_all(w.imaged);
    assert_int_equal(w.commands, 2);
    assert_int_equal(w.moves, 4); /* to the start and off, twice */
    assert_true(w.worst_m < 1e-6);
    assert_true(w.lead_ns >= 50 * MS && w.lead_ns <= 200 * MS);
    /* Pings take 1.2 s a pass; the rest is ways, ramps and receipts. */
    assert_true(w.now_ns - 1000000 * MS < 2 * 1200 * MS + 3000 * MS);
    scan_destroy(w.scan);
}

/* Emissions 9 and 10, of rounds 2 and 2: the run goes from round 1 to 3. */
static void what_got_lost_is_taken_again_with_its_neighbours(void **state)
{
    struct world w;
    (void)state;
    setup(&w, false);
    w.lose[0] = 9;
    w.lose[1] = 2;
    run(&w, 60);
    Anlos__ScanStatus s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(s.pings_done, N_POSITIONS * N_SPEAKERS);
    assert_int_equal(s.pings_retaken, 2);
    assert_all(w.imaged);
    assert_int_equal(w.commands, 2);
    assert_int_equal(w.shot.position, 1);
    assert_int_equal(w.shot.n_rounds, 3);
    assert_true(w.worst_m < 1e-6);
    scan_destroy(w.scan);
}

static void a_command_that_got_lost_costs_a_run(void **state)
{
    struct world w;
    (void)state;
    setup(&w, false);
    w.deaf = true;
    while (!w.commands)
        step(&w);
    w.deaf = false;
    run(&w, 60);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(w.commands, 2);
    assert_all(w.imaged);
    scan_destroy(w.scan);
}

/* Its process has begun anew: it stands where it was, and knows no command. */
static void restart_stage(struct world *w)
{
    Anlos__Health health = ANLOS__HEALTH__INIT;
    health.state = ANLOS__HEALTH__STATE__READY;
    w->motion = (struct trapezoid){.start = place_m(w, w->now_ns)};
    w->command_id = 0;
    w->target_m = 0;
    w->stage_epoch_ns = w->now_ns;
    if (scan_hear(w->scan, "stage", w->stage_epoch_ns, w->now_ns))
        scan_health(w->scan, "stage", &health);
    tell_stage(w);
}

/* While it gets up to speed: nothing has been fired, and it does not go on. */
static void a_stage_that_restarts_on_its_run_up_begins_the_run_anew(void **state)
{
    struct world w;
    (void)state;
    setup(&w, false);
    while (w.moves < 2 || w.now_ns - w.set_off_ns < 60 * MS)
        step(&w);
    assert_int_equal(w.commands, 0);
    restart_stage(&w);
    run(&w, 60);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(w.commands, 1);
    assert_int_equal(w.moves, 4); /* to the start and off, twice */
    assert_all(w.imaged);
    assert_true(w.worst_m < 1e-6);
    scan_destroy(w.scan);
}

/* At 0.04 m/s2 it takes 4.5 cm and 1.5 s; the first run-up is 2.2 cm. */
static void a_stage_that_gets_up_to_speed_slowly_begins_farther_off(void **state)
{
    struct world w;
    (void)state;
    setup(&w, false);
    w.acceleration = 0.04;
    w.min_m = -0.2;
    run(&w, 120);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(w.commands, 1);
    assert_true(w.worst_m < 1e-6);
    scan_destroy(w.scan);
}

static void one_that_never_does_is_named(void **state)
{
    struct world w;
    (void)state;
    setup(&w, false);
    w.acceleration = 0.001;
    w.min_m = -1;
    run(&w, 600);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__FAILED);
    assert_int_equal(w.commands, 0);
    assert_non_null(strstr(status(&w).text, "it does not get up to 0.0600 m/s within"));
    scan_destroy(w.scan);
}

static void a_start_out_of_reach_is_named(void **state)
{
    struct world w;
    (void)state;
    setup(&w, false);
    w.min_m = 0;
    run(&w, 60);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__FAILED);
    /* At 6 cm/s 0.3 s and 0.12 s with 0.5 m/s2; behind 7.2 cm 0.1 s and as much. */
    assert_non_null(strstr(status(&w).text,
                           "stage: cannot move that far; without stops it goes from "
                           "-0.022 to 0.082 m at 0.0600 m/s: 'anlos plan'"));
    scan_destroy(w.scan);
}

/* Reports 0.1 mm before and behind by turns. */
static void reports_that_jitter_are_averaged(void **state)
{
    struct world w;
    (void)state;
    setup(&w, false);
    w.jitter_m = 1e-4;
    run(&w, 60);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(w.commands, 1);
    assert_true(w.worst_m < 2e-4);
    scan_destroy(w.scan);
}

static void a_hand_on_the_stage_ends_the_run_and_another_follows(void **state)
{
    struct world w;
    (void)state;
    setup(&w, false);
    while (w.next < 10)
        step(&w);
    w.held = true;
    tell_stage(&w);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__PAUSED);
    w.firing = false; /* the array takes them for not valid */
    for (int i = 0; i < 1000; i++)
        step(&w);
    assert_int_equal(w.commands, 1);
    w.held = false;
    run(&w, 60);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(w.commands, 2);
    assert_all(w.imaged);
    scan_destroy(w.scan);
}

/* What is played was moved when it was recorded. */
static void without_a_stage_the_array_fires_at_once(void **state)
{
    const struct scan_config cfg = {
        .retries = 1, .timeout_s = 1, .silence_s = 5, .needs = needs, .n_needs = 4};
    struct world w;
    struct scan_action action;
    (void)state;
    setup(&w, false);
    scan_destroy(w.scan);
    assert_int_equal(scan_create(&w.scan, &cfg), 0);
    tell_health(&w);
    tell_survey(&w);
    scan_step(w.scan, w.now_ns, &action);
    assert_true(action.fire && !action.move);
    assert_int_equal(action.fire_command.n_rounds, N_POSITIONS);
    assert_true(action.fire_command.start_ns == 0 && action.fire_command.speed_m_s == 0);
    scan_destroy(w.scan);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_ping_is_taken_on_the_way_from_its_place),
        cmocka_unit_test(what_got_lost_is_taken_again_with_its_neighbours),
        cmocka_unit_test(a_command_that_got_lost_costs_a_run),
        cmocka_unit_test(a_stage_that_restarts_on_its_run_up_begins_the_run_anew),
        cmocka_unit_test(a_stage_that_gets_up_to_speed_slowly_begins_farther_off),
        cmocka_unit_test(one_that_never_does_is_named),
        cmocka_unit_test(a_start_out_of_reach_is_named),
        cmocka_unit_test(reports_that_jitter_are_averaged),
        cmocka_unit_test(a_hand_on_the_stage_ends_the_run_and_another_follows),
        cmocka_unit_test(without_a_stage_the_array_fires_at_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
