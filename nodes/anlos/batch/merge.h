/* SPDX-License-Identifier: MIT */
/* nodes/anlos/batch/merge.h -- `anlos batch merge`: the results of folders as one table,
 * versions beside each other. */
#ifndef ANLOS_NODES_ANLOS_BATCH_MERGE_H
#define ANLOS_NODES_ANLOS_BATCH_MERGE_H

/* argv[0] is "merge"; help is that of `anlos batch`.  Returns the exit code. */
int batch_merge(int argc, char **argv, const char *help);

#endif
