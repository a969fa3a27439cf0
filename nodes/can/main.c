/* SPDX-License-Identifier: MIT */
/* nodes/can/main.c: "detections", "scan/status", "survey", "health", "wall" -> the
 * vehicle's CAN bus -> "ego", "ambient", "wall/given" */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "hal/canbus.h"
#include "msgs/topics.h"
#include "nodes/can/config.h"
#include "nodes/can/cyclic.h"
#include "nodes/can/inbox.h"
#include "nodes/can/list_check.h"
#include "nodes/can/outbox.h"
#include "nodes/can/vehicle_bus.h"
#include "nodes/can/watch.h"
#include "nodes/rt/loop.h"
#include "nodes/rt/stop.h"

#define FINISH_NS 100000000LL /* what waits has to go out in when the node ends */

struct run {
    struct node *node;
    struct canbus *bus;
    struct sender sender;
    struct outbox outbox;
    struct inbox inbox;
    struct list_check lists;
    struct watch watch;
    struct diagnosis diagnosis;
    struct cyclic cyclic;
    enum can_state told_state; /* in the log */
    uint16_t told_faults;
};

static void receive(struct run *r)
{
    struct can_frame_data frame;
    int64_t now = node_machine_ns(r->node), came;

    while (!canbus_receive(r->bus, &frame, now, &came)) {
        switch (inbox_take(&r->inbox, &frame, came)) {
        case INBOX_EGO:
            watch_ego(&r->watch, came);
            node_publish(r->node, topic_ego(), came, &r->inbox.ego.base);
            break;
        case INBOX_AMBIENT:
            watch_ambient(&r->watch, r->inbox.ambient.temperature_c, came);
            node_publish(r->node, topic_ambient(), came, &r->inbox.ambient.base);
            break;
        case INBOX_WALLS_GIVEN:
            node_publish(r->node, topic_wall_given(), came, &r->inbox.wall_list.base);
            break;
        case INBOX_WRONG:
            watch_wrong_input(&r->watch);
            break;
        case INBOX_NOTHING:
            break;
        }
    }
    inbox_step(&r->inbox, now);
    if (inbox_doubts(&r->inbox))
        watch_wrong_input(&r->watch);
    if (inbox_ego_ends(&r->inbox, now))
        node_publish(r->node, topic_ego(), now, &r->inbox.ego.base);
    if (inbox_walls_end(&r->inbox, now))
        node_publish(r->node, topic_wall_given(), now, &r->inbox.wall_list.base);
}

/* The state that the vehicle is told, and why. */
static void describe_state(const struct run *r, char *out, size_t size)
{
    char text[256];
    static const char *const names[] = {
        [CAN_INIT] = "init",       [CAN_CALIBRATING] = "calibrating",
        [CAN_ACTIVE] = "active",   [CAN_DEGRADED] = "degraded",
        [CAN_FAULT] = "faulty",    [CAN_BLOCKED] = "blocked",
        [CAN_STANDBY] = "standby",
    };

    watch_text(&r->watch, text, sizeof text);
    snprintf(out, size, "the sensor is %s%s%s", names[watch_state(&r->watch)],
             text[0] ? ": " : "", text);
}

static void tell_inputs(struct run *r)
{
    char text[INBOX_TEXT_SIZE];
    enum e2e_state state;

    while (inbox_change(&r->inbox, &state, text, sizeof text))
        node_log_each(r->node, state == E2E_INVALID ? LOG_LEVEL_WARNING : LOG_LEVEL_INFO,
                      "of the vehicle: %s%s", text,
                      state == E2E_INVALID ? ": it is not used until it is well again"
                                           : "");
}

static void tell_state(struct run *r)
{
    char text[320];
    enum can_state state = watch_state(&r->watch);
    uint16_t faults = watch_faults(&r->watch);

    if (state == r->told_state && faults == r->told_faults)
        return;
    r->told_state = state;
    r->told_faults = faults;
    describe_state(r, text, sizeof text);
    node_log_each(r->node,
                  state == CAN_FAULT || state == CAN_BLOCKED ? LOG_LEVEL_WARNING
                                                             : LOG_LEVEL_INFO,
                  "%s", text);
}

/* In a replay nothing is now: neither the clock nor what is wrong with it counts. */
static void judge(struct run *r)
{
    bool live = !node_is_replayed(r->node);
    int64_t now = node_machine_ns(r->node);
    int64_t ahead_ns = live ? clock_wall_ahead_ns() : 0;

    if (stop_requested()) /* of the others too: that they are silent is no fault */
        return;
    r->watch.cfg.replayed = !live;
    if (live)
        watch_clock(&r->watch, ahead_ns);
    watch_dropped(&r->watch, r->outbox.dropped + r->lists.verdicts[LIST_MALFORMED]);
    watch_step(&r->watch, now);
    r->sender.wall_ahead_ns = ahead_ns;
    sender_let_objects(&r->sender, watch_lets_objects(&r->watch));
    r->sender.status.state = watch_state(&r->watch);
    r->sender.status.faults = watch_faults(&r->watch);
    r->sender.status.temperature_c = watch_temperature_c(&r->watch);
    tell_inputs(r);
    r->sender.status.range_m = watch_range_m(&r->watch);
    tell_state(r);
}

static int take_list(void *self, const struct node_message *in)
{
    struct run *r = self;
    const Anlos__DetectionList *message = (const Anlos__DetectionList *)in->content;
    struct sender_list list;
    enum list_verdict verdict = list_check(&r->lists, message, in->from, in->epoch_ns,
                                           in->sequence, node_is_replayed(r->node));

    if (verdict != LIST_GOOD) {
        node_log(r->node, LOG_LEVEL_WARNING, "a list of %s is not sent: %s", in->from,
                 list_verdict_text(verdict));
        return 0;
    }
    watch_list(&r->watch, message, in->capture_ns, node_machine_ns(r->node));
    diagnosis_list(&r->diagnosis, message);
    sender_list(&r->sender, message, in->capture_ns, &list);
    if (list.note)
        node_log(r->node, LOG_LEVEL_WARNING, "%s", list.note);
    if (node_is_replayed(r->node))
        list.dated_ns = in->publish_ns;
    outbox_put_list(&r->outbox, &list);
    return 0;
}

static int take_survey(void *self, const struct node_message *in)
{
    struct run *r = self;
    const Anlos__Survey *survey = (const Anlos__Survey *)in->content;

    sender_survey(&r->sender, survey);
    watch_survey(&r->watch, survey->temperature_c);
    return 0;
}

static int take_status(void *self, const struct node_message *in)
{
    struct run *r = self;

    watch_scan(&r->watch, (const Anlos__ScanStatus *)in->content);
    diagnosis_scan(&r->diagnosis, (const Anlos__ScanStatus *)in->content);
    return 0;
}

static int take_health(void *self, const struct node_message *in)
{
    struct run *r = self;
    int64_t now = node_machine_ns(r->node);

    watch_health(&r->watch, (const Anlos__Health *)in->content, now);
    diagnosis_health(&r->diagnosis, (const Anlos__Health *)in->content, now);
    return 0;
}

static int take_walls(void *self, const struct node_message *in)
{
    struct run *r = self;

    watch_walls(&r->watch, (const Anlos__WallList *)in->content,
                node_machine_ns(r->node));
    return 0;
}

static void step(struct run *r)
{
    char text[320], inputs[INBOX_TEXT_SIZE];
    uint64_t truncated = r->outbox.truncated;

    outbox_step(&r->outbox);
    if (r->outbox.truncated > truncated)
        node_log(r->node, LOG_LEVEL_WARNING,
                 "objects were left out of a list: more than %d, or than the bus may "
                 "carry (can.bitrate, can.load)",
                 CAN_MAX_OBJECTS);
    if (outbox_well(&r->outbox, text, sizeof text)) {
        describe_state(r, text, sizeof text);
        inbox_text(&r->inbox, inputs, sizeof inputs);
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "ready, %s%s%s", text,
                   inputs[0] ? "; of the vehicle: " : "", inputs);
    } else {
        node_state(r->node, ANLOS__HEALTH__STATE__DEGRADED, "%s", text);
    }
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

_Static_assert(CANBUS_MAX_COUNTS + OUTBOX_COUNTS + INBOX_COUNTS + 4 <= DEVICE_MAX_COUNTS,
               "no room");

static size_t counts(void *device, struct device_count *out)
{
    const struct run *r = device;
    size_t n = canbus_counts(r->bus, out);

    outbox_counts(&r->outbox, out + n);
    inbox_counts(&r->inbox, out + n + OUTBOX_COUNTS);
    n += OUTBOX_COUNTS + INBOX_COUNTS;
    out[n++] = (struct device_count){"lists_repeated", r->lists.verdicts[LIST_REPEATED]};
    out[n++] =
        (struct device_count){"lists_malformed", r->lists.verdicts[LIST_MALFORMED]};
    out[n++] = (struct device_count){"places_withheld", r->sender.beyond};
    out[n++] = (struct device_count){"objects_beyond", r->sender.out_of_range};
    return n;
}

/* The log of a replay has its time, and none before its first message. */
static bool has_time(const struct run *r)
{
    return r->outbox.clock == clock_system() || !node_is_replayed(r->node) ||
           node_follows_replay(r->node);
}

static int64_t turn_due_ns(const void *self)
{
    const struct run *r = self;
    int64_t due_ns = node_machine_ns(r->node) + outbox_wait_ms(&r->outbox) * 1000000LL;
    int64_t cyclic_ns = has_time(r) ? cyclic_due_ns(&r->cyclic) : LOOP_NEVER;

    return cyclic_ns < due_ns ? cyclic_ns : due_ns;
}

static int turn(void *self)
{
    struct run *r = self;

    receive(r);
    judge(r);
    if (has_time(r))
        cyclic_step(&r->cyclic, node_machine_ns(r->node));
    step(r);
    return 0;
}

static int bus_fd_of(const void *self)
{
    return canbus_fd(((const struct run *)self)->bus);
}

static bool has_walls(const void *self)
{
    return ((const struct run *)self)->watch.cfg.wall;
}

static const struct loop_input inputs[] = {
    {.topic = topic_detections, .take = take_list},
    {.topic = topic_scan_status, .take = take_status},
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_health, .take = take_health},
    {.topic = topic_wall, .take = take_walls, .wanted = has_walls},
    {.topic = NULL},
};

static const struct loop_timer timers[] = {
    {.due_ns = turn_due_ns, .run = turn, .when = LOOP_EACH},
    {.run = NULL},
};

static int run(struct run *r)
{
    const struct loop loop = {.inputs = inputs, .timers = timers, .fd = bus_fd_of};
    int err = loop_run(r->node, &loop, r);

    finish(r);
    return err;
}

/* A vehicle that talks while a recording is played is not where that was made. */
static int listen(struct run *r)
{
    uint32_t ids[CANBUS_MAX_INPUTS];
    size_t n = inbox_ids(&r->inbox, ids);
    int err = node_is_replayed(r->node) ? -EOPNOTSUPP : canbus_listen(r->bus, ids, n);

    r->watch.cfg.ego = !err;
    if (err && err != -EOPNOTSUPP)
        node_log(r->node, LOG_LEVEL_ERROR, "the CAN bus cannot be listened to: %s",
                 strerror(-err));
    return err == -EOPNOTSUPP ? 0 : err;
}

static int open_bus(struct run *r)
{
    struct error why = {""};
    int err = vehicle_bus_open(&r->bus, node_launch(r->node), &why);

    if (err)
        node_log(r->node, LOG_LEVEL_ERROR, "%s", why.text);
    else if (r->sender.cfg.base_id != CAN_BASE_DEFAULT)
        node_log(r->node, LOG_LEVEL_INFO, "identifiers begin at 0x%x",
                 (unsigned)r->sender.cfg.base_id);
    return err ? err : listen(r);
}

static void set_up(struct run *r)
{
    const struct launchfile *l = node_launch(r->node);
    struct sender_config sends;
    struct watch_config watches;

    can_config_sender(&sends, l);
    can_config_watch(&watches, l);
    sender_init(&r->sender, &sends);
    watch_init(&r->watch, &watches);
    inbox_init(&r->inbox, sends.base_id);
    r->cyclic = (struct cyclic){.sender = &r->sender,
                                .outbox = &r->outbox,
                                .diagnosis = &r->diagnosis,
                                .watch = &r->watch};
    diagnosis_init(&r->diagnosis, (unsigned)sysconf(_SC_NPROCESSORS_ONLN));
    if (node_is_replayed(r->node)) /* from the first frame on */
        r->sender.status.source = CAN_REPLAY;
}

int main(int argc, char **argv)
{
    struct run r = {0};
    int err = node_create(&r.node, "can", "Tells the vehicle what is around the corner.",
                          argc, argv);

    if (!r.node)
        return err;
    set_up(&r);
    err = open_bus(&r);
    if (!err) {
        outbox_init(&r.outbox, r.bus,
                    vehicle_bus_clock(node_launch(r.node), node_clock(r.node)),
                    &r.sender);
        node_device(r.node, counts, &r);
        err = run(&r);
    }
    node_device(r.node, NULL, NULL);
    canbus_close(r.bus);
    return node_finish(r.node, err);
}
