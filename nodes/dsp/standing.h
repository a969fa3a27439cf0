/* nodes/dsp/standing.h -- does the vehicle stand, as the topic "ego" has it? */
#ifndef ANLOS_NODES_DSP_STANDING_H
#define ANLOS_NODES_DSP_STANDING_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/vehicle.pb-c.h"
#include "recon/ego.h"

/* Slower is standing: 5 mm in a tenth of a second is a quarter of the shortest wave. */
#define STANDING_M_S   0.05
#define STANDING_RAD_S 0.01

struct standing { /* {0}: nothing was heard */
    bool heard;
    struct ego_path path;
};

void standing_hear(struct standing *s, const Anlos__EgoMotion *ego, int64_t capture_ns);

/* From one instant to another, as far as it was told by now: a ping that ends while the
 * vehicle sets off was not heard standing.  Where nobody tells, it stands; when who told
 * is silent, it does not. */
bool standing_between(const struct standing *s, int64_t from_ns, int64_t to_ns);

#endif
