/* SPDX-License-Identifier: MIT */
/* nodes/stage/mover.h -- the node stage: commands to the hardware, its state to messages.
 * A person may take the stage by hand: then the scan has to wait until it is released, or
 * homed. */
#ifndef ANLOS_NODES_STAGE_MOVER_H
#define ANLOS_NODES_STAGE_MOVER_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/stage.h"
#include "msgs/stage.pb-c.h"
#include "nodes/rt/loop.h"

#define MOVER_TEXT_SIZE STAGE_TEXT_SIZE

struct mover {
    struct node *node;   /* not owned; NULL: for the steps below alone */
    struct stage *stage; /* whom the loop closes */
    bool heard;          /* the scan */
    int64_t tell_due_ns;
    bool commanded;
    uint32_t command_id;
    double target_m;
    char refusal[MOVER_TEXT_SIZE]; /* why the newest command cannot be done; or empty */
    uint64_t manual_id, manual_id_before;
    char manual_refusal[MOVER_TEXT_SIZE];
    bool held;   /* by hand */
    bool homing; /* by hand: at its end it is released */
    char note[MOVER_TEXT_SIZE];
    bool note_told;
    bool told;              /* a state has been given out */
    Anlos__StageState last; /* it, without its text */
    int64_t at_ns;          /* when its position was true */
    char text[MOVER_TEXT_SIZE];
    int64_t last_ns;
};

extern const struct loop mover_loop;

void mover_init(struct mover *m, struct node *node, struct stage *stage);

/* Ignored: a command seen before, and any while the stage is held by hand.  The
 * hardware's refusal shows in the state. */
void mover_command(struct mover *m, const Anlos__StageCommand *command);

void mover_manual(struct mover *m, const Anlos__StageManual *command);

/* What a person should know and has not been told yet, or NULL. */
const char *mover_note(struct mover *m);

/* Reads the stage.  true: the state in *out is to be published now, because it changed or
 * the last one is 50 ms (moving) or 500 ms (at rest) old.  Its text lives in m. */
bool mover_state(struct mover *m, int64_t now_ns, Anlos__StageState *out);

#endif
