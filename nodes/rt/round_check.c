/* SPDX-License-Identifier: MIT */
#include "nodes/rt/round_check.h"

#include <errno.h>

int round_check(const struct survey *s, const uint32_t *speakers, size_t n,
                struct error *why)
{
    for (size_t i = 0; i < n; i++)
        if (speakers[i] >= s->n_speakers)
            return error_say(why, -EINVAL,
                             "scan.speakers: the survey has speakers 0 to %zu, not %u",
                             s->n_speakers - 1, speakers[i]);
    if (!n)
        n = s->n_speakers;
    if (s->n_positions > 1)
        return error_say(why, -EINVAL,
                         "scan.mode is fixed, but the survey has %zu positions of a "
                         "stage; leave its stage out",
                         s->n_positions);
    if (!survey_round_fits(s, n))
        return error_say(why, -EINVAL,
                         "scan.speakers: %zu in slots of %zu samples come round within "
                         "the chirp of %g s; expected more of them, or longer slots",
                         n, s->slot_samples, s->chirp_duration_s);
    if (s->together > 1 && n % s->together)
        return error_say(
            why, -EINVAL,
            "scan.speakers: %zu cannot sound two at a time; expected an even "
            "number",
            n);
    return 0;
}
