/* nodes/launcher/voice.h -- what the launcher itself says on the bus: its health, once a
 * second, and its lines about the nodes, so that a recording has them too. */
#ifndef ANLOS_NODES_LAUNCHER_VOICE_H
#define ANLOS_NODES_LAUNCHER_VOICE_H

#include "msgs/bus.h"
#include "nodes/launcher/crew.h"
#include "nodes/launcher/supervisor.h"
#include "nodes/rt/log_topic.h"

struct voice { /* zeroed: mute */
    struct bus *bus;
    struct log_topic log;
    int64_t epoch_ns, due_ns;
    unsigned n_running, n_lost; /* as said last */
};

/* bus: of node "launcher"; NULL: there is none. */
void voice_open(struct voice *v, struct bus *bus, int64_t epoch_ns);

/* Before the bus is destroyed. */
void voice_close(struct voice *v);
void voice_log(struct voice *v, const struct log_line *line);

/* When it is time to, and at once when more or fewer run: ready while all nodes of the
 * crew run or have ended by themselves, else degraded. */
void voice_health(struct voice *v, int64_t now_ns, const struct crew *crew,
                  const struct supervisor *supervisor);

#endif
