/* SPDX-License-Identifier: MIT */
#include "nodes/array/places.h"

#include <errno.h>
#include <math.h>

/* Who went farther has come off. */
int places_correct(struct survey *s, const Anlos__MovedElement *m, struct error *why)
{
    const char *kind = m->speaker ? "speaker" : "microphone";
    size_t n = m->speaker ? s->n_speakers : s->n_microphones;
    double way_m = sqrt(m->x_m * m->x_m + m->y_m * m->y_m + m->z_m * m->z_m);

    if (m->element < 1 || m->element > n)
        return error_say(why, -EINVAL, "%s %u, expected 1 to %zu", kind, m->element, n);
    if (!(way_m <= SURVEY_SAME_M))
        return error_say(why, -EINVAL,
                         "%s %u has moved by %.1f cm, expected at most %.0f", kind,
                         m->element, 1e2 * way_m, 1e2 * SURVEY_SAME_M);
    double *at_m = (m->speaker ? s->speakers_m : s->microphones_m)[m->element - 1];
    at_m[0] += m->x_m;
    at_m[1] += m->y_m;
    at_m[2] += m->z_m;
    return 0;
}
