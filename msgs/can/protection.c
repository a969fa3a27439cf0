/* SPDX-License-Identifier: MIT */
#include "msgs/can/protection.h"

#include <string.h>

void can_protect(const struct can_protection *p, struct can_frame_data *f)
{
    const struct can_message *m = can_message_find(p->base, f->id);

    if (!m || f->size != m->size)
        return;
    if (m->profile == CAN_PROFILE_05)
        e2e_p05_protect(f->data, f->size, (uint16_t)f->id, p->counters[m->id]);
    else
        e2e_p11_protect(f->data, f->size, (uint16_t)f->id, p->counters[m->id]);
}

void can_protection_sent(struct can_protection *p, const struct can_frame_data *f)
{
    const struct can_message *m = can_message_find(p->base, f->id);

    if (!m)
        return;
    unsigned n = m->profile == CAN_PROFILE_05 ? E2E_P05_COUNTERS : E2E_P11_COUNTERS;
    p->counters[m->id] = (uint8_t)((p->counters[m->id] + 1u) % n);
}

enum e2e_verdict can_check(struct can_checks *c, const struct can_frame_data *f)
{
    const struct can_message *m = can_message_find(c->base, f->id);

    if (!m || f->size != m->size || f->fd != m->fd)
        return E2E_WRONG_CRC;
    struct e2e_check *check = &c->checks[m->id];
    uint16_t data_id = (uint16_t)f->id;
    return m->profile == CAN_PROFILE_05
               ? e2e_p05_check(check, f->data, f->size, data_id, CAN_MAX_DELTA)
               : e2e_p11_check(check, f->data, f->size, data_id, CAN_MAX_DELTA);
}

void can_checks_forget(struct can_checks *c, enum can_id id)
{
    memset(&c->checks[id], 0, sizeof c->checks[id]);
}
