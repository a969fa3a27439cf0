/* SPDX-License-Identifier: MIT */
#include "nodes/stage/mover.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "msgs/topics.h"

#define MOVING_PERIOD_NS 50000000LL
#define REST_PERIOD_NS   500000000LL

static const Anlos__StageState__State states[] = {
    [STAGE_IDLE] = ANLOS__STAGE_STATE__STATE__IDLE,
    [STAGE_MOVING] = ANLOS__STAGE_STATE__STATE__MOVING,
    [STAGE_SETTLING] = ANLOS__STAGE_STATE__STATE__SETTLING,
    [STAGE_FAULT] = ANLOS__STAGE_STATE__STATE__FAULT,
};

void mover_init(struct mover *m, struct node *node, struct stage *stage)
{
    *m = (struct mover){.node = node, .stage = stage};
}

static void say_refusal(const struct mover *m, char out[MOVER_TEXT_SIZE],
                        const char *what, double target_m, int err)
{
    char why[STAGE_TEXT_SIZE];
    struct stage_status status;

    stage_status(m->stage, &status);
    stage_refusal(&status, err, why);
    snprintf(out, MOVER_TEXT_SIZE, "cannot %s %.4f m: %.100s", what, target_m, why);
}

void mover_command(struct mover *m, const Anlos__StageCommand *command)
{
    if (m->held)
        return;
    /* A scan that was restarted counts from 1 again: the target tells it apart. */
    if (m->commanded && command->id == m->command_id && command->target_m == m->target_m)
        return;
    m->commanded = true;
    m->command_id = command->id;
    m->target_m = command->target_m;
    m->refusal[0] = '\0';
    char what[48] = "move to";
    if (command->speed_m_s > 0)
        snprintf(what, sizeof what, "move at %.4f m/s to", command->speed_m_s);
    int err = command->speed_m_s > 0
                  ? stage_move_at(m->stage, command->target_m, command->speed_m_s)
                  : stage_move(m->stage, command->target_m);
    if (err && err != -ESTALE) /* which the stage's own fault says better */
        say_refusal(m, m->refusal, what, command->target_m, err);
}

/* The scan's command is void from now on, so that it is given again. */
static void take_by_hand(struct mover *m)
{
    m->held = true;
    m->homing = false;
    m->commanded = false;
    m->command_id = 0;
    m->refusal[0] = '\0';
}

static void release(struct mover *m)
{
    struct stage_status status;

    stage_status(m->stage, &status);
    if (status.motion == STAGE_FAULT)
        snprintf(m->manual_refusal, sizeof m->manual_refusal,
                 "it is in fault: home it, which also releases it");
    else
        m->held = m->homing = false;
}

void mover_manual(struct mover *m, const Anlos__StageManual *command)
{
    int err = 0;

    /* They come again and again: the one before may still do so. */
    if (command->id == m->manual_id || command->id == m->manual_id_before)
        return;
    m->manual_id_before = m->manual_id;
    m->manual_id = command->id;
    m->manual_refusal[0] = '\0';
    switch (command->verb) {
    case ANLOS__STAGE_MANUAL__VERB__HOME:
        take_by_hand(m);
        m->homing = true;
        err = stage_home(m->stage);
        break;
    case ANLOS__STAGE_MANUAL__VERB__MOVE:
        err = stage_move(m->stage, command->target_m);
        if (!err)
            take_by_hand(m);
        break;
    case ANLOS__STAGE_MANUAL__VERB__STOP:
        take_by_hand(m);
        err = stage_stop(m->stage);
        break;
    case ANLOS__STAGE_MANUAL__VERB__RELEASE:
        release(m);
        break;
    default:
        err = -ENOTSUP;
    }
    if (err)
        say_refusal(m, m->manual_refusal, "move by hand to", command->target_m, err);
}

const char *mover_note(struct mover *m)
{
    if (m->note_told || !m->note[0])
        return NULL;
    m->note_told = true;
    return m->note;
}

static void take_note(struct mover *m, const char *note)
{
    if (!strcmp(note, m->note))
        return;
    snprintf(m->note, sizeof m->note, "%s", note);
    m->note_told = false;
}

static void write_text(struct mover *m, const struct stage_status *status)
{
    if (m->refusal[0])
        snprintf(m->text, sizeof m->text, "%s", m->refusal);
    else if (status->motion == STAGE_FAULT || !m->held)
        snprintf(m->text, sizeof m->text, "%s", status->text);
    else
        snprintf(m->text, sizeof m->text,
                 m->homing ? "is homed by hand" : "held by hand");
}

static bool is_news(const struct mover *m, const Anlos__StageState *s)
{
    const Anlos__StageState *last = &m->last;

    return !m->told || s->state != last->state || s->command_id != last->command_id ||
           s->target_m != last->target_m || s->manual_id != last->manual_id ||
           s->held != last->held || s->homed != last->homed;
}

bool mover_state(struct mover *m, int64_t now_ns, Anlos__StageState *out)
{
    struct stage_status status;

    stage_status(m->stage, &status);
    take_note(m, status.note);
    if (m->homing && status.motion == STAGE_IDLE && status.homed)
        m->held = m->homing = false;
    anlos__stage_state__init(out);
    out->state = m->refusal[0] ? ANLOS__STAGE_STATE__STATE__REFUSED
                               : states[status.motion];
    out->command_id = m->command_id;
    out->position_m = status.position_m;
    out->target_m = m->commanded ? m->target_m : status.target_m;
    out->homed = status.homed;
    out->held = m->held;
    out->manual_id = m->manual_id;
    write_text(m, &status);

    int64_t period = out->state == ANLOS__STAGE_STATE__STATE__MOVING ||
                             out->state == ANLOS__STAGE_STATE__STATE__SETTLING
                         ? MOVING_PERIOD_NS
                         : REST_PERIOD_NS;
    if (!is_news(m, out) && now_ns - m->last_ns < period)
        return false;
    m->at_ns = status.at_ns;
    m->told = true;
    m->last = *out;
    m->last_ns = now_ns;
    out->text = m->text;
    out->manual_refusal = m->manual_refusal;
    return true;
}

/* How long the hardware may be left alone. */
static int mover_wait_ms(const struct mover *m)
{
    bool moves = m->last.state == ANLOS__STAGE_STATE__STATE__MOVING ||
                 m->last.state == ANLOS__STAGE_STATE__STATE__SETTLING;

    return m->told && !moves ? 100 : 5;
}

static int take_manual(void *self, const struct node_message *in)
{
    mover_manual(self, (const Anlos__StageManual *)in->content);
    return 0;
}

/* Hearing the scan's status proves that its commands will come through. */
static int take_status(void *self, const struct node_message *in)
{
    (void)in;
    ((struct mover *)self)->heard = true;
    return 0;
}

static int take_command(void *self, const struct node_message *in)
{
    mover_command(self, (const Anlos__StageCommand *)in->content);
    return take_status(self, in);
}

static int64_t tell_due_ns(const void *self)
{
    return ((const struct mover *)self)->tell_due_ns;
}

static int tell(void *self)
{
    struct mover *m = self;
    Anlos__StageState state;
    int err = 0;

    if (mover_state(m, node_now_ns(m->node), &state))
        err = node_publish(m->node, topic_stage_state(), m->at_ns, &state.base);
    const char *note = mover_note(m);
    if (note)
        node_log(m->node, LOG_LEVEL_WARNING, "%s", note);
    if (m->heard && m->text[0])
        node_state(m->node, ANLOS__HEALTH__STATE__DEGRADED, "%s", m->text);
    else if (m->heard)
        node_state(m->node, ANLOS__HEALTH__STATE__READY, "ready");
    m->tell_due_ns = node_machine_ns(m->node) + mover_wait_ms(m) * 1000000LL;
    return err;
}

static size_t counts(void *self, struct device_count *out)
{
    return stage_counts(((struct mover *)self)->stage, out);
}

static void close_stage(void *self)
{
    stage_close(((struct mover *)self)->stage);
}

static const struct loop_input inputs[] = {
    {.topic = topic_stage_command, .take = take_command},
    {.topic = topic_stage_manual, .take = take_manual},
    {.topic = topic_scan_status, .take = take_status},
    {.topic = NULL},
};

static const struct loop_timer timers[] = {
    {.due_ns = tell_due_ns, .run = tell, .when = LOOP_EACH},
    {.run = NULL},
};

const struct loop mover_loop = {.inputs = inputs,
                                .timers = timers,
                                .waits_for = "scan",
                                .counts = counts,
                                .close = close_stage};
