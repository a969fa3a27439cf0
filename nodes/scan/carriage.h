/* nodes/scan/carriage.h -- the stage as the scan drives it: a command until the state
 * says that it was accepted and is done. */
#ifndef ANLOS_NODES_SCAN_CARRIAGE_H
#define ANLOS_NODES_SCAN_CARRIAGE_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/stage.pb-c.h"

enum carriage_progress {
    CARRIAGE_THERE,  /* at rest at the target */
    CARRIAGE_MOVING, /* wait */
    CARRIAGE_SEND,   /* the command is to be sent, or sent again */
    CARRIAGE_FAILED, /* gave up; text says why */
};

struct carriage {
    unsigned retries; /* after a fault */
    bool commanded;
    uint32_t id;
    double target_m;
    int64_t sent_ns;
    bool accepted, idle, fault;
    unsigned faults;
    double position_m; /* where it stands */
    char text[128];
};

void carriage_init(struct carriage *c, unsigned retries);
void carriage_state(struct carriage *c, const Anlos__StageState *state);

/* The stage process was restarted: it knows no command. */
void carriage_forget(struct carriage *c);

/* Brings the stage to the target.  On CARRIAGE_SEND, id and target_m are to be sent. */
enum carriage_progress carriage_go(struct carriage *c, double target_m, int64_t now_ns);

#endif
