/* SPDX-License-Identifier: MIT */
/* nodes/rt/launchfile_sections.h -- inside nodes/rt/launchfile: sections of the text to
 * those of the launch file, one after the other. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_SECTIONS_H
#define ANLOS_NODES_RT_LAUNCHFILE_SECTIONS_H

#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_text.h"

/* Whether the array is carried or static, with which speakers, and what is subtracted:
 *
 *   scan: {mode: fixed, speakers: [0, 5, 10, 15], background: true, background_frames: 8}
 *   dsp: {background: adaptive, background_s: 5}
 *
 * Fills in l->scan but its numbers of a stepped scan, and l->dsp's background.  0,
 * -EINVAL, -ENOMEM. */
int launchfile_copy_scan(struct launchfile *l, const struct launch_text *t,
                         struct error *why);
void launchfile_free_scan(struct launchfile *l);

/* The images of a static array:
 *
 *   recon: {frames: {pings: 16, sum: power, every: frame}}
 *
 * They are made by back-projection (recon/static_array/frames.h); methods, their options
 * and previews are for scans.  Fills in l->recon.frames; l->scan is there.  0, -EINVAL.
 */
int launchfile_copy_frames(struct launchfile *l, const struct launch_text *t,
                           struct error *why);

/* Fills in l->track.  0, -EINVAL. */
int launchfile_copy_track(struct launchfile *l, const struct launch_text *t,
                          struct error *why);

/* Fills in l->wall.  0, -EINVAL. */
int launchfile_copy_wall(struct launchfile *l, const struct launch_text *t,
                         struct error *why);

/* Fills in l->can; paths are as they are written.  0, -EINVAL, -ENOMEM. */
int launchfile_copy_can(struct launchfile *l, const struct launch_text *t,
                        struct error *why);

/* A log into the report's folder; a scene is relative to the launch file's, folder.  0,
 * -ENOMEM. */
int launchfile_resolve_can(struct launchfile *l, const char *folder);
void launchfile_free_can(struct launchfile *l);

/* Fills in l->view; a bag's path is relative to the launch file's folder.  0, -EINVAL,
 * -ENOMEM. */
int launchfile_copy_view(struct launchfile *l, const struct launch_text *t,
                         struct error *why);
void launchfile_free_view(struct launchfile *l);

/* Fills in l->record; a path or folder in the options adds the node, before all others.
 * 0, -EINVAL, -ENOMEM. */
int launchfile_copy_record(struct launchfile *l, const struct launch_text *t,
                           const struct launchfile_options *options, struct error *why);
void launchfile_free_record(struct launchfile *l);

/* Fills in l->play; what the options say wins.  0, -EINVAL, -ENOMEM. */
int launchfile_copy_play(struct launchfile *l, const struct launch_text *t,
                         const struct launchfile_options *options, struct error *why);
void launchfile_free_play(struct launchfile *l);

#endif
