/* The scan against a small world of its own: a stage that moves, an array that records, a
 * dsp and a recon that acknowledge; each can lose things, refuse them, or be restarted.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/scan/scan.h"

#define MS          1000000LL
#define N_POSITIONS 3
#define N_SPEAKERS  4
#define QUEUE       64

struct ping {
    Anlos__Pass pass;
    uint32_t scan, position, speaker;
    double stage_m;
};

struct world {
    struct scan *scan;
    int64_t now_ns;
    struct {
        int64_t array, dsp, recon, stage;
    } epoch;
    uint32_t command_id;
    double target_m, position_m;
    bool stage_fault, stage_deaf, stage_held, stage_short;
    struct ping queue[QUEUE]; /* fired, and not yet recorded and processed */
    size_t n_queue;
    bool has_background[N_POSITIONS][N_SPEAKERS];
    bool imaged[N_POSITIONS][N_SPEAKERS];
    unsigned fired[2][N_POSITIONS][N_SPEAKERS];
    unsigned commands, moves, most_under_way;
    int lose; /* pings that get lost from now on */
    int refuse;
    bool array_deaf;
};

static const char *const needs[] = {"stage", "array", "dsp", "recon"};
static double positions[N_POSITIONS] = {0.0, 0.1, 0.2};

static void hear(struct world *w, const char *name, int64_t epoch,
                 Anlos__Health__State state)
{
    Anlos__Health health = ANLOS__HEALTH__INIT;

    health.node = (char *)name;
    health.state = state;
    health.text = (char *)"text of health";
    if (scan_hear(w->scan, name, epoch, w->now_ns))
        scan_health(w->scan, name, &health);
}

static void all_healthy(struct world *w)
{
    hear(w, "stage", w->epoch.stage, ANLOS__HEALTH__STATE__READY);
    hear(w, "array", w->epoch.array, ANLOS__HEALTH__STATE__READY);
    hear(w, "dsp", w->epoch.dsp, ANLOS__HEALTH__STATE__READY);
    hear(w, "recon", w->epoch.recon, ANLOS__HEALTH__STATE__READY);
}

static void tell_survey(struct world *w)
{
    Anlos__Survey survey = ANLOS__SURVEY__INIT;
    Anlos__Vec3 v = ANLOS__VEC3__INIT;
    Anlos__Vec3 *speakers[N_SPEAKERS] = {&v, &v, &v, &v};

    survey.id = 42;
    survey.n_speakers_m = N_SPEAKERS;
    survey.speakers_m = speakers;
    survey.n_stage_positions_m = N_POSITIONS;
    survey.stage_positions_m = positions;
    assert_int_equal(scan_survey(w->scan, &survey), 0);
}

static void setup_patient(struct world *w, bool background, unsigned retries,
                          unsigned window, double timeout_s)
{
    const struct scan_config cfg = {.background = background,
                                    .has_stage = true,
                                    .window = window,
                                    .retries = retries,
                                    .timeout_s = timeout_s,
                                    .silence_s = 5.0,
                                    .needs = needs,
                                    .n_needs = 4};

    memset(w, 0, sizeof *w);
    w->now_ns = 1000 * MS;
    w->epoch.array = w->epoch.dsp = w->epoch.recon = w->epoch.stage = 1;
    assert_int_equal(scan_create(&w->scan, &cfg), 0);
}

static void setup(struct world *w, bool background, unsigned retries, unsigned window)
{
    setup_patient(w, background, retries, window, 1.0);
}

static void tell_stage(struct world *w)
{
    Anlos__StageState s = ANLOS__STAGE_STATE__INIT;

    s.state = w->stage_fault   ? ANLOS__STAGE_STATE__STATE__FAULT
              : w->stage_short ? ANLOS__STAGE_STATE__STATE__REFUSED
                               : ANLOS__STAGE_STATE__STATE__IDLE;
    s.held = w->stage_held;
    s.command_id = w->command_id;
    s.position_m = w->position_m;
    s.target_m = w->target_m;
    s.text = (char *)"a limit switch is open";
    if (scan_hear(w->scan, "stage", w->epoch.stage, w->now_ns))
        scan_stage(w->scan, &s);
}

static void tell_receipt(struct world *w, const char *from, int64_t epoch,
                         const struct ping *p, Anlos__Pass pass, bool usable)
{
    Anlos__Receipt r = ANLOS__RECEIPT__INIT;

    r.scan = p->scan;
    r.pass = pass;
    r.position = p->position;
    r.speaker = p->speaker;
    r.usable = usable;
    if (scan_hear(w->scan, from, epoch, w->now_ns))
        scan_receipt(w->scan, &r, w->now_ns);
}

static void tell_ping(struct world *w, const struct ping *p)
{
    Anlos__Ping m = ANLOS__PING__INIT;

    m.scan = p->scan;
    m.pass = p->pass;
    m.position = p->position;
    m.speaker = p->speaker;
    if (scan_hear(w->scan, "array", w->epoch.array, w->now_ns))
        scan_ping(w->scan, &m, w->now_ns);
}

/* One ping through array, dsp and recon. */
static void process_one(struct world *w)
{
    struct ping p = w->queue[0];

    memmove(w->queue, w->queue + 1, --w->n_queue * sizeof *w->queue);
    tell_ping(w, &p);
    if (w->lose > 0) {
        w->lose--;
        return;
    }
    bool usable = w->refuse-- <= 0;
    if (p.pass == ANLOS__PASS__BACKGROUND) {
        w->has_background[p.position][p.speaker] |= usable;
        tell_receipt(w, "dsp", w->epoch.dsp, &p, ANLOS__PASS__BACKGROUND, usable);
    } else {
        w->imaged[p.position][p.speaker] |= usable;
        tell_receipt(w, "recon", w->epoch.recon, &p, ANLOS__PASS__SCENE, usable);
    }
}

static void take_fire(struct world *w, const Anlos__FireCommand *c)
{
    w->commands++;
    /* The array fires where the stage stands. */
    assert_true(c->position < N_POSITIONS);
    assert_true(c->stage_m == w->position_m);
    if (w->array_deaf)
        return;
    for (size_t i = 0; i < c->n_speakers; i++) {
        assert_true(c->speakers[i] < N_SPEAKERS);
        assert_true(w->n_queue < QUEUE);
        w->fired[c->pass][c->position][c->speakers[i]]++;
        w->queue[w->n_queue++] =
            (struct ping){c->pass, c->scan, c->position, c->speakers[i], c->stage_m};
    }
    if (w->n_queue > w->most_under_way)
        w->most_under_way = (unsigned)w->n_queue;
}

static void step(struct world *w)
{
    struct scan_action action;

    scan_step(w->scan, w->now_ns, &action);
    if (action.move) {
        w->moves++;
        if (!w->stage_deaf) {
            w->command_id = action.stage_command.id;
            w->target_m = action.stage_command.target_m;
            w->position_m = w->target_m + 0.0003; /* near enough, and said so */
            tell_stage(w);
        }
    }
    if (action.fire)
        take_fire(w, &action.fire_command);
}

static Anlos__ScanStatus status(const struct world *w)
{
    Anlos__ScanStatus s;

    scan_status(w->scan, w->now_ns, &s);
    return s;
}

static void start(struct world *w)
{
    all_healthy(w);
    tell_survey(w);
    tell_stage(w);
}

/* Lets time pass in steps of 50 ms, with health every second, until the scan has ended or
 * the time is over. */
static void run(struct world *w, int64_t limit_ms)
{
    int64_t end = w->now_ns + limit_ms * MS;

    for (int i = 0; w->now_ns < end; i++) {
        if (i % 20 == 0)
            all_healthy(w);
        step(w);
        while (w->n_queue) {
            process_one(w);
            step(w);
        }
        Anlos__ScanStatus s = status(w);
        if (s.state == ANLOS__SCAN_STATUS__STATE__DONE ||
            s.state == ANLOS__SCAN_STATUS__STATE__FAILED)
            return;
        w->now_ns += 50 * MS;
    }
}

static unsigned fired_total(const struct world *w, Anlos__Pass pass)
{
    unsigned n = 0;

    for (int p = 0; p < N_POSITIONS; p++)
        for (int s = 0; s < N_SPEAKERS; s++)
            n += w->fired[pass][p][s];
    return n;
}

static void assert_all_imaged(const struct world *w)
{
    for (int p = 0; p < N_POSITIONS; p++)
        for (int s = 0; s < N_SPEAKERS; s++)
            assert_true(w->imaged[p][s]);
}

static void it_waits_for_every_node_and_says_for_whom(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 1, 8);
    tell_survey(&w);
    tell_stage(&w);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__WAITING);
    hear(&w, "stage", 1, ANLOS__HEALTH__STATE__READY);
    hear(&w, "array", 1, ANLOS__HEALTH__STATE__READY);
    hear(&w, "recon", 1, ANLOS__HEALTH__STATE__STARTING);
    step(&w);
    assert_string_equal(status(&w).text, "waits for dsp, recon");
    assert_int_equal(w.moves + w.commands, 0);
    hear(&w, "dsp", 1, ANLOS__HEALTH__STATE__DEGRADED);
    hear(&w, "recon", 1, ANLOS__HEALTH__STATE__READY);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__RUNNING);
    assert_int_equal(w.moves, 1);
    scan_destroy(w.scan);
}

static void without_a_survey_it_waits(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 1, 8);
    all_healthy(&w);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__WAITING);
    assert_string_equal(status(&w).text, "waits for the survey");
    scan_destroy(w.scan);
}

static void every_ping_is_fired_once_background_first(void **state)
{
    struct world w;

    (void)state;
    setup(&w, true, 3, 8);
    start(&w);
    run(&w, 10000);
    Anlos__ScanStatus s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(s.pings_expected, 2 * N_POSITIONS * N_SPEAKERS);
    assert_int_equal(s.pings_done, s.pings_expected);
    assert_int_equal(s.pings_retaken, 0);
    assert_int_equal(fired_total(&w, ANLOS__PASS__BACKGROUND), 12);
    assert_int_equal(fired_total(&w, ANLOS__PASS__SCENE), 12);
    assert_all_imaged(&w);
    /* There and back again: the scene begins where the background ended. */
    assert_int_equal(w.moves, 5);
    scan_destroy(w.scan);
}

static void never_more_pings_are_under_way_than_the_window_allows(void **state)
{
    struct world w;

    (void)state;
    for (unsigned window = 1; window <= 9; window++) {
        setup(&w, false, 0, window);
        start(&w);
        run(&w, 20000);
        assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
        assert_true(w.most_under_way <= window);
        assert_int_equal(fired_total(&w, ANLOS__PASS__SCENE), 12);
        scan_destroy(w.scan);
    }
}

static void a_command_is_sent_again_until_a_ping_answers_it(void **state)
{
    (void)state;
    for (int answered = 0; answered < 2; answered++) {
        struct world w;
        setup(&w, false, 0, 8);
        start(&w);
        step(&w); /* moves */
        step(&w); /* fires */
        assert_int_equal(w.commands, 1);
        if (answered)
            tell_ping(&w, &w.queue[0]);
        w.now_ns += 700 * MS;
        step(&w);
        assert_int_equal(w.commands, answered ? 1 : 2);
        scan_destroy(w.scan);
    }
}

static void it_goes_on_while_receipts_are_on_their_way(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    step(&w); /* move */
    step(&w); /* fire */
    assert_int_equal(w.n_queue, 4);
    step(&w);
    assert_int_equal(w.moves, 1); /* it records: the stage stands still */
    for (int i = 0; i < 4; i++)
        tell_ping(&w, &w.queue[i]);
    step(&w);
    step(&w);
    assert_int_equal(w.moves, 2);
    assert_int_equal(w.n_queue, 8);
    for (int i = 4; i < 8; i++)
        tell_ping(&w, &w.queue[i]);
    step(&w); /* moves, but the window is full */
    step(&w);
    assert_int_equal(w.n_queue, 8);
    scan_destroy(w.scan);
}

static void a_lost_ping_is_taken_again(void **state)
{
    struct world w;

    (void)state;
    setup(&w, true, 3, 8);
    start(&w);
    w.lose = 1;
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_retaken, 1);
    assert_int_equal(status(&w).pings_lost, 0);
    assert_int_equal(fired_total(&w, ANLOS__PASS__BACKGROUND), 13);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

static void the_last_ping_of_all_is_missed_by_the_clock(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 1, 4);
    start(&w);
    while (fired_total(&w, ANLOS__PASS__SCENE) < 12) {
        step(&w);
        while (w.n_queue > (fired_total(&w, ANLOS__PASS__SCENE) == 12 ? 1 : 0))
            process_one(&w);
        w.now_ns += 10 * MS;
    }
    w.lose = 1;
    process_one(&w);
    int64_t lost_ns = w.now_ns;
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_retaken, 1);
    assert_true(w.now_ns - lost_ns >= 1000 * MS);
    assert_true(w.now_ns - lost_ns < 1500 * MS);
    scan_destroy(w.scan);
}

static void what_nobody_can_use_is_given_up_and_said(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 2, 4);
    start(&w);
    w.refuse = 3;
    w.lose = 0;
    step(&w);
    step(&w);
    /* The first shot's first ping is refused three times. */
    for (int i = 0; i < 3; i++) {
        while (w.n_queue > 0) {
            struct ping p = w.queue[0];
            w.refuse = p.position == 0 && p.speaker == 0;
            process_one(&w);
        }
        step(&w);
    }
    w.refuse = 0;
    run(&w, 10000);
    Anlos__ScanStatus s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(s.pings_lost, 1);
    assert_int_equal(s.pings_done, 11);
    assert_int_equal(s.pings_retaken, 2);
    assert_string_equal(s.text, "done; 1 of 12 pings were given up");
    scan_destroy(w.scan);
}

static void a_scan_without_a_single_ping_has_failed(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    w.refuse = 1000;
    run(&w, 20000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__FAILED);
    assert_int_equal(status(&w).pings_lost, 12);
    scan_destroy(w.scan);
}

static void a_stage_command_that_got_lost_is_sent_again(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    w.stage_deaf = true;
    step(&w);
    w.now_ns += 400 * MS;
    step(&w);
    assert_int_equal(w.moves, 1);
    w.now_ns += 200 * MS;
    w.stage_deaf = false;
    step(&w);
    assert_int_equal(w.moves, 2);
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    scan_destroy(w.scan);
}

static void a_fire_command_that_got_lost_is_sent_again_before_the_time_out(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    w.array_deaf = true;
    step(&w);
    step(&w);
    assert_int_equal(w.commands, 1);
    w.now_ns += 600 * MS;
    w.array_deaf = false;
    step(&w);
    assert_int_equal(w.commands, 2);
    run(&w, 10000);
    assert_int_equal(status(&w).pings_lost, 0);
    assert_int_equal(status(&w).pings_retaken, 0);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

static void a_target_out_of_the_stages_reach_fails_the_scan(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 2, 8);
    start(&w);
    w.stage_short = true;
    run(&w, 60000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__FAILED);
    assert_string_equal(status(&w).text, "stage: a limit switch is open");
    assert_int_equal(w.moves, 1);
    assert_int_equal(w.commands, 0);
    scan_destroy(w.scan);
}

/* Hours if need be: nothing times out, nothing is fired, nothing counts as failed. */
static void a_stage_in_fault_pauses_the_scan_until_it_is_homed(void **state)
{
    struct world w;

    (void)state;
    setup(&w, true, 1, 8);
    start(&w);
    run(&w, 100);
    unsigned moves = w.moves, commands = w.commands;
    double left_s = status(&w).time_left_s;
    w.stage_fault = true;
    w.position_m = 0.05; /* somewhere */
    tell_stage(&w);
    run(&w, 3600000);
    Anlos__ScanStatus s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__PAUSED);
    assert_string_equal(s.text,
                        "stage: a limit switch is open; 'anlos stage home' goes on");
    assert_int_equal(w.moves, moves);
    assert_int_equal(w.commands, commands);
    w.stage_fault = false;
    w.command_id = 0; /* it was homed by hand, and knows no command */
    w.position_m = w.target_m = 0;
    tell_stage(&w);
    step(&w);
    assert_int_equal(w.moves, moves + 1);
    assert_true(status(&w).time_left_s <= left_s + 60);
    run(&w, 60000);
    s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(s.pings_lost, 0);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

/* The array had not got the command, or was still emitting: the stage may have been
 * pushed. */
static void what_was_being_recorded_when_it_paused_is_taken_again(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    step(&w); /* moves */
    step(&w); /* fires */
    assert_int_equal(w.n_queue, 4);
    tell_ping(&w, &w.queue[0]);
    w.stage_held = true;
    tell_stage(&w);
    w.n_queue = 0; /* and the array lost them */
    run(&w, 20000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__PAUSED);
    assert_non_null(strstr(status(&w).text, "'anlos stage home' or 'release' goes on"));
    assert_int_equal(w.commands, 1);
    w.stage_held = false;
    tell_stage(&w);
    run(&w, 20000);
    Anlos__ScanStatus s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(s.pings_lost, 0);
    assert_int_equal(s.pings_retaken, 4);
    scan_destroy(w.scan);
}

/* Receipts come in while it pauses: what was heard before is not taken again. */
static void receipts_count_while_it_pauses(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    step(&w);
    step(&w);
    w.stage_held = true;
    tell_stage(&w);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__PAUSED);
    while (w.n_queue)
        process_one(&w);
    assert_int_equal(status(&w).pings_done, 4);
    w.stage_held = false;
    tell_stage(&w);
    run(&w, 20000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_retaken, 0);
    scan_destroy(w.scan);
}

static void a_restarted_stage_is_not_in_the_fault_of_the_one_before(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    w.stage_fault = true;
    tell_stage(&w);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__PAUSED);
    w.stage_fault = false;
    w.epoch.stage++;
    all_healthy(&w);
    run(&w, 20000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    scan_destroy(w.scan);
}

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

static void time_left_follows_the_pace(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 4);
    start(&w);
    step(&w);
    step(&w);
    w.now_ns += 400 * MS; /* four of twelve in 0.4 s */
    while (w.n_queue)
        process_one(&w);
    assert_true(status(&w).time_left_s > 0.799 && status(&w).time_left_s < 0.801);
    scan_destroy(w.scan);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_waits_for_every_node_and_says_for_whom),
        cmocka_unit_test(without_a_survey_it_waits),
        cmocka_unit_test(every_ping_is_fired_once_background_first),
        cmocka_unit_test(never_more_pings_are_under_way_than_the_window_allows),
        cmocka_unit_test(a_command_is_sent_again_until_a_ping_answers_it),
        cmocka_unit_test(it_goes_on_while_receipts_are_on_their_way),
        cmocka_unit_test(a_lost_ping_is_taken_again),
        cmocka_unit_test(the_last_ping_of_all_is_missed_by_the_clock),
        cmocka_unit_test(what_nobody_can_use_is_given_up_and_said),
        cmocka_unit_test(a_scan_without_a_single_ping_has_failed),
        cmocka_unit_test(a_stage_command_that_got_lost_is_sent_again),
        cmocka_unit_test(a_fire_command_that_got_lost_is_sent_again_before_the_time_out),
        cmocka_unit_test(a_target_out_of_the_stages_reach_fails_the_scan),
        cmocka_unit_test(a_stage_in_fault_pauses_the_scan_until_it_is_homed),
        cmocka_unit_test(what_was_being_recorded_when_it_paused_is_taken_again),
        cmocka_unit_test(receipts_count_while_it_pauses),
        cmocka_unit_test(a_restarted_stage_is_not_in_the_fault_of_the_one_before),
        cmocka_unit_test(a_restarted_dsp_gets_its_background_again),
        cmocka_unit_test(a_restarted_recon_gets_the_whole_scene_again),
        cmocka_unit_test(a_recon_that_dies_after_the_end_begins_the_scene_anew),
        cmocka_unit_test(a_restarted_array_or_stage_is_commanded_again),
        cmocka_unit_test(receipts_of_a_former_process_are_void),
        cmocka_unit_test(a_link_that_is_cut_for_longer_than_the_time_out_costs_no_ping),
        cmocka_unit_test(a_silent_node_is_waited_for_and_nothing_times_out),
        cmocka_unit_test(a_node_that_comes_back_with_its_clock_behind_is_taken_as_new),
        cmocka_unit_test(a_node_that_cannot_go_on_ends_the_scan),
        cmocka_unit_test(time_left_follows_the_pace),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
