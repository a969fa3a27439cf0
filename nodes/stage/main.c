/* SPDX-License-Identifier: MIT */
/* nodes/stage/main.c: "stage/command" and "stage/manual" -> the translation stage ->
 * "stage/state" */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/rt/loop.h"
#include "nodes/stage/mover.h"

static size_t counts(void *device, struct device_count *out)
{
    return stage_counts(device, out);
}

struct run {
    struct node *node;
    struct stage *stage;
    struct mover mover;
    bool heard; /* the scan */
    int64_t tell_due_ns;
};

static int64_t tell_due_ns(const void *self)
{
    return ((const struct run *)self)->tell_due_ns;
}

static int tell(void *self)
{
    struct run *r = self;
    struct node *node = r->node;
    struct mover *mover = &r->mover;
    Anlos__StageState state;
    int err = 0;

    if (mover_state(mover, node_now_ns(node), &state))
        err = node_publish(node, topic_stage_state(), 0, &state.base);
    const char *note = mover_note(mover);
    if (note)
        node_log(node, LOG_LEVEL_WARNING, "%s", note);
    if (r->heard && mover->text[0])
        node_state(node, ANLOS__HEALTH__STATE__DEGRADED, "%s", mover->text);
    else if (r->heard)
        node_state(node, ANLOS__HEALTH__STATE__READY, "ready");
    r->tell_due_ns = node_machine_ns(node) + mover_wait_ms(mover) * 1000000LL;
    return err;
}

static int take_manual(void *self, const struct node_message *in)
{
    struct run *r = self;

    mover_manual(&r->mover, (const Anlos__StageManual *)in->content);
    return 0;
}

static int take_status(void *self, const struct node_message *in)
{
    struct run *r = self;

    (void)in;
    r->heard = true;
    return 0;
}

static int take_command(void *self, const struct node_message *in)
{
    struct run *r = self;

    mover_command(&r->mover, (const Anlos__StageCommand *)in->content);
    return take_status(self, in);
}

/* Hearing the scan's status proves that its commands will come through. */
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

static int run(struct run *r)
{
    const struct loop loop = {.inputs = inputs, .timers = timers};

    mover_init(&r->mover, r->stage);
    node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "waits for scan");
    return loop_run(r->node, &loop, r);
}

int main(int argc, char **argv)
{
    struct run r = {0};
    struct error why = {""};
    int err = node_create(&r.node, "stage", "Moves the stage that carries the array.",
                          argc, argv);

    if (!r.node)
        return err;
    err = stage_open(&r.stage, node_launch(r.node)->stage.uri, node_clock(r.node), &why);
    if (err)
        node_log(r.node, LOG_LEVEL_ERROR, "%s", why.text);
    else {
        node_device(r.node, counts, r.stage);
        err = run(&r);
    }
    node_device(r.node, NULL, NULL);
    stage_close(r.stage);
    return node_finish(r.node, err);
}
