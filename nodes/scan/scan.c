#include "nodes/scan/scan.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/scan/carriage.h"
#include "nodes/scan/ledger.h"
#include "nodes/scan/peers.h"
#include "nodes/scan/volley.h"

struct scan {
    struct scan_config cfg;
    struct peers peers;
    struct carriage carriage;
    struct ledger *ledger; /* NULL: no survey yet */
    uint64_t survey_id;
    size_t n_positions, n_speakers;
    double *positions_m;  /* [n_positions] */
    uint32_t *speakers;   /* [n_speakers], scratch */
    uint32_t number;      /* of the scan, from 1 */
    struct volley volley; /* fired last */
    size_t position;
    int64_t sign_ns;  /* last sign of life of what is under way */
    int64_t start_ns; /* 0: not yet running */
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
    carriage_init(&s->carriage, cfg->retries);
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
    int err = ledger_create(&ledger, &size);
    if (err)
        return err;
    double *positions = calloc(size.n_positions, sizeof *positions);
    uint32_t *speakers = calloc(size.n_speakers, sizeof *speakers);
    err = positions && speakers ? volley_reset(&s->volley, size.n_speakers) : -ENOMEM;
    if (err) {
        free(positions);
        free(speakers);
        ledger_destroy(ledger);
        return err;
    }
    memcpy(positions, survey->stage_positions_m, size.n_positions * sizeof *positions);
    ledger_destroy(s->ledger);
    free(s->positions_m);
    free(s->speakers);
    s->ledger = ledger;
    s->positions_m = positions;
    s->speakers = speakers;
    s->n_positions = size.n_positions;
    s->n_speakers = size.n_speakers;
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

/* The nearest position where something is missing; n_positions: nowhere.  So the stage
 * goes there and back again, and takes up what was lost on its way. */
static size_t nearest_missing(const struct scan *s, Anlos__Pass pass)
{
    size_t best = s->n_positions;
    double best_m = INFINITY;

    for (size_t i = 0; i < s->n_positions; i++) {
        double distance_m = fabs(s->positions_m[i] - s->positions_m[s->position]);
        if (distance_m < best_m && ledger_missing(s->ledger, pass, i, s->speakers)) {
            best = i;
            best_m = distance_m;
        }
    }
    return best;
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
        const struct ledger_ping ping = {pass, s->position, s->speakers[i]};
        ledger_fire(s->ledger, &ping);
    }
    volley_load(&s->volley, s->number, s->speakers, n);
    c->pass = pass;
    c->position = (uint32_t)s->position;
    c->stage_m = s->cfg.has_stage ? s->carriage.position_m : s->positions_m[s->position];
    s->sign_ns = now_ns;
    send_volley(s, now_ns, out);
}

/* true: the stage stands where it should. */
static bool move(struct scan *s, int64_t now_ns, struct scan_action *out)
{
    if (!s->cfg.has_stage)
        return true;
    switch (carriage_go(&s->carriage, s->positions_m[s->position], now_ns)) {
    case CARRIAGE_THERE:
        return true;
    case CARRIAGE_SEND:
        out->move = true;
        out->stage_command.id = s->carriage.id;
        out->stage_command.target_m = s->carriage.target_m;
        return false;
    case CARRIAGE_FAILED:
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
    const struct peer *fault = peers_fault(&s->peers);

    if (fault) {
        fail(s, fault->name, fault->text);
        return false;
    }
    s->state = ANLOS__SCAN_STATUS__STATE__WAITING;
    if (!peers_ready(&s->peers, now_ns, s->text, sizeof s->text)) {
        s->sign_ns = now_ns;
        return false;
    }
    if (!s->ledger) {
        snprintf(s->text, sizeof s->text, "waits for the survey");
        return false;
    }
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
    next = nearest_missing(s, pass);
    if (next == s->n_positions)
        return;
    s->position = next;
    if (!move(s, now_ns, out))
        return;
    size_t n = ledger_missing(s->ledger, pass, s->position, s->speakers);
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
    if (!all_ready(s, now_ns))
        return;
    if (!s->start_ns)
        s->start_ns = now_ns;
    s->state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    s->text[0] = '\0';
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
    free(s->positions_m);
    free(s->speakers);
    volley_clear(&s->volley);
    free(s);
}
