/* SPDX-License-Identifier: MIT */
/* nodes/rt/list_figures.h -- what a list of objects says in three numbers, to be plotted
 * over time. */
#ifndef ANLOS_NODES_RT_LIST_FIGURES_H
#define ANLOS_NODES_RT_LIST_FIGURES_H

#include <stdint.h>

#include "msgs/detections.pb-c.h"

struct list_figures {
    double snr_db; /* of the strongest object over the image's noise, of those that were
                    * heard for this list; NaN: none was */
    double latency_s; /* from the sound to the list; NaN: of no sound, of a replay, or of
                       * two clocks (before the sound, or an hour after it) */
    unsigned n_objects; /* but those that are deleted */
};

/* capture_ns 0: of no sound. */
struct list_figures list_figures(const Anlos__DetectionList *list, int64_t capture_ns,
                                 int64_t publish_ns);

#endif
