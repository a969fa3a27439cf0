#include "hal/can/errors.h"

#include <linux/can.h>
#include <linux/can/error.h>

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
