/* SPDX-License-Identifier: MIT */
/* nodes/recon/volume_room.h -- does the image of a survey fit its topic? */
#ifndef ANLOS_NODES_RECON_VOLUME_ROOM_H
#define ANLOS_NODES_RECON_VOLUME_ROOM_H

#include "dsp/error.h"
#include "recon/survey.h"
#include "recon/volume.h"

/* 0, or -EINVAL and an error: also what processing_plan says of the survey. */
int volume_room_check(const struct survey *s, struct error *why);

/* Leaves out what lies around the volume where both do not fit. */
void volume_room_fit(struct volume *v);

#endif
