/* nodes/scan/carriage.h -- the stage as the scan drives it: a command until the state
 * says that it was accepted and is done.  A fault, or a person's hand on it, it waits
 * out, and then begins anew. */
#ifndef ANLOS_NODES_SCAN_CARRIAGE_H
#define ANLOS_NODES_SCAN_CARRIAGE_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/stage.pb-c.h"

enum carriage_progress {
    CARRIAGE_THERE,  /* at rest at the target */
    CARRIAGE_MOVING, /* wait */
    CARRIAGE_SEND,   /* the command is to be sent, or sent again */
    CARRIAGE_PAUSED, /* a person has to home it, or release it; text says why */
    CARRIAGE_FAILED, /* the target is out of reach; text says why */
};

struct carriage {
    bool commanded;
    uint32_t id;
    double target_m;
    int64_t sent_ns;
    bool accepted, idle, refused;
    bool fault, held;
    double position_m; /* where it stands */
    char text[160];
};

void carriage_init(struct carriage *c);
void carriage_state(struct carriage *c, const Anlos__StageState *state);

/* The stage process was restarted: it knows no command. */
void carriage_forget(struct carriage *c);

/* Does it wait for a person?  As carriage_go with any target. */
bool carriage_is_paused(const struct carriage *c);

/* Brings the stage to the target.  On CARRIAGE_SEND, id and target_m are to be sent. */
enum carriage_progress carriage_go(struct carriage *c, double target_m, int64_t now_ns);

#endif
