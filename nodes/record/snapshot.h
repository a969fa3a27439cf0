/* SPDX-License-Identifier: MIT */
/* nodes/record/snapshot.h -- "save the last 30 s": a ring of what came (ring.h), and on
 * request a bag of it, FOLDER/20260301T120000Z_REASON.mcap, with so many seconds before
 * the request and after it, of use by itself.
 *
 * Requests are messages of topic "record/save", and new faults in "health": each fault of
 * a node once, and once more when it went and an hour is over.  One that comes while a
 * bag is being written makes that longer, up to LONGEST times what one request takes;
 * after that it waits, and gets a bag of its own.
 *
 * Messages are written a few at a time, between those that come in.  What is not written
 * yet stays in the ring beyond its time, but not beyond its bytes: a disk that is slower
 * than that loses messages of the bag, counted in it, and none of the ring.  An error of
 * writing ends that bag, whole with what fitted, and the ring lives on. */
#ifndef ANLOS_NODES_RECORD_SNAPSHOT_H
#define ANLOS_NODES_RECORD_SNAPSHOT_H

#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"
#include "msgs/bag/compression.h"
#include "msgs/bus.h"
#include "msgs/envelope.h"
#include "msgs/health.pb-c.h"
#include "msgs/save.pb-c.h"
#include "nodes/record/session.h"
#include "nodes/rt/log.h"

#define SNAPSHOT_LONGEST  4
#define SNAPSHOT_AGAIN_NS 3600000000000LL

struct snapshot_config {
    const char *folder; /* NULL: keeps nothing, and refuses requests */
    int64_t before_ns, after_ns;
    size_t max_bytes;
    bool on_faults;
    const struct topic *const *topics; /* [n_topics] that bags have */
    size_t n_topics;
    enum bag_compression compression;
    bool shuffle;                  /* msgs/shuffle.h, of sound and images */
    const struct session *session; /* outlives it */
    void (*say)(void *context, enum log_level level, const char *text);
    void *context;
};

struct snapshot;

/* Makes the folder, and tries it.  0, -ENOMEM, errno of that; the error says which. */
int snapshot_create(struct snapshot **out, const struct snapshot_config *cfg,
                    struct error *why);

/* Whether it has to hear this topic, whatever bags have. */
bool snapshot_wants(const struct snapshot *s, const struct topic *t);

/* A message that came, which it takes over. */
void snapshot_put(struct snapshot *s, struct bus_message *m, int64_t now_ns);

/* So many messages of the topic are lost by now. */
void snapshot_lost(struct snapshot *s, const struct topic *t, uint64_t total,
                   int64_t now_ns);

/* from: who asks, a node's name.  false: nothing is saved of it; the status says why. */
bool snapshot_request(struct snapshot *s, const char *from, const char *reason,
                      int64_t now_ns);

/* When snapshot_step is to be called; 0: at once; INT64_MAX: after a message. */
int64_t snapshot_due_ns(const struct snapshot *s);

/* Writes some of what is to be written. */
void snapshot_step(struct snapshot *s, int64_t now_ns);

/* Writes what there is of the bag under way, at once. */
void snapshot_end(struct snapshot *s, int64_t now_ns);

/* Counts up whenever the status has news. */
uint64_t snapshot_news(const struct snapshot *s);

/* Borrows from the snapshot until it is called next. */
void snapshot_status(const struct snapshot *s, int64_t now_ns, Anlos__SaveStatus *out);

/* Counted beside those of the status: faults that came again too soon. */
uint64_t snapshot_faults_again(const struct snapshot *s);

/* Ends it too. */
void snapshot_destroy(struct snapshot *s);

/* Which faults that nodes state (topic "health") are new. */

#define NEW_FAULTS_MAX  64 /* different ones of all nodes; more are not told */
#define NEW_FAULTS_NAME 32

struct new_faults {   /* starts as {0} but for again_ns */
    int64_t again_ns; /* the same one is new again after that long */
    struct {
        char node[ENVELOPE_NODE_SIZE], name[NEW_FAULTS_NAME];
        bool lasts;
        int64_t told_ns;
    } list[NEW_FAULTS_MAX];
    size_t n;
    uint64_t again; /* that came again before */
};

/* A fault that this node did not state before, "fault" for its state without one; NULL:
 * there is none.  To be called until then. */
const char *new_faults_next(struct new_faults *f, const char *node,
                            const Anlos__Health *h, int64_t now_ns);

#endif
