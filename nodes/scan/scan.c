/* SPDX-License-Identifier: MIT */
#include "nodes/scan/scan.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "msgs/stage.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "nodes/rt/stage_line.h"
#include "nodes/scan/peers.h"
#include "nodes/scan/pending_fire.h"
#include "nodes/scan/ping_tracker.h"
#include "recon/planning/scan_plan.h"
#include "recon/survey.h"

/* The stage as the scan drives it: a command until the state says that it was accepted
 * and is done.  A fault, or a person's hand on it, it waits out, and then restarts. */

enum stage_client_progress {
    STAGE_CLIENT_THERE,  /* at rest at the target */
    STAGE_CLIENT_MOVING, /* wait */
    STAGE_CLIENT_SEND,   /* the command is to be sent, or sent again */
    STAGE_CLIENT_PAUSED, /* a person has to home it, or release it; text says why */
    STAGE_CLIENT_FAILED, /* the target is out of reach; text says why */
};

struct stage_client {
    bool commanded;
    uint32_t id;
    double target_m, speed_m_s;
    int64_t sent_ns;
    bool accepted, idle, refused;
    bool fault, held;
    double position_m; /* where it stands */
    char text[160];
};

/* The positions that the scan has to go to, and in which order. */

struct route {
    size_t n_positions;
    double *positions_m; /* [n_positions] */
    uint32_t *speakers;  /* [n_speakers of the survey]: those that are missing */
};

#define RESEND_NS 500000000LL /* without a sign that the command was accepted */

static void stage_client_init(struct stage_client *c)
{
    *c = (struct stage_client){.commanded = false};
}

static void stage_client_state(struct stage_client *c, const Anlos__StageState *state)
{
    c->position_m = state->position_m;
    /* The target too: an id may be left from a scan that was restarted. */
    c->accepted = c->commanded && state->command_id == c->id &&
                  state->target_m == c->target_m;
    c->idle = state->state == ANLOS__STAGE_STATE__STATE__IDLE;
    c->refused = state->state == ANLOS__STAGE_STATE__STATE__REFUSED;
    c->fault = state->state == ANLOS__STAGE_STATE__STATE__FAULT;
    c->held = state->held;
    snprintf(c->text, sizeof c->text, "%s", state->text);
}

/* The stage process was restarted: it knows no command. */
static void stage_client_forget(struct stage_client *c)
{
    c->commanded = c->accepted = false;
    c->fault = c->held = false;
}

/* Does it wait for a person?  As stage_client_go with any target. */
static bool stage_client_is_paused(const struct stage_client *c)
{
    return c->fault || c->held;
}

static enum stage_client_progress send_new(struct stage_client *c, double target_m,
                                           double speed_m_s, int64_t now_ns)
{
    c->commanded = true;
    c->accepted = false;
    c->id++;
    c->target_m = target_m;
    c->speed_m_s = speed_m_s;
    c->sent_ns = now_ns;
    return STAGE_CLIENT_SEND;
}

/* Brings the stage to the target, at its own speed (0) or another.  On STAGE_CLIENT_SEND
 * id, target_m and speed_m_s are to be sent. */
static enum stage_client_progress stage_client_go(struct stage_client *c, double target_m,
                                                  double speed_m_s, int64_t now_ns)
{
    if (stage_client_is_paused(c)) {
        c->commanded = c->accepted = false;
        return STAGE_CLIENT_PAUSED;
    }
    if (!c->commanded || c->target_m != target_m || c->speed_m_s != speed_m_s)
        return send_new(c, target_m, speed_m_s, now_ns);
    if (!c->accepted) {
        if (now_ns - c->sent_ns < RESEND_NS)
            return STAGE_CLIENT_MOVING;
        c->sent_ns = now_ns;
        return STAGE_CLIENT_SEND;
    }
    if (c->refused)
        return STAGE_CLIENT_FAILED;
    return c->idle ? STAGE_CLIENT_THERE : STAGE_CLIENT_MOVING;
}

static void route_clear(struct route *r)
{
    free(r->positions_m);
    free(r->speakers);
    *r = (struct route){.n_positions = 0};
}

/* 0, -ENOMEM. */
static int route_open(struct route *out, const Anlos__Survey *survey)
{
    size_t n = survey->n_stage_positions_m;

    *out =
        (struct route){.n_positions = n,
                       .positions_m = calloc(n, sizeof *out->positions_m),
                       .speakers = calloc(survey->n_speakers_m, sizeof *out->speakers)};
    if (!out->positions_m || !out->speakers) {
        route_clear(out);
        return -ENOMEM;
    }
    memcpy(out->positions_m, survey->stage_positions_m, n * sizeof *out->positions_m);
    return 0;
}

/* Which speakers are missing at a position: how many, and r->speakers has them. */
static size_t route_missing(const struct route *r, const struct ping_tracker *l,
                            Anlos__Pass pass, size_t position)
{
    return ping_tracker_missing(l, pass, position, r->speakers);
}

/* The positions where anything is missing, and one more at each end: a ping sounds as it
 * did only between its neighbours.  false: none is. */
static bool route_span(const struct route *r, const struct ping_tracker *l,
                       Anlos__Pass pass, size_t *first, size_t *end)
{
    *first = r->n_positions;
    *end = 0;
    for (size_t i = 0; i < r->n_positions; i++) {
        if (!route_missing(r, l, pass, i))
            continue;
        *first = *end ? *first : (i ? i - 1 : 0);
        *end = i + 2 < r->n_positions ? i + 2 : r->n_positions;
    }
    return *end > 0;
}

/* The nearest position where something is missing; n_positions: nowhere.  So the stage
 * goes there and back again, and takes up what was lost on its way. */
static size_t route_nearest(const struct route *r, const struct ping_tracker *l,
                            Anlos__Pass pass, size_t from)
{
    size_t best = r->n_positions;
    double best_m = INFINITY;

    for (size_t i = 0; i < r->n_positions; i++) {
        double distance_m = fabs(r->positions_m[i] - r->positions_m[from]);
        if (distance_m < best_m && route_missing(r, l, pass, i)) {
            best = i;
            best_m = distance_m;
        }
    }
    return best;
}

/* -- a run ------------------------------------------------------------------------------
 *
 * Of a stage that does not stop, from one round of pings to another: it is brought before
 * the first, sent off at its speed, and when its reports tell that it goes at that, the
 * array is told when it will be at the first round's place.  One that is not up to speed
 * by then goes back, farther. */

enum run_progress {
    RUN_WAITS,
    RUN_TO_START, /* the stage is to stand before the first round, at go_m */
    RUN_SETS_OFF, /* and then to go to go_m at speed_m_s */
    RUN_FIRES,    /* once: the array begins at start_ns, when the stage is at first_m */
    RUN_RECORDS,  /* since then */
    RUN_FAILED,   /* it does not get up to speed; text says so */
};

struct run {
    double speed_m_s, first_m, end_m; /* it goes from first_m to end_m, where the last
                                         slot ends */
    double run_up_m, go_m;
    unsigned tries, late;
    bool stands;  /* before the first round, ready */
    bool set_off; /* has moved since */
    bool fired;
    int64_t start_ns;
    struct stage_line line; /* since it was sent off */
    char text[160];
};

/* In its run-up the stage says three times or more that it is at its speed, and the array
 * has time to hear of it. */
#define MOST_LATE 20
#define EARLY_NS  200000000LL /* before the first slot, to tell the array, */
#define LATEST_NS 50000000LL  /* at the latest */
#define SPEED_OFF 0.02        /* that a steady stage may be off its speed */
#define FIT_NS    300000000LL
#define EXACT_OFF 0.005      /* of one whose reports are exact, */
#define EXACT_M   1e-5       /* and how far they lie beside a line */
#define STEADY_NS 90000000LL /* that the reports must span */

/* A new one, from a round's place on, at a speed with its sign. */
static void run_begin(struct run *r, double first_m, double end_m, double speed_m_s)
{
    double s = fabs(speed_m_s);

    *r = (struct run){.speed_m_s = speed_m_s, .first_m = first_m, .end_m = end_m};
    r->run_up_m = SCAN_RUN_UP_S * s + s * s / (2.0 * SCAN_RUN_UP_M_S2);
    r->go_m = first_m - copysign(r->run_up_m, speed_m_s);
}

/* From where it gets up to speed to where it stands again. */
static void run_room(const struct run *r, double room_m[2])
{
    double ramp_m = r->run_up_m - SCAN_RUN_UP_S * fabs(r->speed_m_s);

    room_m[0] = r->first_m - copysign(r->run_up_m, r->speed_m_s);
    room_m[1] = r->end_m + SCAN_RUN_OUT_S * r->speed_m_s + copysign(ramp_m, r->speed_m_s);
}

/* The stage has been said to be at rest at the start; and what it reports on its way. */
static void run_stands(struct run *r)
{
    double room_m[2];

    r->stands = true;
    r->set_off = false;
    r->line.n = 0;
    run_room(r, room_m);
    r->go_m = room_m[1];
}

static void run_report(struct run *r, const Anlos__StageState *state, int64_t at_ns)
{
    if (!r->stands || state->state != ANLOS__STAGE_STATE__STATE__MOVING)
        return;
    r->set_off = true;
    stage_line_add(&r->line, at_ns, state->position_m);
}

/* late: it is at its speed, but who was to tell the array was too busy. */
static enum run_progress begin_again(struct run *r, bool late, double speed_m_s)
{
    if (late && ++r->late == MOST_LATE) {
        snprintf(
            r->text, sizeof r->text,
            "its reports came too late to tell the array when to begin, %u times; is "
            "this machine too busy?",
            r->late);
        return RUN_FAILED;
    }
    if (!late && ++r->tries == SCAN_RUN_TRIES) {
        snprintf(r->text, sizeof r->text,
                 "it does not get up to %.4f m/s within %.3f m (%.4f by its reports); is "
                 "its acceleration too small?",
                 fabs(r->speed_m_s), r->run_up_m, fabs(speed_m_s));
        return RUN_FAILED;
    }
    r->run_up_m *= late ? 1.0 : SCAN_MORE_RUN_UP;
    r->stands = r->set_off = false;
    r->go_m = r->first_m - copysign(r->run_up_m, r->speed_m_s);
    return RUN_TO_START;
}

/* By its newest reports, as many as lie on a line: those from when it got up to speed do
 * not. */
static bool is_steady(const struct run *r, struct stage_line_fit *fit)
{
    const struct stage_line *l = &r->line;
    double off_m_s = SPEED_OFF * fabs(r->speed_m_s);
    *fit = (struct stage_line_fit){.n = 0};
    if (!l->n)
        return false;
    int64_t newest_ns = l->at_ns[(l->n - 1) % STAGE_LINE_REPORTS];
    for (int64_t span_ns = STEADY_NS; span_ns <= FIT_NS; span_ns += STEADY_NS / 3) {
        struct stage_line_fit f;
        if (!stage_line_fit(l, newest_ns - span_ns, newest_ns, &f))
            continue;
        if (fit->n && (fabs(f.speed_m_s - r->speed_m_s) > off_m_s ||
                       f.jitter_m > fmax(EXACT_M, 1.5 * fit->jitter_m)))
            break;
        *fit = f;
    }
    return fit->n && fabs(fit->speed_m_s - r->speed_m_s) <= off_m_s;
}

static enum run_progress run_step(struct run *r, int64_t now_ns)
{
    struct stage_line_fit fit;

    if (r->fired)
        return RUN_RECORDS;
    if (!r->stands)
        return RUN_TO_START;
    if (!r->set_off)
        return RUN_SETS_OFF;
    bool steady = is_steady(r, &fit);
    if (!r->line.n)
        return RUN_WAITS;
    double reached_m = steady ? stage_line_place_m(&fit, now_ns + LATEST_NS)
                              : r->line.place_m[(r->line.n - 1) % STAGE_LINE_REPORTS];
    if ((reached_m - r->first_m) * r->speed_m_s > 0)
        return begin_again(r, steady, fit.speed_m_s);
    if (!steady)
        return RUN_WAITS;
    /* The longer it is watched, the better its place is known; but who is busy may be
     * late. */
    r->start_ns = stage_line_time_ns(&fit, r->first_m);
    bool exact = fit.jitter_m <= EXACT_M &&
                 fabs(fit.speed_m_s - r->speed_m_s) <= EXACT_OFF * fabs(r->speed_m_s);
    if (r->start_ns - now_ns > (exact ? EARLY_NS : 2 * LATEST_NS))
        return RUN_WAITS;
    r->fired = true;
    return RUN_FIRES;
}

/* -- the scan ---------------------------------------------------------------------------
 */

#define HEARD_NS 2000000000LL /* each node publishes its health every second */

struct scan {
    struct scan_config cfg;
    struct peers peers;
    struct stage_client stage_client;
    struct ping_tracker *ping_tracker; /* NULL: no survey yet */
    uint64_t survey_id;
    struct route route;
    double speed_m_s; /* of a stage that does not stop; else 0 */
    size_t n_speakers;
    bool running; /* there is a run, */
    struct run run;
    size_t run_end;                   /* from position on, before this one */
    double round_s;                   /* that a round of it takes */
    uint32_t number;                  /* of the scan, from 1 */
    struct pending_fire pending_fire; /* fired last */
    size_t position;
    int64_t sign_ns;  /* last sign of life of what is under way */
    int64_t start_ns; /* 0: not yet running; later by each pause */
    int64_t pause_ns; /* since when it pauses; 0: it does not */
    Anlos__ScanStatus__State state;
    bool failed; /* for good */
    char text[256];
};

int scan_create(struct scan **out, const struct scan_config *cfg)
{
    struct scan *s = calloc(1, sizeof *s);

    if (!s)
        return -ENOMEM;
    s->cfg = *cfg;
    s->state = ANLOS__SCAN_STATUS__STATE__WAITING;
    peers_init(&s->peers, cfg->needs, cfg->n_needs, cfg->silence_s);
    stage_client_init(&s->stage_client);
    snprintf(s->text, sizeof s->text, "waits for the other nodes");
    *out = s;
    return 0;
}

/* What a process kept is gone with it. */
static void forget(struct scan *s, const char *node)
{
    if (!strcmp(node, "stage")) {
        stage_client_forget(&s->stage_client);
        s->running = s->running && s->run.fired; /* it would not get there */
    }
    if (!s->ping_tracker)
        return;
    if (!strcmp(node, "array") || !strcmp(node, "dsp") || !strcmp(node, "recon"))
        ping_tracker_forget_under_way(s->ping_tracker);
    if (!strcmp(node, "recon"))
        ping_tracker_forget_scene(s->ping_tracker);
    if (!strcmp(node, "dsp"))
        ping_tracker_forget_background(s->ping_tracker);
}

bool scan_hear(struct scan *s, const char *from, int64_t epoch_ns, int64_t now_ns)
{
    switch (peers_hear(&s->peers, from, epoch_ns, now_ns)) {
    case PEERS_STALE:
        return false;
    case PEERS_RESTARTED:
        forget(s, from);
        return true;
    default:
        return true;
    }
}

static int take_speed(double *speed_m_s, const Anlos__Survey *survey)
{
    struct survey v;
    int err = survey_from_message(&v, survey, NULL);

    if (err)
        return err;
    *speed_m_s = survey_speed_m_s(&v);
    survey_clear(&v);
    return 0;
}

int scan_survey(struct scan *s, const Anlos__Survey *survey)
{
    struct ping_tracker_size size = {.background = s->cfg.background,
                                     .n_positions = survey->n_stage_positions_m,
                                     .n_speakers = survey->n_speakers_m,
                                     .retries = s->cfg.retries};
    struct ping_tracker *ping_tracker = NULL;

    if (s->ping_tracker && survey->id == s->survey_id)
        return 0;
    struct route route = {.n_positions = 0};
    double speed_m_s = 0;
    int err = survey->continuous ? take_speed(&speed_m_s, survey) : 0;
    if (!err)
        err = ping_tracker_create(&ping_tracker, &size);
    if (!err)
        err = route_open(&route, survey);
    if (!err)
        err = pending_fire_reset(&s->pending_fire, size.n_speakers);
    if (err) {
        route_clear(&route);
        ping_tracker_destroy(ping_tracker);
        return err;
    }
    ping_tracker_destroy(s->ping_tracker);
    route_clear(&s->route);
    s->ping_tracker = ping_tracker;
    s->route = route;
    s->survey_id = survey->id;
    s->speed_m_s = speed_m_s;
    s->round_s =
        speed_m_s != 0 ? (route.positions_m[1] - route.positions_m[0]) / speed_m_s : 0;
    s->n_speakers = survey->n_speakers_m;
    s->running = false;
    s->position = 0;
    s->start_ns = 0;
    s->number++;
    return 0;
}

void scan_health(struct scan *s, const char *from, const Anlos__Health *health)
{
    peers_health(&s->peers, from, health);
}

void scan_stage(struct scan *s, const Anlos__StageState *state, int64_t at_ns)
{
    stage_client_state(&s->stage_client, state);
    if (s->running && s->stage_client.accepted)
        run_report(&s->run, state, at_ns);
}

void scan_ping(struct scan *s, const Anlos__Ping *ping, int64_t now_ns)
{
    const struct ping_tracker_ping p = {ping->pass, ping->position, ping->speaker};

    if (!s->ping_tracker || ping->scan != s->number)
        return;
    s->sign_ns = now_ns;
    pending_fire_answer(&s->pending_fire);
    ping_tracker_recorded(s->ping_tracker, &p);
}

void scan_receipt(struct scan *s, const Anlos__Receipt *receipt, int64_t now_ns)
{
    const struct ping_tracker_ping p = {receipt->pass, receipt->position,
                                        receipt->speaker};

    if (!s->ping_tracker || receipt->scan != s->number)
        return;
    s->sign_ns = now_ns;
    ping_tracker_receipt(s->ping_tracker, &p, receipt->usable);
}

static void fail(struct scan *s, const char *who, const char *what)
{
    s->failed = true;
    s->state = ANLOS__SCAN_STATUS__STATE__FAILED;
    snprintf(s->text, sizeof s->text, "%s: %s", who, what);
}

static void send_pending_fire(struct scan *s, int64_t now_ns, struct scan_action *out)
{
    out->fire = true;
    out->fire_command = pending_fire_send(&s->pending_fire, now_ns);
}

static void fire(struct scan *s, Anlos__Pass pass, size_t n, int64_t now_ns,
                 struct scan_action *out)
{
    Anlos__FireCommand *c = &s->pending_fire.command;

    for (size_t i = 0; i < n; i++) {
        const struct ping_tracker_ping ping = {pass, s->position, s->route.speakers[i]};
        ping_tracker_fire(s->ping_tracker, &ping);
    }
    pending_fire_load(&s->pending_fire, s->number, s->route.speakers, n);
    c->pass = pass;
    c->position = (uint32_t)s->position;
    c->stage_m = s->cfg.has_stage ? s->stage_client.position_m
                                  : s->route.positions_m[s->position];
    s->sign_ns = now_ns;
    send_pending_fire(s, now_ns, out);
}

/* A stage that stops needs no more room than its positions, and no speed. */
static void fail_move(struct scan *s)
{
    char what[sizeof s->text - 8];
    double room_m[2];

    if (!s->running) {
        fail(s, "stage", s->stage_client.text);
        return;
    }
    run_room(&s->run, room_m);
    snprintf(
        what, sizeof what,
        "%.140s; without stops it goes from %.3f to %.3f m at %.4f m/s: 'anlos plan' "
        "finds slower ways",
        s->stage_client.text, room_m[0], room_m[1], fabs(s->speed_m_s));
    fail(s, "stage", what);
}

/* true: the stage stands there.  What is on its way to the image still gets there when it
 * cannot. */
static bool move(struct scan *s, double target_m, double speed_m_s, int64_t now_ns,
                 const struct ping_tracker_count *count, struct scan_action *out)
{
    if (!s->cfg.has_stage)
        return true;
    switch (stage_client_go(&s->stage_client, target_m, speed_m_s, now_ns)) {
    case STAGE_CLIENT_THERE:
        return true;
    case STAGE_CLIENT_SEND:
        out->move = true;
        out->stage_command.id = s->stage_client.id;
        out->stage_command.target_m = target_m;
        out->stage_command.speed_m_s = speed_m_s;
        return false;
    case STAGE_CLIENT_FAILED:
        if (!count->under_way)
            fail_move(s);
        return false;
    default:
        return false;
    }
}

static void finish(struct scan *s, const struct ping_tracker_count *count)
{
    if (!count->scene_done) {
        fail(s, "scan", "not one ping of the scene could be used");
        return;
    }
    s->state = ANLOS__SCAN_STATUS__STATE__DONE;
    if (count->lost)
        snprintf(s->text, sizeof s->text, "done; %zu of %zu pings were given up",
                 count->lost, count->expected);
    else
        snprintf(s->text, sizeof s->text, "done");
}

/* Are all there who are needed?  While one is away, nothing can time out. */
static bool all_ready(struct scan *s, int64_t now_ns)
{
    bool ready = peers_let(&s->peers, s->ping_tracker != NULL, now_ns, &s->sign_ns,
                           &s->state, s->text, sizeof s->text);

    s->failed = s->failed || s->state == ANLOS__SCAN_STATUS__STATE__FAILED;
    return ready;
}

/* What was fired and not recorded yet may not stand where it should: it is taken again.
 */
static void begin_pause(struct scan *s, int64_t now_ns)
{
    s->pause_ns = now_ns;
    s->running = false;
    ping_tracker_forget_under_way(s->ping_tracker);
    pending_fire_answer(&s->pending_fire);
}

static bool pauses(struct scan *s, int64_t now_ns)
{
    const struct stage_client *c = &s->stage_client;

    if (!s->cfg.has_stage || !stage_client_is_paused(c)) {
        if (s->pause_ns && s->start_ns)
            s->start_ns += now_ns - s->pause_ns;
        s->pause_ns = 0;
        return false;
    }
    if (!s->pause_ns)
        begin_pause(s, now_ns);
    s->sign_ns = now_ns;
    s->state = ANLOS__SCAN_STATUS__STATE__PAUSED;
    snprintf(s->text, sizeof s->text, "stage: %s; 'anlos stage home'%s goes on", c->text,
             c->fault ? "" : " or 'release'");
    return true;
}

/* A round is over where the next one begins, the last one as much further on. */
static void begin_run(struct scan *s, size_t first, size_t end)
{
    const double *at_m = s->route.positions_m;

    s->running = true;
    s->position = first;
    s->run_end = end;
    run_begin(&s->run, at_m[first], at_m[end - 1] + at_m[1] - at_m[0], s->speed_m_s);
}

/* All speakers of all rounds; what was missing counts. */
static void fire_run(struct scan *s, Anlos__Pass pass, struct scan_action *out,
                     int64_t now_ns)
{
    Anlos__FireCommand *c = &s->pending_fire.command;

    for (size_t k = s->position; k < s->run_end; k++) {
        size_t n = route_missing(&s->route, s->ping_tracker, pass, k);
        for (size_t i = 0; i < n; i++) {
            const struct ping_tracker_ping ping = {pass, k, s->route.speakers[i]};
            ping_tracker_fire(s->ping_tracker, &ping);
        }
    }
    for (size_t j = 0; j < s->n_speakers; j++)
        s->route.speakers[j] = (uint32_t)j;
    pending_fire_load(&s->pending_fire, s->number, s->route.speakers, s->n_speakers);
    c->pass = pass;
    c->position = (uint32_t)s->position;
    c->n_rounds = (uint32_t)(s->run_end - s->position);
    c->stage_m = s->run.first_m;
    c->start_ns = s->cfg.has_stage ? s->run.start_ns : 0;
    c->speed_m_s = s->cfg.has_stage ? s->speed_m_s : 0;
    s->sign_ns = s->cfg.has_stage ? s->run.start_ns : now_ns;
    send_pending_fire(s, now_ns, out);
}

static void step_run(struct scan *s, Anlos__Pass pass, int64_t now_ns,
                     const struct ping_tracker_count *count, struct scan_action *out)
{
    enum run_progress progress = run_step(&s->run, now_ns);

    switch (progress) {
    case RUN_TO_START:
        s->sign_ns = now_ns; /* a way back may be long */
        if (move(s, s->run.go_m, 0, now_ns, count, out))
            run_stands(&s->run);
        return;
    case RUN_SETS_OFF:
        s->sign_ns = now_ns;
        move(s, s->run.go_m, s->speed_m_s > 0 ? s->speed_m_s : -s->speed_m_s, now_ns,
             count, out);
        return;
    case RUN_FIRES:
        fire_run(s, pass, out, now_ns);
        return;
    case RUN_FAILED:
        fail(s, "stage", s->run.text);
        return;
    default:
        return;
    }
}

/* What was missing may be recorded before the last slot ends. */
static bool is_over(const struct scan *s, int64_t now_ns)
{
    double run_s = s->round_s * (double)(s->run_end - s->position);

    return !s->running || !s->run.fired || !s->cfg.has_stage ||
           now_ns - s->run.start_ns > llrint(1e9 * run_s);
}

/* On a stage that does not stop.  A command that got lost is not sent again: it would
 * come too late. */
static void advance_runs(struct scan *s, int64_t now_ns,
                         const struct ping_tracker_count *count, struct scan_action *out)
{
    Anlos__Pass pass = ping_tracker_pass(s->ping_tracker);
    size_t first, end;

    if (count->recording || !is_over(s, now_ns))
        return;
    if (s->running &&
        (s->run.fired || !route_span(&s->route, s->ping_tracker, pass, &first, &end)))
        s->running = false;
    if (!s->running) {
        if (count->under_way ||
            !route_span(&s->route, s->ping_tracker, pass, &first, &end))
            return;
        begin_run(s, first, end);
    }
    if (s->cfg.has_stage) {
        step_run(s, pass, now_ns, count, out);
        return;
    }
    s->run.fired = true;
    fire_run(s, pass, out, now_ns);
}

static void advance(struct scan *s, int64_t now_ns,
                    const struct ping_tracker_count *count, struct scan_action *out)
{
    Anlos__Pass pass = ping_tracker_pass(s->ping_tracker);
    size_t next;

    /* The stage must stand still while the array records. */
    if (count->recording) {
        if (pending_fire_is_due(&s->pending_fire, now_ns))
            send_pending_fire(s, now_ns, out);
        return;
    }
    next = route_nearest(&s->route, s->ping_tracker, pass, s->position);
    if (next == s->route.n_positions)
        return;
    s->position = next;
    if (!move(s, s->route.positions_m[next], 0, now_ns, count, out))
        return;
    size_t n = route_missing(&s->route, s->ping_tracker, pass, s->position);
    size_t whole = n < s->cfg.window ? n : s->cfg.window;
    if (count->under_way + whole <= s->cfg.window)
        fire(s, pass, whole, now_ns, out);
}

void scan_step(struct scan *s, int64_t now_ns, struct scan_action *out)
{
    struct ping_tracker_count count;

    *out = (struct scan_action){0};
    anlos__stage_command__init(&out->stage_command);
    anlos__fire_command__init(&out->fire_command);
    if (s->failed)
        return;
    if (s->ping_tracker) {
        ping_tracker_count(s->ping_tracker, &count);
        if (count.done + count.lost == count.expected) {
            finish(s, &count);
            return;
        }
    }
    if (!all_ready(s, now_ns) || pauses(s, now_ns))
        return;
    if (!s->start_ns)
        s->start_ns = now_ns;
    s->state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    s->text[0] = '\0';
    if (!peers_heard(&s->peers, now_ns, HEARD_NS))
        s->sign_ns = now_ns; /* a link may be down: what is on its way is not lost yet */
    if (count.under_way && now_ns - s->sign_ns > (int64_t)(s->cfg.timeout_s * 1e9)) {
        ping_tracker_time_out(s->ping_tracker);
        ping_tracker_count(s->ping_tracker, &count);
    }
    if (s->speed_m_s != 0)
        advance_runs(s, now_ns, &count, out);
    else
        advance(s, now_ns, &count, out);
}

void scan_status(const struct scan *s, int64_t now_ns, Anlos__ScanStatus *out)
{
    struct ping_tracker_count count = {0};

    anlos__scan_status__init(out);
    out->state = s->state;
    out->scan = s->number;
    out->text = (char *)s->text;
    out->held = s->state == ANLOS__SCAN_STATUS__STATE__PAUSED && !s->stage_client.fault;
    if (!s->ping_tracker)
        return;
    ping_tracker_count(s->ping_tracker, &count);
    out->pass = ping_tracker_pass(s->ping_tracker);
    out->position = (uint32_t)s->position;
    out->pings_done = (uint32_t)count.done;
    out->pings_expected = (uint32_t)count.expected;
    out->pings_retaken = count.retaken;
    out->pings_lost = (uint32_t)count.lost;
    size_t left = count.expected - count.done - count.lost;
    if (s->start_ns && count.done)
        out->time_left_s = 1e-9 * (double)(now_ns - s->start_ns) * (double)left /
                           (double)count.done;
}

void scan_destroy(struct scan *s)
{
    if (!s)
        return;
    ping_tracker_destroy(s->ping_tracker);
    route_clear(&s->route);
    pending_fire_clear(&s->pending_fire);
    free(s);
}
