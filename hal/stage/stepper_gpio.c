#include "hal/stage/stepper_gpio.h"

#include <errno.h>
#include <poll.h>
#include <time.h>

#define NS_PER_S INT64_C(1000000000)
#define SPIN_NS  20000  /* shorter waits are not worth a sleep */
#define WAKE_NS  200000 /* poll wakes so much early, the timer does the rest */
#define REST_MS  1000

static int64_t gpio_now_ns(void *state)
{
    struct timespec t;

    (void)state;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * NS_PER_S + t.tv_nsec;
}

static struct timespec timespec_of(int64_t ns)
{
    return (struct timespec){.tv_sec = (time_t)(ns / NS_PER_S), .tv_nsec = ns % NS_PER_S};
}

static void gpio_sleep(void *state, int64_t t_ns)
{
    const struct timespec at = timespec_of(t_ns);

    if (t_ns - gpio_now_ns(state) > SPIN_NS)
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR)
            ;
    while (gpio_now_ns(state) < t_ns)
        ;
}

static void gpio_watch(void *state, int64_t t_ns)
{
    struct stepper_gpio *g = state;
    struct pollfd fds[GPIO_MAX_LINES];
    int64_t left_ns = t_ns - gpio_now_ns(state) - WAKE_NS;
    size_t n = gpio_poll(g->gpio, fds);

    if (left_ns > 0 && n) {
        const struct timespec timeout = timespec_of(left_ns);
        if (ppoll(fds, n, &timeout, NULL) > 0)
            return;
    }
    gpio_sleep(state, t_ns);
}

static int gpio_line_set(void *state, enum stepper_line line, bool active)
{
    struct stepper_gpio *g = state;

    return gpio_set(g->gpio, line, active);
}

static int gpio_line_inputs(void *state, unsigned *active)
{
    struct stepper_gpio *g = state;

    return gpio_inputs(g->gpio, active);
}

static bool gpio_cancelled(void *state)
{
    struct stepper_gpio *g = state;

    return g->cancelled(g->owner);
}

struct stepper_io stepper_gpio_io(struct stepper_gpio *g)
{
    return (struct stepper_io){.state = g,
                               .now_ns = gpio_now_ns,
                               .sleep = gpio_sleep,
                               .watch = gpio_watch,
                               .set = gpio_line_set,
                               .inputs = gpio_line_inputs,
                               .cancelled = gpio_cancelled};
}

/* A chip that is gone is readable for ever: only the clock and the waker count then. */
void stepper_gpio_rest(struct stepper_gpio *g, int wake_fd)
{
    struct pollfd fds[1 + GPIO_MAX_LINES];
    size_t n = 1 + gpio_poll(g->gpio, fds + 1);

    fds[0] = (struct pollfd){.fd = wake_fd, .events = POLLIN};
    if (poll(fds, n, REST_MS) <= 0)
        return;
    for (size_t i = 1; i < n; i++)
        if (fds[i].revents & (POLLERR | POLLHUP | POLLNVAL)) {
            poll(fds, 1, REST_MS);
            return;
        }
}
