/* nodes/can/main.c: "detections", "scan/status", "survey" -> the vehicle's CAN bus */
#include <errno.h>
#include <string.h>

#include "hal/canbus.h"
#include "msgs/topics.h"
#include "nodes/can/sender.h"
#include "nodes/rt/export.h"
#include "nodes/rt/node.h"
#include "nodes/rt/uri.h"

#define STATUS_PERIOD_NS 100000000LL
#define FULL_RETRIES     20 /* a list of 98 frames outruns the queue of a CAN interface */
#define FULL_PAUSE_NS    1000000LL

struct run {
    struct node *node;
    struct canbus *bus;
    struct sender sender;
    int64_t status_due_ns;
    uint64_t unsent;
};

static int send_frame(struct run *r, const struct can_frame_data *frame)
{
    const struct clock_source *clock = node_clock(r->node);
    int err = -ENOBUFS;

    for (int i = 0; i < FULL_RETRIES && err == -ENOBUFS; i++) {
        err = canbus_send(r->bus, frame, node_now_ns(r->node));
        if (err == -ENOBUFS)
            clock->sleep_until_ns(clock->state, node_now_ns(r->node) + FULL_PAUSE_NS);
    }
    return err;
}

/* Half a list is no list: after a frame that did not go, the rest stays. */
static void send_frames(struct run *r, const struct can_frame_data *frames, size_t n)
{
    int err = 0;

    for (size_t i = 0; i < n && !err; i++)
        err = send_frame(r, &frames[i]);
    if (!err)
        err = canbus_flush(r->bus);
    if (err)
        node_state(r->node, ANLOS__HEALTH__STATE__DEGRADED,
                   "frames did not go out %llu times: %s",
                   (unsigned long long)++r->unsent, strerror(-err));
    else
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "ready");
}

static void send_status(struct run *r)
{
    struct can_frame_data frame;
    int64_t now = node_now_ns(r->node);

    if (now < r->status_due_ns)
        return;
    r->status_due_ns = now + STATUS_PERIOD_NS;
    sender_status(&r->sender, &frame);
    send_frames(r, &frame, 1);
}

static void take(struct run *r, const struct node_message *in)
{
    struct can_frame_data frames[SENDER_MAX_FRAMES];

    if (in->topic == topic_survey())
        sender_survey(&r->sender, (const Anlos__Survey *)in->content);
    else if (in->topic == topic_scan_status())
        sender_scan(&r->sender, (const Anlos__ScanStatus *)in->content);
    else
        send_frames(r, frames,
                    sender_list(&r->sender, (const Anlos__DetectionList *)in->content,
                                in->capture_ns, node_now_ns(r->node), frames));
}

static size_t counts(void *device, struct device_count *out)
{
    return canbus_counts(device, out);
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
        send_status(r);
        err = node_next(r->node, &in, 20);
        if (!err)
            take(r, &in);
        else if (err == -ETIMEDOUT)
            err = 0;
    }
    return err;
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
    err = open_bus(&r);
    if (!err) {
        node_device(r.node, counts, r.bus);
        err = run(&r);
    }
    node_device(r.node, NULL, NULL);
    canbus_close(r.bus);
    return node_finish(r.node, err);
}
