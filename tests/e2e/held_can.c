/* SPDX-License-Identifier: MIT */
/* Stands before the clock and the bus of the node can: the linker's --wrap sends their
 * calls here. */
#include <errno.h>
#include <time.h>

#include "hal/canbus.h"
#include "tests/e2e/held.h"

int __real_clock_gettime(clockid_t id, struct timespec *t);
int __wrap_clock_gettime(clockid_t id, struct timespec *t);
int __real_canbus_receive(struct canbus *b, struct can_frame_data *out, int64_t now_ns,
                          int64_t *came_ns);
int __wrap_canbus_receive(struct canbus *b, struct can_frame_data *out, int64_t now_ns,
                          int64_t *came_ns);
int __real_canbus_send(struct canbus *b, const struct can_frame_data *frame,
                       int64_t stamp_ns);
int __wrap_canbus_send(struct canbus *b, const struct can_frame_data *frame,
                       int64_t stamp_ns);

static struct held *held;

/* Before there are threads, and before anything looks at the clock. */
__attribute__((constructor)) static void begin(void)
{
    held = held_open(getenv(HELD_FILE));
}

int __wrap_clock_gettime(clockid_t id, struct timespec *t)
{
    int err = __real_clock_gettime(id, t);

    if (!err && id == CLOCK_REALTIME)
        t->tv_sec += held->wall_ahead_ns / 1000000000;
    return err;
}

/* Does the node get this frame? */
static bool lets(struct can_frame_data *f, int64_t came_ns)
{
    switch (f->id - CAN_BASE_DEFAULT) {
    case CAN_ID_EGO_MOTION:
        if (held->no_ego)
            return false;
        held->ego_ns = came_ns;
        return true;
    case CAN_ID_AMBIENT:
        if (held->no_ambient)
            return false;
        held->ambient_ns = came_ns;
        return true;
    default:
        f->data[0] ^= held->bad_walls;
        return true;
    }
}

int __wrap_canbus_receive(struct canbus *b, struct can_frame_data *out, int64_t now_ns,
                          int64_t *came_ns)
{
    int err;

    do
        err = __real_canbus_receive(b, out, now_ns, came_ns);
    while (!err && !lets(out, *came_ns));
    return err;
}

int __wrap_canbus_send(struct canbus *b, const struct can_frame_data *frame,
                       int64_t stamp_ns)
{
    if (frame->id == CAN_BASE_DEFAULT + CAN_ID_LIST_HEADER &&
        atomic_exchange(&held->refuse_list, false))
        return -EIO;
    return __real_canbus_send(b, frame, stamp_ns);
}
