/* nodes/launcher/fellows.h -- the launchers of a system's other machines: whether they
 * are there, how their clocks differ, and how all come to an end.
 *
 * The host with the report ends when that is written, the others when they hear so.  One
 * that failed ends the others.  One that was stopped by a signal, or is not heard, is
 * waited for: a link or a machine may come back. */
#ifndef ANLOS_NODES_LAUNCHER_FELLOWS_H
#define ANLOS_NODES_LAUNCHER_FELLOWS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/bus.h"
#include "msgs/host.pb-c.h"
#include "msgs/hosts.h"

#define FELLOWS_SILENCE_NS  3000000000LL  /* then it is said that one is not heard */
#define FELLOWS_PATIENCE_NS 60000000000LL /* then the system is given up */
#define FELLOWS_FAREWELL_NS 10000000000LL /* for all to hear how it ended */
#define FELLOWS_TEXT_SIZE   200
#define FELLOWS_SAMPLES     8

struct fellow {
    char name[HOSTS_NAME_SIZE];
    int64_t epoch_ns;          /* 0: never heard */
    int64_t sent_ns, heard_ns; /* its newest message: by its clock, by ours */
    int64_t knows_ns;          /* the stamp of our newest message that it has heard */
    Anlos__HostStatus__State state;
    char text[FELLOWS_TEXT_SIZE];
    bool ran; /* was heard while it ran: only then its end is one of this run */
    bool silent, returned, restarted, ended, other_file, clock_known; /* to be told */
    int64_t silence_ns; /* how long it was */
    uint64_t silences;
    unsigned n_samples; /* measured since it started; the newest FELLOWS_SAMPLES kept */
    double ahead_s[FELLOWS_SAMPLES], round_trip_s[FELLOWS_SAMPLES];
};

struct fellows {
    char name[HOSTS_NAME_SIZE]; /* ours */
    int64_t epoch_ns;
    uint64_t launch_file;
    Anlos__HostStatus__State state;
    int64_t state_ns; /* since when */
    char text[FELLOWS_TEXT_SIZE];
    size_t n;
    struct fellow list[HOSTS_MAX];
    Anlos__HostSight sights[HOSTS_MAX], *sight_list[HOSTS_MAX];
};

/* The other hosts of h; epoch_ns: of our messages. */
void fellows_init(struct fellows *f, const struct hosts *h, int64_t epoch_ns,
                  uint64_t launch_file);

/* A message has come in; what is our own is passed over. */
void fellows_hear(struct fellows *f, const Anlos__HostStatus *m, int64_t epoch_ns,
                  int64_t publish_ns, int64_t now_ns);

/* What is to be published now; it borrows from f. */
void fellows_say(struct fellows *f, Anlos__HostStatus *out);

/* We come to an end, and why; the first time counts. */
void fellows_end(struct fellows *f, Anlos__HostStatus__State state, const char *text,
                 int64_t now_ns);

enum fellows_verdict {
    FELLOWS_GO_ON,
    FELLOWS_NOTE,    /* text is worth a line; ask again */
    FELLOWS_WARNING, /* as well */
    FELLOWS_DONE,    /* the results are written; text says where */
    FELLOWS_FAILED,  /* text says who and why */
};
enum fellows_verdict fellows_judge(struct fellows *f, int64_t now_ns,
                                   char text[FELLOWS_TEXT_SIZE]);

/* May we go?  Yes when all others know how it ended, or cannot be reached. */
bool fellows_may_leave(const struct fellows *f, int64_t now_ns);

/* The fellows (fellows.h) on the bus: what the launcher says to those of other hosts,
 * and hears of them. */

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
