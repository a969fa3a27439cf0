/* dsp/channel_order.h -- do channels answer from where they should?  A channel whose
 * arrivals fit the place of another one better than its own is wired to that one.
 *
 * Its misfit to a place is the median over the other kind's channels of the difference
 * between when it was heard and when it should have been: single channels of the other
 * kind that are wrong themselves do not matter. */
#ifndef ANLOS_DSP_CHANNEL_ORDER_H
#define ANLOS_DSP_CHANNEL_ORDER_H

#include <stddef.h>

struct channel_place {
    size_t answers_as;     /* itself, when there is no doubt */
    double own_s, other_s; /* misfit to its own place, and to that of answers_as; NaN: it
                              was not heard often enough */
};

/* heard [n][n_others]: arrivals without the latency, in s, NaN where there is none;
 * expected [n][n_others]: distance over speed.  A channel keeps its place unless its
 * misfit there is over tolerance_s and another place halves it.  out [n].
 * 0, -ENOMEM. */
int channel_order_find(size_t n, size_t n_others, const double *heard,
                       const double *expected, double tolerance_s,
                       struct channel_place *out);

#endif
