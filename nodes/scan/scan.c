#include "nodes/scan/scan.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/stage.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "nodes/scan/ledger.h"
#include "nodes/scan/peers.h"
#include "nodes/scan/volley.h"

/* The stage as the scan drives it: a command until the state says that it was accepted
 * and is done.  A fault, or a person's hand on it, it waits out, and then begins anew. */

enum carriage_progress {
    CARRIAGE_THERE,  /* at rest at the target */
    CARRIAGE_MOVING, /* wait */
    CARRIAGE_SEND,   /* the command is to be sent, or sent again */
    CARRIAGE_PAUSED, /* a person has to home it, or release it; text says why */
    CARRIAGE_FAILED, /* the target is out of reach; text says why */
};

struct carriage {
    bool commanded;
    uint32_t id;
    double target_m;
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

static void carriage_init(struct carriage *c)
{
    *c = (struct carriage){.commanded = false};
}

static void carriage_state(struct carriage *c, const Anlos__StageState *state)
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
static void carriage_forget(struct carriage *c)
{
    c->commanded = c->accepted = false;
    c->fault = c->held = false;
}

/* Does it wait for a person?  As carriage_go with any target. */
static bool carriage_is_paused(const struct carriage *c)
{
    return c->fault || c->held;
}

static enum carriage_progress send_new(struct carriage *c, double target_m,
                                       int64_t now_ns)
{
    c->commanded = true;
    c->accepted = false;
    c->id++;
    c->target_m = target_m;
    c->sent_ns = now_ns;
    return CARRIAGE_SEND;
}

/* Brings the stage to the target.  On CARRIAGE_SEND, id and target_m are to be sent. */
static enum carriage_progress carriage_go(struct carriage *c, double target_m,
                                          int64_t now_ns)
{
    if (carriage_is_paused(c)) {
        c->commanded = c->accepted = false;
        return CARRIAGE_PAUSED;
    }
    if (!c->commanded || c->target_m != target_m)
        return send_new(c, target_m, now_ns);
    if (!c->accepted) {
        if (now_ns - c->sent_ns < RESEND_NS)
            return CARRIAGE_MOVING;
        c->sent_ns = now_ns;
        return CARRIAGE_SEND;
    }
    if (c->refused)
        return CARRIAGE_FAILED;
    return c->idle ? CARRIAGE_THERE : CARRIAGE_MOVING;
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
static size_t route_missing(const struct route *r, const struct ledger *l,
                            Anlos__Pass pass, size_t position)
{
    return ledger_missing(l, pass, position, r->speakers);
}

/* The nearest position where something is missing; n_positions: nowhere.  So the stage
 * goes there and back again, and takes up what was lost on its way. */
static size_t route_nearest(const struct route *r, const struct ledger *l,
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

#define HEARD_NS 2000000000LL /* each node publishes its health every second */

struct scan {
    struct scan_config cfg;
    struct peers peers;
    struct carriage carriage;
    struct ledger *ledger; /* NULL: no survey yet */
    uint64_t survey_id;
    struct route route;
    uint32_t number;      /* of the scan, from 1 */
    struct volley volley; /* fired last */
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
    carriage_init(&s->carriage);
    snprintf(s->text, sizeof s->text, "waits for the other nodes");
    *out = s;
    return 0;
}

/* What a process kept is gone with it. */
static void forget(struct scan *s, const char *node)
{
    if (!strcmp(node, "stage"))
        carriage_forget(&s->carriage);
    if (!s->ledger)
        return;
    if (!strcmp(node, "array") || !strcmp(node, "dsp") || !strcmp(node, "recon"))
        ledger_forget_under_way(s->ledger);
    if (!strcmp(node, "recon"))
        ledger_forget_scene(s->ledger);
    if (!strcmp(node, "dsp"))
        ledger_forget_background(s->ledger);
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

int scan_survey(struct scan *s, const Anlos__Survey *survey)
{
    struct ledger_size size = {.background = s->cfg.background,
                               .n_positions = survey->n_stage_positions_m,
                               .n_speakers = survey->n_speakers_m,
                               .retries = s->cfg.retries};
    struct ledger *ledger = NULL;

    if (s->ledger && survey->id == s->survey_id)
        return 0;
    struct route route = {.n_positions = 0};
    int err = ledger_create(&ledger, &size);
    if (!err)
        err = route_open(&route, survey);
    if (!err)
        err = volley_reset(&s->volley, size.n_speakers);
    if (err) {
        route_clear(&route);
        ledger_destroy(ledger);
        return err;
    }
    ledger_destroy(s->ledger);
    route_clear(&s->route);
    s->ledger = ledger;
    s->route = route;
    s->survey_id = survey->id;
    s->position = 0;
    s->start_ns = 0;
    s->number++;
    return 0;
}

void scan_health(struct scan *s, const char *from, const Anlos__Health *health)
{
    peers_health(&s->peers, from, health);
}

void scan_stage(struct scan *s, const Anlos__StageState *state)
{
    carriage_state(&s->carriage, state);
}

void scan_ping(struct scan *s, const Anlos__Ping *ping, int64_t now_ns)
{
    const struct ledger_ping p = {ping->pass, ping->position, ping->speaker};

    if (!s->ledger || ping->scan != s->number)
        return;
    s->sign_ns = now_ns;
    volley_answer(&s->volley);
    ledger_recorded(s->ledger, &p);
}

void scan_receipt(struct scan *s, const Anlos__Receipt *receipt, int64_t now_ns)
{
    const struct ledger_ping p = {receipt->pass, receipt->position, receipt->speaker};

    if (!s->ledger || receipt->scan != s->number)
        return;
    s->sign_ns = now_ns;
    ledger_receipt(s->ledger, &p, receipt->usable);
}

static void fail(struct scan *s, const char *who, const char *what)
{
    s->failed = true;
    s->state = ANLOS__SCAN_STATUS__STATE__FAILED;
    snprintf(s->text, sizeof s->text, "%s: %s", who, what);
}

static void send_volley(struct scan *s, int64_t now_ns, struct scan_action *out)
{
    out->fire = true;
    out->fire_command = volley_send(&s->volley, now_ns);
}

static void fire(struct scan *s, Anlos__Pass pass, size_t n, int64_t now_ns,
                 struct scan_action *out)
{
    Anlos__FireCommand *c = &s->volley.command;

    for (size_t i = 0; i < n; i++) {
        const struct ledger_ping ping = {pass, s->position, s->route.speakers[i]};
        ledger_fire(s->ledger, &ping);
    }
    volley_load(&s->volley, s->number, s->route.speakers, n);
    c->pass = pass;
    c->position = (uint32_t)s->position;
    c->stage_m = s->cfg.has_stage ? s->carriage.position_m
                                  : s->route.positions_m[s->position];
    s->sign_ns = now_ns;
    send_volley(s, now_ns, out);
}

/* true: the stage stands where it should.  What is on its way to the image still gets
 * there when it cannot. */
static bool move(struct scan *s, int64_t now_ns, const struct ledger_count *count,
                 struct scan_action *out)
{
    if (!s->cfg.has_stage)
        return true;
    switch (carriage_go(&s->carriage, s->route.positions_m[s->position], now_ns)) {
    case CARRIAGE_THERE:
        return true;
    case CARRIAGE_SEND:
        out->move = true;
        out->stage_command.id = s->carriage.id;
        out->stage_command.target_m = s->carriage.target_m;
        return false;
    case CARRIAGE_FAILED:
        if (!count->under_way)
            fail(s, "stage", s->carriage.text);
        return false;
    default:
        return false;
    }
}

static void finish(struct scan *s, const struct ledger_count *count)
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
    bool ready = peers_let(&s->peers, s->ledger != NULL, now_ns, &s->sign_ns, &s->state,
                           s->text, sizeof s->text);

    s->failed = s->failed || s->state == ANLOS__SCAN_STATUS__STATE__FAILED;
    return ready;
}

/* What was fired and not recorded yet may not stand where it should: it is taken again.
 */
static void begin_pause(struct scan *s, int64_t now_ns)
{
    s->pause_ns = now_ns;
    ledger_forget_under_way(s->ledger);
    volley_answer(&s->volley);
}

static bool pauses(struct scan *s, int64_t now_ns)
{
    const struct carriage *c = &s->carriage;

    if (!s->cfg.has_stage || !carriage_is_paused(c)) {
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

static void advance(struct scan *s, int64_t now_ns, const struct ledger_count *count,
                    struct scan_action *out)
{
    Anlos__Pass pass = ledger_pass(s->ledger);
    size_t next;

    /* The stage must stand still while the array records. */
    if (count->recording) {
        if (volley_is_due(&s->volley, now_ns))
            send_volley(s, now_ns, out);
        return;
    }
    next = route_nearest(&s->route, s->ledger, pass, s->position);
    if (next == s->route.n_positions)
        return;
    s->position = next;
    if (!move(s, now_ns, count, out))
        return;
    size_t n = route_missing(&s->route, s->ledger, pass, s->position);
    size_t whole = n < s->cfg.window ? n : s->cfg.window;
    if (count->under_way + whole <= s->cfg.window)
        fire(s, pass, whole, now_ns, out);
}

void scan_step(struct scan *s, int64_t now_ns, struct scan_action *out)
{
    struct ledger_count count;

    *out = (struct scan_action){0};
    anlos__stage_command__init(&out->stage_command);
    anlos__fire_command__init(&out->fire_command);
    if (s->failed)
        return;
    if (s->ledger) {
        ledger_count(s->ledger, &count);
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
        ledger_time_out(s->ledger);
        ledger_count(s->ledger, &count);
    }
    advance(s, now_ns, &count, out);
}

void scan_status(const struct scan *s, int64_t now_ns, Anlos__ScanStatus *out)
{
    struct ledger_count count = {0};

    anlos__scan_status__init(out);
    out->state = s->state;
    out->scan = s->number;
    out->text = (char *)s->text;
    out->held = s->state == ANLOS__SCAN_STATUS__STATE__PAUSED && !s->carriage.fault;
    if (!s->ledger)
        return;
    ledger_count(s->ledger, &count);
    out->pass = ledger_pass(s->ledger);
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
    ledger_destroy(s->ledger);
    route_clear(&s->route);
    volley_clear(&s->volley);
    free(s);
}
