/* SPDX-License-Identifier: MIT */
/* dsp/time_zero.h -- when an array really emits, and how fast sound is, from arrivals
 * over known distances: t = latency + distance / speed, a straight line, fitted so that
 * wrong arrivals (another path, a dead channel, an element that stands elsewhere) do not
 * pull at it: iteratively reweighted least squares with Tukey's biweight (Beaton and
 * Tukey 1974), from the median on. */
#ifndef ANLOS_DSP_TIME_ZERO_H
#define ANLOS_DSP_TIME_ZERO_H

#include <stdbool.h>
#include <stddef.h>

struct time_zero_pair {
    double distance_m, arrival_s; /* arrival_s NaN: not heard */
};

struct time_zero {
    double latency_s, speed_m_s;
    double latency_sigma_s, speed_sigma_m_s; /* of one standard deviation */
    double spread_s; /* of the pairs around the line: 1.48 times the median deviation */
    size_t n_heard, n_used; /* used: within 4.7 spreads of the line */
};

/* The latency for a speed that is known.  0, -ENODATA (no pair was heard),
 * -ENOMEM. */
int time_zero_fit(struct time_zero *out, const struct time_zero_pair *pairs, size_t n,
                  double speed_m_s);

/* The speed as well: start_m_s is where to begin.  The sigmas tell whether the distances
 * are different enough.  0, -ENODATA (fewer than 3 pairs, or all of one distance, or no
 * line that rises), -ENOMEM. */
int time_zero_fit_speed(struct time_zero *out, const struct time_zero_pair *pairs,
                        size_t n, double start_m_s);

#endif
