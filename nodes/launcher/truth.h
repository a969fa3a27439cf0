/* SPDX-License-Identifier: MIT */
/* nodes/launcher/truth.h -- what is hidden in a simulated scene beside what was found:
 * the table at the end of a launch. */
#ifndef ANLOS_NODES_LAUNCHER_TRUTH_H
#define ANLOS_NODES_LAUNCHER_TRUTH_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "dsp/error.h"

#define TRUTH_MAX     64
#define TRUTH_MATCH_M 0.5 /* farther apart, they are two different things */

struct truth_object { /* hidden */
    char name[64];
    double position_m[3];
    int found; /* index of the detection matched with it, or -1 */
};

struct truth_detection { /* reported */
    double position_m[3];
    double existence;
    int object; /* index, or -1 */
};

struct truth {
    size_t n_objects, n_detections;
    struct truth_object objects[TRUTH_MAX];
    struct truth_detection detections[TRUTH_MAX];
    char frame[16]; /* "vehicle" or "array" */
    bool mirrored;  /* detections are where the objects really are */
    bool moving;    /* a drive: the last list is no place to compare objects with */
};

/* detections.json in a folder.  0, -ENOENT, -EINVAL, -ENOMEM. */
int truth_read_detections(struct truth *t, const char *folder, struct error *why);

/* The objects of a scene file, in the frame of the detections read before; of a drive
 * none. */
int truth_read_scene(struct truth *t, const char *scene, struct error *why);

/* The nearest pairs first, each object and each detection once. */
void truth_match(struct truth *t);
void truth_print(const struct truth *t, FILE *to);

/* What an array that stands has tracked: the table at the end of its launch.  The last
 * list alone would show who is there at the end, and often nobody is. */

#define TRACKS_SHOWN 20 /* of more, the newest */

/* From report.json in a folder.  0, -ENOENT (there is none), -ENODATA (none of tracks),
 * -EINVAL. */
int tracks_print(const char *folder, FILE *to, struct error *why);

#endif
