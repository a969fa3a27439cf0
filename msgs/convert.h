/* SPDX-License-Identifier: MIT */
/* msgs/convert.h -- messages as the plain types that dsp and recon work on, and back.
 * What comes out of a message borrows its arrays, and what goes into one is borrowed by
 * it, but for surveys, which own theirs. */
#ifndef ANLOS_MSGS_CONVERT_H
#define ANLOS_MSGS_CONVERT_H

#include "dsp/error.h"
#include "msgs/array.pb-c.h"
#include "msgs/detections.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/traces.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "recon/detection/objects.h"
#include "recon/ego.h"
#include "recon/ping.h"
#include "recon/survey.h"
#include "recon/traces.h"
#include "recon/volume.h"
#include "recon/walls/wall_receiver.h"
#include "recon/walls/walls.h"

/* The survey as message bytes in *out; free() it.  0, -ENOMEM, -EINVAL (does not pass
 * survey_check). */
int survey_pack(const struct survey *s, uint8_t **out, size_t *size);

/* From a received message; *s owns its arrays, and needs no survey_clear after an error.
 * 0, -ENOMEM, -EINVAL (incomplete, does not pass survey_check, or its id is not that of
 * its content). */
int survey_from_message(struct survey *s, const Anlos__Survey *m, struct error *why);

/* Who records with a program of his own need not know what an id is made of: gives a
 * message without one that of its content, if it is a survey at all. */
void survey_complete_id(Anlos__Survey *m);

/* samples is NULL where the message's arrays do not fit each other. */
void ping_from_message(struct ping *p, const Anlos__Ping *m, int64_t capture_ns);

/* masked [n_microphones] and view are storage for the message. */
void traces_to_message(const struct traces *t, protobuf_c_boolean *masked,
                       struct tensor_view *view, Anlos__Traces *m);

struct traces_room { /* {0}: storage for what a message has in another type */
    bool masked[SURVEY_MAX_ELEMENTS];
};

/* samples is NULL where the message's arrays do not fit each other. */
void traces_from_message(struct traces *t, struct traces_room *room,
                         const Anlos__Traces *m, int64_t capture_ns);

struct volume_view { /* storage for a message that borrows its image */
    struct tensor_view intensity, newest, coarse, beyond, movers, ambiguous, courses;
    Anlos__Vec3 origin, step, newest_origin, newest_step, coarse_origin, coarse_step;
};

/* imaging_s is the caller's to set. */
void volume_to_message(const struct volume *v, struct volume_view *view,
                       Anlos__Volume *m);

/* intensity [nz][ny][nx], borrowed from the message.  NULL: the message does not hold, or
 * its grid lies or reaches farther than 10 km, or is finer than 1 um. */
const float *volume_grid(const Anlos__Volume *v, struct grid *out);

/* intensity is NULL where volume_grid says so; newest where it is not there, the
 * same would have to be said of its blocks, or these are more than the voxels;
 * around.intensity where it is not there, or its grid or its spots do not hold; and there
 * are no movers, or none that are ambiguous, where one of them does not. */
void volume_from_message(struct volume *v, const Anlos__Volume *m, int64_t capture_ns);

/* A message of its own; detections_free it.  0, -ENOMEM. */
int detections_from_objects(Anlos__DetectionList **out, const struct object_list *list);
void detections_free(Anlos__DetectionList *list);

/* out; NULL: somebody told of the motion, but not that. */
const struct ego_motion *ego_from_message(struct ego_motion *out,
                                          const Anlos__EgoMotion *m);

/* Of topic "wall", or of "wall/given" in the vehicle frame (walls_to_array).  0, or
 * -EINVAL with an error: what walls_check says. */
int walls_from_message(struct walls *out, const Anlos__WallList *m, struct error *why);

struct walls_view { /* storage for a message that borrows its walls */
    Anlos__Wall walls[WALLS_MAX], *each[WALLS_MAX];
    Anlos__Vec3 normals[WALLS_MAX];
};

/* text: what is wrong with them, for a person. */
void walls_to_message(const struct walls *w, const char *text, struct walls_view *view,
                      Anlos__WallList *m);

struct returns_room { /* storage for either direction; {0}: empty */
    size_t n;         /* microphones that there is room for */
    struct wall_arrivals *at;
    protobuf_c_boolean *heard;
    uint32_t *arrivals;
    double *path_m, *amplitude; /* [n][WALL_PEAKS] */
};

/* Both borrow from the room, and are good until its next use.  0, -ENOMEM; -EINVAL (from
 * a message whose numbers do not fit each other). */
int returns_to_message(const struct wall_returns *r, struct returns_room *room,
                       Anlos__Echoes *m);
int returns_from_message(struct wall_returns *r, struct returns_room *room,
                         const Anlos__Echoes *m, int64_t capture_ns);
void returns_room_clear(struct returns_room *room);

#endif
