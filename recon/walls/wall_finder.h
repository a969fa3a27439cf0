/* SPDX-License-Identifier: MIT */
/* recon/walls/wall_finder.h -- the walls that mirror sound: what is heard, given or
 * configured of them to the lists that the imaging and the tracks work with.
 *
 * One thread at a time. */
#ifndef ANLOS_RECON_WALLS_WALL_FINDER_H
#define ANLOS_RECON_WALLS_WALL_FINDER_H

#include "recon/walls/wall_listener.h"
#include "recon/walls/wall_map.h"

struct wall_finder_config {
    struct wall_map_config map;
    struct wall_listener_config listener; /* of walls from echoes */
    bool takes_pings;                     /* else what arrived of them */
};

/* What holds where nothing is said: the survey's walls; where they are heard, walls
 * upright to 2 degrees, up to 5 m away, a look every 0.5 s, lost after 3 s. */
void wall_finder_config_default(struct wall_finder_config *cfg);

struct wall_finder;

/* 0, -ENOMEM. */
int wall_finder_create(struct wall_finder **out, const struct wall_finder_config *cfg);

/* Copies it; the walls of another one are forgotten.  0, or a negative errno with an
 * error: also where walls are to be heard and this array cannot; it has no survey
 * then. */
int wall_finder_survey(struct wall_finder *f, const struct survey *survey,
                       struct error *why);

/* survey_id of what it was given; 0: nothing. */
uint64_t wall_finder_survey_id(const struct wall_finder *f);

/* How the vehicle moves; NULL: somebody told of it, but not that. */
void wall_finder_ego(struct wall_finder *f, const struct ego_motion *motion,
                     int64_t capture_ns);

/* What arrived of a ping; now_ns: when it came in.  false: nothing is heard before a
 * survey, or where walls are not from echoes. */
bool wall_finder_returns(struct wall_finder *f, const struct wall_returns *returns,
                         int64_t now_ns);

/* The same of a ping, where no front end stands beside it (takes_pings): it compresses
 * each itself. */
bool wall_finder_ping(struct wall_finder *f, const struct ping *ping, int64_t now_ns);

/* What the vehicle says of them, as wall_map_given has it. */
int wall_finder_given(struct wall_finder *f, const struct walls *given,
                      int64_t capture_ns, struct error *why);

/* After each of these, and while nothing comes: the list that is to be told now, at most
 * ten a second, with its stamp; NULL: none is.  Borrows until the next call. */
const struct walls *wall_finder_list(struct wall_finder *f, int64_t now_ns,
                                     int64_t *stamp_ns);

/* What they are known by: their tracks, the newest list and what is wrong with it. */
struct wall_map *wall_finder_map(struct wall_finder *f);

size_t wall_finder_unusable(const struct wall_finder *f); /* pings of this survey */
void wall_finder_destroy(struct wall_finder *f);

#endif
