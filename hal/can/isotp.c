/* SPDX-License-Identifier: MIT */
#include "hal/can/isotp.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/isotp.h>
#include <net/if.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define LOOK_NS    1000000000LL
#define MAX_ERRORS 8 /* taken at once */
#define MAX_FRAME  7 /* bytes of a message that is one frame */

enum { PHYSICAL, FUNCTIONAL, SOCKETS };

struct isotp {
    char interface[IF_NAMESIZE];
    uint32_t request[SOCKETS]; /* 0: not heard */
    uint32_t response;
    int fds[SOCKETS]; /* -1: not open */
    bool gone;
    int64_t look_ns;
    uint64_t broken;
};

static canid_t kernel_id(uint32_t id)
{
    return id > CAN_SFF_MASK ? id | CAN_EFF_FLAG : id;
}

/* Nobody may ask all for a message of several frames, so it gets no flow control. */
static int set_up(int fd, bool functional)
{
    const struct can_isotp_options options = {
        .flags = CAN_ISOTP_TX_PADDING | (functional ? CAN_ISOTP_LISTEN_MODE : 0),
        .txpad_content = CAN_ISOTP_DEFAULT_PAD_CONTENT,
    };

    return setsockopt(fd, SOL_CAN_ISOTP, CAN_ISOTP_OPTS, &options, sizeof options) < 0
               ? -errno
               : 0;
}

static int open_socket(struct isotp *t, int kind, struct error *why)
{
    struct sockaddr_can address = {.can_family = AF_CAN};
    int err = 0;
    int fd = socket(PF_CAN, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_ISOTP);

    if (fd < 0)
        return error_say(why, -ENOTSUP,
                         "this kernel gives no ISO-TP socket: %s; load the module "
                         "can_isotp (Linux 5.10 and later)",
                         strerror(errno));
    address.can_ifindex = (int)if_nametoindex(t->interface);
    address.can_addr.tp.rx_id = kernel_id(t->request[kind]);
    address.can_addr.tp.tx_id = kernel_id(t->response);
    if (!address.can_ifindex)
        err = -ENODEV;
    if (!err)
        err = set_up(fd, kind == FUNCTIONAL);
    if (!err && bind(fd, (const struct sockaddr *)&address, sizeof address) < 0)
        err = -errno;
    if (err) {
        close(fd);
        return error_say(why, err, "ISO-TP on %s with 0x%x and 0x%x: %s", t->interface,
                         (unsigned)t->request[kind], (unsigned)t->response,
                         strerror(-err));
    }
    t->fds[kind] = fd;
    return 0;
}

static void close_sockets(struct isotp *t)
{
    for (int i = 0; i < SOCKETS; i++) {
        if (t->fds[i] >= 0)
            close(t->fds[i]);
        t->fds[i] = -1;
    }
}

static int open_sockets(struct isotp *t, struct error *why)
{
    int err = 0;

    for (int i = 0; i < SOCKETS && !err; i++)
        if (t->request[i])
            err = open_socket(t, i, why);
    if (err)
        close_sockets(t);
    return err;
}

int isotp_open(struct isotp **out, const struct isotp_address *address, struct error *why)
{
    struct isotp *t = NULL;

    if (strlen(address->interface) >= sizeof t->interface)
        return error_say(why, -ENODEV, "interface \"%s\": a name has %zu letters at most",
                         address->interface, sizeof t->interface - 1);
    t = calloc(1, sizeof *t);
    if (!t)
        return error_say(why, -ENOMEM, "out of memory");
    strcpy(t->interface, address->interface);
    t->request[PHYSICAL] = address->request;
    t->request[FUNCTIONAL] = address->functional;
    t->response = address->response;
    t->fds[PHYSICAL] = t->fds[FUNCTIONAL] = -1;
    int err = open_sockets(t, why);
    if (err)
        free(t);
    else
        *out = t;
    return err;
}

static void look_for_interface(struct isotp *t, int64_t now_ns)
{
    if (now_ns < t->look_ns)
        return;
    t->gone = open_sockets(t, NULL) != 0;
    t->look_ns = now_ns + LOOK_NS;
}

/* The kernel tells once that the interface is gone, and has unbound the socket. */
static bool is_gone(int err)
{
    return err == -ENODEV || err == -ENXIO || err == -EADDRNOTAVAIL;
}

/* 0, -EAGAIN, -ENODEV. */
static int receive(struct isotp *t, int kind, uint8_t *data, size_t size, size_t *n)
{
    for (int errors = 0; t->fds[kind] >= 0 && errors < MAX_ERRORS; errors++) {
        ssize_t came = recv(t->fds[kind], data, size, 0);
        int err = came < 0 ? -errno : 0;
        if (is_gone(err))
            return -ENODEV;
        if (err == -EAGAIN)
            break;
        if (err != -EINTR && (err || (kind == FUNCTIONAL && came > MAX_FRAME)))
            t->broken++;
        if (err || (kind == FUNCTIONAL && came > MAX_FRAME))
            continue;
        *n = (size_t)came;
        return 0;
    }
    return -EAGAIN;
}

int isotp_receive(struct isotp *t, uint8_t *data, size_t size, size_t *n,
                  bool *functional, int64_t now_ns)
{
    if (t->gone)
        look_for_interface(t, now_ns);
    for (int i = 0; i < SOCKETS; i++) {
        int err = receive(t, i, data, size, n);
        if (!err) {
            *functional = i == FUNCTIONAL;
            return 0;
        }
        if (err == -ENODEV) {
            close_sockets(t);
            t->gone = true;
            break;
        }
    }
    return -EAGAIN;
}

int isotp_send(struct isotp *t, const uint8_t *data, size_t n)
{
    ssize_t sent;

    if (t->fds[PHYSICAL] < 0)
        return -ENETDOWN;
    do
        sent = write(t->fds[PHYSICAL], data, n);
    while (sent < 0 && errno == EINTR);
    if (sent < 0)
        return errno == EAGAIN ? -EBUSY : -errno;
    return (size_t)sent == n ? 0 : -EIO;
}

uint64_t isotp_broken(const struct isotp *t)
{
    return t->broken;
}

void isotp_close(struct isotp *t)
{
    if (!t)
        return;
    close_sockets(t);
    free(t);
}
