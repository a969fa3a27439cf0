/* nodes/anlos/top/plain.h -- the whole table as text, for pipes and files. */
#ifndef ANLOS_NODES_ANLOS_TOP_PLAIN_H
#define ANLOS_NODES_ANLOS_TOP_PLAIN_H

#include <stdio.h>

#include "nodes/anlos/top/table.h"

/* Every column of every node and of the topics that are there, what devices count, the
 * last lines of the log.  0, -errno of the write. */
int plain_print(FILE *to, const struct table *t);

#endif
