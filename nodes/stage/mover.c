#include "nodes/stage/mover.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#define MOVING_PERIOD_NS 50000000LL
#define REST_PERIOD_NS   500000000LL

static const Anlos__StageState__State states[] = {
    [STAGE_IDLE] = ANLOS__STAGE_STATE__STATE__IDLE,
    [STAGE_MOVING] = ANLOS__STAGE_STATE__STATE__MOVING,
    [STAGE_SETTLING] = ANLOS__STAGE_STATE__STATE__SETTLING,
    [STAGE_FAULT] = ANLOS__STAGE_STATE__STATE__FAULT,
};

void mover_init(struct mover *m, struct stage *stage)
{
    *m = (struct mover){.stage = stage};
}

void mover_command(struct mover *m, const Anlos__StageCommand *command)
{
    /* A scan that was restarted counts from 1 again: the target tells it apart. */
    if (m->commanded && command->id == m->command_id && command->target_m == m->target_m)
        return;
    m->commanded = true;
    m->command_id = command->id;
    m->target_m = command->target_m;
    m->refusal[0] = '\0';
    int err = stage_move(m->stage, command->target_m);
    if (err)
        snprintf(m->refusal, sizeof m->refusal, "cannot move to %.4f m: %s",
                 command->target_m,
                 err == -ERANGE ? "it does not reach that far" : strerror(-err));
}

bool mover_state(struct mover *m, int64_t now_ns, Anlos__StageState *out)
{
    struct stage_status status;
    bool refused = m->refusal[0];

    stage_status(m->stage, &status);
    anlos__stage_state__init(out);
    out->state = refused ? ANLOS__STAGE_STATE__STATE__FAULT : states[status.motion];
    out->command_id = m->command_id;
    out->position_m = status.position_m;
    out->target_m = m->commanded ? m->target_m : status.target_m;
    snprintf(m->text, sizeof m->text, "%s", refused ? m->refusal : status.text);

    int64_t period = out->state == ANLOS__STAGE_STATE__STATE__MOVING ||
                             out->state == ANLOS__STAGE_STATE__STATE__SETTLING
                         ? MOVING_PERIOD_NS
                         : REST_PERIOD_NS;
    bool due = !m->told || out->state != m->last.state ||
               out->command_id != m->last.command_id ||
               out->target_m != m->last.target_m || now_ns - m->last_ns >= period;
    if (!due)
        return false;
    m->told = true;
    m->last = *out;
    m->last_ns = now_ns;
    out->text = m->text;
    return true;
}

int mover_wait_ms(const struct mover *m)
{
    bool at_rest = m->told && (m->last.state == ANLOS__STAGE_STATE__STATE__IDLE ||
                               m->last.state == ANLOS__STAGE_STATE__STATE__FAULT);

    return at_rest ? 100 : 5;
}
