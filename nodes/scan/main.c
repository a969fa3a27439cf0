/* SPDX-License-Identifier: MIT */
/* nodes/scan/main.c: "health", "survey", "stage/state", "ping", "receipt" ->
 * "stage/command", "array/fire", "scan/status" */
#include <errno.h>
#include <string.h>

#include "msgs/topics.h"
#include "nodes/rt/loop.h"
#include "nodes/scan/fixed_scan.h"
#include "nodes/scan/peers.h"
#include "nodes/scan/scan.h"

#define STATUS_PERIOD_NS 200000000LL
#define STEP_NS          50000000LL /* what is too late is seen by then */
#define SILENCE_S        5.0

struct run {
    struct node *node;
    struct scan *scan;              /* this one, */
    struct fixed_scan *fixed;       /* or that one: the array stands */
    Anlos__ScanStatus__State state; /* published last */
    int64_t status_due_ns;
    int64_t step_due_ns;
};

static int create_scan(struct run *r, const char *const *needs, size_t n_needs)
{
    const struct launchfile *l = node_launch(r->node);
    const struct scan_config cfg = {.background = l->scan.background,
                                    .has_stage = launchfile_moves_stage(l),
                                    .window = l->scan.window,
                                    .retries = l->scan.retries,
                                    .timeout_s = l->scan.timeout_s,
                                    .silence_s = SILENCE_S,
                                    .needs = needs,
                                    .n_needs = n_needs};

    return scan_create(&r->scan, &cfg);
}

static int create_fixed(struct run *r, const char *const *needs, size_t n_needs)
{
    const struct launchfile *l = node_launch(r->node);
    const struct fixed_scan_config cfg = {
        .speakers = l->scan.speakers,
        .n_speakers = l->scan.n_speakers,
        .background_frames = l->scan.background ? l->scan.background_frames : 0,
        .timeout_s = l->scan.timeout_s,
        .silence_s = SILENCE_S,
        .needs = needs,
        .n_needs = n_needs};

    return fixed_scan_create(&r->fixed, &cfg);
}

/* A display or a report that is away does not keep an array that stands from listening.
 */
static bool is_needed(const char *node, bool fixed)
{
    static const char *const beside[] = {"scan", "record"};
    static const char *const aside[] = {"view", "report", "stage"};

    for (size_t i = 0; i < sizeof beside / sizeof *beside; i++)
        if (!strcmp(node, beside[i]))
            return false;
    for (size_t i = 0; fixed && i < sizeof aside / sizeof *aside; i++)
        if (!strcmp(node, aside[i]))
            return false;
    return true;
}

static int create(struct run *r)
{
    const struct launchfile *l = node_launch(r->node);
    const char *needs[PEERS_MAX];
    size_t n = 0;

    for (unsigned i = 0; i < l->n_nodes && n < PEERS_MAX; i++)
        if (is_needed(l->nodes[i], l->scan.fixed))
            needs[n++] = l->nodes[i];
    return l->scan.fixed ? create_fixed(r, needs, n) : create_scan(r, needs, n);
}

/* Of which process is it, and is that the one that was heard before? */
static bool hear(struct run *r, const struct node_message *in)
{
    int64_t now = node_now_ns(r->node);

    return r->fixed ? fixed_scan_hear(r->fixed, in->from, in->epoch_ns, now)
                    : scan_hear(r->scan, in->from, in->epoch_ns, now);
}

static int take_survey(void *self, const struct node_message *in)
{
    struct run *r = self;
    const Anlos__Survey *survey = (const Anlos__Survey *)in->content;

    if (!hear(r, in))
        return 0;
    return r->fixed ? fixed_scan_survey(r->fixed, survey) : scan_survey(r->scan, survey);
}

static int take_health(void *self, const struct node_message *in)
{
    struct run *r = self;
    const Anlos__Health *health = (const Anlos__Health *)in->content;

    if (!hear(r, in))
        return 0;
    if (r->fixed)
        fixed_scan_health(r->fixed, in->from, health);
    else
        scan_health(r->scan, in->from, health);
    return 0;
}

static int take_ping(void *self, const struct node_message *in)
{
    struct run *r = self;
    const Anlos__Ping *ping = (const Anlos__Ping *)in->content;

    if (!hear(r, in))
        return 0;
    if (r->fixed)
        fixed_scan_ping(r->fixed, ping, node_now_ns(r->node));
    else
        scan_ping(r->scan, ping, node_now_ns(r->node));
    return 0;
}

static int take_stage(void *self, const struct node_message *in)
{
    struct run *r = self;

    if (hear(r, in) && r->scan)
        scan_stage(r->scan, (const Anlos__StageState *)in->content);
    return 0;
}

static int take_receipt(void *self, const struct node_message *in)
{
    struct run *r = self;

    if (hear(r, in) && r->scan)
        scan_receipt(r->scan, (const Anlos__Receipt *)in->content, node_now_ns(r->node));
    return 0;
}

static void publish_status(struct run *r)
{
    int64_t now = node_now_ns(r->node);
    Anlos__ScanStatus status;

    if (r->fixed)
        fixed_scan_status(r->fixed, now, &status);
    else
        scan_status(r->scan, now, &status);
    if (status.state == r->state && now < r->status_due_ns)
        return;
    if (status.state != r->state && status.text[0])
        node_log(r->node,
                 status.state == ANLOS__SCAN_STATUS__STATE__FAILED   ? LOG_LEVEL_ERROR
                 : status.state == ANLOS__SCAN_STATUS__STATE__PAUSED ? LOG_LEVEL_WARNING
                                                                     : LOG_LEVEL_INFO,
                 "%s%s",
                 status.state == ANLOS__SCAN_STATUS__STATE__PAUSED ? "pauses: " : "",
                 status.text);
    r->state = status.state;
    r->status_due_ns = now + STATUS_PERIOD_NS;
    node_publish(r->node, topic_scan_status(), 0, &status.base);
}

static int64_t step_due_ns(const void *self)
{
    return ((const struct run *)self)->step_due_ns;
}

static int step(void *self)
{
    struct run *r = self;
    int64_t now = node_now_ns(r->node);
    struct scan_action action = {.move = false};

    if (r->fixed)
        action.fire = fixed_scan_step(r->fixed, now, &action.fire_command);
    else
        scan_step(r->scan, now, &action);
    if (action.move)
        node_publish(r->node, topic_stage_command(), 0, &action.stage_command.base);
    if (action.fire)
        node_publish(r->node, topic_fire(), 0, &action.fire_command.base);
    publish_status(r);
    r->step_due_ns = node_machine_ns(r->node) + STEP_NS;
    return 0;
}

static void start(void *self)
{
    node_state(((const struct run *)self)->node, ANLOS__HEALTH__STATE__READY, "ready");
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

int main(int argc, char **argv)
{
    struct run r = {.state = (Anlos__ScanStatus__State)-1};
    int err =
        node_create(&r.node, "scan",
                    "Steps the stage, fires the array, takes again what was lost; or "
                    "keeps an array going that stands.",
                    argc, argv);

    if (!r.node)
        return err;
    err = create(&r);
    const struct loop loop = {.inputs = inputs, .timers = timers, .start = start};
    if (!err)
        err = loop_run(r.node, &loop, &r);
    scan_destroy(r.scan);
    fixed_scan_destroy(r.fixed);
    return node_finish(r.node, err);
}
