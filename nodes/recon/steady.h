/* nodes/recon/steady.h -- the recon node's step for a fixed array (scan.mode fixed): the
 * newest pings to an image for every frame or every ping, from where the elements stood
 * when the vehicle moves (recon/frames.h).  Without bus and clock: benches and replays
 * call it as the node does. */
#ifndef ANLOS_NODES_RECON_STEADY_H
#define ANLOS_NODES_RECON_STEADY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/complaint.h"
#include "msgs/survey.pb-c.h"
#include "msgs/traces.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "recon/compressor.h"
#include "recon/frames.h"

struct steady_config {
    size_t threads;     /* 0: as many as processors may be used */
    enum window window; /* as dsp has them: they decide the traces' format */
    enum compression compression;
    size_t frame_pings; /* in a frame; 0: as many as there are speakers */
    size_t pings;       /* in an image; 0: as in a frame */
    enum frames_sum sum;
    bool every_ping;  /* an image; else every frame */
    bool moving_only; /* what stands still is muted where it was not subtracted */
};

struct steady;

/* 0, -ENOMEM, -EAGAIN (threads). */
int steady_create(struct steady **out, const struct steady_config *cfg);

/* Plans for a survey; the pings of another one are forgotten.  0, or a negative errno and
 * a complaint: also of a survey whose array moves by itself. */
int steady_survey(struct steady *s, const Anlos__Survey *survey, struct complaint *why);

/* What the vehicle says of its motion at an instant; what it calls invalid is left out.
 */
void steady_ego(struct steady *s, const Anlos__EgoMotion *ego, int64_t capture_ns);

/* The walls, as topic "wall" has them at a stamp: what cannot have come from behind one
 * is muted from then on (nodes/recon/first_return.h).  0, or -EINVAL with a complaint. */
int steady_walls(struct steady *s, const Anlos__WallList *walls, int64_t capture_ns,
                 struct complaint *why);

/* Takes one ping's traces.  true: an image is due; of two speakers that sound together,
 * with the second.  A frame that lacks its last ping is
 * due with the first of the next.  note[size] is for the log, empty when there is nothing
 * to say.  Before the first survey none can be used, and no note says so. */
bool steady_traces(struct steady *s, const Anlos__Traces *traces, int64_t capture_ns,
                   char *note, size_t size);

/* The image of the newest pings; with moving_only, where some had no background and the
 * vehicle's motion is known, see nodes/recon/clutter_map.h.  Borrowed, good until the
 * next call.  Its stamp is steady_capture_ns. */
void steady_image(struct steady *s, Anlos__Volume *out);
int64_t steady_capture_ns(const struct steady *s);

enum steady_motion {
    STEADY_STANDS,   /* nothing was ever said of motion: the vehicle counts as standing */
    STEADY_MOVES,    /* known, and made up for */
    STEADY_NO_MOUNT, /* known, but where the array sits is not: counts as standing */
    STEADY_UNKNOWN,  /* not known for a part of the newest image: counts as standing */
};

/* Of the newest image. */
enum steady_motion steady_motion(const struct steady *s);

struct steady_counts {
    uint64_t images;
    uint64_t unfit;     /* traces that did not fit the survey */
    uint64_t backwards; /* pings from before the newest: all others were forgotten */
    uint64_t unknown;   /* images with pings of unknown motion */
};

const struct steady_counts *steady_counts(const struct steady *s);
void steady_destroy(struct steady *s);

#endif
