/* SPDX-License-Identifier: MIT */
/* nodes/play/playback.h -- plays a bag: what was recorded goes out under the names of
 * those who sent it, and nobody can tell it from live but by its source, which is REPLAY.
 *
 * It waits until who is to hear it is ready.  Every node of the replay says how far it is
 * (topic "progress"), the last of each chain too, and at every pace no more is under way
 * than all of their queues hold.  The end of a scan is held back until all of its pings
 * are used, and what comes after it until its list of objects is there: so the same bag
 * gives the same lists, whatever the pace and the machine. */
#ifndef ANLOS_NODES_PLAY_PLAYBACK_H
#define ANLOS_NODES_PLAY_PLAYBACK_H

#include "msgs/clock.pb-c.h"
#include "msgs/detections.pb-c.h"
#include "msgs/health.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/traces.pb-c.h"
#include "nodes/play/account.h"
#include "nodes/play/bag_iterator.h"

struct playback_config { /* what it points to outlives the player */
    struct bag_iterator_config bag_iterator;
    const char *run_dir;
    double rate; /* of the recording's pace; 0: as fast as it is used */
    bool loop, paused;
    const char *topics, *exclude; /* patterns with commas between; NULL: the default */
    const char *const *nodes;     /* [n_nodes] that run beside it, of the launch file */
    size_t n_nodes;
    bool alone;         /* no launch file: whoever is alive in the run folder */
    bool fixed;         /* they take an array that stands, if not alone */
    bool several_hosts; /* who is connected cannot be known */
    unsigned window;    /* pings under way, 1 to ACCOUNT_MAX */
    double timeout_s;   /* after the last receipt, a ping counts as missing */
};

struct playback;

/* Takes the names of whoever it stands in for.  0; errors of bag_iterator_open; -EINVAL
 * (nothing is left to play), -EADDRINUSE (a node of a live system runs in the runtime
 * directory, or one of the names is alive and not of the launch file); errors of
 * bus_create. */
int playback_create(struct playback **out, const struct playback_config *cfg,
                    int64_t epoch_ns, struct error *why);

/* What the others say; now_ns by the machine's clock, here and below. */
void playback_health(struct playback *p, const char *from, int64_t epoch_ns,
                     const Anlos__Health *h, int64_t now_ns);
void playback_receipt(struct playback *p, const Anlos__Receipt *r, int64_t now_ns);
void playback_progress(struct playback *p, const char *from, const Anlos__Progress *m);
void playback_list(struct playback *p, const Anlos__DetectionList *list);

/* Where there is no recon, dsp's traces say that a ping was used. */
void playback_traces(struct playback *p, const Anlos__Traces *t, int64_t now_ns);
bool playback_wants_traces(const struct playback *p);

/* What all have to hear for that, when it is new; else false.  Borrows from the player
 * until it is destroyed; lists are of the caller's. */
bool playback_tells(struct playback *p, Anlos__Progress *out, Anlos__Sent *sent,
                    Anlos__Sent **list, char **nodes, size_t max, int64_t now_ns);

/* Is somebody waited for whose receipts and lists come here?  Then so many publishers of
 * the topic have to be connected before play begins. */
size_t playback_speakers(const struct playback *p, const struct topic *t);
void playback_hears(struct playback *p, bool all);

/* Publishes one message, or none; *due_ns: not before then will there be anything to do
 * unless something comes in (INT64_MAX: never).  0; errors of the bag iterator and of
 * bus_publish; the error says what. */
int playback_step(struct playback *p, int64_t now_ns, int64_t *due_ns, struct error *why);

enum playback_phase { PLAYBACK_WAITS, PLAYBACK_PLAYS, PLAYBACK_PAUSES, PLAYBACK_ENDED };

struct playback_status {
    enum playback_phase phase;
    char text[200]; /* who is waited for; empty: nobody */
    double rate;
    int64_t at_ns, start_ns, end_ns; /* publish stamps: newest, first, last */
    uint64_t messages, malformed, lists, rounds;
    bool heard;    /* somebody was connected to the topic of one of them */
    uint64_t lost; /* messages that did not reach who uses them, and nodes that stopped
                    * using them: the results are not those of the recording */
    struct account pings;
};

void playback_status(const struct playback *p, struct playback_status *out);

/* What a person should know, once; NULL: nothing new. */
const char *playback_note(struct playback *p);

/* From the keyboard. */
void playback_pause(struct playback *p, bool paused, int64_t now_ns);
void playback_one(struct playback *p); /* while it pauses: one message more */
void playback_rate(struct playback *p, double rate, int64_t now_ns);
void playback_seek(struct playback *p, int64_t publish_ns);

const char *playback_bag(const struct playback *p);

/* The i-th node that it stands in for, or NULL. */
const char *playback_stands_for(const struct playback *p, size_t i);
void playback_destroy(struct playback *p);

#endif
