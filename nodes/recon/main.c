/* SPDX-License-Identifier: MIT */
/* nodes/recon/main.c: "survey", "traces", "scan/status" -> "volume", "receipt"; of a
 * fixed array: nodes/recon/fixed.c */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/recon/fixed.h"
#include "nodes/recon/recon.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/loop.h"

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

static int publish_preview(void *self)
{
    struct run *r = self;
    Anlos__Volume v;
    int64_t start = node_machine_ns(r->node);

    node_busy(r->node, IMAGE_S);
    recon_image(r->recon, true, &v);
    publish_volume(r, &v);
    int64_t now = node_machine_ns(r->node);
    int64_t pause = PREVIEW_PAUSE * (now - start);
    r->preview_due_ns = now + (pause > PREVIEW_PAUSE_MIN ? pause : PREVIEW_PAUSE_MIN);
    return 0;
}

static int take_survey(void *self, const struct node_message *in)
{
    struct run *r = self;
    struct error why = {""};

    if (!recon_is_planned(r->recon))
        node_busy(r->node, PLAN_S);
    int err = recon_survey(r->recon, (const Anlos__Survey *)in->content, &why);

    if (err) {
        node_state(r->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else {
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "ready");
        node_dropped_say(r->node, &r->dropped);
    }
    return err;
}

static int take_traces(void *self, const struct node_message *in)
{
    struct run *r = self;
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
    return 0;
}

static int take_status(void *self, const struct node_message *in)
{
    struct run *r = self;
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
    return 0;
}

static int64_t preview_due_ns(const void *self)
{
    const struct run *r = self;
    bool wanted = node_launch(r->node)->recon.preview &&
                  recon_has_new_position(r->recon) && !recon_is_complete(r->recon);

    return wanted ? r->preview_due_ns : LOOP_NEVER;
}

static int64_t repeat_due_ns(const void *self)
{
    const struct run *r = self;

    return r->has_final ? r->repeat_due_ns : LOOP_NEVER;
}

static int repeat_final(void *self)
{
    struct run *r = self;

    r->final.repeated = true;
    node_publish(r->node, topic_volume(), recon_capture_ns(r->recon), &r->final.base);
    r->repeat_due_ns = node_machine_ns(r->node) + REPEAT_NS;
    return 0;
}

static const struct loop_input inputs[] = {
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_traces, .take = take_traces},
    {.topic = topic_scan_status, .take = take_status},
    {.topic = NULL},
};

/* Of all pings that are there. */
static const struct loop_timer timers[] = {
    {.due_ns = preview_due_ns, .run = publish_preview, .when = LOOP_LAST},
    {.due_ns = repeat_due_ns, .run = repeat_final, .when = LOOP_LAST},
    {.run = NULL},
};

static int run(struct run *r)
{
    const struct loop loop = {.inputs = inputs, .timers = timers};

    node_device(r->node, counts, r);
    node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "waits for the survey");
    int err = loop_run(r->node, &loop, r);
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
