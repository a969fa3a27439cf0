/* SPDX-License-Identifier: MIT */
/* nodes/launcher/host_peers.h -- the launchers of a system's other machines: whether they
 * are there, how their clocks differ, and how all come to an end.
 *
 * The host with the report ends when that is written, the others when they hear so.  One
 * that failed ends the others.  One that was stopped by a signal, or is not heard, is
 * waited for: a link or a machine may come back. */
#ifndef ANLOS_NODES_LAUNCHER_HOST_PEERS_H
#define ANLOS_NODES_LAUNCHER_HOST_PEERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/bus.h"
#include "msgs/host.pb-c.h"
#include "msgs/hosts.h"

#define HOST_PEERS_SILENCE_NS  3000000000LL  /* then it is said that one is not heard */
#define HOST_PEERS_PATIENCE_NS 60000000000LL /* then the system is given up */
#define HOST_PEERS_FAREWELL_NS 10000000000LL /* for all to hear how it ended */
#define HOST_PEERS_TEXT_SIZE   200
#define HOST_PEERS_SAMPLES     8

struct host_peer {
    char name[HOSTS_NAME_SIZE];
    int64_t epoch_ns;          /* 0: never heard */
    int64_t sent_ns, heard_ns; /* its newest message: by its clock, by ours */
    int64_t knows_ns;          /* the stamp of our newest message that it has heard */
    Anlos__HostStatus__State state;
    char text[HOST_PEERS_TEXT_SIZE];
    bool ran; /* was heard while it ran: only then its end is one of this run */
    bool silent, returned, restarted, ended, other_file, clock_known; /* to be told */
    int64_t silence_ns; /* how long it was */
    uint64_t silences;
    unsigned n_samples; /* since it started; of them the newest are kept */
    double ahead_s[HOST_PEERS_SAMPLES], round_trip_s[HOST_PEERS_SAMPLES];
};

struct host_peers {
    char name[HOSTS_NAME_SIZE]; /* ours */
    int64_t epoch_ns;
    uint64_t launch_file;
    Anlos__HostStatus__State state;
    int64_t state_ns; /* since when */
    char text[HOST_PEERS_TEXT_SIZE];
    size_t n;
    struct host_peer list[HOSTS_MAX];
    Anlos__HostSight sights[HOSTS_MAX], *sight_list[HOSTS_MAX];
};

/* The other hosts of h; epoch_ns: of our messages. */
void host_peers_init(struct host_peers *f, const struct hosts *h, int64_t epoch_ns,
                     uint64_t launch_file);

/* A message has come in; what is our own is ignored. */
void host_peers_hear(struct host_peers *f, const Anlos__HostStatus *m, int64_t epoch_ns,
                     int64_t publish_ns, int64_t now_ns);

/* What is to be published now; it borrows from f. */
void host_peers_say(struct host_peers *f, Anlos__HostStatus *out);

/* We come to an end, and why; the first time counts. */
void host_peers_end(struct host_peers *f, Anlos__HostStatus__State state,
                    const char *text, int64_t now_ns);

enum host_peers_verdict {
    HOST_PEERS_GO_ON,
    HOST_PEERS_NOTE,    /* text is worth a line; ask again */
    HOST_PEERS_WARNING, /* as well */
    HOST_PEERS_DONE,    /* the results are written; text says where */
    HOST_PEERS_FAILED,  /* text says who and why */
};
enum host_peers_verdict host_peers_judge(struct host_peers *f, int64_t now_ns,
                                         char text[HOST_PEERS_TEXT_SIZE]);

/* May we go?  Yes when all others know how it ended, or cannot be reached. */
bool host_peers_may_leave(const struct host_peers *f, int64_t now_ns);

/* The peers on the bus: what the launcher says to those of other hosts,
 * and hears of them. */

struct host_peering { /* zeroed: all on one machine */
    struct host_peers host_peers;
    struct bus *bus;
    int64_t tell_ns; /* when the others are told again how we are */
};

/* bus: of node "launcher"; it subscribes to their topic.  0 or a negative errno. */
int host_peering_open(struct host_peering *f, struct bus *bus, const struct hosts *hosts,
                      int64_t epoch_ns, uint64_t launch_file);

/* A message of topic "host". */
void host_peering_hear(struct host_peering *f, const ProtobufCMessage *m,
                       const struct envelope *e, int64_t now_ns);

/* Speaks when it is time to.  When that is again; INT64_MAX: never. */
int64_t host_peering_tell(struct host_peering *f, int64_t now_ns);

/* The launcher will end with this code; results: their folder when they are written here,
 * or NULL.  The first time counts. */
void host_peering_end(struct host_peering *f, int exit_code, const char *results,
                      int64_t now_ns);
bool host_peering_may_leave(const struct host_peering *f, int64_t now_ns);

#endif
