#include "hal/can/intake.h"

#include <errno.h>

void can_intake_put(struct can_intake *i, const struct can_frame_data *f, int64_t came_ns)
{
    size_t at;

    i->received++;
    if (i->n == CAN_INTAKE_MAX) {
        i->first = (i->first + 1) % CAN_INTAKE_MAX;
        i->n--;
        i->dropped++;
    }
    at = (i->first + i->n++) % CAN_INTAKE_MAX;
    i->frames[at] = *f;
    i->came_ns[at] = came_ns;
}

int can_intake_take(struct can_intake *i, struct can_frame_data *out, int64_t *came_ns)
{
    if (!i->n)
        return -EAGAIN;
    *out = i->frames[i->first];
    *came_ns = i->came_ns[i->first];
    i->first = (i->first + 1) % CAN_INTAKE_MAX;
    i->n--;
    return 0;
}
