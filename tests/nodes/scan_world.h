/* SPDX-License-Identifier: MIT */
/* tests/nodes/scan_world.h -- a small world around a scan: a stage that moves, an array
 * that records, a dsp and a recon that acknowledge; each can lose things, refuse them, or
 * be restarted. */
#ifndef ANLOS_TESTS_NODES_SCAN_WORLD_H
#define ANLOS_TESTS_NODES_SCAN_WORLD_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/survey.pb-c.h"
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

static inline void hear(struct world *w, const char *name, int64_t epoch,
                        Anlos__Health__State state)
{
    Anlos__Health health = ANLOS__HEALTH__INIT;

    health.node = (char *)name;
    health.state = state;
    health.text = (char *)"text of health";
    if (scan_hear(w->scan, name, epoch, w->now_ns))
        scan_health(w->scan, name, &health);
}

static inline void all_healthy(struct world *w)
{
    hear(w, "stage", w->epoch.stage, ANLOS__HEALTH__STATE__READY);
    hear(w, "array", w->epoch.array, ANLOS__HEALTH__STATE__READY);
    hear(w, "dsp", w->epoch.dsp, ANLOS__HEALTH__STATE__READY);
    hear(w, "recon", w->epoch.recon, ANLOS__HEALTH__STATE__READY);
}

static inline void tell_survey(struct world *w)
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

static inline void setup_patient(struct world *w, bool background, unsigned retries,
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

static inline void setup(struct world *w, bool background, unsigned retries,
                         unsigned window)
{
    setup_patient(w, background, retries, window, 1.0);
}

static inline void tell_stage(struct world *w)
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
        scan_stage(w->scan, &s, w->now_ns);
}

static inline void tell_receipt(struct world *w, const char *from, int64_t epoch,
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

static inline void tell_ping(struct world *w, const struct ping *p)
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
static inline void process_one(struct world *w)
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

static inline void take_fire(struct world *w, const Anlos__FireCommand *c)
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

static inline void step(struct world *w)
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

static inline Anlos__ScanStatus status(const struct world *w)
{
    Anlos__ScanStatus s;

    scan_status(w->scan, w->now_ns, &s);
    return s;
}

static inline void start(struct world *w)
{
    all_healthy(w);
    tell_survey(w);
    tell_stage(w);
}

/* Lets time pass in steps of 50 ms, with health every second, until the scan has ended or
 * the time is over. */
static inline void run(struct world *w, int64_t limit_ms)
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

static inline unsigned fired_total(const struct world *w, Anlos__Pass pass)
{
    unsigned n = 0;

    for (int p = 0; p < N_POSITIONS; p++)
        for (int s = 0; s < N_SPEAKERS; s++)
            n += w->fired[pass][p][s];
    return n;
}

static inline void assert_all_imaged(const struct world *w)
{
    for (int p = 0; p < N_POSITIONS; p++)
        for (int s = 0; s < N_SPEAKERS; s++)
            assert_true(w->imaged[p][s]);
}

#endif
