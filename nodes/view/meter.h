/* SPDX-License-Identifier: MIT */
/* nodes/view/meter.h -- how loud each channel of the array is, and which ones are of no
 * use, ping by ping. */
#ifndef ANLOS_NODES_VIEW_METER_H
#define ANLOS_NODES_VIEW_METER_H

#include <jansson.h>
#include <stdbool.h>

#include "msgs/array.pb-c.h"

#define METER_MAX_CHANNELS 4096 /* SURVEY_MAX_ELEMENTS */

/* As recon/frontend/channel_check.h judges a position: dead is silent, over 60 dB below
 * the median channel; clipped is over 1 % of the samples; damaged has samples that are no
 * numbers.  A speaker is faint that is heard 20 dB below the median speaker. */
enum meter_state {
    METER_UNHEARD,
    METER_OK,
    METER_CLIPPED,
    METER_DEAD,
    METER_DAMAGED,
    METER_FAINT
};

struct meter_channel {
    double peak, rms;             /* of the newest ping, full scale 1 */
    enum meter_state state;       /* of the newest ping */
    uint64_t clipped, not_finite; /* samples, of all pings of the scan */
};

struct meter {
    struct meter_channel *microphones, *speakers; /* [n_microphones], [n_speakers] */
    size_t n_microphones, n_speakers;
    uint64_t pings, invalid; /* of the scan; invalid: to be taken again */
    uint32_t scan, speaker;  /* of the newest ping */
    double temperature_c;    /* NaN: not measured */
};

void meter_init(struct meter *m);

/* Counts what is wrong with the ping; looks at its samples only when asked, which costs
 * 0.1 ms.  0, -EINVAL (not a ping), -ENOMEM. */
int meter_ping(struct meter *m, const Anlos__Ping *ping, bool samples);

/* {"microphones": [[peak dB, rms dB, state, clipped samples, samples that are no number],
 * ...], "speakers": [[rms dB, state], ...], ...}; dB of full scale, null: never heard or
 * all zero. */
json_t *meter_json(const struct meter *m);
void meter_clear(struct meter *m);

#endif
