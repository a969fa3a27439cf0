/* SPDX-License-Identifier: MIT */
/* nodes/scan/run.h -- one run of a stage that does not stop, from one round of pings to
 * another: it is brought before the first, sent off at its speed, and when its reports
 * tell that it goes at that, the array is told when it will be at the first round's
 * place.  One that is not up to speed by then goes back, farther. */
#ifndef ANLOS_NODES_SCAN_RUN_H
#define ANLOS_NODES_SCAN_RUN_H

#include "msgs/stage.pb-c.h"
#include "nodes/rt/stage_line.h"

enum run_progress {
    RUN_WAITS,
    RUN_TO_START, /* the stage is to stand before the first round, at go_m */
    RUN_SETS_OFF, /* and then to go to go_m at speed_m_s */
    RUN_FIRES,    /* once: the array begins at start_ns, when the stage is at first_m */
    RUN_RECORDS,  /* since then */
    RUN_FAILED,   /* it does not get up to speed; text says so */
};

struct run {
    double speed_m_s, first_m, end_m; /* it goes from first_m to end_m, where the last
                                         slot ends */
    double run_up_m, go_m;
    unsigned tries, late;
    bool stands;  /* before the first round, ready */
    bool set_off; /* has moved since */
    bool fired;
    int64_t start_ns;
    struct stage_line line; /* since it was sent off */
    char text[160];
};

/* A new one, from a round's place on, at a speed with its sign. */
void run_begin(struct run *r, double first_m, double end_m, double speed_m_s);

/* From where it gets up to speed to where it stands again. */
void run_room(const struct run *r, double room_m[2]);

/* The stage has been said to be at rest at the start; and what it reports on its way. */
void run_stands(struct run *r);
void run_report(struct run *r, const Anlos__StageState *state, int64_t at_ns);

enum run_progress run_step(struct run *r, int64_t now_ns);

#endif
