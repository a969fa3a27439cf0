/* recon/planning/probe_place.h -- inside recon/planning/probe: what the geometry alone
 * says of how a point at some place will be imaged, by all pairs and by those of fewer
 * speakers. */
#ifndef ANLOS_RECON_PLANNING_PROBE_PLACE_H
#define ANLOS_RECON_PLANNING_PROBE_PLACE_H

#include "recon/planning/probe.h"

struct probe_places;

/* set->geometry outlives them.  0, -ENOMEM. */
int probe_places_create(struct probe_places **out, const struct trace_set *set);

/* Of an object's position_m: moveout_m, moveout_rad, fewer_m, width_m, lean. */
void probe_places_describe(const struct probe_places *p, struct probe_object *o);
void probe_places_destroy(struct probe_places *p);

#endif
