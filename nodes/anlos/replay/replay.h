/* SPDX-License-Identifier: MIT */
/* nodes/anlos/replay/replay.h -- the part of `anlos recon` for bags. */
#ifndef ANLOS_NODES_ANLOS_REPLAY_REPLAY_H
#define ANLOS_NODES_ANLOS_REPLAY_REPLAY_H

#include "nodes/anlos/recon/options.h"
#include "nodes/anlos/stopwatch.h"

/* Runs options->bag and writes the files of a recording, and can.candump.  began: when
 * the command started.  Returns the exit code. */
int replay_run(const struct recon_options *options, const struct stopwatch *began);

#endif
