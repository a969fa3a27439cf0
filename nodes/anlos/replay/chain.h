/* nodes/anlos/replay/chain.h -- the steps of the nodes dsp, recon, wall, track and can
 * one after the other in one process: a recorded scan gives the lists and the CAN frames
 * that it gives when the nodes hear it over the bus, bit for bit, because it is the same
 * code in the same order. */
#ifndef ANLOS_NODES_ANLOS_REPLAY_CHAIN_H
#define ANLOS_NODES_ANLOS_REPLAY_CHAIN_H

#include "hal/canbus.h"
#include "msgs/array.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "nodes/anlos/recon/results.h"
#include "nodes/can/sender.h"
#include "nodes/can/watch.h"
#include "nodes/dsp/dsp.h"
#include "nodes/recon/fixed.h"
#include "nodes/recon/recon.h"
#include "nodes/track/tracking.h"
#include "nodes/wall/finding.h"

struct chain_config {
    struct frontend_config dsp;
    struct scan_imager_config recon; /* what it points to outlives the chain */
    bool fixed;                      /* an array that stands; then: */
    struct static_array_config steady;
    struct object_tracker_config track;
    struct sender_config sender;
    const struct launchfile *walls; /* with what node wall runs; NULL: it does not, and
                                     * its lists are those of the recording */
    struct canbus *can;             /* the frames of each list go there; not owned */
};

/* What a step said that a person should know, each text once. */
struct chain_note {
    char text[256];
    size_t times;
};

struct chain {
    struct chain_config cfg;
    struct dsp *dsp;
    struct recon *recon;   /* of a scan, else NULL */
    struct steady *steady; /* of a fixed array, else NULL */
    struct tracking *tracking;
    struct finding *finding; /* with cfg.walls, else NULL */
    struct sender sender;
    struct watch watch;               /* of a replay: the state of the scan */
    bool has_image;                   /* of the pings that are in */
    Anlos__Volume volume;             /* the newest; borrows from recon */
    Anlos__DetectionList *detections; /* of it; NULL: there is no image yet */
    size_t n_images, n_scene_pings, n_unusable, n_background_pings;
    uint64_t clipped;
    int64_t scan_epoch_ns;
    uint32_t scan_base, newest_scan; /* added to the recorded number; with it */
    int64_t list_ns;                 /* when the list before went out; 0: none did */
    struct chain_note notes[16];
    size_t n_notes, n_more_notes;
    struct stopwatch *stages; /* [RECON_STAGES], counted into */
};

/* 0, -ENOMEM, -EAGAIN (threads). */
int chain_create(struct chain *c, const struct chain_config *cfg,
                 struct stopwatch stages[RECON_STAGES]);

/* Each takes a message as it was published: what the nodes would do until its effects
 * have come to the CAN bus.  0; of a survey those of processing_plan and recon_survey;
 * errors of canbus_send; -ENOMEM.  The error says what. */
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
