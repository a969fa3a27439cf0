/* SPDX-License-Identifier: MIT */
/* hal/stage/gpio_v1.c -- hal/stage/gpio.h on libgpiod 1.x: each line is a request of its
 * own. */
#include <errno.h>
#include <gpiod.h>
#include <stdlib.h>
#include <string.h>

#include "hal/stage/gpio.h"

struct gpio {
    struct gpiod_chip *chip;
    size_t n;
    struct {
        struct gpiod_line *line; /* NULL: not there */
        bool input;
    } lines[GPIO_MAX_LINES];
};

static struct gpiod_line *find_line(struct gpiod_chip *chip, const char *name)
{
    int offset = gpio_chip_offset(name);

    if (offset < 0)
        return gpiod_chip_find_line(chip, name);
    if ((unsigned)offset >= gpiod_chip_num_lines(chip))
        return NULL;
    return gpiod_chip_get_line(chip, (unsigned)offset);
}

static int flags_of(const struct gpio_line *want)
{
    static const int pulls[] = {
        [GPIO_PULL_UP] = GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP,
        [GPIO_PULL_DOWN] = GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN};

    return pulls[want->pull] |
           (want->active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0);
}

static int request(struct gpio *g, size_t i, const struct gpio_line *want,
                   const char *consumer, struct error *why)
{
    const char *chip = gpiod_chip_name(g->chip);
    struct gpiod_line_request_config cfg = {
        .consumer = consumer,
        .request_type = want->input ? GPIOD_LINE_REQUEST_EVENT_RISING_EDGE
                                    : GPIOD_LINE_REQUEST_DIRECTION_OUTPUT,
        .flags = flags_of(want)};
    struct gpiod_line *line = find_line(g->chip, want->name);

    if (!line)
        return error_say(why, -ENOENT, "GPIO chip %s has no line %s", chip, want->name);
    if (gpiod_line_request(line, &cfg, 0)) {
        int err = -errno;
        const char *user = gpiod_line_consumer(line);
        if (err == -EBUSY)
            return error_say(why, err, "GPIO chip %s, line %s: used by %s", chip,
                             want->name, user ? user : "the kernel");
        return error_say(why, err, "GPIO chip %s, line %s: %s", chip, want->name,
                         strerror(-err));
    }
    g->lines[i].line = line;
    g->lines[i].input = want->input;
    return 0;
}

int gpio_open(struct gpio **out, const char *chip, const struct gpio_line *lines,
              size_t n, const char *consumer, struct error *why)
{
    char path[GPIO_CHIP_PATH_SIZE];
    int err = gpio_chip_path(path, chip, why);

    if (err)
        return err;
    struct gpio *g = calloc(1, sizeof *g);
    if (!g)
        return error_say(why, -ENOMEM, "out of memory");
    g->n = n;
    g->chip = gpiod_chip_open(path);
    if (!g->chip)
        err = error_say(why, -errno, "%s: %s", path, strerror(errno));
    for (size_t i = 0; i < n && !err; i++)
        if (lines[i].name)
            err = request(g, i, &lines[i], consumer, why);
    if (err)
        gpio_close(g);
    else
        *out = g;
    return err;
}

int gpio_set(struct gpio *g, size_t line, bool active)
{
    if (!g->lines[line].line)
        return 0;
    return gpiod_line_set_value(g->lines[line].line, active) ? -errno : 0;
}

/* Takes all events that wait. */
static int drain(struct gpiod_line *line, bool *any)
{
    struct gpiod_line_event events[16];
    struct timespec now = {0};

    for (;;) {
        int err = gpiod_line_event_wait(line, &now);
        if (err <= 0)
            return err ? -errno : 0;
        *any = true;
        if (gpiod_line_event_read_multiple(line, events, 16) < 0)
            return -errno;
    }
}

int gpio_inputs(struct gpio *g, unsigned *active)
{
    *active = 0;
    for (size_t i = 0; i < g->n; i++) {
        bool any = false;
        if (!g->lines[i].line || !g->lines[i].input)
            continue;
        int err = drain(g->lines[i].line, &any);
        int value = err ? err : gpiod_line_get_value(g->lines[i].line);
        if (value < 0)
            return err ? err : -errno;
        if (any || value)
            *active |= 1u << i;
    }
    return 0;
}

size_t gpio_poll(const struct gpio *g, struct pollfd *fds)
{
    size_t n = 0;

    for (size_t i = 0; i < g->n; i++)
        if (g->lines[i].line && g->lines[i].input)
            fds[n++] = (struct pollfd){.fd = gpiod_line_event_get_fd(g->lines[i].line),
                                       .events = POLLIN | POLLPRI};
    return n;
}

void gpio_close(struct gpio *g)
{
    if (!g)
        return;
    if (g->chip)
        gpiod_chip_close(g->chip); /* and its lines */
    free(g);
}
