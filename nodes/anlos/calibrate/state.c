#include "nodes/anlos/calibrate/state.h"

#include <stdio.h>
#include <string.h>

#include "hal/survey/calibration.h"

const char *state_print(unsigned faults, char out[STATE_SIZE])
{
    static const struct {
        unsigned fault;
        const char *name;
    } names[] = {{CALIBRATION_DEAD, "dead"},
                 {CALIBRATION_INVERTED, "inverted"},
                 {CALIBRATION_CLIPPED, "clipped"},
                 {CALIBRATION_NOISY, "noisy"}};
    out[0] = 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        size_t n = strlen(out);
        if (faults & names[i].fault)
            snprintf(out + n, STATE_SIZE - n, "%s%s", n ? ", " : "", names[i].name);
    }
    return out[0] ? out : strcpy(out, "good");
}
