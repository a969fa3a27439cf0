/* SPDX-License-Identifier: MIT */
/* nodes/recon/main.c: "survey", "traces", "scan/status" -> "volume", "receipt"; of a
 * fixed array: nodes/recon/fixed.c */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/recon/fixed.h"
#include "nodes/recon/recon.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/node.h"

#define REPEAT_NS         2000000000LL /* the last volume, for whoever missed it */
#define PLAN_S            60.0         /* at most: of a fine volume */
#define IMAGE_S           600.0        /* of a sharpened one */
#define PREVIEW_PAUSE     4 /* times what a preview took: most time is for pings */
#define PREVIEW_PAUSE_MIN 100000000LL

struct run {
    struct node *node;
    struct recon *recon;
    struct node_dropped dropped;
    int64_t scan_epoch_ns;
    int64_t preview_due_ns, repeat_due_ns;
    bool has_final; /* of what is in: */
    Anlos__Volume final;
};

static size_t counts(void *ctx, struct device_count *out)
{
    const struct run *r = ctx;

    return node_dropped_count(&r->dropped, out);
}

static int create(struct run *r)
{
    struct pipeline_config cfg;

    launchfile_pipeline(&cfg, node_launch(r->node));
    return recon_create(&r->recon, &cfg.scan);
}

static void publish_volume(struct run *r, Anlos__Volume *v)
{
    int64_t taken = recon_taken_ns(r->recon);

    v->imaging_s = 1e-9 * (double)(node_now_ns(r->node) - taken);
    node_publish(r->node, topic_volume(), recon_capture_ns(r->recon), &v->base);
}

static void publish_final(struct run *r)
{
    node_busy(r->node, IMAGE_S);
    recon_image(r->recon, false, &r->final);
    publish_volume(r, &r->final);
    r->has_final = true;
    r->repeat_due_ns = node_machine_ns(r->node) + REPEAT_NS;
    node_log(r->node, LOG_LEVEL_DEBUG, "volume of %zu pings, %.1f ms after the last",
             recon_pings(r->recon), 1e3 * r->final.imaging_s);
}

static void publish_preview(struct run *r)
{
    Anlos__Volume v;
    int64_t start = node_machine_ns(r->node);

    node_busy(r->node, IMAGE_S);
    recon_image(r->recon, true, &v);
    publish_volume(r, &v);
    int64_t now = node_machine_ns(r->node);
    int64_t pause = PREVIEW_PAUSE * (now - start);
    r->preview_due_ns = now + (pause > PREVIEW_PAUSE_MIN ? pause : PREVIEW_PAUSE_MIN);
}

static int take_survey(struct run *r, const Anlos__Survey *survey)
{
    struct error why = {""};

    if (!recon_is_planned(r->recon))
        node_busy(r->node, PLAN_S);
    int err = recon_survey(r->recon, survey, &why);

    if (err) {
        node_state(r->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else {
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "ready");
        node_dropped_say(r->node, &r->dropped);
    }
    return err;
}

static void take_traces(struct run *r, const struct node_message *in)
{
    Anlos__Receipt receipt;
    char note[128];

    r->dropped.n += !recon_is_planned(r->recon);
    recon_traces(r->recon, (const Anlos__Traces *)in->content, in->capture_ns,
                 node_now_ns(r->node), &receipt, note, sizeof note);
    node_publish(r->node, topic_receipt(), in->capture_ns, &receipt.base);
    if (note[0])
        node_log(r->node, LOG_LEVEL_WARNING, "%s", note);
    if (!recon_is_complete(r->recon))
        r->has_final = false;
    else if (!r->has_final)
        publish_final(r);
}

static void take_status(struct run *r, const struct node_message *in)
{
    const Anlos__ScanStatus *status = (const Anlos__ScanStatus *)in->content;

    /* A scan was restarted, and so must the image be. */
    if (r->scan_epoch_ns && in->epoch_ns != r->scan_epoch_ns) {
        recon_reset(r->recon);
        r->has_final = false;
    }
    r->scan_epoch_ns = in->epoch_ns;
    if ((status->state == ANLOS__SCAN_STATUS__STATE__DONE ||
         status->state == ANLOS__SCAN_STATUS__STATE__FAILED) &&
        !r->has_final && recon_pings(r->recon))
        publish_final(r);
}

static bool wants_preview(const struct run *r)
{
    return node_launch(r->node)->recon.preview && recon_has_new_position(r->recon) &&
           !recon_is_complete(r->recon) && node_machine_ns(r->node) >= r->preview_due_ns;
}

static void idle(struct run *r)
{
    if (wants_preview(r)) {
        publish_preview(r);
    } else if (r->has_final && node_machine_ns(r->node) >= r->repeat_due_ns) {
        r->final.repeated = true;
        node_publish(r->node, topic_volume(), recon_capture_ns(r->recon), &r->final.base);
        r->repeat_due_ns = node_machine_ns(r->node) + REPEAT_NS;
    }
}

static int run(struct run *r)
{
    struct node_message in;
    int err = node_subscribe(r->node, topic_survey());

    if (!err)
        err = node_subscribe(r->node, topic_traces());
    if (!err)
        err = node_subscribe(r->node, topic_scan_status());
    node_device(r->node, counts, r);
    node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "waits for the survey");
    while (!err) {
        err = node_next(r->node, &in, wants_preview(r) ? 0 : 100);
        if (err == -ETIMEDOUT) {
            idle(r);
            err = 0;
        } else if (!err && in.topic == topic_survey())
            err = take_survey(r, (const Anlos__Survey *)in.content);
        else if (!err && in.topic == topic_traces())
            take_traces(r, &in);
        else if (!err)
            take_status(r, &in);
    }
    node_device(r->node, NULL, NULL);
    return err;
}

int main(int argc, char **argv)
{
    struct run r = {.dropped = {.count = "traces before the survey"}};
    int err = node_create(&r.node, "recon",
                          "Images what the echoes show, while they come in.", argc, argv);

    if (!r.node)
        return err;
    if (node_launch(r.node)->scan.fixed)
        return node_finish(r.node, fixed_run(r.node));
    err = create(&r);
    if (!err)
        err = run(&r);
    recon_destroy(r.recon);
    return node_finish(r.node, err);
}
