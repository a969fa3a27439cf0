/* SPDX-License-Identifier: MIT */
/* hal/stage/none.c -- an array that is bolted down, at stage position 0. */
#include <errno.h>
#include <stddef.h>

#include "hal/device.h"
#include "hal/stage.h"

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

const struct stage_ops stage_none_ops = {.scheme = "none",
                                         .open = none_open,
                                         .move = none_move,
                                         .home = none_rest,
                                         .stop = none_rest,
                                         .status = none_status,
                                         .close = none_close};
