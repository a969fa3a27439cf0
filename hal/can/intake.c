#include "hal/can/intake.h"

#include <errno.h>

void can_intake_put(struct can_intake *i, const struct can_frame_data *f)
{
    i->received++;
    if (i->n == CAN_INTAKE_MAX) {
        i->first = (i->first + 1) % CAN_INTAKE_MAX;
        i->n--;
        i->dropped++;
    }
    i->frames[(i->first + i->n++) % CAN_INTAKE_MAX] = *f;
}

int can_intake_take(struct can_intake *i, struct can_frame_data *out)
{
    if (!i->n)
        return -EAGAIN;
    *out = i->frames[i->first];
    i->first = (i->first + 1) % CAN_INTAKE_MAX;
    i->n--;
    return 0;
}
