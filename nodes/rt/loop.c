/* SPDX-License-Identifier: MIT */
#include "nodes/rt/loop.h"

#include <errno.h>
#include <limits.h>
#include <poll.h>

#define NS_PER_MS 1000000LL
#define MOST_MS   100 /* in poll, which knows nothing of when health is due */

static const struct loop_input no_inputs[] = {{.topic = NULL}};
static const struct loop_timer no_timers[] = {{.run = NULL}};

static int subscribe(struct node *n, const struct loop_input *inputs, const void *self)
{
    int err = 0;

    for (const struct loop_input *i = inputs; !err && i->topic; i++)
        if (!i->wanted || i->wanted(self))
            err = node_subscribe(n, i->topic());
    return err;
}

static int dispatch(const struct loop *l, const struct loop_input *inputs, void *self,
                    const struct node_message *in)
{
    for (const struct loop_input *i = inputs; i->topic; i++)
        if (i->topic() == in->topic)
            return i->take(self, in);
    return l->rest ? l->rest(self, in) : 0;
}

static int run_timers(struct node *n, const struct loop_timer *timers, bool last,
                      bool came, void *self)
{
    int err = 0;

    for (const struct loop_timer *t = timers; !err && t->run; t++)
        if ((t->when == LOOP_LAST) == last &&
            ((came && t->when == LOOP_EACH) || t->due_ns(self) <= node_machine_ns(n)))
            err = t->run(self);
    return err;
}

/* Rounded up: not woken before it is due. */
static int wait_ms(struct node *n, const struct loop_timer *timers, const void *self)
{
    int64_t next_ns = LOOP_NEVER, now_ns = node_machine_ns(n);

    for (const struct loop_timer *t = timers; t->run; t++) {
        int64_t due_ns = t->due_ns(self);
        next_ns = due_ns < next_ns ? due_ns : next_ns;
    }
    if (next_ns == LOOP_NEVER)
        return -1;
    if (next_ns <= now_ns)
        return 0;
    int64_t ms = (next_ns - now_ns + NS_PER_MS - 1) / NS_PER_MS;
    return ms < INT_MAX ? (int)ms : INT_MAX;
}

/* Until somebody has something, or it is time. */
static void wait_for_both(struct node *n, int fd, int ms)
{
    struct pollfd fds[] = {{.fd = node_fd(n), .events = POLLIN},
                           {.fd = fd, .events = POLLIN}};

    poll(fds, 2, ms < 0 || ms > MOST_MS ? MOST_MS : ms);
}

int loop_run(struct node *n, const struct loop *l, void *self)
{
    const struct loop_input *inputs = l->inputs ? l->inputs : no_inputs;
    const struct loop_timer *timers = l->timers ? l->timers : no_timers;
    int err = subscribe(n, inputs, self);
    bool came = true;

    if (!err && l->start)
        l->start(self);
    while (!err) {
        struct node_message in;
        err = run_timers(n, timers, false, came, self);
        if (err)
            break;
        err = node_next(n, &in, l->fd ? 0 : wait_ms(n, timers, self));
        came = !err;
        if (came)
            err = dispatch(l, inputs, self, &in);
        else if (err == -ETIMEDOUT)
            err = run_timers(n, timers, true, false, self);
        if (!err && !came && l->fd) {
            wait_for_both(n, l->fd(self), wait_ms(n, timers, self));
            came = true;
        }
    }
    return err == LOOP_DONE ? 0 : err;
}

static int run(struct node *n, const struct loop *l, void *self)
{
    if (l->counts)
        node_device(n, l->counts, self);
    if (l->waits_for)
        node_state(n, ANLOS__HEALTH__STATE__STARTING, "waits for %s", l->waits_for);
    int err = loop_run(n, l, self);
    return l->end ? l->end(self, err) : err;
}

int loop_main(struct node *n, const struct loop *l, void *self, int err,
              const struct error *why)
{
    if (err && why->text[0])
        node_log(n, LOG_LEVEL_ERROR, "%s", why->text);
    if (!err)
        err = run(n, l, self);
    node_device(n, NULL, NULL);
    node_sensing(n, NULL);
    l->close(self);
    return node_finish(n, err);
}
