/* SPDX-License-Identifier: MIT */
#include "nodes/play/account.h"

#include <string.h>

static void take_out(struct account *a, size_t i)
{
    a->n--;
    memmove(&a->under_way[i], &a->under_way[i + 1], (a->n - i) * sizeof *a->under_way);
}

void account_play(struct account *a, const struct account_ping *ping)
{
    if (a->n == ACCOUNT_MAX)
        take_out(a, 0);
    a->under_way[a->n++] = *ping;
    a->played++;
}

/* dsp asks for the background of a scene ping when it has none: that is an answer to the
 * scene ping. */
static bool answers(const Anlos__Receipt *r, const struct account_ping *p)
{
    return r->scan == p->scan && r->position == p->position && r->speaker == p->speaker &&
           r->frame == p->frame &&
           (r->pass == p->pass || (r->pass == ANLOS__PASS__BACKGROUND && !r->usable));
}

bool account_receipt(struct account *a, const Anlos__Receipt *r)
{
    size_t i = 0;

    while (i < a->n && !answers(r, &a->under_way[i]))
        i++;
    if (i == a->n)
        return false;
    const struct account_ping ping = a->under_way[i];
    take_out(a, i);
    a->used += r->usable;
    a->unused += !r->usable && ping.valid;
    /* dsp overtakes recon, but neither overtakes itself. */
    for (size_t k = 0; r->usable && k < i;) {
        if (a->under_way[k].pass != ping.pass || !a->under_way[k].valid) {
            k++;
            continue;
        }
        take_out(a, k);
        a->missing++;
        i--;
    }
    return true;
}

size_t account_give_up(struct account *a)
{
    size_t n = a->n;

    a->missing += n;
    a->n = 0;
    return n;
}

void account_forget(struct account *a)
{
    a->n = 0;
}
