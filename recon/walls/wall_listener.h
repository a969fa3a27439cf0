/* SPDX-License-Identifier: MIT */
/* recon/walls/wall_listener.h -- the array's own first returns: what arrived of each ping
 * (recon/walls/wall_receiver.h) to estimates of the walls around it.
 *
 * Of a fixed array each look is one round of its speakers, carried to the place of the
 * newest by the vehicle's motion; of a scan it grows by every stage position. */
#ifndef ANLOS_RECON_WALLS_WALL_LISTENER_H
#define ANLOS_RECON_WALLS_WALL_LISTENER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "recon/ego.h"
#include "recon/ping.h"
#include "recon/survey.h"
#include "recon/walls/wall_estimate.h"
#include "recon/walls/wall_receiver.h"

struct wall_listener_config {
    bool vertical;       /* the prior: walls are upright */
    double vertical_rad; /* one sigma */
    double reach_m;      /* how far away walls are looked for */
    double every_s;      /* from look to look */
};

struct wall_listener;

/* Plans for a survey, which must outlive it.  0, or a negative errno with an error. */
int wall_listener_create(struct wall_listener **out,
                         const struct wall_listener_config *cfg, const struct survey *s,
                         struct error *why);

/* Takes what arrived of a ping of that survey.  true: it ended a look, and *out is what
 * was heard, in the array's frame at the ping's capture stamp; then *blind says that the
 * vehicle moved and nobody knows how.  NULL path: the array stands.  A ping that cannot
 * be used is left out and counted. */
bool wall_listener_take(struct wall_listener *l, const struct wall_returns *returns,
                        const struct ego_path *path, struct wall_estimates *out,
                        bool *blind);

size_t wall_listener_unusable(const struct wall_listener *l); /* pings, of all time */
void wall_listener_destroy(struct wall_listener *l);

#endif
