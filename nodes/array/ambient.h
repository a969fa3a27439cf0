/* SPDX-License-Identifier: MIT */
/* nodes/array/ambient.h -- the air that sound goes through, as the vehicle says it (topic
 * "ambient"): an array that stands and was measured at another temperature would place
 * what it hears at 4 m wrong by 7 mm for each kelvin. */
#ifndef ANLOS_NODES_ARRAY_AMBIENT_H
#define ANLOS_NODES_ARRAY_AMBIENT_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/vehicle.pb-c.h"
#include "recon/survey.h"

struct ambient {
    int64_t changed_ns; /* monotonic; 0: never */
};

/* Gives a survey, which is `measured` but for what this sets, the temperature and speed
 * of sound of what the vehicle says, where the speed differs by more than it takes to
 * tell, and not more often than once a minute: whoever images starts anew then.  In
 * colder air the gate ends where the slot does.  false: it stays as it is. */
bool ambient_take(struct ambient *a, const struct survey *measured, struct survey *s,
                  const Anlos__Ambient *said, int64_t now_ns);

#endif
