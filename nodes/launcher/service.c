/* SPDX-License-Identifier: MIT */
#include "nodes/launcher/service.h"

#include <string.h>
#include <systemd/sd-daemon.h>

#define LOOK_NS 100000000LL /* while it is not ready */

static int notify_systemd(const char *state)
{
    return sd_notify(0, state);
}

void service_open(struct service *s)
{
    uint64_t watchdog_us = 0;

    *s = (struct service){.notify = notify_systemd};
    if (sd_watchdog_enabled(0, &watchdog_us) > 0)
        s->watchdog_ns = (int64_t)watchdog_us * 1000;
}

void service_heard(struct service *s, const struct process_group *c, const char *node,
                   int64_t now_ns)
{
    for (unsigned i = 0; i < c->n; i++)
        if (!strcmp(c->children[i].name, node))
            s->heard_ns[i] = now_ns;
}

static bool have_all_spoken(const struct service *s, const struct process_group *c)
{
    for (unsigned i = 0; i < c->n; i++)
        if (!s->heard_ns[i] && c->children[i].phase != CHILD_ENDED)
            return false;
    return true;
}

static bool do_all_live(const struct service *s, const struct process_group *c,
                        int64_t now_ns)
{
    if (s->supervised)
        return true;
    for (unsigned i = 0; i < c->n; i++) {
        const struct child *child = &c->children[i];
        int64_t heard = s->heard_ns[i] > child->started_ns ? s->heard_ns[i]
                                                           : child->started_ns;
        if (child->phase == CHILD_RUNNING && now_ns - heard > s->watchdog_ns / 2)
            return false;
    }
    return true;
}

int64_t service_tick(struct service *s, const struct process_group *c, int64_t now_ns)
{
    if (now_ns < s->due_ns)
        return s->due_ns;
    if (!s->ready && have_all_spoken(s, c)) {
        s->ready = true;
        s->notify("READY=1");
    }
    if (s->watchdog_ns && do_all_live(s, c, now_ns))
        s->notify("WATCHDOG=1");
    s->due_ns = !s->ready        ? now_ns + LOOK_NS
                : s->watchdog_ns ? now_ns + s->watchdog_ns / 4
                                 : INT64_MAX;
    return s->due_ns;
}

void service_ends(struct service *s)
{
    s->notify("STOPPING=1");
    s->due_ns = INT64_MAX;
}
