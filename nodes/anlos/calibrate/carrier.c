/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/calibrate/carrier.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "hal/stage.h"
#include "nodes/rt/stop.h"

#define LOOK_NS 10000000 /* between looks at a stage that moves */

struct carrier {
    struct stage *stage;
    const struct survey *survey;
};

int carrier_open(struct carrier **out, const char *uri, const struct survey *survey,
                 struct error *why)
{
    struct carrier *c = calloc(1, sizeof *c);
    if (!c)
        return error_say(why, -ENOMEM, "out of memory");
    c->survey = survey;
    int err = stage_open(&c->stage, uri, clock_system(), why);
    if (err)
        free(c);
    else
        *out = c;
    return err;
}

static int wait_until_it_stands(struct carrier *c, struct error *why)
{
    const struct clock_source *clock = clock_system();
    struct stage_status status;
    for (;;) {
        if (interrupt_requested()) {
            stage_stop(c->stage);
            return error_say(why, -EINTR, "interrupted");
        }
        stage_status(c->stage, &status);
        if (status.motion == STAGE_FAULT)
            return error_say(why, -EIO, "the stage has a fault: %s", status.text);
        if (status.motion == STAGE_IDLE)
            return 0;
        clock->sleep_until_ns(clock->state, clock_now_ns(clock) + LOOK_NS);
    }
}

int carrier_move(struct carrier *c, size_t position, struct error *why)
{
    double target_m = c->survey->stage_positions_m[position];
    int err = stage_move(c->stage, target_m);
    if (err)
        return error_say(why, err, "the stage does not go to %g m: %s", target_m,
                         strerror(-err));
    return wait_until_it_stands(c, why);
}

void carrier_close(struct carrier *c)
{
    if (!c)
        return;
    stage_close(c->stage);
    free(c);
}
