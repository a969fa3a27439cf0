/* nodes/launcher/fellowship.h -- the fellows (fellows.h) on the bus: what the launcher
 * says to those of other hosts, and hears of them. */
#ifndef ANLOS_NODES_LAUNCHER_FELLOWSHIP_H
#define ANLOS_NODES_LAUNCHER_FELLOWSHIP_H

#include "msgs/bus.h"
#include "nodes/launcher/fellows.h"

struct fellowship { /* zeroed: all on one machine */
    struct fellows fellows;
    struct bus *bus;
    int64_t tell_ns; /* when the others are told again how we are */
};

/* bus: of node "launcher"; it subscribes to their topic.  0 or a negative errno. */
int fellowship_open(struct fellowship *f, struct bus *bus, const struct hosts *hosts,
                    int64_t epoch_ns, uint64_t launch_file);

/* A message of topic "host". */
void fellowship_hear(struct fellowship *f, const ProtobufCMessage *m,
                     const struct envelope *e, int64_t now_ns);

/* Speaks when it is time to.  When that is again; INT64_MAX: never. */
int64_t fellowship_tell(struct fellowship *f, int64_t now_ns);

/* The launcher will end with this code; results: their folder when they are written here,
 * or NULL.  The first time counts. */
void fellowship_end(struct fellowship *f, int exit_code, const char *results,
                    int64_t now_ns);
bool fellowship_may_leave(const struct fellowship *f, int64_t now_ns);

#endif
