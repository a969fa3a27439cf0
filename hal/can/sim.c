/* SPDX-License-Identifier: MIT */
/* hal/can/sim.c -- the CAN bus of a simulated vehicle: "sim:drive.yaml?log=out.candump".
 * What is sent goes into the log, if there is one; what comes is EgoMotion every 20 ms
 * and Ambient every second, as the vehicle of the drive scene moves at that time of the
 * wall clock (hal/room/room.h), with their end-to-end protection, and with wall=on the
 * WallIn of its perception, which sees the scene's wall, every 100 ms.  With save=on it
 * sends SaveRequest and has one event, 3 s after it began.  For tests it misbehaves:
 *   ego=off      EgoMotion never comes; ego=bad: its CRC is wrong
 *   ambient=off, wall=bad  the same of Ambient, of WallIn
 *   save=stuck   the event's request never ends
 * interface=X and append=yes are as of a log. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include "hal/canbus.h"
#include "hal/device.h"
#include "hal/room/room.h"
#include "msgs/can/e2e.h"

#define EGO_PERIOD_NS     20000000LL
#define AMBIENT_PERIOD_NS 1000000000LL
#define WALL_PERIOD_NS    100000000LL
#define SAVE_PERIOD_NS    100000000LL
#define SAVE_IDLE         30 /* frames before the event, */
#define SAVE_FRAMES       5  /* and of it */
#define WALL_SIGMA_M      0.02
#define WALL_SIGMA_RAD    (0.3 * M_PI / 180.0)
#define MAX_LATE_NS       1000000000LL /* what is older never comes */

enum { ON, OFF, BAD, STUCK }; /* how an input behaves */

struct source { /* of one kind of frame */
    int behaviour;
    int64_t period_ns, due_ns; /* due 0: not listened to */
};

struct canbus_sim {
    struct room *room;
    void *log; /* of canbus_log_ops; NULL: none */
    int timer;
    struct can_protection protection;
    struct source ego, ambient, wall, save;
    int n_saves; /* frames of it so far */
};

static void sim_close(void *state)
{
    struct canbus_sim *s = state;

    if (s->log)
        canbus_log_ops.close(s->log);
    if (s->timer >= 0)
        close(s->timer);
    room_destroy(s->room);
    free(s);
}

static int open_log(struct canbus_sim *s, const struct device *d, bool to_write,
                    struct error *why)
{
    const char *path = device_option(d, "log"),
               *interface = device_option(d, "interface"),
               *append = device_option(d, "append");
    char arg[4096];

    if (!path)
        return 0;
    if (snprintf(arg, sizeof arg, "%s?interface=%s&append=%s", path,
                 interface ? interface : "can0",
                 append ? append : "no") >= (int)sizeof arg)
        return error_say(why, -ENAMETOOLONG, "log: the path is too long");
    return to_write ? canbus_log_ops.open(&s->log, arg, why)
                    : canbus_log_ops.check(arg, why);
}

static int open_timer(struct canbus_sim *s, struct error *why)
{
    const struct timespec period = {.tv_nsec = EGO_PERIOD_NS};
    const struct itimerspec often = {.it_interval = period, .it_value = period};

    s->timer = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    if (s->timer < 0 || timerfd_settime(s->timer, 0, &often, NULL))
        return error_say(why, -errno, "the simulated vehicle gets no timer");
    return 0;
}

static int set_up(struct canbus_sim *s, const struct device *d, bool to_write,
                  struct error *why)
{
    static const char *const behaviours[] = {"on", "off", "bad", NULL};
    static const char *const saves[] = {"on", "off", "bad", "stuck", NULL};
    int ego = device_choice(d, "ego", behaviours, why), ambient, wall, save, err;

    if (ego < 0)
        return ego;
    ambient = device_choice(d, "ambient", behaviours, why);
    if (ambient < 0)
        return ambient;
    wall = device_choice(d, "wall", behaviours, why);
    if (wall < 0)
        return wall;
    if (!device_option(d, "wall"))
        wall = OFF;
    save = device_choice(d, "save", saves, why);
    if (save < 0)
        return save;
    if (!device_option(d, "save"))
        save = OFF;
    s->save = (struct source){.behaviour = save, .period_ns = SAVE_PERIOD_NS};
    s->wall = (struct source){.behaviour = wall, .period_ns = WALL_PERIOD_NS};
    s->ego = (struct source){.behaviour = ego, .period_ns = EGO_PERIOD_NS};
    s->ambient = (struct source){.behaviour = ambient, .period_ns = AMBIENT_PERIOD_NS};
    if (!*d->path)
        return error_say(why, -EINVAL, "expected a scene file, sim:SCENE.yaml");
    err = room_load(&s->room, d->path, why);
    if (!err)
        err = open_log(s, d, to_write, why);
    return err ? err : open_timer(s, why);
}

/* to_write: its log too. */
static int make(void **state, const char *arg, bool to_write, struct error *why)
{
    static const char *const known[] = {"log",     "interface", "append", "ego",
                                        "ambient", "wall",      "save",   NULL};
    struct canbus_sim *s = NULL;
    struct device d;
    int err = device_parse(&d, arg, known, why);

    if (err)
        return err;
    s = calloc(1, sizeof *s);
    if (s) {
        s->timer = -1;
        err = set_up(s, &d, to_write, why);
        if (err)
            sim_close(s);
        else
            *state = s;
    } else {
        err = error_say(why, -ENOMEM, "out of memory");
    }
    device_clear(&d);
    return err;
}

static int sim_open(void **state, const char *arg, struct error *why)
{
    return make(state, arg, true, why);
}

static int sim_check(const char *arg, struct error *why)
{
    void *state;
    int err = make(&state, arg, false, why);

    if (!err)
        sim_close(state);
    return err;
}

static int sim_send(void *state, const struct can_frame_data *f, int64_t stamp_ns)
{
    struct canbus_sim *s = state;

    return s->log ? canbus_log_ops.send(s->log, f, stamp_ns) : 0;
}

static int sim_flush(void *state)
{
    struct canbus_sim *s = state;

    return s->log ? canbus_log_ops.flush(s->log) : 0;
}

/* The vehicle talks to the sensor whose EgoMotion is the first of the identifiers. */
static int sim_listen(void *state, const uint32_t *ids, size_t n)
{
    struct canbus_sim *s = state;

    if (!n || ids[0] < CAN_ID_EGO_MOTION)
        return -EINVAL;
    s->protection = (struct can_protection){.base = ids[0] - CAN_ID_EGO_MOTION};
    s->ego.due_ns = s->ambient.due_ns = s->wall.due_ns = s->save.due_ns = 1;
    return 0;
}

/* Is it time for the next one?  *at_ns: what it tells of. */
static bool is_due(struct source *s, int64_t now_ns, int64_t *at_ns)
{
    if (!s->due_ns || s->behaviour == OFF)
        return false;
    if (now_ns - s->due_ns > MAX_LATE_NS)
        s->due_ns = now_ns - now_ns % s->period_ns;
    if (now_ns < s->due_ns)
        return false;
    *at_ns = s->due_ns;
    s->due_ns += s->period_ns;
    return true;
}

static void finish(struct canbus_sim *s, const struct source *from,
                   struct can_frame_data *f)
{
    can_protect(&s->protection, f);
    can_protection_sent(&s->protection, f);
    f->data[0] ^= from->behaviour == BAD;
}

static void tell_ego(struct canbus_sim *s, int64_t at_ns, struct can_frame_data *out)
{
    struct room_ego ego;

    room_ego(s->room, room_time_s(s->room, at_ns), &ego);
    const struct can_ego_motion motion = {
        .speed_m_s = ego.speed_m_s,
        .yaw_rate_rad_s = ego.yaw_rate_rad_s,
        .standstill = ego.standstill ? CAN_STANDS : CAN_ROLLS,
        .validity = CAN_VALID,
    };
    can_pack_ego_motion(out, s->protection.base, &motion);
    finish(s, &s->ego, out);
}

static void tell_ambient(struct canbus_sim *s, struct can_frame_data *out)
{
    const struct can_ambient air = {
        .temperature_c = room_temperature_c(s->room, PASS_SCENE, 0),
        .humidity = NAN,
    };

    can_pack_ambient(out, s->protection.base, &air);
    finish(s, &s->ambient, out);
}

/* What leans is told as it stands at the height of the vehicle's origin. */
static void tell_wall(struct canbus_sim *s, int64_t at_ns, struct can_frame_data *out)
{
    double n[3], distance_m;

    room_vehicle_wall(s->room, room_time_s(s->room, at_ns), n, &distance_m);
    const struct can_wall_in wall = {
        .id = 1,
        .validity = CAN_VALID,
        .azimuth_rad = atan2(n[1], n[0]),
        .distance_m = distance_m / hypot(n[0], n[1]),
        .sigma_azimuth_rad = WALL_SIGMA_RAD,
        .sigma_distance_m = WALL_SIGMA_M,
    };

    can_pack_wall_in(out, s->protection.base, &wall);
    finish(s, &s->wall, out);
}

static void tell_save(struct canbus_sim *s, struct can_frame_data *out)
{
    bool event = s->n_saves >= SAVE_IDLE &&
                 (s->n_saves < SAVE_IDLE + SAVE_FRAMES || s->save.behaviour == STUCK);
    const struct can_save_request request = {
        .number = 1, .reason = CAN_TEST, .request = event ? CAN_SAVE : CAN_IDLE};

    s->n_saves += s->n_saves < SAVE_IDLE + SAVE_FRAMES;
    can_pack_save_request(out, s->protection.base, &request);
    finish(s, &s->save, out);
}

static int sim_receive(void *state, struct can_frame_data *out, int64_t now_ns,
                       int64_t *came_ns)
{
    struct canbus_sim *s = state;
    uint64_t ticks;

    if (is_due(&s->ego, now_ns, came_ns))
        tell_ego(s, *came_ns, out);
    else if (is_due(&s->ambient, now_ns, came_ns))
        tell_ambient(s, out);
    else if (is_due(&s->wall, now_ns, came_ns))
        tell_wall(s, *came_ns, out);
    else if (is_due(&s->save, now_ns, came_ns))
        tell_save(s, out);
    else
        return read(s->timer, &ticks, sizeof ticks) < 0 && errno != EAGAIN ? -errno
                                                                           : -EAGAIN;
    return 0;
}

static int sim_fd(const void *state)
{
    return ((const struct canbus_sim *)state)->timer;
}

const struct canbus_ops canbus_sim_ops = {.scheme = "sim",
                                          .open = sim_open,
                                          .check = sim_check,
                                          .send = sim_send,
                                          .flush = sim_flush,
                                          .listen = sim_listen,
                                          .receive = sim_receive,
                                          .fd = sim_fd,
                                          .close = sim_close};
