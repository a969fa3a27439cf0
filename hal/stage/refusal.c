/* SPDX-License-Identifier: MIT */
/* hal/stage/refusal.c -- why a stage does not move, for a person. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "hal/stage.h"

#define STEPS_PER_M 1e4 /* of what is said; never beyond what it reaches */

static void say_reach(const double reach_m[2], char text[STAGE_TEXT_SIZE])
{
    double from_m = ceil(reach_m[0] * STEPS_PER_M - 1e-6) / STEPS_PER_M + 0.0; /* no -0 */
    double to_m = floor(reach_m[1] * STEPS_PER_M + 1e-6) / STEPS_PER_M;

    if (from_m < to_m)
        snprintf(text, STAGE_TEXT_SIZE,
                 "it does not reach that far: it goes from %g to %g m", from_m, to_m);
    else
        snprintf(text, STAGE_TEXT_SIZE,
                 "it does not reach that far: it stands at %g m for good", reach_m[0]);
}

void stage_refusal(const struct stage_status *s, int err, char text[STAGE_TEXT_SIZE])
{
    if (err == -ERANGE)
        say_reach(s->reach_m, text);
    else
        snprintf(text, STAGE_TEXT_SIZE, "%s",
                 err == -ESTALE ? "its place is not known, home it first"
                 : err == -EDOM ? "it does not go at that speed"
                                : strerror(-err));
}
