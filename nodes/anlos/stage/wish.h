/* nodes/anlos/stage/wish.h -- what a person wants of the stage, and how its state is told
 * to one. */
#ifndef ANLOS_NODES_ANLOS_STAGE_WISH_H
#define ANLOS_NODES_ANLOS_STAGE_WISH_H

#include <stdbool.h>
#include <stddef.h>

enum stage_verb { VERB_STATUS, VERB_HOME, VERB_MOVE, VERB_STOP, VERB_RELEASE };

struct stage_wish {
    enum stage_verb verb;
    double target_m; /* of VERB_MOVE */
};

struct stage_sight {
    const char *state; /* "idle" */
    double position_m;
    bool homed;
    const char *text; /* what is wrong; or empty */
};

/* "idle at 0.1000 m", and what else there is to know, as a line on stdout. */
void stage_sight_print(const struct stage_sight *s);

/* With a system that runs in the folder: through its stage process.  An exit code. */
int stage_wish_remote(const char *run_dir, const struct stage_wish *wishes, size_t n);

/* Without one: opens the device itself.  An exit code. */
int stage_wish_direct(const char *uri, const struct stage_wish *wishes, size_t n);

#endif
