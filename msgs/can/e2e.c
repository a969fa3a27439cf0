/* SPDX-License-Identifier: MIT */
#include "msgs/can/e2e.h"

#include <string.h>

/* SAE J1850. */
static uint8_t crc8(uint8_t crc, const uint8_t *data, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++)
            crc = (uint8_t)(crc & 0x80 ? crc << 1 ^ 0x1d : crc << 1);
    }
    return crc;
}

/* CCITT-FALSE. */
static uint16_t crc16(uint16_t crc, const uint8_t *data, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        crc ^= (uint16_t)(data[i] << 8);
        for (int bit = 0; bit < 8; bit++)
            crc = (uint16_t)(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
    }
    return crc;
}

static uint8_t p11_crc(const uint8_t *data, size_t size, uint16_t data_id)
{
    const uint8_t low[] = {(uint8_t)data_id, 0};

    return crc8(crc8(0, low, sizeof low), data + 1, size - 1);
}

static uint16_t p05_crc(const uint8_t *data, size_t size, uint16_t data_id)
{
    const uint8_t id[] = {(uint8_t)data_id, (uint8_t)(data_id >> 8)};

    return crc16(crc16(0xffff, data + 2, size - 2), id, sizeof id);
}

static uint8_t p11_nibble(uint16_t data_id)
{
    return (uint8_t)(data_id >> 8 & 0xf);
}

void e2e_p11_protect(uint8_t *data, size_t size, uint16_t data_id, uint8_t counter)
{
    data[1] = (uint8_t)(p11_nibble(data_id) << 4 | counter % E2E_P11_COUNTERS);
    data[0] = p11_crc(data, size, data_id);
}

void e2e_p05_protect(uint8_t *data, size_t size, uint16_t data_id, uint8_t counter)
{
    data[2] = counter;
    uint16_t crc = p05_crc(data, size, data_id);
    data[0] = (uint8_t)crc;
    data[1] = (uint8_t)(crc >> 8);
}

/* Of an undamaged frame. */
static enum e2e_verdict follow(struct e2e_check *c, uint8_t counter, unsigned n_counters,
                               uint8_t max_delta)
{
    unsigned delta = (counter + n_counters - c->counter) % n_counters;
    bool began = c->began;

    *c = (struct e2e_check){.began = true, .counter = counter};
    if (!began || delta == 1)
        return E2E_OK;
    if (delta == 0)
        return E2E_REPEATED;
    return delta <= max_delta ? E2E_SOME_LOST : E2E_WRONG_SEQUENCE;
}

enum e2e_verdict e2e_p11_check(struct e2e_check *c, const uint8_t *data, size_t size,
                               uint16_t data_id, uint8_t max_delta)
{
    if (!data)
        return E2E_NO_NEW_DATA;
    if (size < 2 || data[0] != p11_crc(data, size, data_id) ||
        data[1] >> 4 != p11_nibble(data_id) || (data[1] & 0xf) >= E2E_P11_COUNTERS)
        return E2E_WRONG_CRC;
    return follow(c, data[1] & 0xf, E2E_P11_COUNTERS, max_delta);
}

enum e2e_verdict e2e_p05_check(struct e2e_check *c, const uint8_t *data, size_t size,
                               uint16_t data_id, uint8_t max_delta)
{
    if (!data)
        return E2E_NO_NEW_DATA;
    if (size < 3 || (data[0] | data[1] << 8) != p05_crc(data, size, data_id))
        return E2E_WRONG_CRC;
    return follow(c, data[2], E2E_P05_COUNTERS, max_delta);
}

bool e2e_is_usable(enum e2e_verdict v)
{
    return v == E2E_OK || v == E2E_SOME_LOST;
}

const char *e2e_verdict_text(enum e2e_verdict v)
{
    static const char *const texts[] = {
        [E2E_OK] = "ok",
        [E2E_SOME_LOST] = "some lost",
        [E2E_NO_NEW_DATA] = "no new data",
        [E2E_REPEATED] = "repeated",
        [E2E_WRONG_SEQUENCE] = "wrong sequence",
        [E2E_WRONG_CRC] = "wrong CRC",
    };

    return texts[v];
}

static void clear(struct e2e_sm *sm)
{
    sm->n = 0;
}

struct tally {
    unsigned ok, error;
};

static struct tally add(struct e2e_sm *sm, unsigned size, enum e2e_verdict verdict)
{
    struct tally t = {0, 0};

    sm->window[sm->n % size] = verdict;
    if (++sm->n == 2 * size)
        sm->n = size; /* of a full window only the place in it counts */
    for (unsigned i = 0; i < size && i < sm->n; i++) {
        t.ok += e2e_is_usable(sm->window[i]);
        t.error += sm->window[i] == E2E_WRONG_CRC;
    }
    return t;
}

static enum e2e_state e2e_sm_follow(const struct e2e_sm *sm,
                                    const struct e2e_sm_config *c, struct tally t)
{
    switch (sm->state) {
    case E2E_INIT:
        if (t.error > c->max_error_init)
            return E2E_INVALID;
        return t.ok >= c->min_ok_init ? E2E_VALID : E2E_INIT;
    case E2E_VALID:
        return t.error <= c->max_error_valid && t.ok >= c->min_ok_valid ? E2E_VALID
                                                                        : E2E_INVALID;
    default:
        return t.error <= c->max_error_invalid && t.ok >= c->min_ok_invalid ? E2E_VALID
                                                                            : E2E_INVALID;
    }
}

enum e2e_state e2e_sm_check(struct e2e_sm *sm, const struct e2e_sm_config *cfg,
                            enum e2e_verdict verdict)
{
    if (sm->state == E2E_NODATA) {
        if (verdict != E2E_WRONG_CRC && verdict != E2E_NO_NEW_DATA)
            sm->state = E2E_INIT;
        return sm->state;
    }
    enum e2e_state state = e2e_sm_follow(sm, cfg, add(sm, cfg->window, verdict));
    if (state == E2E_INVALID && sm->state != E2E_INVALID)
        clear(sm);
    return sm->state = state;
}

void e2e_sm_reset(struct e2e_sm *sm)
{
    sm->state = E2E_NODATA;
    clear(sm);
}

const char *e2e_state_text(enum e2e_state state)
{
    static const char *const texts[E2E_STATES] = {[E2E_NODATA] = "no data",
                                                  [E2E_INIT] = "init",
                                                  [E2E_VALID] = "valid",
                                                  [E2E_INVALID] = "invalid"};

    return texts[state];
}

/* -- our frames -------------------------------------------------------------------------
 */

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
