#include "dsp/drift_track.h"

#include <math.h>

#define PRIOR 2e-3
#define STEP  2e-5 /* between pings, 0.01 K: other paths, and time */

void drift_track_start(struct drift_track *t)
{
    *t = (struct drift_track){0.0, PRIOR * PRIOR};
}

double drift_track_update(struct drift_track *t, const struct drift_measurement *m)
{
    t->variance = fmin(t->variance + STEP * STEP, PRIOR * PRIOR);
    if (isfinite(m->variance)) {
        double gain = t->variance / (t->variance + m->variance);
        t->stretch += gain * (m->stretch - t->stretch);
        t->variance *= 1.0 - gain;
    }
    return fmin(fmax(t->stretch, -DRIFT_MAX_STRETCH), DRIFT_MAX_STRETCH);
}
