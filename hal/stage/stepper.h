/* SPDX-License-Identifier: MIT */
/* hal/stage/stepper.h -- steps for a step-and-direction driver, one after the other in
 * the caller's thread.  A step is never sooner than the trapezoid of speed has it: one
 * that comes late moves all that follow, and when it broke the rhythm they start again
 * from the speed that was left.  Before each step the switches are looked at. */
#ifndef ANLOS_HAL_STAGE_STEPPER_H
#define ANLOS_HAL_STAGE_STEPPER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum stepper_line {
    STEPPER_STEP,
    STEPPER_DIRECTION,
    STEPPER_ENABLE,
    STEPPER_N_OUTPUTS,
    STEPPER_HOME = STEPPER_N_OUTPUTS,
    STEPPER_LIMIT, /* at the far end */
    STEPPER_ESTOP,
    STEPPER_N_LINES,
};
#define STEPPER_BIT(line) (1u << (line))

/* The lines and the clock, so that tests have a rail of their own.  Absent outputs accept
 * everything, absent inputs are never active. */
struct stepper_io {
    void *state;
    int64_t (*now_ns)(void *state);
    void (*sleep)(void *state, int64_t t_ns); /* never ends early */
    /* Sleeps until t_ns, or until an input changes. */
    void (*watch)(void *state, int64_t t_ns);
    int (*set)(void *state, enum stepper_line line, bool active); /* 0, -errno */
    /* Bits of the inputs that are active, or were since the last call.  0, -errno. */
    int (*inputs)(void *state, unsigned *active);
    bool (*cancelled)(void *state); /* something newer is to be done */
};

struct stepper_config {
    double acceleration; /* steps/s2 */
    int64_t pulse_ns;    /* the step line is active for so long, and then inactive */
    int64_t direction_setup_ns, enable_ns;
};

struct stepper {
    struct stepper_config cfg;
    struct stepper_io io;
    int64_t position; /* steps */
    bool enabled, forward, direction_set;
    int64_t ready_ns;                   /* when the pulse before is over */
    _Atomic uint64_t steps, late_steps; /* others may read them meanwhile */
};

enum stepper_end {
    STEPPER_ARRIVED,
    STEPPER_CANCELLED, /* braked to rest */
    STEPPER_INPUT,     /* one of stop_on is active: stopped at once */
    STEPPER_ERROR,     /* the lines cannot be used: stopped at once */
};

struct stepper_run {
    int64_t target;   /* steps */
    double speed;     /* steps/s */
    unsigned stop_on; /* bits of inputs */
    unsigned active;  /* out: which of stop_on ended it */
    int error;        /* out: of STEPPER_ERROR, -errno */
};

void stepper_init(struct stepper *s, const struct stepper_config *cfg,
                  const struct stepper_io *io);

/* Makes the steps from position to target, and returns when they are made. */
enum stepper_end stepper_go(struct stepper *s, struct stepper_run *run);

/* The driver holds the motor, or lets go of it.  0, -errno. */
int stepper_enable(struct stepper *s, bool on);

/* Position over time of what starts, moves and stops at a limited speed and
 * acceleration: the speed is a trapezoid, or a triangle where the way is too short for
 * full speed.  Any unit of length: metres, steps.  Pure functions; times in seconds. */

/* Pieces of constant acceleration, one after the other. */
struct trapezoid {
    size_t n_pieces;
    struct {
        double duration_s, acceleration;
    } pieces[4];
    double start, start_speed;
};

/* From x, at speed v (signed), to rest at the target.  speed, acceleration > 0.  Where v
 * leads away from the target or past it, it brakes to rest first. */
void trapezoid_plan(struct trapezoid *t, double x, double v, double target, double speed,
                    double acceleration);

double trapezoid_duration_s(const struct trapezoid *t);

/* Position after time_s; *speed too. */
double trapezoid_at(const struct trapezoid *t, double time_s, double *speed);

/* When position x is first reached.  For plans without a turn (v was 0 or led to the
 * target); an x beyond the end is reached at the end. */
double trapezoid_time_s(const struct trapezoid *t, double x);

/* A stepper on a rail: metres, homing, soft limits, backlash, and whether its place is
 * known.  Homing: fast to the switch, off it, slowly back to it, and off it by
 * back_off_m; there the axis stands at the end of its range. */

enum { STEPPER_AXIS_TEXT_SIZE = 128 };

struct stepper_axis_config {
    double steps_per_m;
    double speed_m_s, home_speed_m_s;
    double min_m, max_m;
    double back_off_m;
    double backlash_m;  /* under back_off_m; taken up by arriving away from home */
    bool has_home;      /* else homing says that it stands at the end of its range now */
    bool home_positive; /* the home switch is at max_m, else at min_m */
};

struct stepper_axis {
    struct stepper_axis_config cfg;
    struct stepper stepper;
    bool homed; /* its place is known */
    bool taut;  /* the backlash is taken up */
    int64_t home_steps;
    _Atomic uint64_t homings, limit_hits, estops;
    char text[STEPPER_AXIS_TEXT_SIZE]; /* why the last command failed */
};

void stepper_axis_init(struct stepper_axis *a, const struct stepper_axis_config *cfg,
                       const struct stepper_config *stepper, const struct stepper_io *io);

double stepper_axis_position_m(const struct stepper_axis *a);

/* Both block until the axis is at rest.  0, -ECANCELED (braked, place known), or: place
 * lost, text says why: -EIO (a limit, no home switch found), -ESHUTDOWN (emergency stop),
 * another negative errno (the lines).  move: -ERANGE, -ESTALE (place not known);
 * speed_m_s 0: the axis' own. */
int stepper_axis_home(struct stepper_axis *a);
int stepper_axis_move(struct stepper_axis *a, double target_m, double speed_m_s);

/* At rest: looks at the switches.  0, or as above. */
int stepper_axis_watch(struct stepper_axis *a);

#endif
