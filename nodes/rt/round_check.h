/* SPDX-License-Identifier: MIT */
/* nodes/rt/round_check.h -- can an array that stands be asked for these speakers, round
 * after round? */
#ifndef ANLOS_NODES_RT_ROUND_CHECK_H
#define ANLOS_NODES_RT_ROUND_CHECK_H

#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "recon/survey.h"

/* speakers[n]; n 0: all of the survey.  0, -EINVAL; the error begins with the key of
 * the launch file. */
int round_check(const struct survey *s, const uint32_t *speakers, size_t n,
                struct error *why);

#endif
