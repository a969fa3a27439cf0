/* SPDX-License-Identifier: MIT */
/* nodes/anlos/score/drive_truth_file.h -- who was really there, by a text file:
 *
 *   time_s,id,kind,x_m,y_m
 *   1767225600.25,7,person,2.5,-1.125
 *
 * Unix time by the clock of the recording, places in the vehicle frame (x forward, y
 * left).  An id's rows come in the order of their times; between them it goes straight
 * on, unless they are over a second apart: then it was not there. */
#ifndef ANLOS_NODES_ANLOS_SCORE_DRIVE_TRUTH_FILE_H
#define ANLOS_NODES_ANLOS_SCORE_DRIVE_TRUTH_FILE_H

#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"

struct truth_file;

struct truth_place {
    const char *name, *kind;
    double position_m[2], velocity_m_s[2]; /* as seen from the vehicle */
};

/* 0, -EINVAL (file, line and what is wrong), errors of text_file_open, -ENOMEM. */
int truth_file_load(struct truth_file **out, const char *path, struct error *why);

/* out[max]; returns how many there are at a time. */
size_t truth_file_at(const struct truth_file *f, int64_t unix_ns, struct truth_place *out,
                     size_t max);
void truth_file_destroy(struct truth_file *f);

#endif
