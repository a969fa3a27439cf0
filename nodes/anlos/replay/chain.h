/* SPDX-License-Identifier: MIT */
/* nodes/anlos/replay/chain.h -- recorded messages through all stages (recon/pipeline.h)
 * and the can node's sender in one process: a recording gives the lists and the CAN
 * frames that it gives when the nodes hear it over the bus, bit for bit, because it is
 * the same code in the same order. */
#ifndef ANLOS_NODES_ANLOS_REPLAY_CHAIN_H
#define ANLOS_NODES_ANLOS_REPLAY_CHAIN_H

#include "hal/canbus.h"
#include "msgs/array.pb-c.h"
#include "msgs/detections.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/anlos/recon/report.h"
#include "nodes/can/sender.h"
#include "nodes/can/watch.h"
#include "recon/pipeline.h"

struct chain_config {
    struct pipeline_config pipeline; /* what it points to outlives the chain; without
                                      * walls of its own it takes the recorded lists */
    struct sender_config sender;
    struct canbus *can; /* the frames of each list go there; not owned */
};

/* What a step said that a person should know, each text once. */
struct chain_note {
    char text[256];
    size_t times;
};

struct chain {
    struct chain_config cfg;
    struct pipeline *pipeline;
    struct sender sender;
    struct watch watch;               /* of a replay: the state of the scan */
    struct volume volume;             /* the newest; borrows from the pipeline */
    Anlos__DetectionList *detections; /* of it; NULL: there is no image yet */
    size_t n_images, n_scene_pings, n_unusable, n_background_pings;
    uint64_t clipped;
    int64_t scan_epoch_ns;
    uint32_t scan_base, newest_scan; /* added to the recorded number; with it */
    int64_t list_ns;                 /* when the list before went out; 0: none did */
    struct chain_note notes[16];
    size_t n_notes, n_more_notes;
    struct stopwatch *stages; /* [RECON_STAGES], counted into, */
    struct stopwatch now;     /* and since when */
};

/* It stays where it is.  0, errors of pipeline_create. */
int chain_create(struct chain *c, const struct chain_config *cfg,
                 struct stopwatch stages[RECON_STAGES]);

/* Each takes a message as it was published: what the nodes would do until its effects
 * have come to the CAN bus.  0; errors of pipeline_survey; errors of canbus_send;
 * -ENOMEM.  The error says what. */
int chain_survey(struct chain *c, const Anlos__Survey *survey, struct error *why);
int chain_ping(struct chain *c, const Anlos__Ping *ping, int64_t capture_ns,
               int64_t publish_ns, struct error *why);
void chain_ego(struct chain *c, const Anlos__EgoMotion *ego, int64_t capture_ns,
               int64_t publish_ns);
void chain_ambient(struct chain *c, const Anlos__Ambient *ambient);
void chain_walls(struct chain *c, const Anlos__WallList *walls, int64_t capture_ns);
void chain_given(struct chain *c, const Anlos__WallList *given, int64_t capture_ns,
                 int64_t publish_ns);
int chain_status(struct chain *c, const Anlos__ScanStatus *status, int64_t epoch_ns,
                 struct error *why);

/* The bag has ended: a scan that was cut off gets its image. */
int chain_end(struct chain *c, struct error *why);
void chain_clear(struct chain *c);

#endif
