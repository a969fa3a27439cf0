/* SPDX-License-Identifier: MIT */
/* hal/room/sight.h -- what a building hides from direct view, and until when. */
#ifndef ANLOS_HAL_ROOM_SIGHT_H
#define ANLOS_HAL_ROOM_SIGHT_H

#include <stdbool.h>
#include <stddef.h>

/* Does the straight line from a to b pass an outline of n >= 3 corners x, z?  Seen from
 * above: y does not count.  n = 0: nothing is in the way. */
bool sight_clear(const double (*outline)[2], size_t n, const double a[3],
                 const double b[3]);

struct sight_span { /* in view */
    double from_s, to_s;
};

struct sight_spans {
    size_t n, room;
    struct sight_span *spans; /* [n], in their order */
};

/* Asks in_view(ctx, t) at steps from one time to another and halves the steps where the
 * answer changes.  Adds to *out.  0, -ENOMEM. */
int sight_scan(struct sight_spans *out, bool (*in_view)(void *ctx, double t_s), void *ctx,
               double from_s, double to_s, double step_s);

/* Seconds from t until a span begins; 0 within one, NaN when none comes. */
double sight_until_s(const struct sight_spans *s, double t_s);
void sight_clear_spans(struct sight_spans *s);

#endif
