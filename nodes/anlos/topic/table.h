/* nodes/anlos/topic/table.h -- the tables of `anlos topic hz`, bw and delay, and of list.
 */
#ifndef ANLOS_NODES_ANLOS_TOPIC_TABLE_H
#define ANLOS_NODES_ANLOS_TOPIC_TABLE_H

#include <stdio.h>

#include "nodes/anlos/topic/tally.h"

/* How often, measured and expected; the intervals; what is missing. */
void topic_table_rates(const struct tally *t, double elapsed_s, FILE *f);

/* Bytes a second, and of a message. */
void topic_table_sizes(const struct tally *t, double elapsed_s, FILE *f);

/* From capture and from publishing to arrival. */
void topic_table_delays(const struct tally *t, double elapsed_s, FILE *f);

/* Every topic as msgs/topics.h has it. */
void topic_table_all(FILE *f);

#endif
