/* SPDX-License-Identifier: MIT */
#include "nodes/can/vehicle.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "msgs/topics.h"
#include "nodes/can/cyclic.h"
#include "nodes/can/inbox.h"
#include "nodes/can/list_check.h"
#include "nodes/can/outbox.h"
#include "nodes/can/saving.h"
#include "nodes/can/uds_server.h"
#include "nodes/can/watch.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"
#include "nodes/rt/uri.h"

#define FINISH_NS 100000000LL /* what waits has to go out in when the node ends */
#define LAST_NS   20000000LL  /* between the frames that say so, */
#define LAST      3           /* of which two may get lost */

struct vehicle {
    struct node *node;
    struct canbus *bus;
    struct sender sender;
    struct outbox outbox;
    struct inbox inbox;
    struct list_check lists;
    struct watch watch;
    struct diagnosis diagnosis;
    struct cyclic cyclic;
    struct saving saving;
    struct uds_server uds;
    uint64_t told_cleared;
    enum can_state told_state; /* in the log */
    uint16_t told_faults;
};

/* A file that was written since the launcher began. */
static bool is_of_this_run(const char *path)
{
    const char *start = getenv("ANLOS_LAUNCH_NS");
    struct stat st;

    return start && *path && !stat(path, &st) &&
           st.st_mtim.tv_sec * 1000000000LL + st.st_mtim.tv_nsec >= atoll(start);
}

/* The URI of a log that goes on if it has begun in this run, or as it says itself. */
static char *logging_uri(const char *uri)
{
    char *path = uri_has_scheme(uri, "log") ? uri_path(uri) : uri_option(uri, "log");
    char *out = NULL;

    if (path)
        out = is_of_this_run(path) ? uri_set_option(uri, "append", "yes") : strdup(uri);
    free(path);
    return out;
}

int vehicle_bus_open(struct canbus **out, const struct launchfile *l, struct error *why)
{
    *out = NULL;
    if (uri_has_scheme(l->can.uri, "socketcan"))
        return canbus_open(out, l->can.uri, why);
    int err = export_folder(l->report.folder, why);
    if (err)
        return err;
    char *uri = logging_uri(l->can.uri);
    if (!uri)
        return error_say(why, -ENOMEM, "out of memory");
    err = canbus_open(out, uri, why);
    free(uri);
    return err;
}

/* A bus has time-outs of its own; a log has none, and is dated like what it holds:
 * replayed. */
static const struct clock_source *vehicle_bus_clock(const struct launchfile *l,
                                                    const struct clock_source *replayed)
{
    return uri_has_scheme(l->can.uri, "log") ? replayed : clock_system();
}

static void configure(struct vehicle *v)
{
    const struct launchfile *l = node_launch(v->node);
    struct sender_config sends;
    const struct watch_config watches = {.fixed = l->scan.fixed,
                                         .wall = launchfile_has_node(l, "wall")};

    sender_config_set(&sends, l);
    sender_init(&v->sender, &sends);
    watch_init(&v->watch, &watches);
    inbox_init(&v->inbox, sends.base_id);
    v->cyclic = (struct cyclic){.sender = &v->sender,
                                .outbox = &v->outbox,
                                .diagnosis = &v->diagnosis,
                                .watch = &v->watch};
    diagnosis_init(&v->diagnosis, (unsigned)sysconf(_SC_NPROCESSORS_ONLN));
    if (node_is_replayed(v->node)) /* from the first frame on */
        v->sender.status.source = CAN_REPLAY;
}

/* A vehicle that talks while a recording is played is not where that was made. */
static int listen(struct vehicle *v, struct error *why)
{
    uint32_t ids[CANBUS_MAX_INPUTS];
    size_t n = inbox_ids(&v->inbox, ids);
    int err = node_is_replayed(v->node) ? -EOPNOTSUPP : canbus_listen(v->bus, ids, n);

    v->watch.cfg.ego = !err;
    if (!err || err == -EOPNOTSUPP)
        return 0;
    return error_say(why, err, "the CAN bus cannot be listened to: %s", strerror(-err));
}

static int open_bus(struct vehicle *v, struct error *why)
{
    const struct launchfile *l = node_launch(v->node);
    int err = vehicle_bus_open(&v->bus, l, why);

    if (err)
        return err;
    if (v->sender.cfg.base_id != CAN_BASE_DEFAULT)
        node_log(v->node, LOG_LEVEL_INFO, "identifiers begin at 0x%x",
                 (unsigned)v->sender.cfg.base_id);
    outbox_init(&v->outbox, v->bus, vehicle_bus_clock(l, node_clock(v->node)),
                &v->sender);
    return listen(v, why);
}

/* In a replay nothing is now that a tester could ask for. */
static int open_diagnosis(struct vehicle *v, struct error *why)
{
    return node_is_replayed(v->node)
               ? 0
               : uds_server_open(&v->uds, node_launch(v->node), &v->watch, why);
}

static void close_all(void *self)
{
    struct vehicle *v = self;

    if (v) {
        uds_server_close(&v->uds);
        canbus_close(v->bus);
    }
    free(v);
}

int vehicle_open(struct vehicle **out, struct node *node, struct error *why)
{
    struct vehicle *v = calloc(1, sizeof *v);

    if (!v)
        return error_say(why, -ENOMEM, "out of memory");
    v->node = node;
    configure(v);
    int err = open_bus(v, why);
    if (!err)
        err = open_diagnosis(v, why);
    if (err)
        close_all(v);
    else
        *out = v;
    return err;
}

/* Not while a recording is played: the vehicle is not heard then. */
static void save(struct vehicle *v, int64_t now_ns)
{
    Anlos__SaveRequest request;

    if (saving_due(&v->saving, now_ns, &request))
        node_publish(v->node, topic_save(), 0, &request.base);
    if (saving_ends(&v->saving, now_ns))
        node_log_each(v->node, LOG_LEVEL_WARNING, "not saved: %s", v->saving.failed);
}

static void take_save(struct vehicle *v, int64_t now_ns)
{
    saving_begin(&v->saving, &v->inbox.save.newest, now_ns);
    node_log_each(v->node, LOG_LEVEL_INFO, "asks to save the last seconds: %s",
                  v->saving.reason);
}

static void receive(struct vehicle *v)
{
    struct can_frame_data frame;
    int64_t now = node_machine_ns(v->node), came;

    while (!canbus_receive(v->bus, &frame, now, &came)) {
        switch (inbox_take(&v->inbox, &frame, came)) {
        case INBOX_EGO:
            watch_ego(&v->watch, came);
            node_publish(v->node, topic_ego(), came, &v->inbox.ego.base);
            break;
        case INBOX_AMBIENT:
            watch_ambient(&v->watch, v->inbox.ambient.temperature_c, came);
            node_publish(v->node, topic_ambient(), came, &v->inbox.ambient.base);
            break;
        case INBOX_WALLS_GIVEN:
            node_publish(v->node, topic_wall_given(), came, &v->inbox.wall_list.base);
            break;
        case INBOX_SAVE:
            take_save(v, now);
            break;
        case INBOX_SAVE_AGAIN:
            node_log(v->node, LOG_LEVEL_WARNING,
                     "the vehicle's request %u to save is not taken: its number was "
                     "taken before, or it did not come after one of Idle",
                     (unsigned)v->inbox.save.newest.number);
            break;
        case INBOX_WRONG:
            watch_wrong_input(&v->watch);
            break;
        case INBOX_NOTHING:
        case INBOX_WALL_ENDS:
            break;
        }
    }
    inbox_step(&v->inbox, now);
    if (inbox_doubts(&v->inbox))
        watch_wrong_input(&v->watch);
    if (inbox_ego_ends(&v->inbox, now))
        node_publish(v->node, topic_ego(), now, &v->inbox.ego.base);
    if (inbox_walls_end(&v->inbox, now))
        node_publish(v->node, topic_wall_given(), now, &v->inbox.wall_list.base);
}

/* The state that the vehicle is told, and why. */
static void describe_state(const struct vehicle *v, char *out, size_t size)
{
    char text[256];
    static const char *const names[] = {
        [CAN_INIT] = "init",       [CAN_CALIBRATING] = "calibrating",
        [CAN_ACTIVE] = "active",   [CAN_DEGRADED] = "degraded",
        [CAN_FAULT] = "faulty",    [CAN_BLOCKED] = "blocked",
        [CAN_STANDBY] = "standby",
    };

    watch_text(&v->watch, text, sizeof text);
    snprintf(out, size, "the sensor is %s%s%s", names[watch_state(&v->watch)],
             text[0] ? ": " : "", text);
}

static void tell_inputs(struct vehicle *v)
{
    char text[INBOX_TEXT_SIZE];
    enum e2e_state state;

    while (inbox_change(&v->inbox, &state, text, sizeof text))
        node_log_each(v->node, state == E2E_INVALID ? LOG_LEVEL_WARNING : LOG_LEVEL_INFO,
                      "of the vehicle: %s%s", text,
                      state == E2E_INVALID ? ": it is not used until it is well again"
                                           : "");
}

static void tell_state(struct vehicle *v)
{
    char text[320];
    enum can_state state = watch_state(&v->watch);
    uint16_t faults = watch_faults(&v->watch);

    if (state == v->told_state && faults == v->told_faults)
        return;
    v->told_state = state;
    v->told_faults = faults;
    describe_state(v, text, sizeof text);
    node_log_each(v->node,
                  state == CAN_FAULT || state == CAN_BLOCKED ? LOG_LEVEL_WARNING
                                                             : LOG_LEVEL_INFO,
                  "%s", text);
}

/* In a replay nothing is now: neither the clock nor what is wrong with it counts. */
static void judge(struct vehicle *v)
{
    bool live = !node_is_replayed(v->node);
    int64_t now = node_machine_ns(v->node);
    int64_t ahead_ns = live ? clock_wall_ahead_ns() : 0;

    if (stop_requested()) /* of the others too: that they are silent is no fault */
        return;
    v->watch.cfg.replayed = !live;
    if (live)
        watch_clock(&v->watch, ahead_ns);
    watch_dropped(&v->watch, v->outbox.dropped + v->lists.verdicts[LIST_MALFORMED]);
    watch_step(&v->watch, now);
    v->sender.wall_ahead_ns = ahead_ns;
    sender_let_objects(&v->sender, watch_lets_objects(&v->watch));
    v->sender.status.state = watch_state(&v->watch);
    v->sender.status.faults = watch_faults(&v->watch);
    v->sender.status.temperature_c = watch_temperature_c(&v->watch);
    tell_inputs(v);
    v->sender.status.range_m = watch_range_m(&v->watch);
    tell_state(v);
}

static void answer_tester(struct vehicle *v)
{
    int err = uds_server_step(&v->uds, &v->watch, &v->diagnosis, node_machine_ns(v->node),
                              v->sender.wall_ahead_ns);

    if (err)
        node_log(v->node, LOG_LEVEL_WARNING, "an answer to the tester was not sent: %s",
                 strerror(-err));
    if (v->uds.cleared != v->told_cleared)
        node_log(v->node, LOG_LEVEL_INFO, "a tester has cleared trouble codes");
    v->told_cleared = v->uds.cleared;
}

static int take_list(void *self, const struct node_message *in)
{
    struct vehicle *v = self;
    const Anlos__DetectionList *message = (const Anlos__DetectionList *)in->content;
    struct sender_list list;
    enum list_verdict verdict = list_check(&v->lists, message, in->from, in->epoch_ns,
                                           in->sequence, node_is_replayed(v->node));

    if (verdict != LIST_GOOD) {
        node_log(v->node, LOG_LEVEL_WARNING, "a list of %s is not sent: %s", in->from,
                 list_verdict_text(verdict));
        return 0;
    }
    watch_list(&v->watch, message, in->capture_ns, node_machine_ns(v->node));
    diagnosis_list(&v->diagnosis, message);
    sender_list(&v->sender, message, in->capture_ns, &list);
    if (list.note)
        node_log(v->node, LOG_LEVEL_WARNING, "%s", list.note);
    if (node_is_replayed(v->node))
        list.dated_ns = in->publish_ns;
    outbox_put_list(&v->outbox, &list);
    return 0;
}

static int take_survey(void *self, const struct node_message *in)
{
    struct vehicle *v = self;
    const Anlos__Survey *survey = (const Anlos__Survey *)in->content;

    sender_survey(&v->sender, survey);
    watch_survey(&v->watch, survey->temperature_c);
    return 0;
}

static int take_status(void *self, const struct node_message *in)
{
    struct vehicle *v = self;

    watch_scan(&v->watch, (const Anlos__ScanStatus *)in->content);
    diagnosis_scan(&v->diagnosis, (const Anlos__ScanStatus *)in->content);
    return 0;
}

static int take_health(void *self, const struct node_message *in)
{
    struct vehicle *v = self;
    int64_t now = node_machine_ns(v->node);

    watch_health(&v->watch, (const Anlos__Health *)in->content, now);
    diagnosis_health(&v->diagnosis, (const Anlos__Health *)in->content, now);
    return 0;
}

static int take_saved(void *self, const struct node_message *in)
{
    struct vehicle *v = self;
    const Anlos__SaveStatus *status = (const Anlos__SaveStatus *)in->content;

    if (saving_status(&v->saving, status))
        node_log_each(v->node, LOG_LEVEL_INFO, "%s saves %s: %s", in->from, status->path,
                      v->saving.reason);
    return 0;
}

static int take_walls(void *self, const struct node_message *in)
{
    struct vehicle *v = self;

    watch_walls(&v->watch, (const Anlos__WallList *)in->content,
                node_machine_ns(v->node));
    return 0;
}

static void step(struct vehicle *v)
{
    char text[320], inputs[INBOX_TEXT_SIZE];
    uint64_t truncated = v->outbox.truncated;

    outbox_step(&v->outbox);
    if (v->outbox.truncated > truncated)
        node_log(v->node, LOG_LEVEL_WARNING,
                 "objects were left out of a list: more than %d, or than the bus may "
                 "carry (can.bitrate, can.load)",
                 CAN_MAX_OBJECTS);
    if (outbox_well(&v->outbox, text, sizeof text)) {
        describe_state(v, text, sizeof text);
        inbox_text(&v->inbox, inputs, sizeof inputs);
        node_state(v->node, ANLOS__HEALTH__STATE__READY, "ready, %s%s%s%s%s", text,
                   inputs[0] ? "; of the vehicle: " : "", inputs,
                   v->saving.failed[0] ? "; not saved: " : "", v->saving.failed);
    } else {
        node_state(v->node, ANLOS__HEALTH__STATE__DEGRADED, "%s", text);
    }
}

/* The log of a replay has its time, and none before its first message. */
static bool has_time(const struct vehicle *v)
{
    return v->outbox.clock == clock_system() || !node_is_replayed(v->node) ||
           node_follows_replay(v->node);
}

static int64_t turn_due_ns(const void *self)
{
    const struct vehicle *v = self;
    int64_t due_ns = node_machine_ns(v->node) + outbox_wait_ms(&v->outbox) * 1000000LL;
    int64_t cyclic_ns = has_time(v) ? cyclic_due_ns(&v->cyclic) : LOOP_NEVER;

    return cyclic_ns < due_ns ? cyclic_ns : due_ns;
}

static int turn(void *self)
{
    struct vehicle *v = self;

    receive(v);
    save(v, node_machine_ns(v->node));
    judge(v);
    answer_tester(v);
    if (has_time(v))
        cyclic_step(&v->cyclic, node_machine_ns(v->node));
    step(v);
    return 0;
}

/* Silence from now on is no failure.  Of a replay nothing is said that was not recorded.
 */
static void say_shutdown(struct vehicle *v)
{
    const struct clock_source *clock = clock_system();
    struct can_frame_data frame;

    v->sender.status.shutdown = true;
    v->sender.status.state = CAN_STATE_UNKNOWN;
    sender_status(&v->sender, &frame);
    for (int i = 0; i < LAST; i++) {
        outbox_put_cyclic(&v->outbox, OUTBOX_STATUS, &frame);
        outbox_step(&v->outbox);
        clock->sleep_until_ns(clock->state, node_machine_ns(v->node) + LAST_NS);
    }
    canbus_flush(v->bus);
}

/* A list on its way is finished if the bus takes it. */
static int finish(void *self, int err)
{
    struct vehicle *v = self;
    const struct clock_source *clock = clock_system();
    int64_t end = node_machine_ns(v->node) + FINISH_NS;
    char text[PATH_MAX + 256];

    outbox_step(&v->outbox);
    while (outbox_busy(&v->outbox) && node_machine_ns(v->node) < end) {
        clock->sleep_until_ns(clock->state, node_machine_ns(v->node) +
                                                outbox_wait_ms(&v->outbox) * 1000000LL);
        outbox_step(&v->outbox);
    }
    if (v->outbox.n_lists)
        node_log(v->node, LOG_LEVEL_WARNING, "lists that did not go out: %zu",
                 v->outbox.n_lists);
    bool ends_well = !err || err == -ESHUTDOWN;
    if (ends_well && !node_is_replayed(v->node))
        say_shutdown(v);
    if (!outbox_log_lacks(&v->outbox, text, sizeof text))
        return err;
    node_log(v->node, LOG_LEVEL_ERROR, "%s", text);
    return ends_well ? NODE_TOLD : err;
}

_Static_assert(CANBUS_MAX_COUNTS + OUTBOX_COUNTS + INBOX_COUNTS + SAVING_COUNTS + 4 +
                       UDS_SERVER_COUNTS <=
                   DEVICE_MAX_COUNTS,
               "no room");

static size_t counts(void *device, struct device_count *out)
{
    const struct vehicle *v = device;
    size_t n = canbus_counts(v->bus, out);

    outbox_counts(&v->outbox, out + n);
    inbox_counts(&v->inbox, out + n + OUTBOX_COUNTS);
    saving_counts(&v->saving, out + n + OUTBOX_COUNTS + INBOX_COUNTS);
    n += OUTBOX_COUNTS + INBOX_COUNTS + SAVING_COUNTS;
    out[n++] = (struct device_count){"lists_repeated", v->lists.verdicts[LIST_REPEATED]};
    out[n++] =
        (struct device_count){"lists_malformed", v->lists.verdicts[LIST_MALFORMED]};
    out[n++] = (struct device_count){"places_withheld", v->sender.beyond};
    out[n++] = (struct device_count){"objects_beyond", v->sender.out_of_range};
    return n + uds_server_counts(&v->uds, out + n);
}

static int frames_fd(const void *self)
{
    return canbus_fd(((const struct vehicle *)self)->bus);
}

static bool has_walls(const void *self)
{
    return ((const struct vehicle *)self)->watch.cfg.wall;
}

static const struct loop_input inputs[] = {
    {.topic = topic_detections, .take = take_list},
    {.topic = topic_scan_status, .take = take_status},
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_health, .take = take_health},
    {.topic = topic_wall, .take = take_walls, .wanted = has_walls},
    {.topic = topic_save_status, .take = take_saved},
    {.topic = NULL},
};

static const struct loop_timer timers[] = {
    {.due_ns = turn_due_ns, .run = turn, .when = LOOP_EACH},
    {.run = NULL},
};

const struct loop vehicle_loop = {.inputs = inputs,
                                  .timers = timers,
                                  .fd = frames_fd,
                                  .counts = counts,
                                  .end = finish,
                                  .close = close_all};
