/* SPDX-License-Identifier: MIT */
/* hal/stage/gpio_v2.c -- hal/stage/gpio.h on libgpiod 2.x: one request has all lines. */
#include <errno.h>
#include <gpiod.h>
#include <stdlib.h>
#include <string.h>

#include "hal/stage/gpio.h"

enum { BUFFER_EVENTS = 16 };

struct gpio {
    struct gpiod_line_request *request;
    struct gpiod_edge_event_buffer *events;
    size_t n;
    struct {
        bool there, input;
        unsigned offset;
    } lines[GPIO_MAX_LINES];
    size_t n_inputs;
    unsigned input_offsets[GPIO_MAX_LINES], input_lines[GPIO_MAX_LINES];
};

static struct gpiod_line_settings *settings_of(const struct gpio_line *want)
{
    static const enum gpiod_line_bias pulls[] = {
        [GPIO_PULL_AS_IS] = GPIOD_LINE_BIAS_AS_IS,
        [GPIO_PULL_UP] = GPIOD_LINE_BIAS_PULL_UP,
        [GPIO_PULL_DOWN] = GPIOD_LINE_BIAS_PULL_DOWN};
    struct gpiod_line_settings *s = gpiod_line_settings_new();

    if (!s)
        return NULL;
    gpiod_line_settings_set_active_low(s, want->active_low);
    gpiod_line_settings_set_bias(s, pulls[want->pull]);
    gpiod_line_settings_set_direction(s, want->input ? GPIOD_LINE_DIRECTION_INPUT
                                                     : GPIOD_LINE_DIRECTION_OUTPUT);
    if (want->input)
        gpiod_line_settings_set_edge_detection(s, GPIOD_LINE_EDGE_RISING);
    return s;
}

/* Is it there, and free? */
static int check_line(struct gpiod_chip *chip, int offset, const char *name,
                      struct error *why)
{
    struct gpiod_line_info *info =
        offset < 0 ? NULL : gpiod_chip_get_line_info(chip, (unsigned)offset);

    if (!info)
        return error_say(why, -ENOENT, "GPIO chip %s has no line %s",
                         gpiod_chip_get_path(chip), name);
    const char *user = gpiod_line_info_get_consumer(info);
    int err = gpiod_line_info_is_used(info)
                  ? error_say(why, -EBUSY, "GPIO chip %s, line %s: used by %s",
                              gpiod_chip_get_path(chip), name, user ? user : "the kernel")
                  : 0;
    gpiod_line_info_free(info);
    return err;
}

static int add_line(struct gpio *g, size_t i, struct gpiod_chip *chip,
                    struct gpiod_line_config *config, const struct gpio_line *want,
                    struct error *why)
{
    int offset = gpio_chip_offset(want->name);

    if (offset < 0)
        offset = gpiod_chip_get_line_offset_from_name(chip, want->name);
    int err = check_line(chip, offset, want->name, why);
    if (err)
        return err;
    struct gpiod_line_settings *settings = settings_of(want);
    if (!settings)
        return error_say(why, -ENOMEM, "out of memory");
    unsigned number = (unsigned)offset;
    if (gpiod_line_config_add_line_settings(config, &number, 1, settings))
        err = error_say(why, -errno, "GPIO line %s: %s", want->name, strerror(errno));
    gpiod_line_settings_free(settings);
    g->lines[i].there = true;
    g->lines[i].input = want->input;
    g->lines[i].offset = number;
    if (want->input) {
        g->input_lines[g->n_inputs] = (unsigned)i;
        g->input_offsets[g->n_inputs++] = number;
    }
    return err;
}

static int request(struct gpio *g, struct gpiod_chip *chip, const struct gpio_line *lines,
                   const char *consumer, struct error *why)
{
    struct gpiod_line_config *config = gpiod_line_config_new();
    struct gpiod_request_config *as = gpiod_request_config_new();
    int err = config && as ? 0 : error_say(why, -ENOMEM, "out of memory");

    for (size_t i = 0; i < g->n && !err; i++)
        if (lines[i].name)
            err = add_line(g, i, chip, config, &lines[i], why);
    if (!err) {
        gpiod_request_config_set_consumer(as, consumer);
        g->request = gpiod_chip_request_lines(chip, as, config);
        if (!g->request)
            err = error_say(why, -errno, "GPIO chip %s: its lines: %s",
                            gpiod_chip_get_path(chip), strerror(errno));
    }
    gpiod_request_config_free(as);
    gpiod_line_config_free(config);
    return err;
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
    g->events = gpiod_edge_event_buffer_new(BUFFER_EVENTS);
    struct gpiod_chip *open = gpiod_chip_open(path);
    if (!g->events)
        err = error_say(why, -ENOMEM, "out of memory");
    else if (!open)
        err = error_say(why, -errno, "%s: %s", path, strerror(errno));
    else
        err = request(g, open, lines, consumer, why);
    if (open)
        gpiod_chip_close(open);
    if (err)
        gpio_close(g);
    else
        *out = g;
    return err;
}

int gpio_set(struct gpio *g, size_t line, bool active)
{
    if (!g->lines[line].there)
        return 0;
    return gpiod_line_request_set_value(g->request, g->lines[line].offset,
                                        active ? GPIOD_LINE_VALUE_ACTIVE
                                               : GPIOD_LINE_VALUE_INACTIVE)
               ? -errno
               : 0;
}

static void mark(const struct gpio *g, unsigned offset, unsigned *active)
{
    for (size_t i = 0; i < g->n_inputs; i++)
        if (g->input_offsets[i] == offset)
            *active |= 1u << g->input_lines[i];
}

/* Takes all events that wait. */
static int drain(struct gpio *g, unsigned *active)
{
    for (;;) {
        int there = gpiod_line_request_wait_edge_events(g->request, 0);
        if (there <= 0)
            return there ? -errno : 0;
        int n = gpiod_line_request_read_edge_events(g->request, g->events, BUFFER_EVENTS);
        if (n < 0)
            return -errno;
        for (int i = 0; i < n; i++)
            mark(g,
                 gpiod_edge_event_get_line_offset(
                     gpiod_edge_event_buffer_get_event(g->events, (unsigned long)i)),
                 active);
    }
}

int gpio_inputs(struct gpio *g, unsigned *active)
{
    enum gpiod_line_value values[GPIO_MAX_LINES];

    *active = 0;
    if (!g->n_inputs)
        return 0;
    int err = drain(g, active);
    if (err)
        return err;
    if (gpiod_line_request_get_values_subset(g->request, g->n_inputs, g->input_offsets,
                                             values))
        return -errno;
    for (size_t i = 0; i < g->n_inputs; i++)
        if (values[i] == GPIOD_LINE_VALUE_ACTIVE)
            *active |= 1u << g->input_lines[i];
    return 0;
}

size_t gpio_poll(const struct gpio *g, struct pollfd *fds)
{
    if (!g->n_inputs)
        return 0;
    fds[0] = (struct pollfd){.fd = gpiod_line_request_get_fd(g->request),
                             .events = POLLIN | POLLPRI};
    return 1;
}

void gpio_close(struct gpio *g)
{
    if (!g)
        return;
    if (g->request)
        gpiod_line_request_release(g->request);
    if (g->events)
        gpiod_edge_event_buffer_free(g->events);
    free(g);
}
