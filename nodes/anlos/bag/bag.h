/* nodes/anlos/bag/bag.h -- `anlos bag VERB`: work on recordings (MCAP, msgs/bag) without
 * a running system.  Each verb is a file of its own beside this; argv[0] is its name. */
#ifndef ANLOS_NODES_ANLOS_BAG_BAG_H
#define ANLOS_NODES_ANLOS_BAG_BAG_H

int bag_record(int argc, char **argv);
int bag_play(int argc, char **argv);
int bag_info(int argc, char **argv);
int bag_check_command(int argc, char **argv);
int bag_recover_command(int argc, char **argv);
int bag_merge(int argc, char **argv);
int bag_filter(int argc, char **argv);
int bag_export(int argc, char **argv);
int bag_import(int argc, char **argv);

#endif
