#include "nodes/scan/carriage.h"

#include <stdio.h>

#define RESEND_NS 500000000LL /* without a sign that the command was accepted */

void carriage_init(struct carriage *c)
{
    *c = (struct carriage){.commanded = false};
}

void carriage_state(struct carriage *c, const Anlos__StageState *state)
{
    c->position_m = state->position_m;
    /* The target too: an id may be left from a scan that was restarted. */
    c->accepted = c->commanded && state->command_id == c->id &&
                  state->target_m == c->target_m;
    c->idle = state->state == ANLOS__STAGE_STATE__STATE__IDLE;
    c->refused = state->state == ANLOS__STAGE_STATE__STATE__REFUSED;
    c->fault = state->state == ANLOS__STAGE_STATE__STATE__FAULT;
    c->held = state->held;
    snprintf(c->text, sizeof c->text, "%s", state->text);
}

void carriage_forget(struct carriage *c)
{
    c->commanded = c->accepted = false;
    c->fault = c->held = false;
}

bool carriage_is_paused(const struct carriage *c)
{
    return c->fault || c->held;
}

static enum carriage_progress send_new(struct carriage *c, double target_m,
                                       int64_t now_ns)
{
    c->commanded = true;
    c->accepted = false;
    c->id++;
    c->target_m = target_m;
    c->sent_ns = now_ns;
    return CARRIAGE_SEND;
}

enum carriage_progress carriage_go(struct carriage *c, double target_m, int64_t now_ns)
{
    if (carriage_is_paused(c)) {
        c->commanded = c->accepted = false;
        return CARRIAGE_PAUSED;
    }
    if (!c->commanded || c->target_m != target_m)
        return send_new(c, target_m, now_ns);
    if (!c->accepted) {
        if (now_ns - c->sent_ns < RESEND_NS)
            return CARRIAGE_MOVING;
        c->sent_ns = now_ns;
        return CARRIAGE_SEND;
    }
    if (c->refused)
        return CARRIAGE_FAILED;
    return c->idle ? CARRIAGE_THERE : CARRIAGE_MOVING;
}
