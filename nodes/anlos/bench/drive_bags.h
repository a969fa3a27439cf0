/* nodes/anlos/bench/drive_bags.h -- `anlos bench drive --bag`: recorded drives. */
#ifndef ANLOS_NODES_ANLOS_BENCH_DRIVE_BAGS_H
#define ANLOS_NODES_ANLOS_BENCH_DRIVE_BAGS_H

#include "nodes/anlos/bench/bench.h"

/* As bench_drive. */
int drive_bags(const struct bench_options *o, struct complaint *why);

#endif
