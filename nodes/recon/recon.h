/* SPDX-License-Identifier: MIT */
/* nodes/recon/recon.h -- the node recon of a scan: traces go to
 * recon/imaging/scan_imager.h, and images come back: previews, and the final one. */
#ifndef ANLOS_NODES_RECON_RECON_H
#define ANLOS_NODES_RECON_RECON_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "msgs/scan.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/traces.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "nodes/rt/loop.h"
#include "recon/imaging/scan_imager.h"

struct recon;

extern const struct loop recon_loop;

/* node is not owned; NULL: for the steps below alone.  threads 0: as many as processors
 * may be used.  0, -ENOMEM, -EAGAIN (threads). */
int recon_create(struct recon **out, struct node *node,
                 const struct scan_imager_config *cfg);

/* Plans for a survey; the traces of another one are forgotten.  0, or a negative errno
 * and an error (of the survey, of the method, or of a volume over the topic's size).
 */
int recon_survey(struct recon *r, const Anlos__Survey *survey, struct error *why);
bool recon_is_planned(const struct recon *r);

/* Takes one ping's traces; the receipt is to be published.  note[size] is for the log,
 * empty when there is nothing to say.  Before recon_is_planned none can be used, and no
 * note says so. */
void recon_traces(struct recon *r, const Anlos__Traces *traces, int64_t capture_ns,
                  int64_t now_ns, Anlos__Receipt *receipt, char *note, size_t size);

size_t recon_pings(const struct recon *r);
bool recon_is_complete(const struct recon *r);   /* every ping of the scan is in */
int64_t recon_capture_ns(const struct recon *r); /* of the newest ping */
int64_t recon_taken_ns(const struct recon *r);   /* when its traces came in */

/* Another stage position is complete since the last image? */
bool recon_has_new_position(const struct recon *r);

/* Images what is in.  The message borrows from the recon until the next image;
 * imaging_s is the caller's to set.  0, or -ECANCELED: the process is to stop. */
int recon_image(struct recon *r, bool preview, Anlos__Volume *out);

/* A new scan: forget all traces. */
void recon_reset(struct recon *r);
void recon_destroy(struct recon *r);

#endif
