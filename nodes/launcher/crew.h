/* nodes/launcher/crew.h -- the node processes of a launch together: who runs, who is
 * still to be started, and signals to many at once.
 *
 * One that is aside (the recorder) does not keep the launch going, is started first and
 * stopped last. */
#ifndef ANLOS_NODES_LAUNCHER_CREW_H
#define ANLOS_NODES_LAUNCHER_CREW_H

#include "nodes/launcher/child.h"
#include "nodes/launcher/launcher.h"
#include "nodes/launcher/program.h"

#define CREW_MAX 16

struct crew {
    unsigned n;
    struct child children[CREW_MAX];
    struct program programs[CREW_MAX];
};

/* Those of the launch file's nodes that run on this host; none is started yet.  c must
 * stay where it is, and cfg what it is.  0, -ENAMETOOLONG. */
int crew_fill(struct crew *c, const struct launcher_config *cfg);

/* Does the process of any live?  aside: those count too. */
bool crew_runs(const struct crew *c, bool aside);

/* Does any run that is not aside, or is about to? */
bool crew_goes_on(const struct crew *c);

/* Is the one of this name aside?  NULL: is any? */
bool crew_has_aside(const struct crew *c, const char *name);
unsigned crew_count(const struct crew *c, enum child_phase phase);

/* Those that should run and do not, but for onlookers (nodes/rt/onlooker.h): what comes
 * out of the system is less without them. */
unsigned crew_lost(const struct crew *c);

/* To those that are aside, or to all others. */
void crew_signal(const struct crew *c, bool aside, int number);

/* Those that were never started and are not aside are to be, at start_ns. */
void crew_start_rest(struct crew *c, int64_t start_ns);

#endif
