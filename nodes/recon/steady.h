/* SPDX-License-Identifier: MIT */
/* nodes/recon/steady.h -- the node recon of a static array (scan.mode fixed): traces,
 * motion and walls go to recon/static_array/static_array.h, and images come back. */
#ifndef ANLOS_NODES_RECON_STEADY_H
#define ANLOS_NODES_RECON_STEADY_H

#include "msgs/survey.pb-c.h"
#include "msgs/traces.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/rt/loop.h"
#include "recon/static_array/static_array.h"

struct steady;

extern const struct loop steady_loop;

/* node is not owned; NULL: for the steps below alone.  threads 0: as many as processors
 * may be used.  0, -ENOMEM, -EAGAIN (threads). */
int steady_create(struct steady **out, struct node *node,
                  const struct static_array_config *cfg);

/* Plans for a survey; the pings of another one are forgotten.  0, or a negative errno and
 * an error: also of a volume over the topic's size, which would be imaged for nobody.
 */
int steady_survey(struct steady *s, const Anlos__Survey *survey, struct error *why);
void steady_ego(struct steady *s, const Anlos__EgoMotion *ego, int64_t capture_ns);

/* As topic "wall" has them at a stamp.  0, or -EINVAL with an error: they stay as they
 * were. */
int steady_walls(struct steady *s, const Anlos__WallList *walls, int64_t capture_ns,
                 struct error *why);

/* As static_array_traces. */
bool steady_traces(struct steady *s, const Anlos__Traces *traces, int64_t capture_ns,
                   char *note, size_t size);

/* Borrowed, good until the next call.  Its stamp is steady_capture_ns. */
void steady_image(struct steady *s, Anlos__Volume *out);
int64_t steady_capture_ns(const struct steady *s);

/* What does the work. */
const struct static_array *steady_array(const struct steady *s);
void steady_destroy(struct steady *s);

#endif
