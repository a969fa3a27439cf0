/* SPDX-License-Identifier: MIT */
/* nodes/view/history.h -- how the lists of objects went over time, for plots
 * (nodes/rt/list_figures.h).  Of each of HISTORY_POINTS steps of time the largest that
 * there was. */
#ifndef ANLOS_NODES_VIEW_HISTORY_H
#define ANLOS_NODES_VIEW_HISTORY_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#include "msgs/detections.pb-c.h"

#define HISTORY_POINTS 480

struct history {
    int64_t start_ns, step_ns;
    bool rolls; /* the newest steps are kept; else those from start_ns on */
    struct history_point {
        int64_t step;             /* since start_ns, from 1; 0: nothing came in it */
        double snr_db, latency_s; /* NaN: no object, a replay */
        unsigned n_objects;
    } points[HISTORY_POINTS]; /* by step, modulo */
};

/* The newest HISTORY_POINTS * step_ns of a system that runs. */
void history_roll(struct history *h, int64_t step_ns);

/* The whole of a recording. */
void history_span(struct history *h, int64_t start_ns, int64_t end_ns);

/* at_ns: of the plot.  capture_ns 0: of no sound.  One that is before all of them, or
 * after a span, is left out. */
void history_take(struct history *h, const Anlos__DetectionList *list, int64_t capture_ns,
                  int64_t publish_ns, int64_t at_ns);

/* {"type": "history", "from_s": .., "step_s": .., "snr_db": [..], "latency_ms": [..],
 * "objects": [..]}, a step each from from_s on: of a recording since its start, else
 * before now_ns, so that it is negative.  NULL: nothing has come, or no memory. */
json_t *history_json(const struct history *h, int64_t now_ns);

#endif
