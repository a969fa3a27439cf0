/* SPDX-License-Identifier: MIT */
/* nodes/dsp/main.c: "survey", "ping", "ego", "ambient" -> pulse compression -> "traces",
 * "receipt"; where walls are from echoes, "echoes" */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/dsp/dsp.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/node.h"

struct run {
    struct node *node;
    struct dsp *dsp;
    struct node_dropped dropped;
    uint64_t blanked; /* pings */
};

static size_t counts(void *ctx, struct device_count *out)
{
    const struct run *r = ctx;

    out[0] = (struct device_count){"pings blanked", r->blanked};
    return 1 + node_dropped_count(&r->dropped, out + 1);
}

static int take_survey(struct run *r, const Anlos__Survey *survey)
{
    struct error why = {""};
    int err = dsp_survey(r->dsp, survey, &why);

    if (err) {
        node_state(r->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else {
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "ready");
        node_dropped_say(r->node, &r->dropped);
    }
    return err;
}

/* Said when the text changes, which is in tenths of a kelvin. */
static void show_air(struct node *node, const struct air *air)
{
    char text[160];

    air_text(air, text, sizeof text);
    if (air_is_distrusted(air))
        node_state(node, ANLOS__HEALTH__STATE__DEGRADED,
                   "%s: too much to subtract it well; record it again", text);
    else
        node_state(node, ANLOS__HEALTH__STATE__READY, "%s", text[0] ? text : "ready");
    if (text[0] && air->pings == air->expected)
        node_log(node, LOG_LEVEL_INFO, "%zu of %zu backgrounds corrected: %s",
                 air->corrected, air->pings, text);
}

static void tell_faults(struct node *node, const struct frontend_faults *c)
{
    if (!c->n)
        return;
    node_fault(node, NODE_FAULT_CHANNELS_SILENT, c->silent, c->n);
    node_fault(node, NODE_FAULT_ELEMENTS_DAMAGED, c->damaged, c->n);
    node_fault(node, NODE_FAULT_CHANNELS_CLIPPED, c->clipped, c->n);
}

/* A recording is played no faster than it is used: of an array that stands, too, each
 * ping is answered then. */
static void acknowledge(struct node *node, const struct node_message *in)
{
    const Anlos__Ping *ping = (const Anlos__Ping *)in->content;
    Anlos__Receipt receipt = ANLOS__RECEIPT__INIT;

    receipt.scan = ping->scan;
    receipt.pass = ping->pass;
    receipt.position = ping->position;
    receipt.speaker = ping->speaker;
    receipt.frame = ping->frame;
    receipt.usable = ping->pass == ANLOS__PASS__BACKGROUND;
    node_publish(node, topic_receipt(), in->capture_ns, &receipt.base);
}

/* What cannot be sent is logged by node_publish, and retaken by the scan. */
static void take_ping(struct run *r, const struct node_message *in)
{
    struct node *node = r->node;
    struct dsp *dsp = r->dsp;
    struct dsp_output out;

    r->dropped.n += !dsp_is_planned(dsp);
    dsp_ping(dsp, (const Anlos__Ping *)in->content, in->capture_ns, &out);
    r->blanked += out.has_traces && out.traces.blanked;
    if (out.has_traces)
        node_publish(node, topic_traces(), in->capture_ns, &out.traces.base);
    if (out.has_echoes)
        node_publish(node, topic_echoes(), in->capture_ns, &out.echoes.base);
    if (out.has_traces)
        show_air(node, dsp_air(dsp));
    if (out.has_receipt)
        node_publish(node, topic_receipt(), in->capture_ns, &out.receipt.base);
    else if (!out.has_traces && node_is_replayed(node))
        acknowledge(node, in);
    if (out.note[0])
        node_log(node, LOG_LEVEL_WARNING, "%s", out.note);
    tell_faults(node, &out.faults);
}

static int run(struct run *r)
{
    struct node_message in;
    int err = node_subscribe(r->node, topic_survey());

    if (!err)
        err = node_subscribe(r->node, topic_ping());
    if (!err)
        err = node_subscribe(r->node, topic_ego());
    if (!err)
        err = node_subscribe(r->node, topic_ambient());
    node_device(r->node, counts, r);
    node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "waits for the survey");
    while (!err) {
        err = node_next(r->node, &in, -1);
        if (!err && in.topic == topic_survey())
            err = take_survey(r, (const Anlos__Survey *)in.content);
        else if (!err && in.topic == topic_ego())
            dsp_ego(r->dsp, (const Anlos__EgoMotion *)in.content, in.capture_ns);
        else if (!err && in.topic == topic_ambient())
            dsp_ambient(r->dsp, (const Anlos__Ambient *)in.content);
        else if (!err)
            take_ping(r, &in);
    }
    node_device(r->node, NULL, NULL);
    return err;
}

int main(int argc, char **argv)
{
    struct run r = {.dropped = {.count = "pings before the survey"}};
    struct pipeline_config cfg;
    int err = node_create(&r.node, "dsp",
                          "Compresses pulses and subtracts the background.", argc, argv);

    if (!r.node)
        return err;
    launchfile_pipeline(&cfg, node_launch(r.node));
    err = dsp_create(&r.dsp, &cfg.frontend);
    if (!err)
        err = run(&r);
    dsp_destroy(r.dsp);
    return node_finish(r.node, err);
}
