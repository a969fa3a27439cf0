/* nodes/scan/route.h -- the positions that the scan has to go to, and in which order. */
#ifndef ANLOS_NODES_SCAN_ROUTE_H
#define ANLOS_NODES_SCAN_ROUTE_H

#include <stddef.h>
#include <stdint.h>

#include "msgs/survey.pb-c.h"
#include "nodes/scan/ledger.h"

struct route {
    size_t n_positions;
    double *positions_m; /* [n_positions] */
    uint32_t *speakers;  /* [n_speakers of the survey]: those that are missing */
};

/* 0, -ENOMEM. */
int route_open(struct route *out, const Anlos__Survey *survey);

/* The nearest position where something is missing; n_positions: nowhere.  So the stage
 * goes there and back again, and takes up what was lost on its way. */
size_t route_nearest(const struct route *r, const struct ledger *l, Anlos__Pass pass,
                     size_t from);

/* Which speakers are missing at a position: how many, and r->speakers has them. */
size_t route_missing(const struct route *r, const struct ledger *l, Anlos__Pass pass,
                     size_t position);
void route_clear(struct route *r);

#endif
