/* SPDX-License-Identifier: MIT */
#include "gpio_rail.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* Before the stage's thread in priority: of the two, when both wake at once, it looks
 * first. */
#define PRIORITY 80
#define LOOKS    4 /* in a pulse; each costs the host about 0.3 ms */

struct gpio_rail_insides {
    int value[RAIL_LINES], pull[RAIL_LINES];
    bool inverted, pulled[RAIL_LINES];
    long pulse_us;
    atomic_bool quit;
    pthread_t thread;
};

static bool read_value(struct gpio_rail *r, int line)
{
    char c = '0';
    if (pread(r->insides->value[line], &c, 1, 0) != 1)
        abort();
    return c == '1';
}

static void pull(struct gpio_rail *r, int line, bool closed)
{
    const char *word = closed != r->insides->inverted ? "pull-up" : "pull-down";
    if (r->insides->pulled[line] == closed)
        return;
    r->insides->pulled[line] = closed;
    if (pwrite(r->insides->pull[line], word, strlen(word), 0) < 0)
        abort();
}

static void pull_switches(struct gpio_rail *r)
{
    pull(r, RAIL_HOME, r->position <= r->home_at);
    pull(r, RAIL_LIMIT, r->position >= r->limit_at);
}

static void count(struct gpio_rail *r)
{
    r->position += read_value(r, RAIL_DIRECTION) ? 1 : -1;
    r->unpowered += !gpio_rail_enabled(r);
    r->steps++;
    if (r->tap_at && r->steps == r->tap_at) {
        pull(r, RAIL_ESTOP, true);
        pull(r, RAIL_ESTOP, false);
    }
}

static void *watch(void *arg)
{
    struct gpio_rail *r = arg;
    const struct timespec pause = {.tv_nsec = 1000 * r->insides->pulse_us / LOOKS};
    bool before = false;
    while (!r->insides->quit) {
        bool high = read_value(r, RAIL_STEP);
        if (high && !before)
            count(r);
        before = high;
        pull_switches(r);
        nanosleep(&pause, NULL);
    }
    return NULL;
}

static int open_attribute(int line, const char *name, int flags)
{
    const char *folder = getenv("GUEST_GPIO_SYSFS");
    char path[256];
    snprintf(path, sizeof path, "%s/sim_gpio%d/%s", folder ? folder : "", line, name);
    return open(path, flags | O_CLOEXEC);
}

struct gpio_rail *gpio_rail_start(long position, long home_at, long limit_at,
                                  long pulse_us, bool inverted)
{
    struct gpio_rail *r = calloc(1, sizeof *r);
    struct gpio_rail_insides *in = calloc(1, sizeof *in);
    const struct sched_param priority = {.sched_priority = PRIORITY};
    if (!r || !in)
        abort();
    *r = (struct gpio_rail){
        .position = position, .home_at = home_at, .limit_at = limit_at, .insides = in};
    in->inverted = inverted;
    in->pulse_us = pulse_us;
    for (int i = 0; i < RAIL_LINES; i++) {
        in->value[i] = open_attribute(i, "value", O_RDONLY);
        in->pull[i] = open_attribute(i, "pull", O_RDWR);
        if (in->value[i] < 0 || in->pull[i] < 0) {
            free(in);
            free(r);
            return NULL;
        }
        in->pulled[i] = true;
        if (i >= RAIL_HOME)
            pull(r, i, false);
    }
    pull_switches(r);
    if (pthread_create(&in->thread, NULL, watch, r) ||
        pthread_setschedparam(in->thread, SCHED_FIFO, &priority))
        abort();
    return r;
}

void gpio_rail_press(struct gpio_rail *r, bool pressed)
{
    pull(r, RAIL_ESTOP, pressed);
}

bool gpio_rail_enabled(struct gpio_rail *r)
{
    return read_value(r, RAIL_ENABLE) != r->insides->inverted;
}

void gpio_rail_stop(struct gpio_rail *r)
{
    r->insides->quit = true;
    pthread_join(r->insides->thread, NULL);
    for (int i = 0; i < RAIL_LINES; i++) {
        close(r->insides->value[i]);
        close(r->insides->pull[i]);
    }
    free(r->insides);
    free(r);
}
