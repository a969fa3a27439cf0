/* SPDX-License-Identifier: MIT */
#include "nodes/scan/fixed_scan.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/error.h"
#include "msgs/convert.h"
#include "nodes/rt/round_check.h"
#include "nodes/scan/peers.h"
#include "nodes/scan/pending_fire.h"
#include "recon/survey.h"

#define SILENT_NS 2000000000LL

void rounds_start(struct rounds *t, size_t n_speakers)
{
    t->n_speakers = n_speakers;
    t->next = 0;
    t->n = 0;
}

void rounds_add(struct rounds *t, uint32_t round, size_t index, bool valid,
                int64_t now_ns)
{
    uint64_t at = (uint64_t)(round - 1) * t->n_speakers + index;

    if (at < t->next)
        return;
    t->all_lost += at - t->next + !valid;
    t->all_void += !valid;
    t->all_done += valid;
    t->next = at + 1;
    t->newest_ns[t->n++ % ROUNDS_RING] = now_ns;
}

size_t rounds_frames(const struct rounds *t)
{
    return t->n_speakers ? (size_t)(t->next / t->n_speakers) : 0;
}

static double pings_per_s(const struct rounds *t, int64_t now_ns)
{
    size_t n = t->n < ROUNDS_RING ? t->n : ROUNDS_RING;

    if (n < 2)
        return 0.0;
    int64_t newest = t->newest_ns[(t->n - 1) % ROUNDS_RING];
    int64_t oldest = t->newest_ns[(t->n - n) % ROUNDS_RING];
    if (newest <= oldest || now_ns - newest > SILENT_NS)
        return 0.0;
    return 1e9 * (double)(n - 1) / (double)(newest - oldest);
}

void rounds_text(const struct rounds *t, int64_t now_ns, char *out, size_t size)
{
    double rate = pings_per_s(t, now_ns);

    if (!t->n) {
        snprintf(out, size, "waits for the first ping");
        return;
    }
    snprintf(out, size, "%.1f frames/s, %.1f pings/s",
             t->n_speakers ? rate / (double)t->n_speakers : 0.0, rate);
    if (t->all_void)
        text_add(out, size, "; ", "%llu void", (unsigned long long)t->all_void);
}

#define QUIET_NS 1000000000LL /* after the last ping of a recording */

struct fixed_scan {
    struct scan_config cfg;
    struct peers peers;
    uint64_t survey_id; /* 0: none yet */
    uint32_t *speakers; /* [n_speakers], of a round */
    size_t n_speakers;
    uint32_t number;                  /* of the scan, from 1 */
    struct pending_fire pending_fire; /* what the array was asked last */
    Anlos__Pass pass;                 /* that it was asked for */
    bool asked;
    bool ended;      /* the array plays a recording, which did */
    int64_t sign_ns; /* last sign of life of the array */
    struct rounds rounds;
    Anlos__ScanStatus__State state;
    bool failed; /* until there is another survey */
    char text[256];
};

int fixed_scan_create(struct fixed_scan **out, const struct scan_config *cfg)
{
    struct fixed_scan *s = calloc(1, sizeof *s);

    if (!s)
        return -ENOMEM;
    s->cfg = *cfg;
    s->state = ANLOS__SCAN_STATUS__STATE__WAITING;
    peers_init(&s->peers, cfg->needs, cfg->n_needs, cfg->silence_s);
    snprintf(s->text, sizeof s->text, "waits for the other nodes");
    *out = s;
    return 0;
}

/* Another scan: frames count from 1 again, and whoever keeps anything restarts. */
static void begin(struct fixed_scan *s)
{
    s->number++;
    s->asked = s->ended = false;
    s->pass = s->cfg.background ? ANLOS__PASS__BACKGROUND : ANLOS__PASS__SCENE;
}

bool fixed_scan_hear(struct fixed_scan *s, const char *from, int64_t epoch_ns,
                     int64_t now_ns)
{
    switch (peers_hear(&s->peers, from, epoch_ns, now_ns)) {
    case PEERS_STALE:
        return false;
    case PEERS_RESTARTED:
        if (!strcmp(from, "array") || (!strcmp(from, "dsp") && s->cfg.background))
            begin(s);
        return true;
    default:
        return true;
    }
}

static void fail(struct fixed_scan *s, const char *who, const char *what)
{
    s->failed = true;
    s->state = ANLOS__SCAN_STATUS__STATE__FAILED;
    snprintf(s->text, sizeof s->text, "%s: %.200s", who, what);
}

static int take_speakers(struct fixed_scan *s, size_t n_all)
{
    size_t n = s->cfg.n_speakers ? s->cfg.n_speakers : n_all;
    uint32_t *speakers = malloc(n * sizeof *speakers);

    if (!speakers)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++)
        speakers[i] = s->cfg.n_speakers ? s->cfg.speakers[i] : (uint32_t)i;
    free(s->speakers);
    s->speakers = speakers;
    s->n_speakers = n;
    return pending_fire_reset(&s->pending_fire, n);
}

int fixed_scan_survey(struct fixed_scan *s, const Anlos__Survey *survey)
{
    struct survey v;
    struct error why = {""};

    if (survey->id == s->survey_id)
        return 0;
    if (survey_from_message(&v, survey, &why)) {
        fail(s, "survey", why.text);
        return 0;
    }
    int err = take_speakers(s, v.n_speakers);
    s->failed = false;
    s->survey_id = survey->id;
    if (!err && round_check(&v, s->cfg.speakers, s->cfg.n_speakers, &why))
        fail(s, "scan", why.text);
    survey_clear(&v);
    begin(s);
    return err;
}

void fixed_scan_health(struct fixed_scan *s, const char *from,
                       const Anlos__Health *health)
{
    peers_health(&s->peers, from, health);
    if (!strcmp(from, "array") && s->asked && s->pass == ANLOS__PASS__SCENE)
        s->ended = health->ended;
}

void fixed_scan_ping(struct fixed_scan *s, const Anlos__Ping *ping, int64_t now_ns)
{
    size_t index = 0;

    if (!s->asked || ping->scan != s->number || ping->pass != s->pass)
        return;
    while (index < s->n_speakers && s->speakers[index] != ping->speaker)
        index++;
    if (!ping->frame || index == s->n_speakers)
        return;
    s->sign_ns = now_ns;
    pending_fire_answer(&s->pending_fire);
    rounds_add(&s->rounds, ping->frame, index, ping->valid, now_ns);
}

static bool all_ready(struct fixed_scan *s, int64_t now_ns)
{
    return peers_let(&s->peers, s->survey_id != 0, now_ns, &s->sign_ns, &s->state,
                     s->text, sizeof s->text);
}

static void ask(struct fixed_scan *s, int64_t now_ns)
{
    pending_fire_load(&s->pending_fire, s->number, s->speakers, s->n_speakers);
    s->pending_fire.command.pass = s->pass;
    s->pending_fire.command.endless = true;
    s->asked = true;
    s->sign_ns = now_ns;
    rounds_start(&s->rounds, s->n_speakers);
}

/* The array says that a recording has ended, and its last pings have been used. */
static bool is_done(struct fixed_scan *s, int64_t now_ns)
{
    if (!s->ended || now_ns - s->sign_ns < QUIET_NS)
        return false;
    s->state = ANLOS__SCAN_STATUS__STATE__DONE;
    snprintf(s->text, sizeof s->text, "the recording has ended");
    return true;
}

bool fixed_scan_step(struct fixed_scan *s, int64_t now_ns, Anlos__FireCommand *out)
{
    if (is_done(s, now_ns))
        return false;
    if (s->failed || !all_ready(s, now_ns))
        return false;
    if (s->asked && !s->ended && now_ns - s->sign_ns > (int64_t)(s->cfg.timeout_s * 1e9))
        begin(s);
    if (s->asked && s->pass == ANLOS__PASS__BACKGROUND &&
        rounds_frames(&s->rounds) >= s->cfg.background_frames) {
        s->pass = ANLOS__PASS__SCENE;
        s->asked = false;
    }
    s->state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    bool send = !s->asked;
    if (send)
        ask(s, now_ns);
    if (!send && !pending_fire_is_due(&s->pending_fire, now_ns))
        return false;
    *out = pending_fire_send(&s->pending_fire, now_ns);
    return true;
}

void fixed_scan_status(struct fixed_scan *s, int64_t now_ns, Anlos__ScanStatus *out)
{
    if (s->state == ANLOS__SCAN_STATUS__STATE__RUNNING)
        rounds_text(&s->rounds, now_ns, s->text, sizeof s->text);
    anlos__scan_status__init(out);
    out->state = s->state;
    out->scan = s->number;
    out->text = s->text;
    out->pass = s->pass;
    out->pings_done = (uint32_t)s->rounds.all_done;
    out->pings_lost = (uint32_t)s->rounds.all_lost;
}

void fixed_scan_destroy(struct fixed_scan *s)
{
    if (!s)
        return;
    pending_fire_clear(&s->pending_fire);
    free(s->speakers);
    free(s);
}
