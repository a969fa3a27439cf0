/* hal/canbus_socketcan.c -- a raw socket on a CAN interface of the kernel. */
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "hal/canbus_backends.h"
#include "hal/device.h"

struct canbus_socket {
    int fd;
    bool can_fd;
};

static int bind_interface(struct canbus_socket *s, const char *name,
                          struct complaint *why)
{
    struct sockaddr_can address = {.can_family = AF_CAN};
    int on = 1;
    address.can_ifindex = (int)if_nametoindex(name);
    if (!address.can_ifindex)
        return complain(why, -ENODEV,
                        "there is no network interface \"%s\"; see `ip link`, or write a "
                        "log with log:FILE",
                        name);
    s->fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
    if (s->fd < 0)
        return complain(why, -errno,
                        "this kernel gives no CAN socket: %s; load the modules can and "
                        "can_raw, or write a log with log:FILE",
                        strerror(errno));
    /* Nothing is read here; without a filter the queue would fill up. */
    if (setsockopt(s->fd, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0) < 0)
        return complain(why, -errno, "CAN_RAW_FILTER: %s", strerror(errno));
    s->can_fd = setsockopt(s->fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) == 0;
    if (bind(s->fd, (const struct sockaddr *)&address, sizeof address) < 0)
        return complain(why, -errno, "%s is no CAN interface: %s", name, strerror(errno));
    return 0;
}

static int socketcan_open(void **state, const char *arg, struct complaint *why)
{
    static const char *const known[] = {NULL};
    struct device d;
    int err = device_parse(&d, arg, known, why);
    if (err)
        return err;
    struct canbus_socket *s = calloc(1, sizeof *s);
    if (!s) {
        err = complain(why, -ENOMEM, "out of memory");
        goto device;
    }
    s->fd = -1;
    err = bind_interface(s, d.path, why);
    if (err) {
        if (s->fd >= 0)
            close(s->fd);
        free(s);
    } else {
        *state = s;
    }
device:
    device_clear(&d);
    return err;
}

static int socketcan_send(void *state, const struct can_frame_data *f, int64_t stamp_ns)
{
    const struct canbus_socket *s = state;
    struct canfd_frame frame = {.can_id = f->id, .len = f->size};
    size_t size = f->fd ? CANFD_MTU : CAN_MTU;
    ssize_t n;
    (void)stamp_ns; /* the controller stamps it */
    if (f->fd && !s->can_fd)
        return -EOPNOTSUPP;
    if (f->id > CAN_SFF_MASK)
        frame.can_id |= CAN_EFF_FLAG;
    if (f->fd)
        frame.flags = CANFD_BRS;
    memcpy(frame.data, f->data, f->size);
    do
        n = write(s->fd, &frame, size);
    while (n < 0 && errno == EINTR);
    if (n < 0)
        return errno == EAGAIN ? -ENOBUFS : -errno;
    return (size_t)n == size ? 0 : -EIO;
}

static int socketcan_flush(void *state)
{
    (void)state; /* each frame left with its write */
    return 0;
}

static void socketcan_close(void *state)
{
    struct canbus_socket *s = state;
    close(s->fd);
    free(s);
}

const struct canbus_ops canbus_socketcan_ops = {.scheme = "socketcan",
                                                .open = socketcan_open,
                                                .send = socketcan_send,
                                                .flush = socketcan_flush,
                                                .close = socketcan_close};
