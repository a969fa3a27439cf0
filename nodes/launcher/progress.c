#include "nodes/launcher/progress.h"

#include <stdio.h>
#include <string.h>

void progress_init(struct progress *p, bool terminal)
{
    *p = (struct progress){
        .terminal = terminal, .step = -1, .state = ANLOS__SCAN_STATUS__STATE__WAITING};
}

static uint64_t messages_lost(const struct progress *p)
{
    uint64_t lost = 0;

    for (size_t i = 0; i < p->n_nodes; i++)
        lost += p->nodes[i].lost;
    return lost;
}

static void write_text(struct progress *p, const Anlos__ScanStatus *s)
{
    char left[32] = "";

    if (s->state == ANLOS__SCAN_STATUS__STATE__WAITING && !s->pings_done) {
        snprintf(p->text, sizeof p->text, "%s", s->text);
        return;
    }
    if (s->state == ANLOS__SCAN_STATUS__STATE__PAUSED) {
        snprintf(p->text, sizeof p->text, "paused at %u/%u pings; %s", s->pings_done,
                 s->pings_expected, s->text);
        return;
    }
    if (s->state == ANLOS__SCAN_STATUS__STATE__FAILED && !s->pings_done) {
        snprintf(p->text, sizeof p->text, "failed: %s", s->text);
        return;
    }
    if (!s->pings_expected) {
        snprintf(p->text, sizeof p->text, "%s: %s; %u pings, %u lost, %llu messages lost",
                 s->state == ANLOS__SCAN_STATUS__STATE__DONE     ? "done"
                 : s->state == ANLOS__SCAN_STATUS__STATE__FAILED ? "failed"
                 : s->pass == ANLOS__PASS__BACKGROUND            ? "background"
                                                                 : "runs",
                 s->text, s->pings_done, s->pings_lost,
                 (unsigned long long)messages_lost(p));
        return;
    }
    if (s->state == ANLOS__SCAN_STATUS__STATE__RUNNING && s->pings_done)
        snprintf(left, sizeof left, ", %.0f s left", s->time_left_s);
    snprintf(p->text, sizeof p->text,
             "%s %u/%u pings%s, %u retaken, %u given up, %llu messages lost%s%s",
             s->pass == ANLOS__PASS__BACKGROUND ? "background" : "scene", s->pings_done,
             s->pings_expected, left, s->pings_retaken, s->pings_lost,
             (unsigned long long)messages_lost(p), s->text[0] ? "; " : "", s->text);
}

/* What a reader of a pipe must not miss. */
static bool is_event(const struct progress *p, const Anlos__ScanStatus *s)
{
    if (p->endless && s->state == ANLOS__SCAN_STATUS__STATE__RUNNING)
        return !p->paced && s->pings_done;
    return s->state != p->state && (s->state == ANLOS__SCAN_STATUS__STATE__FAILED ||
                                    s->state == ANLOS__SCAN_STATUS__STATE__PAUSED ||
                                    p->state == ANLOS__SCAN_STATUS__STATE__PAUSED);
}

bool progress_status(struct progress *p, const Anlos__ScanStatus *s)
{
    p->endless = !s->pings_expected;
    bool event = is_event(p, s);
    int step = s->pings_expected ? (int)(10ull * s->pings_done / s->pings_expected) : -1;

    p->state = s->state;
    p->paced = s->state == ANLOS__SCAN_STATUS__STATE__RUNNING && s->pings_done;
    write_text(p, s);
    if (p->terminal)
        return true;
    if (step == p->step && !event)
        return false;
    p->step = step;
    return true;
}

bool progress_end(const struct progress *p)
{
    return !p->terminal && p->endless && p->paced;
}

void progress_health(struct progress *p, const Anlos__Health *health)
{
    size_t i = 0;

    while (i < p->n_nodes && strcmp(p->nodes[i].name, health->node))
        i++;
    if (i == PROGRESS_MAX_NODES)
        return;
    if (i == p->n_nodes)
        snprintf(p->nodes[p->n_nodes++].name, sizeof p->nodes[i].name, "%s",
                 health->node);
    p->nodes[i].lost = 0;
    for (size_t k = 0; k < health->n_topics; k++)
        p->nodes[i].lost += health->topics[k]->gaps + health->topics[k]->dropped;
}
