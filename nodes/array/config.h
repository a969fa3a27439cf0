/* SPDX-License-Identifier: MIT */
/* nodes/array/config.h -- what the launch file says of the array's steps. */
#ifndef ANLOS_NODES_ARRAY_CONFIG_H
#define ANLOS_NODES_ARRAY_CONFIG_H

#include "nodes/rt/launchfile.h"
#include "recon/frontend/range_monitor.h"

void array_config_range(struct range_config *out, const struct launchfile *l,
                        const struct survey *s);

#endif
