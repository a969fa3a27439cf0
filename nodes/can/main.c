/* nodes/can/main.c: "detections", "scan/status", "survey" -> the vehicle's CAN bus */
#include <errno.h>
#include <string.h>

#include "hal/canbus.h"
#include "msgs/topics.h"
#include "nodes/can/outbox.h"
#include "nodes/rt/export.h"
#include "nodes/rt/node.h"
#include "nodes/rt/uri.h"

#define STATUS_PERIOD_NS 100000000LL
#define FINISH_NS        100000000LL /* what waits has to go out in when the node ends */

struct run {
    struct node *node;
    struct canbus *bus;
    struct sender sender;
    struct outbox outbox;
    int64_t status_due_ns;
    struct can_frame_data status; /* as it went out last */
};

/* When it is due, and at once when it says something else. */
static void put_status(struct run *r)
{
    struct can_frame_data frame;
    int64_t now = node_machine_ns(r->node);

    sender_status(&r->sender, &frame);
    if (now < r->status_due_ns && !memcmp(&frame, &r->status, sizeof frame))
        return;
    r->status_due_ns = now + STATUS_PERIOD_NS;
    r->status = frame;
    outbox_put_status(&r->outbox, &frame);
}

static void take(struct run *r, const struct node_message *in)
{
    struct sender_list list;

    if (in->topic == topic_survey()) {
        sender_survey(&r->sender, (const Anlos__Survey *)in->content);
    } else if (in->topic == topic_scan_status()) {
        sender_scan(&r->sender, (const Anlos__ScanStatus *)in->content);
    } else {
        sender_list(&r->sender, (const Anlos__DetectionList *)in->content, in->capture_ns,
                    &list);
        if (node_is_replayed(r->node))
            list.dated_ns = in->publish_ns;
        outbox_put_list(&r->outbox, &list);
    }
}

static void step(struct run *r)
{
    char text[256];

    outbox_step(&r->outbox);
    if (outbox_well(&r->outbox, text, sizeof text))
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "ready");
    else
        node_state(r->node, ANLOS__HEALTH__STATE__DEGRADED, "%s", text);
}

/* A list on its way is finished if the bus takes it. */
static void finish(struct run *r)
{
    const struct clock_source *clock = clock_system();
    int64_t end = node_machine_ns(r->node) + FINISH_NS;

    outbox_step(&r->outbox);
    while (outbox_busy(&r->outbox) && node_machine_ns(r->node) < end) {
        clock->sleep_until_ns(clock->state, node_machine_ns(r->node) +
                                                outbox_wait_ms(&r->outbox) * 1000000LL);
        outbox_step(&r->outbox);
    }
    if (r->outbox.n_lists)
        node_log(r->node, LOG_LEVEL_WARNING, "lists that did not go out: %zu",
                 r->outbox.n_lists);
}

_Static_assert(CANBUS_MAX_COUNTS + OUTBOX_COUNTS <= DEVICE_MAX_COUNTS, "no room");

static size_t counts(void *device, struct device_count *out)
{
    const struct run *r = device;
    size_t n = canbus_counts(r->bus, out);

    outbox_counts(&r->outbox, out + n);
    return n + OUTBOX_COUNTS;
}

static int run(struct run *r)
{
    struct node_message in;
    int err = node_subscribe(r->node, topic_detections());

    if (!err)
        err = node_subscribe(r->node, topic_scan_status());
    if (!err)
        err = node_subscribe(r->node, topic_survey());
    while (!err) {
        put_status(r);
        step(r);
        err = node_next(r->node, &in, (int)outbox_wait_ms(&r->outbox));
        if (!err)
            take(r, &in);
        else if (err == -ETIMEDOUT)
            err = 0;
    }
    finish(r);
    return err;
}

/* A bus has time-outs of its own; a log has none, and is dated like what it holds. */
static const struct clock_source *bus_clock(const struct node *node)
{
    return uri_has_scheme(node_launch(node)->can.uri, "log") ? node_clock(node)
                                                             : clock_system();
}

static int open_bus(struct run *r)
{
    const struct launchfile *l = node_launch(r->node);
    struct complaint why = {""};
    int err = 0;

    /* A log lies in the report's folder, which may not be there yet. */
    if (uri_has_scheme(l->can.uri, "log"))
        err = export_folder(l->report.folder, &why);
    if (!err)
        err = canbus_open(&r->bus, l->can.uri, &why);
    if (err)
        node_log(r->node, LOG_LEVEL_ERROR, "%s", why.text);
    return err;
}

int main(int argc, char **argv)
{
    struct run r = {0};
    int err = node_create(&r.node, "can", "Tells the vehicle what is around the corner.",
                          argc, argv);

    if (err)
        return err - 1;
    sender_init(&r.sender, node_launch(r.node)->can.base_id);
    if (node_is_replayed(r.node)) /* from the first frame on */
        r.sender.status.source = CAN_REPLAY;
    err = open_bus(&r);
    if (!err) {
        outbox_init(&r.outbox, r.bus, bus_clock(r.node), &r.sender);
        node_device(r.node, counts, &r);
        err = run(&r);
    }
    node_device(r.node, NULL, NULL);
    canbus_close(r.bus);
    return node_finish(r.node, err);
}
