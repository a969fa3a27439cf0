/* SPDX-License-Identifier: MIT */
/* nodes/anlos/commands.h -- the subcommands of `anlos`.  argv[0] is the command's name;
 * each returns the exit code: 0; 1 failed; 2 bad input (arguments, files); 130 Ctrl-C. */
#ifndef ANLOS_NODES_ANLOS_COMMANDS_H
#define ANLOS_NODES_ANLOS_COMMANDS_H

#include <stdio.h>

int command_array(int argc, char **argv);
int command_bag(int argc, char **argv);
int command_batch(int argc, char **argv);
int command_bench(int argc, char **argv);
int command_calibrate(int argc, char **argv);
int command_can(int argc, char **argv);
int command_doctor(int argc, char **argv);
int command_keys(int argc, char **argv);
int command_launch(int argc, char **argv);
int command_node(int argc, char **argv);
int command_plan(int argc, char **argv);
int command_psf(int argc, char **argv);
int command_recon(int argc, char **argv);
int command_falloff(int argc, char **argv);
int command_resolution(int argc, char **argv);
int command_score(int argc, char **argv);
int command_sim(int argc, char **argv);
int command_speed_error(int argc, char **argv);
int command_stage(int argc, char **argv);
int command_top(int argc, char **argv);
int command_topic(int argc, char **argv);
int command_view(int argc, char **argv);

/* Parts of a command with a folder or a file of their own.  Each returns the exit code.
 */

/* `anlos recon` of a bag: runs options->bag and writes the files of a recording, and
 * can.candump.  began: when the command started. */
struct recon_options;
struct stopwatch;
int replay_run(const struct recon_options *options, const struct stopwatch *began);

/* `anlos node list`: a line for each node. */
struct census;
void node_list_print(const struct census *c, FILE *f);

#endif
