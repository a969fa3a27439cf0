/* nodes/anlos/falloff/job.h -- distance and power of the strongest echo in recordings,
 * position by position, as the paper measured its signal falloff: one speaker, the
 * microphone beside it, after pulse compression (Lindell 2019, section 5). */
#ifndef ANLOS_NODES_ANLOS_FALLOFF_JOB_H
#define ANLOS_NODES_ANLOS_FALLOFF_JOB_H

#include <stddef.h>

#include "dsp/complaint.h"

struct falloff_points {
    size_t n, room;
    double *distance_m; /* [n] half the path */
    double *power;      /* [n] 1: an echo as loud as what the speaker emits */
};

/* Appends one point for each position of a recording as `anlos sim` writes it: FOLDER
 * with survey.yaml, scene/ and, when there is one, background/, which is subtracted.  The
 * pair is the closest speaker and microphone.  0, -ENOENT, -EINVAL, -EIO, -ENODATA (no
 * position has an echo), -ENOMEM. */
int falloff_measure(struct falloff_points *p, const char *folder, struct complaint *why);
void falloff_points_clear(struct falloff_points *p);

#endif
