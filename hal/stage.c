/* SPDX-License-Identifier: MIT */
#include "hal/stage.h"

#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>

#include "hal/device.h"

/* -- an array that is bolted down, at stage position 0
 * -----------------------------------
 */

static int none_open(void **state, const char *arg, const struct clock_source *clock,
                     struct error *why)
{
    (void)clock;
    *state = NULL;
    if (*arg)
        return error_say(why, -EINVAL, "expected nothing after none:");
    return 0;
}

static int none_move(void *state, double target_m, double speed_m_s)
{
    (void)state;
    if (speed_m_s > 0)
        return -EDOM;
    return target_m == 0 ? 0 : -ERANGE;
}

static int none_rest(void *state)
{
    (void)state;
    return 0;
}

static void none_status(void *state, struct stage_status *out)
{
    (void)state;
    out->motion = STAGE_IDLE;
}

static void none_close(void *state)
{
    (void)state;
}

static const struct stage_ops stage_none_ops = {.scheme = "none",
                                                .open = none_open,
                                                .move = none_move,
                                                .home = none_rest,
                                                .stop = none_rest,
                                                .status = none_status,
                                                .close = none_close};

/* -- any stage --------------------------------------------------------------------------
 */

struct stage {
    const struct stage_ops *ops;
    void *state;
    const struct clock_source *clock;
};

static const struct stage_ops *const backends[] = {&stage_sim_ops, &stage_none_ops,
                                                   &stage_gpiod_ops, &stage_zaber_ops};

int stage_open(struct stage **out, const char *uri, const struct clock_source *clock,
               struct error *why)
{
    const char *arg = NULL;
    const struct stage_ops *ops = NULL;
    *out = NULL;
    for (size_t i = 0; i < sizeof backends / sizeof *backends && !arg; i++) {
        ops = backends[i];
        arg = device_arg(uri, ops->scheme);
    }
    if (!arg)
        return error_say(why, -ENODEV,
                         "%s: no such kind of stage; expected gpiod:, zaber:, sim: or "
                         "none:",
                         uri);
    struct stage *s = calloc(1, sizeof *s);
    if (!s)
        return error_say(why, -ENOMEM, "%s: out of memory", uri);
    s->ops = ops;
    s->clock = clock;
    struct error inner = {.text = ""};
    int err = ops->open(&s->state, arg, clock, &inner);
    if (err) {
        free(s);
        return error_say(why, err, "%s: %s", uri, inner.text);
    }
    *out = s;
    return 0;
}

int stage_move(struct stage *s, double target_m)
{
    if (!isfinite(target_m))
        return -ERANGE;
    return s->ops->move(s->state, target_m, 0);
}

int stage_move_at(struct stage *s, double target_m, double speed_m_s)
{
    if (!isfinite(target_m))
        return -ERANGE;
    if (!(speed_m_s > 0) || !isfinite(speed_m_s))
        return -EDOM;
    return s->ops->move(s->state, target_m, speed_m_s);
}

int stage_home(struct stage *s)
{
    return s->ops->home(s->state);
}

int stage_stop(struct stage *s)
{
    return s->ops->stop(s->state);
}

void stage_status(struct stage *s, struct stage_status *out)
{
    *out = (struct stage_status){
        .motion = STAGE_IDLE, .at_ns = clock_now_ns(s->clock), .homed = true};
    s->ops->status(s->state, out);
}

size_t stage_counts(struct stage *s, struct device_count out[DEVICE_MAX_COUNTS])
{
    return s->ops->counts ? s->ops->counts(s->state, out) : 0;
}

void stage_close(struct stage *s)
{
    if (!s)
        return;
    s->ops->close(s->state);
    free(s);
}
