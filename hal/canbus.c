/* SPDX-License-Identifier: MIT */
#include "hal/canbus.h"

#include <errno.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "hal/device.h"

struct canbus {
    const struct canbus_ops *ops;
    void *state;
    char *uri;
};

static const struct canbus_ops *const backends[] = {
    &canbus_log_ops, &canbus_socketcan_ops, &canbus_sim_ops};

static int find(const struct canbus_ops **ops, const char **arg, const char *uri,
                struct error *why)
{
    *arg = NULL;
    for (size_t i = 0; i < sizeof backends / sizeof *backends && !*arg; i++) {
        *ops = backends[i];
        *arg = device_arg(uri, (*ops)->scheme);
    }
    return *arg ? 0
                : error_say(why, -ENODEV,
                            "%s: no such kind of CAN bus; expected log:FILE, "
                            "socketcan:INTERFACE or sim:SCENE",
                            uri);
}

int canbus_check(const char *uri, struct error *why)
{
    struct error inner = {.text = ""};
    const struct canbus_ops *ops;
    const char *arg;
    void *state;
    int err = find(&ops, &arg, uri, why);

    if (err)
        return err;
    if (ops->check) {
        err = ops->check(arg, &inner);
    } else {
        err = ops->open(&state, arg, &inner);
        if (!err)
            ops->close(state);
    }
    return err ? error_say(why, err, "%s: %s", uri, inner.text) : 0;
}

int canbus_open(struct canbus **out, const char *uri, struct error *why)
{
    const struct canbus_ops *ops;
    const char *arg;
    *out = NULL;
    int err = find(&ops, &arg, uri, why);
    if (err)
        return err;
    struct canbus *b = calloc(1, sizeof *b);
    char *copy = strdup(uri);
    if (!b || !copy) {
        free(b);
        free(copy);
        return error_say(why, -ENOMEM, "%s: out of memory", uri);
    }
    b->ops = ops;
    b->uri = copy;
    struct error inner = {.text = ""};
    err = ops->open(&b->state, arg, &inner);
    if (err) {
        free(b->uri);
        free(b);
        return error_say(why, err, "%s: %s", uri, inner.text);
    }
    *out = b;
    return 0;
}

const char *canbus_uri(const struct canbus *b)
{
    return b->uri;
}

/* CAN FD frames have 0..8 bytes or one of these sizes; a size between is padded. */
static uint8_t fd_size(uint8_t size)
{
    static const uint8_t sizes[] = {12, 16, 20, 24, 32, 48, 64};
    size_t i = 0;
    if (size <= 8)
        return size;
    while (sizes[i] < size)
        i++;
    return sizes[i];
}

int canbus_send(struct canbus *b, const struct can_frame_data *frame, int64_t stamp_ns)
{
    if (frame->size > (frame->fd ? 64 : 8) || frame->id > 0x1fffffff)
        return -EINVAL;
    struct can_frame_data legal = *frame;
    if (frame->fd) {
        legal.size = fd_size(frame->size);
        memset(legal.data + frame->size, 0, (size_t)(legal.size - frame->size));
    }
    return b->ops->send(b->state, &legal, stamp_ns);
}

int canbus_flush(struct canbus *b)
{
    return b->ops->flush(b->state);
}

int canbus_listen(struct canbus *b, const uint32_t *ids, size_t n)
{
    if (n > CANBUS_MAX_INPUTS)
        return -EINVAL;
    return b->ops->listen ? b->ops->listen(b->state, ids, n) : -EOPNOTSUPP;
}

int canbus_receive(struct canbus *b, struct can_frame_data *out, int64_t now_ns,
                   int64_t *came_ns)
{
    int64_t came;

    if (!b->ops->receive)
        return -EAGAIN;
    return b->ops->receive(b->state, out, now_ns, came_ns ? came_ns : &came);
}

int canbus_fd(const struct canbus *b)
{
    return b->ops->fd ? b->ops->fd(b->state) : -1;
}

void canbus_poll(struct canbus *b, int64_t now_ns, struct canbus_status *out)
{
    *out = (struct canbus_status){.state = CANBUS_READY};
    if (b->ops->poll)
        b->ops->poll(b->state, now_ns, out);
}

size_t canbus_counts(struct canbus *b, struct device_count out[CANBUS_MAX_COUNTS])
{
    return b->ops->counts ? b->ops->counts(b->state, out) : 0;
}

void canbus_close(struct canbus *b)
{
    if (!b)
        return;
    b->ops->close(b->state);
    free(b->uri);
    free(b);
}
