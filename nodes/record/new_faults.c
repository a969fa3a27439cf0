/* SPDX-License-Identifier: MIT */
#include "nodes/record/new_faults.h"

#include <stdio.h>
#include <string.h>

#define STATE_NAME "fault"

static bool states(const Anlos__Health *h, const char *name)
{
    for (size_t i = 0; i < h->n_faults; i++)
        if (h->faults[i]->count &&
            !strncmp(h->faults[i]->name, name, NEW_FAULTS_NAME - 1))
            return true;
    return h->state == ANLOS__HEALTH__STATE__FAULT && !strcmp(name, STATE_NAME);
}

static void forget(struct new_faults *f, const char *node, const Anlos__Health *h)
{
    for (size_t i = 0; i < f->n; i++)
        if (!strcmp(f->list[i].node, node) && f->list[i].lasts)
            f->list[i].lasts = states(h, f->list[i].name);
}

/* true: it is new. */
static bool take(struct new_faults *f, const char *node, const char *name, int64_t now_ns)
{
    size_t i = 0;

    while (i < f->n && (strcmp(f->list[i].node, node) ||
                        strncmp(f->list[i].name, name, NEW_FAULTS_NAME - 1)))
        i++;
    if (i == NEW_FAULTS_MAX)
        return false;
    bool first = i == f->n;
    if (first) {
        snprintf(f->list[i].node, ENVELOPE_NODE_SIZE, "%s", node);
        snprintf(f->list[i].name, NEW_FAULTS_NAME, "%s", name);
        f->n++;
    } else if (f->list[i].lasts) {
        return false;
    }
    f->list[i].lasts = true;
    if (!first && now_ns - f->list[i].told_ns < f->again_ns) {
        f->again++;
        return false;
    }
    f->list[i].told_ns = now_ns;
    return true;
}

const char *new_faults_next(struct new_faults *f, const char *node,
                            const Anlos__Health *h, int64_t now_ns)
{
    forget(f, node, h);
    for (size_t i = 0; i < h->n_faults; i++)
        if (h->faults[i]->count && take(f, node, h->faults[i]->name, now_ns))
            return h->faults[i]->name;
    if (h->state == ANLOS__HEALTH__STATE__FAULT && !h->n_faults &&
        take(f, node, STATE_NAME, now_ns))
        return STATE_NAME;
    return NULL;
}
