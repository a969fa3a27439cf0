/* SPDX-License-Identifier: MIT */
/* nodes/stage/main.c: "stage/command" and "stage/manual" -> the translation stage ->
 * "stage/state" */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/rt/node.h"
#include "nodes/stage/mover.h"

static size_t counts(void *device, struct device_count *out)
{
    return stage_counts(device, out);
}

static int subscribe(struct node *node)
{
    /* Hearing the scan's status proves that its commands will come through. */
    const struct topic *const topics[] = {topic_stage_command(), topic_stage_manual(),
                                          topic_scan_status()};
    int err = 0;

    for (size_t i = 0; i < sizeof topics / sizeof *topics && !err; i++)
        err = node_subscribe(node, topics[i]);
    return err;
}

static int tell(struct node *node, struct mover *mover, bool heard)
{
    Anlos__StageState state;
    int err = 0;

    if (mover_state(mover, node_now_ns(node), &state))
        err = node_publish(node, topic_stage_state(), 0, &state.base);
    const char *note = mover_note(mover);
    if (note)
        node_log(node, LOG_LEVEL_WARNING, "%s", note);
    if (heard && mover->text[0])
        node_state(node, ANLOS__HEALTH__STATE__DEGRADED, "%s", mover->text);
    else if (heard)
        node_state(node, ANLOS__HEALTH__STATE__READY, "ready");
    return err;
}

static int run(struct node *node, struct stage *stage)
{
    struct mover mover;
    struct node_message in;
    bool heard = false; /* the scan */
    int err = subscribe(node);

    mover_init(&mover, stage);
    node_state(node, ANLOS__HEALTH__STATE__STARTING, "waits for scan");
    while (!err) {
        err = tell(node, &mover, heard);
        if (!err)
            err = node_next(node, &in, mover_wait_ms(&mover));
        if (err == -ETIMEDOUT) {
            err = 0;
        } else if (!err && in.topic == topic_stage_manual()) {
            mover_manual(&mover, (const Anlos__StageManual *)in.content);
        } else if (!err) {
            heard = true;
            if (in.topic == topic_stage_command())
                mover_command(&mover, (const Anlos__StageCommand *)in.content);
        }
    }
    return err;
}

int main(int argc, char **argv)
{
    struct node *node;
    struct stage *stage = NULL;
    struct error why = {""};
    int err = node_create(&node, "stage", "Moves the stage that carries the array.", argc,
                          argv);

    if (!node)
        return err;
    err = stage_open(&stage, node_launch(node)->stage.uri, node_clock(node), &why);
    if (err)
        node_log(node, LOG_LEVEL_ERROR, "%s", why.text);
    else {
        node_device(node, counts, stage);
        err = run(node, stage);
    }
    node_device(node, NULL, NULL);
    stage_close(stage);
    return node_finish(node, err);
}
