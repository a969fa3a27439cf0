/* nodes/track/listing.h -- tracks as a list of detections, each with what its newest
 * detection told besides its place. */
#ifndef ANLOS_NODES_TRACK_LISTING_H
#define ANLOS_NODES_TRACK_LISTING_H

#include "msgs/detections.pb-c.h"
#include "nodes/track/sight.h"
#include "recon/track.h"
#include "recon/track_ids.h"

struct listing { /* {0} to begin with */
    struct listing_memory {
        double level_db, shape_probability;
        Anlos__Shape shape;
        bool behind_no_wall, in_free_view;
    } of[TRACK_ID_MAX + 1]; /* by id */
};

/* *list, of the detections that were tracked, becomes the list of tracks[n]; on failure
 * it stays.  all_placed: also those are listed with a position that no wall has shown.
 * 0, -ENOMEM. */
int listing_make(struct listing *l, const struct sight *sight,
                 const struct track_report *tracks, size_t n, bool all_placed,
                 Anlos__DetectionList **list);

#endif
