/* SPDX-License-Identifier: MIT */
/* hal/stage/sim.c -- a stage as a stepper with a trapezoid of speed moves it, and as it
 * rings out afterwards.  Where it is follows from the clock alone: no thread. */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "hal/device.h"
#include "hal/random.h"
#include "hal/stage.h"
#include "hal/stage/stepper.h"

struct stage_sim {
    const struct clock_source *clock;
    double speed_m_s, acceleration_m_s2, settle_s, error_m, min_m, max_m;
    bool fast;
    struct random random;
    struct trapezoid motion;
    int64_t start_ns; /* of the motion */
    double target_m;
};

static double elapsed_s(const struct stage_sim *s)
{
    return (double)(clock_now_ns(s->clock) - s->start_ns) * 1e-9;
}

static int read_options(struct stage_sim *s, const struct device *d, struct error *why)
{
    static const char *const paces[] = {"real", "fast", NULL};
    double seed = 1;
    int pace = device_choice(d, "pace", paces, why);
    int err = pace < 0 ? pace : 0;
    s->fast = pace == 1;
    struct {
        const char *key;
        double min, max, *value;
    } numbers[] = {
        {"speed", 1e-4, 100, &s->speed_m_s},
        {"acceleration", 1e-4, 1000, &s->acceleration_m_s2},
        {"settle", 0, 60, &s->settle_s},
        {"error", 0, 0.1, &s->error_m},
        {"min", -100, 100, &s->min_m},
        {"max", -100, 100, &s->max_m},
        {"seed", 0, 1e9, &seed},
    };
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers && !err; i++)
        err = device_number(d, numbers[i].key, numbers[i].min, numbers[i].max,
                            numbers[i].value, why);
    if (!err && s->min_m > s->max_m)
        err =
            error_say(why, -EINVAL, "option min=%g is above max=%g", s->min_m, s->max_m);
    random_seed(&s->random, &(uint64_t){(uint64_t)seed}, 1);
    return err;
}

static int sim_open(void **state, const char *arg, const struct clock_source *clock,
                    struct error *why)
{
    static const char *const known[] = {"speed", "acceleration", "settle", "error", "min",
                                        "max",   "seed",         "pace",   NULL};
    struct device d;
    int err = device_parse(&d, arg, known, why);
    if (err)
        return err;
    struct stage_sim *s = calloc(1, sizeof *s);
    if (!s) {
        err = error_say(why, -ENOMEM, "out of memory");
        goto device;
    }
    s->clock = clock;
    s->speed_m_s = 0.2;
    s->acceleration_m_s2 = 0.5;
    s->settle_s = 0.15;
    s->error_m = 1e-4;
    s->min_m = -0.05;
    s->max_m = 2;
    s->start_ns = clock_now_ns(clock) - (int64_t)60e9; /* long settled */
    err = *d.path ? error_say(why, -EINVAL, "expected only options: sim:?speed=0.2") : 0;
    if (!err)
        err = read_options(s, &d, why);
    if (err)
        free(s);
    else
        *state = s;
device:
    device_clear(&d);
    return err;
}

static int sim_move(void *state, double target_m, double speed_m_s)
{
    struct stage_sim *s = state;
    double v, x = trapezoid_at(&s->motion, elapsed_s(s), &v);
    if (target_m < s->min_m || target_m > s->max_m)
        return -ERANGE;
    if (speed_m_s > s->speed_m_s || (speed_m_s > 0 && s->fast))
        return -EDOM;
    double reached_m = target_m + s->error_m * random_normal(&s->random);
    if (s->fast)
        s->motion = (struct trapezoid){.start = reached_m};
    else
        trapezoid_plan(&s->motion, x, fabs(v) < 1e-9 ? 0 : v, reached_m,
                       speed_m_s > 0 ? speed_m_s : s->speed_m_s, s->acceleration_m_s2);
    s->start_ns = clock_now_ns(s->clock);
    s->target_m = target_m;
    return 0;
}

/* It always knows where it is. */
static int sim_home(void *state)
{
    return sim_move(state, 0, 0);
}

static int sim_stop(void *state)
{
    struct stage_sim *s = state;
    double v, x = trapezoid_at(&s->motion, elapsed_s(s), &v);
    double rest_m = x + 0.5 * v * fabs(v) / s->acceleration_m_s2;
    trapezoid_plan(&s->motion, x, v, rest_m, s->speed_m_s, s->acceleration_m_s2);
    s->start_ns = clock_now_ns(s->clock);
    s->target_m = rest_m;
    return 0;
}

static void sim_status(void *state, struct stage_status *out)
{
    struct stage_sim *s = state;
    double v, t = elapsed_s(s), end_s = trapezoid_duration_s(&s->motion);
    out->position_m = trapezoid_at(&s->motion, t, &v);
    out->target_m = s->target_m;
    out->reach_m[0] = s->min_m;
    out->reach_m[1] = s->max_m;
    if (t < end_s)
        out->motion = STAGE_MOVING;
    else if (!s->fast && t < end_s + s->settle_s)
        out->motion = STAGE_SETTLING;
    else
        out->motion = STAGE_IDLE;
}

static void sim_close(void *state)
{
    free(state);
}

const struct stage_ops stage_sim_ops = {.scheme = "sim",
                                        .open = sim_open,
                                        .move = sim_move,
                                        .home = sim_home,
                                        .stop = sim_stop,
                                        .status = sim_status,
                                        .close = sim_close};
