/* SPDX-License-Identifier: MIT */
#include "nodes/scan/peers.h"

#include <stdio.h>
#include <string.h>

#include "dsp/error.h"

void peers_init(struct peers *p, const char *const *names, size_t n, double silence_s)
{
    memset(p, 0, sizeof *p);
    p->silence_ns = (int64_t)(silence_s * 1e9);
    for (size_t i = 0; i < n && p->n < PEERS_MAX; i++)
        snprintf(p->list[p->n++].name, PEERS_NAME_SIZE, "%s", names[i]);
}

static struct peer *find(struct peers *p, const char *name)
{
    for (size_t i = 0; i < p->n; i++)
        if (!strcmp(p->list[i].name, name))
            return &p->list[i];
    return NULL;
}

enum peers_news peers_hear(struct peers *p, const char *name, int64_t epoch_ns,
                           int64_t now_ns)
{
    struct peer *peer = find(p, name);

    if (!peer)
        return PEERS_STRANGER;
    /* A machine that was away may come back with a clock that is behind. */
    if (epoch_ns < peer->epoch_ns && now_ns - peer->heard_ns <= p->silence_ns)
        return PEERS_STALE;
    peer->heard_ns = now_ns;
    if (epoch_ns == peer->epoch_ns)
        return PEERS_SAME;
    bool known = peer->epoch_ns != 0;
    peer->epoch_ns = epoch_ns;
    peer->state = ANLOS__HEALTH__STATE__STARTING;
    peer->text[0] = '\0';
    return known ? PEERS_RESTARTED : PEERS_SAME;
}

void peers_health(struct peers *p, const char *name, const Anlos__Health *health)
{
    struct peer *peer = find(p, name);

    if (!peer)
        return;
    peer->state = health->state;
    snprintf(peer->text, sizeof peer->text, "%s", health->text);
}

static bool is_ready(const struct peers *p, const struct peer *peer, int64_t now_ns)
{
    return peer->epoch_ns && now_ns - peer->heard_ns <= p->silence_ns &&
           (peer->state == ANLOS__HEALTH__STATE__READY ||
            peer->state == ANLOS__HEALTH__STATE__DEGRADED);
}

/* All there and ready?  Else text[size] says who is waited for. */
static bool peers_ready(const struct peers *p, int64_t now_ns, char *text, size_t size)
{
    text[0] = '\0';
    for (size_t i = 0; i < p->n; i++)
        if (!is_ready(p, &p->list[i], now_ns))
            text_add(text, size, ", ", "%s%s", text[0] ? "" : "waits for ",
                     p->list[i].name);
    return !text[0];
}

bool peers_heard(const struct peers *p, int64_t now_ns, int64_t within_ns)
{
    for (size_t i = 0; i < p->n; i++)
        if (now_ns - p->list[i].heard_ns > within_ns)
            return false;
    return true;
}

/* A peer that says it cannot go on, or NULL. */
static const struct peer *peers_fault(const struct peers *p)
{
    for (size_t i = 0; i < p->n; i++)
        if (p->list[i].state == ANLOS__HEALTH__STATE__FAULT)
            return &p->list[i];
    return NULL;
}

bool peers_let(const struct peers *p, bool has_survey, int64_t now_ns, int64_t *sign_ns,
               Anlos__ScanStatus__State *state, char *text, size_t size)
{
    const struct peer *fault = peers_fault(p);

    *state = fault ? ANLOS__SCAN_STATUS__STATE__FAILED
                   : ANLOS__SCAN_STATUS__STATE__WAITING;
    if (fault) {
        snprintf(text, size, "%s: %s", fault->name, fault->text);
        return false;
    }
    if (!peers_ready(p, now_ns, text, size)) {
        *sign_ns = now_ns;
        return false;
    }
    if (!has_survey)
        snprintf(text, size, "waits for the survey");
    return has_survey;
}
