#include "msgs/can/e2e_sm.h"

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

static enum e2e_state follow(const struct e2e_sm *sm, const struct e2e_sm_config *c,
                             struct tally t)
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
    enum e2e_state state = follow(sm, cfg, add(sm, cfg->window, verdict));
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
