/* SPDX-License-Identifier: MIT */
/* hal/can/socketcan.c -- a CAN interface of the kernel, through what befalls it:
 * errors of the bus, down and up, deleted and made again. */
#include <errno.h>
#include <net/if.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hal/can/errors.h"
#include "hal/can/socket.h"
#include "hal/canbus.h"
#include "hal/device.h"
#include "msgs/can/layout.h"

/* Frames that have come and wait to be taken, the oldest first. */

#define CAN_INTAKE_MAX 64 /* a second of all inputs */

struct can_intake {                               /* all zero: empty */
    struct can_frame_data frames[CAN_INTAKE_MAX]; /* a ring */
    int64_t came_ns[CAN_INTAKE_MAX];
    size_t first, n;
    uint64_t received, dropped;
};

/* Of a full one the oldest goes. */
static void can_intake_put(struct can_intake *i, const struct can_frame_data *f,
                           int64_t came_ns)
{
    size_t at;

    i->received++;
    if (i->n == CAN_INTAKE_MAX) {
        i->first = (i->first + 1) % CAN_INTAKE_MAX;
        i->n--;
        i->dropped++;
    }
    at = (i->first + i->n++) % CAN_INTAKE_MAX;
    i->frames[at] = *f;
    i->came_ns[at] = came_ns;
}

/* 0, -EAGAIN (it is empty). */
static int can_intake_take(struct can_intake *i, struct can_frame_data *out,
                           int64_t *came_ns)
{
    if (!i->n)
        return -EAGAIN;
    *out = i->frames[i->first];
    *came_ns = i->came_ns[i->first];
    i->first = (i->first + 1) % CAN_INTAKE_MAX;
    i->n--;
    return 0;
}

/* A CAN interface of the kernel, through what befalls it: errors of the bus, down and
 * up, deleted and made again. */

#define LOOK_NS      50000000LL /* how often a lost interface is looked for at first */
#define LOOK_LAST_NS 800000000LL
#define LONGEST_NS   1000000000LL

enum { MAX_SENT_IDS = CAN_SOCKET_MAX_IDS - CANBUS_MAX_INPUTS };
enum { MAX_ERRORS = 3 }; /* in a row, of a socket: down, gone, and no end of it */

enum link_state { LINK_UP, LINK_DOWN, LINK_GONE };

struct canbus_socketcan {
    char interface[IF_NAMESIZE];
    int fd; /* none while the link is gone */
    enum link_state link;
    bool can_fd;
    struct canbus_errors errors;
    struct can_delivery delivery;
    int64_t look_ns, look_period_ns; /* when to look at the interface again */
    /* The socket's filter: [n_inputs] that are listened to, [n_ids] that were sent. */
    uint32_t inputs[CANBUS_MAX_INPUTS], ids[MAX_SENT_IDS];
    size_t n_inputs, n_ids;
    struct can_intake intake;
    uint64_t no_buffer, link_down, reopened, foreign;
};

static void leave(struct canbus_socketcan *s, enum link_state link, int64_t now_ns)
{
    if (link == s->link)
        return;
    if (s->link == LINK_UP)
        s->link_down++;
    if (link == LINK_GONE)
        close(s->fd);
    s->link = link;
    s->look_period_ns = LOOK_NS;
    s->look_ns = now_ns + LOOK_NS;
    can_delivery_lost(&s->delivery);
}

/* An interface that comes up has a controller that starts anew.  One without carrier is
 * off already, and its error frame was before our time. */
static int read_link(struct canbus_socketcan *s)
{
    struct can_link link;
    int err = can_socket_link(s->fd, s->interface, &link);

    if (err)
        return err;
    s->link = link.up ? LINK_UP : LINK_DOWN;
    s->can_fd = link.can_fd;
    s->errors.state = link.carrier ? CANBUS_READY : CANBUS_OFF;
    return 0;
}

static int set_filter(const struct canbus_socketcan *s, size_t n_ids)
{
    uint32_t all[CAN_SOCKET_MAX_IDS];

    memcpy(all, s->inputs, s->n_inputs * sizeof *all);
    memcpy(all + s->n_inputs, s->ids, n_ids * sizeof *all);
    return can_socket_filter(s->fd, all, s->n_inputs + n_ids);
}

static int open_socket(struct canbus_socketcan *s, struct error *why)
{
    int err = can_socket_open(&s->fd, s->interface, canbus_errors_mask(), why);

    if (err)
        return err;
    if (s->n_inputs + s->n_ids)
        err = set_filter(s, s->n_ids);
    if (!err)
        err = read_link(s);
    if (err) {
        close(s->fd);
        error_say(why, err, "%s: %s", s->interface, strerror(-err));
    }
    return err;
}

static int socketcan_open(void **state, const char *arg, struct error *why)
{
    static const char *const known[] = {NULL};
    struct canbus_socketcan *s = NULL;
    struct device d;
    int err = device_parse(&d, arg, known, why);

    if (err)
        return err;
    s = calloc(1, sizeof *s);
    if (!s) {
        err = error_say(why, -ENOMEM, "out of memory");
        goto device;
    }
    if (strlen(d.path) >= sizeof s->interface) {
        err = error_say(why, -ENODEV, "interface \"%s\": a name has %zu letters at most",
                        d.path, sizeof s->interface - 1);
        goto socket;
    }
    strcpy(s->interface, d.path);
    s->look_period_ns = LOOK_NS;
    struct error inner = {""};
    err = open_socket(s, &inner);
    if (err) {
        error_say(why, err, "%.900s; without a bus write a log, log:FILE", inner.text);
        goto socket;
    }
    *state = s;
    s = NULL;
socket:
    free(s);
device:
    device_clear(&d);
    return err;
}

/* The first frame of an identifier lets its echoes in. */
static int know_id(struct canbus_socketcan *s, uint32_t id)
{
    size_t i = 0;

    while (i < s->n_ids && s->ids[i] != id)
        i++;
    if (i < s->n_ids)
        return 0;
    if (i == MAX_SENT_IDS)
        return -EINVAL;
    s->ids[s->n_ids] = id;
    int err = set_filter(s, s->n_ids + 1);
    if (!err)
        s->n_ids++;
    return err;
}

static void take_error(struct canbus_socketcan *s, const struct can_event *event)
{
    uint64_t before = s->errors.off + s->errors.restarted;

    canbus_errors_take(&s->errors, event->id, event->frame.data);
    if (s->errors.off + s->errors.restarted != before)
        can_delivery_lost(&s->delivery);
}

static bool is_input(const struct canbus_socketcan *s, uint32_t id)
{
    for (size_t i = 0; i < s->n_inputs; i++)
        if (s->inputs[i] == id)
            return true;
    return false;
}

/* What is held for longer is too old for anything, or the wall clock was set: it must not
 * look new. */
static int64_t came_ns(const struct can_event *event, int64_t now_ns)
{
    return now_ns - (event->held_ns < 0            ? 0
                     : event->held_ns > LONGEST_NS ? LONGEST_NS
                                                   : event->held_ns);
}

static void take_event(struct canbus_socketcan *s, const struct can_event *event,
                       int64_t now_ns)
{
    switch (event->kind) {
    case CAN_EVENT_ECHO:
        can_delivery_echo(&s->delivery, now_ns);
        canbus_errors_alive(&s->errors);
        break;
    case CAN_EVENT_ERROR:
        take_error(s, event);
        break;
    case CAN_EVENT_FOREIGN:
        if (is_input(s, event->frame.id))
            can_intake_put(&s->intake, &event->frame, came_ns(event, now_ns));
        else
            s->foreign++;
        break;
    }
}

/* The kernel tells that the interface went before what was received until then: that is
 * taken first, so that frames which did go out do not count as lost. */
static void take_events(struct canbus_socketcan *s, int64_t now_ns)
{
    enum link_state link = LINK_UP;
    struct can_event event;
    int err = 0;

    for (int errors = 0; err != -EAGAIN && errors < MAX_ERRORS; errors += err != 0) {
        err = can_socket_receive(s->fd, &event);
        if (!err)
            take_event(s, &event, now_ns);
        else if (err == -ENETDOWN && link == LINK_UP)
            link = LINK_DOWN;
        else if (err != -EAGAIN)
            link = LINK_GONE;
    }
    if (link != LINK_UP)
        leave(s, link, now_ns);
}

static int refused(struct canbus_socketcan *s, int err, int64_t now_ns)
{
    switch (err) {
    case -ENOBUFS:
        s->no_buffer++;
        return err;
    case -ENETDOWN:
    case -ENXIO:
    case -ENODEV:
        take_events(s, now_ns);
        if (s->link == LINK_UP)
            leave(s, err == -ENETDOWN ? LINK_DOWN : LINK_GONE, now_ns);
        return -ENETDOWN;
    default:
        return err;
    }
}

static int socketcan_send(void *state, const struct can_frame_data *f, int64_t stamp_ns)
{
    struct canbus_socketcan *s = state;

    if (s->link != LINK_UP)
        return -ENETDOWN;
    if (f->fd && !s->can_fd)
        return -EOPNOTSUPP;
    int err = know_id(s, f->id);
    if (!err)
        err = can_socket_send(s->fd, f);
    if (err)
        return refused(s, err, stamp_ns);
    can_delivery_sent(&s->delivery, stamp_ns);
    return 0;
}

static int socketcan_flush(void *state)
{
    (void)state; /* each frame left with its write */
    return 0;
}

/* Looks for an interface that was lost, ever less often. */
static void look_for_link(struct canbus_socketcan *s, int64_t now_ns)
{
    enum link_state before = s->link;

    if (now_ns < s->look_ns)
        return;
    if (s->link == LINK_GONE)
        s->reopened += !open_socket(s, NULL);
    else if (read_link(s))
        leave(s, LINK_GONE, now_ns);
    s->look_period_ns *= 2;
    if (s->link != before)
        s->look_period_ns = LOOK_NS;
    else if (s->look_period_ns > LOOK_LAST_NS)
        s->look_period_ns = LOOK_LAST_NS;
    s->look_ns = now_ns + s->look_period_ns;
}

static enum canbus_state state_of(const struct canbus_socketcan *s)
{
    if (s->link == LINK_GONE)
        return CANBUS_GONE;
    if (s->link == LINK_DOWN)
        return CANBUS_DOWN;
    if (s->delivery.silent && s->errors.state < CANBUS_SILENT)
        return CANBUS_SILENT;
    return s->errors.state;
}

static int socketcan_listen(void *state, const uint32_t *ids, size_t n)
{
    struct canbus_socketcan *s = state;

    memcpy(s->inputs, ids, n * sizeof *ids);
    s->n_inputs = n;
    return s->link == LINK_GONE ? 0 : set_filter(s, s->n_ids);
}

static int socketcan_receive(void *state, struct can_frame_data *out, int64_t now_ns,
                             int64_t *came_ns)
{
    struct canbus_socketcan *s = state;

    if (s->link != LINK_GONE)
        take_events(s, now_ns);
    return can_intake_take(&s->intake, out, came_ns);
}

/* One whose interface is down is readable without end, as the kernel tells of it. */
static int socketcan_fd(const void *state)
{
    const struct canbus_socketcan *s = state;

    return s->link == LINK_UP ? s->fd : -1;
}

static void socketcan_poll(void *state, int64_t now_ns, struct canbus_status *out)
{
    struct canbus_socketcan *s = state;

    if (s->link != LINK_GONE)
        take_events(s, now_ns);
    if (s->link != LINK_UP)
        look_for_link(s, now_ns);
    can_delivery_check(&s->delivery, now_ns);
    out->state = state_of(s);
    out->pending = s->delivery.pending;
    out->outages = s->delivery.outages;
    canbus_advice(out->text, sizeof out->text, out->state, s->interface);
}

static size_t socketcan_counts(void *state, struct device_count out[CANBUS_MAX_COUNTS])
{
    const struct canbus_socketcan *s = state;
    const struct device_count counts[] = {
        {"frames_sent", s->delivery.sent},
        {"frames_confirmed", s->delivery.confirmed},
        {"frames_unconfirmed", s->delivery.unconfirmed},
        {"no_buffer", s->no_buffer},
        {"error_warning", s->errors.warning},
        {"error_passive", s->errors.passive},
        {"bus_off", s->errors.off},
        {"restarts", s->errors.restarted},
        {"arbitration_lost", s->errors.arbitration_lost},
        {"unacknowledged", s->errors.unacknowledged},
        {"link_down", s->link_down},
        {"reopened", s->reopened},
        {"foreign_frames", s->foreign},
        {"inputs", s->intake.received},
        {"inputs_dropped", s->intake.dropped},
    };

    _Static_assert(sizeof counts / sizeof *counts <= CANBUS_MAX_COUNTS, "no room");
    memcpy(out, counts, sizeof counts);
    return sizeof counts / sizeof *counts;
}

static void socketcan_close(void *state)
{
    struct canbus_socketcan *s = state;

    if (s->link != LINK_GONE)
        close(s->fd);
    free(s);
}

const struct canbus_ops canbus_socketcan_ops = {.scheme = "socketcan",
                                                .open = socketcan_open,
                                                .send = socketcan_send,
                                                .flush = socketcan_flush,
                                                .listen = socketcan_listen,
                                                .receive = socketcan_receive,
                                                .fd = socketcan_fd,
                                                .poll = socketcan_poll,
                                                .counts = socketcan_counts,
                                                .close = socketcan_close};
