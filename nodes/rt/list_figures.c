/* SPDX-License-Identifier: MIT */
#include "nodes/rt/list_figures.h"

#include <math.h>

#define MOST_S 3600.0 /* of a latency: more are two clocks */

struct list_figures list_figures(const Anlos__DetectionList *list, int64_t capture_ns,
                                 int64_t publish_ns)
{
    struct list_figures out = {.snr_db = NAN, .latency_s = NAN};
    double s = 1e-9 * (double)(publish_ns - capture_ns);

    for (size_t i = 0; i < list->n_detections; i++) {
        const Anlos__Detection *d = list->detections[i];
        out.n_objects += d->measurement != ANLOS__MEASUREMENT__DELETED;
        /* What is predicted has the level with which it was heard last. */
        if (d->measurement == ANLOS__MEASUREMENT__NEW ||
            d->measurement == ANLOS__MEASUREMENT__MEASURED)
            out.snr_db = fmax(out.snr_db, d->level_db);
    }
    if (capture_ns && list->source != ANLOS__SOURCE__REPLAY && s >= 0.0 && s <= MOST_S)
        out.latency_s = s;
    return out;
}
