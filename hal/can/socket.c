/* SPDX-License-Identifier: MIT */
#include "hal/can/socket.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stddef.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static int set_option(int fd, int option, const void *value, socklen_t size)
{
    return setsockopt(fd, SOL_CAN_RAW, option, value, size) < 0 ? -errno : 0;
}

static int set_up(int fd, uint32_t error_mask)
{
    const can_err_mask_t errors = error_mask;
    const int on = 1;
    int err = set_option(fd, CAN_RAW_FILTER, NULL, 0);

    if (!err)
        err = set_option(fd, CAN_RAW_ERR_FILTER, &errors, sizeof errors);
    if (!err)
        err = set_option(fd, CAN_RAW_RECV_OWN_MSGS, &on, sizeof on);
    /* A kernel without FD has no such option, and no interface that would need it. */
    if (!err)
        set_option(fd, CAN_RAW_FD_FRAMES, &on, sizeof on);
    /* Without, what comes is taken to have come when it is read. */
    setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
    return err;
}

int can_socket_open(int *fd, const char *interface, uint32_t error_mask,
                    struct error *why)
{
    struct sockaddr_can address = {.can_family = AF_CAN,
                                   .can_ifindex = (int)if_nametoindex(interface)};
    int err;

    if (!address.can_ifindex)
        return error_say(why, -ENODEV,
                         "there is no network interface \"%s\"; see `ip link`",
                         interface);
    *fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
    if (*fd < 0)
        return error_say(why, -errno,
                         "this kernel gives no CAN socket: %s; load the modules can and "
                         "can_raw",
                         strerror(errno));
    err = set_up(*fd, error_mask);
    if (err) {
        error_say(why, err, "the CAN socket cannot be set up: %s", strerror(-err));
    } else if (bind(*fd, (const struct sockaddr *)&address, sizeof address) < 0) {
        err = -errno;
        error_say(why, err, "%s is no CAN interface: %s", interface, strerror(-err));
    }
    if (err)
        close(*fd);
    return err;
}

/* A data frame with this identifier, neither longer nor shorter, and no remote frame. */
int can_socket_filter(int fd, const uint32_t *ids, size_t n)
{
    struct can_filter filters[CAN_SOCKET_MAX_IDS];

    for (size_t i = 0; i < n; i++)
        filters[i] = (struct can_filter){
            .can_id = ids[i] > CAN_SFF_MASK ? ids[i] | CAN_EFF_FLAG : ids[i],
            .can_mask = CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_EFF_MASK,
        };
    return set_option(fd, CAN_RAW_FILTER, filters, (socklen_t)(n * sizeof *filters));
}

int can_socket_link(int fd, const char *interface, struct can_link *out)
{
    struct ifreq r = {0};

    strncpy(r.ifr_name, interface, sizeof r.ifr_name - 1);
    if (ioctl(fd, SIOCGIFMTU, &r) < 0)
        return -errno;
    out->can_fd = r.ifr_mtu >= (int)CANFD_MTU;
    if (ioctl(fd, SIOCGIFFLAGS, &r) < 0)
        return -errno;
    out->up = r.ifr_flags & IFF_UP;
    out->carrier = r.ifr_flags & IFF_RUNNING;
    return 0;
}

int can_socket_send(int fd, const struct can_frame_data *f)
{
    struct canfd_frame frame = {.can_id = f->id, .len = f->size};
    size_t size = f->fd ? CANFD_MTU : CAN_MTU;
    ssize_t n;

    if (f->id > CAN_SFF_MASK)
        frame.can_id |= CAN_EFF_FLAG;
    if (f->fd)
        frame.flags = CANFD_BRS;
    memcpy(frame.data, f->data, f->size);
    do
        n = write(fd, &frame, size);
    while (n < 0 && errno == EINTR);
    if (n < 0)
        return errno == EAGAIN ? -ENOBUFS : -errno;
    return (size_t)n == size ? 0 : -EIO;
}

/* The kernel dates frames by the wall clock. */
static int64_t held_ns(struct msghdr *message)
{
    struct timespec came, now;
    struct cmsghdr *c = CMSG_FIRSTHDR(message);

    while (c && !(c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_TIMESTAMPNS))
        c = CMSG_NXTHDR(message, c);
    if (!c || clock_gettime(CLOCK_REALTIME, &now))
        return 0;
    memcpy(&came, CMSG_DATA(c), sizeof came);
    return (now.tv_sec - came.tv_sec) * 1000000000LL + now.tv_nsec - came.tv_nsec;
}

int can_socket_receive(int fd, struct can_event *out)
{
    union {
        struct cmsghdr aligned;
        char bytes[CMSG_SPACE(sizeof(struct timespec))];
    } control;
    struct canfd_frame frame;
    struct iovec part = {.iov_base = &frame, .iov_len = sizeof frame};
    struct msghdr message = {.msg_iov = &part,
                             .msg_iovlen = 1,
                             .msg_control = &control,
                             .msg_controllen = sizeof control};
    ssize_t n;

    do
        n = recvmsg(fd, &message, 0);
    while (n < 0 && errno == EINTR);
    if (n < 0)
        return -errno;
    if (n < (ssize_t)CAN_MTU ||
        frame.len > n - (ssize_t)offsetof(struct canfd_frame, data))
        return -EIO;
    out->kind = frame.can_id & CAN_ERR_FLAG       ? CAN_EVENT_ERROR
                : message.msg_flags & MSG_CONFIRM ? CAN_EVENT_ECHO
                                                  : CAN_EVENT_FOREIGN;
    out->id = frame.can_id;
    out->frame = (struct can_frame_data){.id = frame.can_id & CAN_EFF_MASK,
                                         .size = frame.len,
                                         .fd = n == (ssize_t)CANFD_MTU};
    memcpy(out->frame.data, frame.data, frame.len);
    out->held_ns = held_ns(&message);
    return 0;
}
