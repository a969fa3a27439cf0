/* SPDX-License-Identifier: MIT */
#include "hal/can/errors.h"

#include <linux/can.h>
#include <linux/can/error.h>
#include <stdio.h>

void canbus_advice(char *text, size_t size, enum canbus_state state,
                   const char *interface)
{
    switch (state) {
    case CANBUS_READY:
        text[0] = '\0';
        break;
    case CANBUS_WARNING:
        snprintf(text, size, "%s has many errors: wiring, termination, bit rate?",
                 interface);
        break;
    case CANBUS_PASSIVE:
        snprintf(text, size,
                 "%s is error passive: no other node that acknowledges, or wrong wiring, "
                 "termination or bit rate?",
                 interface);
        break;
    case CANBUS_SILENT:
        snprintf(text, size,
                 "%s let no frame through for a second, frames are held back: no other "
                 "node that acknowledges, or a bus that is full?",
                 interface);
        break;
    case CANBUS_OFF:
        snprintf(text, size,
                 "%s is bus-off, frames are held back until it restarts: by itself after "
                 "`ip link set %s type can restart-ms 100` while it is down, at once by "
                 "`ip link set %s type can restart`",
                 interface, interface, interface);
        break;
    case CANBUS_DOWN:
        snprintf(text, size, "%s is down, frames are held back: `ip link set %s up`",
                 interface, interface);
        break;
    case CANBUS_GONE:
        snprintf(text, size, "%s is gone, frames are held back until it is there again",
                 interface);
        break;
    }
}

uint32_t canbus_errors_mask(void)
{
    return CAN_ERR_LOSTARB | CAN_ERR_CRTL | CAN_ERR_ACK | CAN_ERR_BUSOFF |
           CAN_ERR_RESTARTED;
}

static void enter(struct canbus_errors *e, enum canbus_state state, uint64_t *count)
{
    if (e->state != state)
        ++*count;
    e->state = state;
}

/* Sending and receiving have a state each; the worse one counts.  A full buffer is told
 * by the same kind of frame and is no state. */
static void take_controller(struct canbus_errors *e, uint8_t what)
{
    if (what & (CAN_ERR_CRTL_TX_PASSIVE | CAN_ERR_CRTL_RX_PASSIVE))
        enter(e, CANBUS_PASSIVE, &e->passive);
    else if (what & (CAN_ERR_CRTL_TX_WARNING | CAN_ERR_CRTL_RX_WARNING))
        enter(e, CANBUS_WARNING, &e->warning);
    else if (what & CAN_ERR_CRTL_ACTIVE)
        e->state = CANBUS_READY;
}

void canbus_errors_take(struct canbus_errors *e, uint32_t id, const uint8_t data[8])
{
    if (id & CAN_ERR_LOSTARB)
        e->arbitration_lost++;
    if (id & CAN_ERR_ACK)
        e->unacknowledged++;
    if (id & CAN_ERR_CRTL)
        take_controller(e, data[1]);
    if (id & CAN_ERR_BUSOFF)
        enter(e, CANBUS_OFF, &e->off);
    if (id & CAN_ERR_RESTARTED) {
        e->restarted++;
        e->state = CANBUS_READY;
    }
}

void canbus_errors_alive(struct canbus_errors *e)
{
    if (e->state == CANBUS_OFF)
        e->state = CANBUS_READY;
}

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
