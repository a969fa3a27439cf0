#include "hal/can/delivery.h"

#define SILENT_NS 1000000000LL

void can_delivery_sent(struct can_delivery *d, int64_t now_ns)
{
    d->sent++;
    if (!d->pending++)
        d->alive_ns = now_ns;
}

/* A late one, of a frame that was given up, counts for one that is pending: else a single
 * echo that got lost would be waited for again and again. */
void can_delivery_echo(struct can_delivery *d, int64_t now_ns)
{
    d->confirmed++;
    if (d->pending)
        d->pending--;
    else if (d->unconfirmed)
        d->unconfirmed--;
    d->alive_ns = now_ns;
    d->silent = false;
}

static void give_up(struct can_delivery *d)
{
    d->outages += d->pending > 0;
    d->unconfirmed += d->pending;
    d->pending = 0;
}

void can_delivery_lost(struct can_delivery *d)
{
    give_up(d);
    d->silent = false;
}

void can_delivery_check(struct can_delivery *d, int64_t now_ns)
{
    if (!d->pending || now_ns - d->alive_ns < SILENT_NS)
        return;
    give_up(d);
    d->silent = true;
}
