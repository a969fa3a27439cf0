/* SPDX-License-Identifier: MIT */
#include "nodes/array/config.h"

void array_config_range(struct range_config *out, const struct launchfile *l,
                        const struct survey *s)
{
    size_t of_a_round = l->scan.n_speakers ? l->scan.n_speakers : s->n_speakers;

    *out = (struct range_config){.ranges = l->scan.fixed,
                                 .n_pings = l->recon.frames.pings ? l->recon.frames.pings
                                                                  : of_a_round,
                                 .sum = l->recon.frames.sum,
                                 .false_alarm_rate = l->track.false_alarm_rate,
                                 .person_m = l->array.person_m};
}
