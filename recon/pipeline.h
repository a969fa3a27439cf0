/* SPDX-License-Identifier: MIT */
/* recon/pipeline.h -- all stages in one: a ping to traces (recon/frontend/frontend.h), to
 * the image of a scan or of a static array (recon/imaging/scan_imager.h,
 * recon/static_array/static_array.h), to the hidden objects in it
 * (recon/tracking/object_tracker.h), by the walls that mirror them
 * (recon/walls/wall_finder.h).  Each process of nodes/ holds one of these stages; here
 * they follow each other in the order of a replay: of one instant an image comes before
 * the walls that were heard in it.  So a recording gives the same bytes either way.
 *
 * What is fed is copied or used up before a call returns.  One thread at a time; it works
 * on as many as it was created with. */
#ifndef ANLOS_RECON_PIPELINE_H
#define ANLOS_RECON_PIPELINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "recon/frontend/frontend.h"
#include "recon/imaging/scan_imager.h"
#include "recon/static_array/static_array.h"
#include "recon/tracking/object_tracker.h"
#include "recon/walls/wall_finder.h"

enum pipeline_stage {
    PIPELINE_COMPRESS, /* a ping to traces */
    PIPELINE_STACK,    /* traces into what is imaged */
    PIPELINE_IMAGE,
    PIPELINE_DETECT, /* objects and tracks */
};

struct pipeline_config { /* compression and threads are the same for all */
    struct frontend_config frontend;
    bool is_static; /* a static array; else a scan */
    struct static_array_config array;
    struct scan_imager_config scan;
    struct object_tracker_config tracker;
    bool finds_walls; /* else they are those that pipeline_walls is given, and before it
                         is called the survey's */
    struct wall_finder_config walls;
    /* After each stage of a ping, for whoever times them; or NULL. */
    void (*did)(void *ctx, enum pipeline_stage stage);
    void *ctx;
};

/* What holds where nothing is said: one thread, the method `fast` for a scan, powers of a
 * static array's pings, no background, the survey's walls. */
void pipeline_config_default(struct pipeline_config *cfg, bool is_static);

struct pipeline_output { /* borrows from the pipeline until its next ping */
    const struct frontend_output *front; /* NULL: not of a ping */
    bool unfit;     /* its traces do not fit the survey, and were left out of a scan */
    char note[128]; /* of image and walls, for the log; empty: nothing new */
    const struct volume *image;        /* NULL: none was due */
    const struct object_list *objects; /* in that image; NULL: there is none */
    int64_t taken_ns;                  /* when the newest ping of that image came in */
};

struct pipeline;

/* 0, -EINVAL (a value out of its range), -ENOMEM, -EAGAIN (threads). */
int pipeline_create(struct pipeline **out, const struct pipeline_config *cfg);

/* Plans for a survey, which it copies; what was heard of another one is forgotten.  0, or
 * a negative errno with an error; then no ping can be used. */
int pipeline_survey(struct pipeline *p, const struct survey *survey, struct error *why);

/* survey_id of what it is planned for; 0: nothing. */
uint64_t pipeline_survey_id(const struct pipeline *p);

/* now_ns: when it came in, which is what the walls are told for.  0, or errors of
 * object_tracker_volume, or -ECANCELED: cfg.scan.stop ended the image that was due; the
 * ping is in, and pipeline_finish images again. */
int pipeline_ping(struct pipeline *p, const struct ping *ping, int64_t now_ns,
                  struct pipeline_output *out, struct error *why);

/* A scan has ended: one that lacks pings gets its image, of those that are in.  Errors as
 * above. */
int pipeline_finish(struct pipeline *p, struct pipeline_output *out, struct error *why);

/* How the vehicle moves; NULL: somebody told of it, but not that.  0, -EINVAL. */
int pipeline_ego(struct pipeline *p, const struct ego_motion *motion, int64_t capture_ns,
                 int64_t now_ns, struct error *why);

/* Of the air around; of use where none is measured with a ping. */
void pipeline_temperature(struct pipeline *p, double temperature_c);

/* The walls as they stand at an instant, of somebody who finds them; left alone where it
 * finds them itself.  0, -EINVAL (what walls_check says, a stamp that is none). */
int pipeline_walls(struct pipeline *p, const struct walls *walls, int64_t capture_ns,
                   struct error *why);

/* All the walls that the vehicle knows, in its frame (wall_map_given); left alone where
 * walls are not from the vehicle.  0, -EINVAL. */
int pipeline_given(struct pipeline *p, const struct walls *given, int64_t capture_ns,
                   int64_t now_ns, struct error *why);

/* The newest list of them that the images and tracks go by, its stamp, and how many there
 * have been; NULL: none has, the survey's count. */
const struct walls *pipeline_known_walls(const struct pipeline *p, int64_t *stamp_ns,
                                         uint64_t *lists);

/* Of the scan that the newest ping belongs to. */
const struct air *pipeline_air(const struct pipeline *p);

/* What does the work, for what each says of itself; NULL: there is none of this kind. */
const struct object_tracker *pipeline_tracker(const struct pipeline *p);
struct wall_finder *pipeline_finder(struct pipeline *p);
void pipeline_destroy(struct pipeline *p);

#endif
