/* SPDX-License-Identifier: MIT */
#include "nodes/scan/controller.h"

#include "msgs/topics.h"

#define STATUS_PERIOD_NS 200000000LL
#define STEP_NS          50000000LL /* what is too late is seen by then */

/* Of which process is it, and is that the one that was heard before? */
static bool hear(struct controller *c, const struct node_message *in)
{
    int64_t now = node_now_ns(c->node);

    return c->fixed ? fixed_scan_hear(c->fixed, in->from, in->epoch_ns, now)
                    : scan_hear(c->scan, in->from, in->epoch_ns, now);
}

static int take_survey(void *self, const struct node_message *in)
{
    struct controller *c = self;
    const Anlos__Survey *survey = (const Anlos__Survey *)in->content;

    if (!hear(c, in))
        return 0;
    return c->fixed ? fixed_scan_survey(c->fixed, survey) : scan_survey(c->scan, survey);
}

static int take_health(void *self, const struct node_message *in)
{
    struct controller *c = self;
    const Anlos__Health *health = (const Anlos__Health *)in->content;

    if (!hear(c, in))
        return 0;
    if (c->fixed)
        fixed_scan_health(c->fixed, in->from, health);
    else
        scan_health(c->scan, in->from, health);
    return 0;
}

static int take_ping(void *self, const struct node_message *in)
{
    struct controller *c = self;
    const Anlos__Ping *ping = (const Anlos__Ping *)in->content;

    if (!hear(c, in))
        return 0;
    if (c->fixed)
        fixed_scan_ping(c->fixed, ping, node_now_ns(c->node));
    else
        scan_ping(c->scan, ping, node_now_ns(c->node));
    return 0;
}

static int take_stage(void *self, const struct node_message *in)
{
    struct controller *c = self;

    if (hear(c, in) && c->scan)
        scan_stage(c->scan, (const Anlos__StageState *)in->content, in->capture_ns);
    return 0;
}

static int take_receipt(void *self, const struct node_message *in)
{
    struct controller *c = self;

    if (hear(c, in) && c->scan)
        scan_receipt(c->scan, (const Anlos__Receipt *)in->content, node_now_ns(c->node));
    return 0;
}

static void publish_status(struct controller *c)
{
    int64_t now = node_now_ns(c->node);
    Anlos__ScanStatus status;

    if (c->fixed)
        fixed_scan_status(c->fixed, now, &status);
    else
        scan_status(c->scan, now, &status);
    if (status.state == c->state && now < c->status_due_ns)
        return;
    if (status.state != c->state && status.text[0])
        node_log(c->node,
                 status.state == ANLOS__SCAN_STATUS__STATE__FAILED   ? LOG_LEVEL_ERROR
                 : status.state == ANLOS__SCAN_STATUS__STATE__PAUSED ? LOG_LEVEL_WARNING
                                                                     : LOG_LEVEL_INFO,
                 "%s%s",
                 status.state == ANLOS__SCAN_STATUS__STATE__PAUSED ? "pauses: " : "",
                 status.text);
    c->state = status.state;
    c->status_due_ns = now + STATUS_PERIOD_NS;
    node_publish(c->node, topic_scan_status(), 0, &status.base);
}

static int64_t step_due_ns(const void *self)
{
    return ((const struct controller *)self)->step_due_ns;
}

static int step(void *self)
{
    struct controller *c = self;
    int64_t now = node_now_ns(c->node);
    struct scan_action action = {.move = false};

    if (c->fixed)
        action.fire = fixed_scan_step(c->fixed, now, &action.fire_command);
    else
        scan_step(c->scan, now, &action);
    if (action.move)
        node_publish(c->node, topic_stage_command(), 0, &action.stage_command.base);
    if (action.fire)
        node_publish(c->node, topic_fire(), 0, &action.fire_command.base);
    publish_status(c);
    c->step_due_ns = node_machine_ns(c->node) + STEP_NS;
    return 0;
}

static void start(void *self)
{
    node_state(((const struct controller *)self)->node, ANLOS__HEALTH__STATE__READY,
               "ready");
}

static const struct loop_input inputs[] = {
    {.topic = topic_health, .take = take_health},
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_stage_state, .take = take_stage},
    {.topic = topic_ping, .take = take_ping},
    {.topic = topic_receipt, .take = take_receipt},
    {.topic = NULL},
};

static const struct loop_timer timers[] = {
    {.due_ns = step_due_ns, .run = step, .when = LOOP_EACH},
    {.run = NULL},
};

static void destroy(void *self)
{
    struct controller *c = self;

    scan_destroy(c->scan);
    fixed_scan_destroy(c->fixed);
}

const struct loop controller_loop = {
    .inputs = inputs, .timers = timers, .start = start, .close = destroy};
