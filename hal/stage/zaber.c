/* hal/stage/zaber.c -- a Zaber stage (the paper's: X-BLQ-E) on a serial line, protocol
 * ASCII 2.  The device keeps the place, the speed and the limits; what is read of it are
 * the resolution and how far it reaches. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/stage/backends.h"
#include "hal/stage/worker.h"
#include "hal/stage/zaber_options.h"
#include "hal/stage/zaber_drive.h"

struct stage_zaber {
    char *path;
    struct zaber_drive drive;
    double min_m, max_m;
    bool fault; /* from before; nothing moves until a person has homed it */
};

/* Without an answer there is no telling how far a microstep goes. */
static int introduce(struct stage_zaber *s, const struct stage_zaber_options *o,
                     struct complaint *why)
{
    char text[STAGE_TEXT_SIZE] = "";
    struct zaber_facts facts = {.resolution = o->resolution};
    int err = zaber_drive_ask(&s->drive, &facts, text);

    if (err)
        return complain(why, err, "%s: %s", s->path, text);
    double m = 1e-3 * o->pitch_mm / (o->steps * facts.resolution);
    s->drive.m_per_step = m;
    s->drive.rest_m = facts.position * m;
    s->drive.homed = facts.homed;
    s->fault = facts.fault;
    s->min_m = fmax(o->min_m, facts.min * m);
    s->max_m = fmin(o->max_m, facts.max * m);
    return 0;
}

static int start(struct stage_zaber *s, const struct stage_zaber_options *o,
                 const struct clock_source *clock, struct complaint *why)
{
    static const struct stage_worker_ops ops = {
        .home = zaber_drive_home, .move = zaber_drive_move, .rest = zaber_drive_rest};
    struct zaber_port_config port = o->port;

    s->path = strdup(o->port.path);
    if (!s->path)
        return complain(why, -ENOMEM, "out of memory");
    port.path = s->path;
    int err = zaber_port_open(&s->drive.port, &port, why);
    if (!err)
        err = introduce(s, o, why);
    const struct stage_worker_config cfg = {.settle_s = o->settle_s,
                                            .homed = s->drive.homed,
                                            .home_first = o->home_first && !s->fault,
                                            .position_m = s->drive.rest_m};
    if (err)
        return err;
    return stage_worker_create(&s->drive.worker, &cfg, &ops, &s->drive, clock, why);
}

static void zaber_close(void *state)
{
    struct stage_zaber *s = state;

    stage_worker_destroy(s->drive.worker);
    if (s->drive.worker)
        zaber_port_shout(&s->drive.port, "stop");
    zaber_port_close(&s->drive.port);
    free(s->path);
    free(s);
}

static int zaber_open(void **state, const char *arg, const struct clock_source *clock,
                      struct complaint *why)
{
    struct stage_zaber_options o;
    struct device d;
    int err = device_parse(&d, arg, stage_zaber_option_keys, why);

    if (err)
        return err;
    struct stage_zaber *s = calloc(1, sizeof *s);
    err = s ? stage_zaber_options_read(&o, &d, why)
            : complain(why, -ENOMEM, "out of memory");
    if (!err)
        err = start(s, &o, clock, why);
    device_clear(&d);
    if (err && s)
        zaber_close(s);
    else
        *state = s;
    return err;
}

static int zaber_move(void *state, double target_m)
{
    struct stage_zaber *s = state;

    if (target_m < s->min_m || target_m > s->max_m)
        return -ERANGE;
    return stage_worker_move(s->drive.worker, target_m);
}

static int zaber_home(void *state)
{
    struct stage_zaber *s = state;

    return stage_worker_home(s->drive.worker);
}

static int zaber_stop(void *state)
{
    struct stage_zaber *s = state;

    return stage_worker_stop(s->drive.worker);
}

static void zaber_status(void *state, struct stage_status *out)
{
    struct stage_zaber *s = state;

    stage_worker_status(s->drive.worker, out);
}

static size_t zaber_counts(void *state, struct device_count out[DEVICE_MAX_COUNTS])
{
    const struct stage_zaber *s = state;
    const struct zaber_port *p = &s->drive.port;
    const struct device_count counts[] = {
        {"homings", s->drive.homings},
        {"limit_hits", s->drive.limit_hits},
        {"warnings", s->drive.warnings},
        {"retries", p->retries},
        {"checksum_errors", p->checksum_errors},
        {"garbled_lines", p->garbled},
        {"late_answers", p->stale},
        {"reopened", p->reopened},
    };

    memcpy(out, counts, sizeof counts);
    return sizeof counts / sizeof *counts;
}

const struct stage_ops stage_zaber_ops = {.scheme = "zaber",
                                          .open = zaber_open,
                                          .move = zaber_move,
                                          .home = zaber_home,
                                          .stop = zaber_stop,
                                          .status = zaber_status,
                                          .counts = zaber_counts,
                                          .close = zaber_close};
