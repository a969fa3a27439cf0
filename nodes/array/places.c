/* SPDX-License-Identifier: MIT */
#include "nodes/array/places.h"

#include <errno.h>
#include <string.h>

#include "recon/geometry.h"

/* Who went farther, in one step or in many, has come off. */
int places_correct(struct survey *s, const struct survey *measured,
                   const Anlos__MovedElement *m, struct error *why)
{
    const char *kind = m->speaker ? "speaker" : "microphone";
    size_t n = m->speaker ? s->n_speakers : s->n_microphones;

    if (m->element < 1 || m->element > n)
        return error_say(why, -EINVAL, "%s %u, expected 1 to %zu", kind, m->element, n);
    size_t i = m->element - 1;
    double *at_m = (m->speaker ? s->speakers_m : s->microphones_m)[i];
    const double *from_m =
        (m->speaker ? measured->speakers_m : measured->microphones_m)[i];
    const double to_m[3] = {at_m[0] + m->x_m, at_m[1] + m->y_m, at_m[2] + m->z_m};
    double way_m = geometry_distance(from_m, to_m);
    if (!(way_m <= SURVEY_SAME_M))
        return error_say(
            why, -EINVAL,
            "%s %u is %.1f cm from its surveyed place, expected at most %.0f", kind,
            m->element, 1e2 * way_m, 1e2 * SURVEY_SAME_M);
    memcpy(at_m, to_m, sizeof to_m);
    return 0;
}
