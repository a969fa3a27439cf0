/* SPDX-License-Identifier: MIT */
/* nodes/can/watch.h -- may what the sensor says be trusted now?  A watchdog on each thing
 * that it depends on: what comes is told, time is an argument, and out come the state and
 * the faults of the status frame.  Nothing here waits, reads a clock or sends.
 *
 * | fault | is raised | state | goes after |
 * | image stale * | 100 ms after a list was due, one longest interval of the newest four
 *     after the last (over 1 s at most twice the shortest, when two or more are known);
 *     at once when its sound is older than 500 ms, or of the future
 *     | fault | 1 s |
 * | ego missing * | 100 ms after the last motion that was valid | degraded | 1 s |
 * | temperature unknown * | 3 s after the last of the vehicle's; while it never told one,
 *     if the survey has none | degraded | 1 s |
 * | channels dead | at once when a microphone is silent or hears no speaker, or a speaker
 *     is heard by none | degraded; blocked when half of the microphones or more are
 *     silent, damaged or clipped, or half of the speakers | 1 s |
 * | element errors | at once when one gives what are no numbers | the same | 1 s |
 * | wall lost * | at once when a list says no places in the vehicle: no wall or no mount
 *     is known; if the node wall runs, also at once when no wall is likely or none was
 *     seen or given for 2 s, and 0.5 s after its last word | degraded | 1 s |
 * | clock jump | at once when the wall clock has moved by 20 ms | degraded | 5 s |
 * | input E2E wrong | at once when a frame is damaged, repeated or out of sequence, and
 *     while an input is invalid (nodes/can/inbox.h) | degraded | 1 s |
 * | array away | at once when its node says so | fault | 1 s |
 * | node lost | at once when the launcher sees one end or a node calls itself faulty; of
 *     a fixed array * 2.5 s after its last health | degraded | 1 s |
 * | clipped | at once when a microphone clips | as channels dead | 1 s |
 * | lists dropped | at once when the bus did not take one, or one was malformed
 *     (nodes/can/list_check.h) | degraded | 5 s |
 * | range reduced * | at once when a person at the end of the gate would be missed in the
 *     noise of now | degraded | 1 s |
 * | elements covered | at once when a microphone or a speaker is | blocked | 1 s |
 * | elements moved | at once when a microphone or a speaker has | degraded | 1 s |
 * | interference * | at once when another array or a tone is heard | degraded | 1 s |
 *
 * "At once" is with the next watch_step.  * only of a fixed array: the image of a scan
 * may take its time.  What was not there while this node itself did not run is not missed
 * for up to 500 ms: it may be waiting to be taken.
 *
 *            nothing wrong for 1 s,          a fault of that state, at once
 *            or 10 s                      .-----------------------------------.
 *     init ----------------------------> active -> degraded -> blocked -> fault
 *      ^                                  ^          ^           ^           |
 *      | at once: the scan waits          '----------'-----------'-----------'
 *      '-- any state                       1 s without the faults of what is worse
 *
 * Worse is at once, better takes WATCH_HEALTH_NS without a break: each fault goes when it
 * was not there for that long or longer, so does what makes the difference between
 * degraded and blocked, and the state gets better once in that time at most.  So what
 * flaps once a second or faster changes the state once, and whatever flaps, in T seconds
 * the state gets better T times at most.  The worst fault's state counts; without faults
 * it is that of the scan, and so it is, at once, whatever the faults are, while the scan
 * waits, records its background, is held (standby) or has failed.
 *
 * Objects are sent while a fixed array is active or degraded; of a scan unless it is
 * faulty, blocked or on standby, which is a stage that a person holds.  In a replay only
 * the state of the scan counts: nothing there is now. */
#ifndef ANLOS_NODES_CAN_WATCH_H
#define ANLOS_NODES_CAN_WATCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/can/frames.h"
#include "msgs/detections.pb-c.h"
#include "msgs/envelope.h"
#include "msgs/health.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/wall.pb-c.h"

#define WATCH_STALE_NS  500000000LL  /* sound that is older is of the past */
#define WATCH_HEALTH_NS 1000000000LL /* without a break, before anything gets better */
#define WATCH_STEP_NS   20000000LL
#define WATCH_MAX_NODES 16
#define WATCH_INTERVALS 4

enum { WATCH_SILENT, WATCH_DAMAGED, WATCH_CLIPPED, WATCH_SUBSCRIPTIONS };
enum { WATCH_MUTE = WATCH_SUBSCRIPTIONS, WATCH_CHANNEL_KINDS }; /* speakers */

struct watch_config {
    bool fixed;    /* an array that stands and fires without end */
    bool replayed; /* only the state of the scan counts */
    bool ego;      /* the vehicle tells its motion */
    bool wall;     /* the node wall runs */
};

struct watch_channels { /* so many microphones or speakers of so many */
    uint32_t count, of;
};

struct watch_node { /* that was heard */
    char name[ENVELOPE_NODE_SIZE];
    int64_t heard_ns;
    bool faulty; /* says so itself */
    uint32_t away, lost, reduced, covered, moved, interfered;
    struct watch_channels channels[WATCH_CHANNEL_KINDS];
};

struct watch {
    struct watch_config cfg;
    enum can_state scan, state;
    uint16_t faults, counted;
    int64_t last_bad_ns[CAN_FAULTS];
    uint8_t raised[CAN_FAULTS]; /* times, up to 255 */
    bool blind; /* most microphones or speakers are of no use, or were lately */
    int64_t last_blind_ns;
    bool begun;
    int64_t began_ns;     /* when it could have; 0: not yet */
    bool judged;          /* the state is that of the faults */
    int64_t changed_ns;   /* since when that is so */
    int64_t stepped_ns;   /* of the newest step; 0: none */
    int64_t unwatched_ns; /* this node did not run, in all; as it was at a stamp: */
    struct watch_node nodes[WATCH_MAX_NODES]; /* [n_nodes] */
    size_t n_nodes;

    int64_t list_ns, capture_ns; /* of the newest list; 0: none */
    bool placed;                 /* it says where in the vehicle's frame */
    int64_t list_unwatched_ns;
    int64_t intervals_ns[WATCH_INTERVALS]; /* between lists, a ring */
    size_t n_lists;
    int64_t ego_ns, ambient_ns; /* of the newest that was valid; 0: none */
    double survey_c, ambient_c; /* NaN: not known */
    int64_t walls_ns;           /* of the node's newest word; 0: none */
    int64_t walls_unwatched_ns;
    bool wall_likely; /* as it says */
    int64_t ahead_ns; /* of the wall clock, as seen last */
    bool clock_seen;
    double range_m;   /* as the array says; NaN: not known */
    int64_t range_ns; /* when it said so */
    uint16_t events;  /* faults that happened since the last step */
    uint64_t lists_dropped;
};

void watch_init(struct watch *w, const struct watch_config *cfg);

/* What has happened, at now_ns by the clock of watch_step. */
void watch_scan(struct watch *w, const Anlos__ScanStatus *status);
void watch_survey(struct watch *w, double temperature_c);
void watch_list(struct watch *w, const Anlos__DetectionList *list, int64_t capture_ns,
                int64_t now_ns);
void watch_ego(struct watch *w, int64_t now_ns);
void watch_ambient(struct watch *w, double temperature_c, int64_t now_ns);
void watch_walls(struct watch *w, const Anlos__WallList *walls, int64_t now_ns);
void watch_health(struct watch *w, const Anlos__Health *health, int64_t now_ns);
void watch_wrong_input(struct watch *w);
void watch_clock(struct watch *w, int64_t ahead_ns);
void watch_dropped(struct watch *w, uint64_t lists);

/* To be called at least every WATCH_STEP_NS, and when something has happened. */
void watch_step(struct watch *w, int64_t now_ns);

enum can_state watch_state(const struct watch *w);
uint16_t watch_faults(const struct watch *w);

/* The faults that can be there in this configuration. */
uint16_t watch_tested(const struct watch *w);

/* The names of the faults, with commas between; empty: there are none. */
void watch_text(const struct watch *w, char *text, size_t size);

/* The vehicle's temperature, or the survey's as long as the vehicle never told one; NaN:
 * not known, or not any more. */
double watch_temperature_c(const struct watch *w);

/* Up to which range a person is found, to the step of its signal that is below; NaN: not
 * known, or there is no wall. */
double watch_range_m(const struct watch *w);

/* May objects be sent? */
bool watch_lets_objects(const struct watch *w);

#endif
