/* SPDX-License-Identifier: MIT */
/* nodes/record/pairs.h -- a metadata record of a bag, text by text. */
#ifndef ANLOS_NODES_RECORD_PAIRS_H
#define ANLOS_NODES_RECORD_PAIRS_H

#include <stdint.h>

#include "dsp/error.h"
#include "msgs/bag/writer.h"

struct pairs { /* starts as {0}; memory that runs out is told by pairs_write */
    struct bytes_buffer map;
};

void pairs_text(struct pairs *p, const char *key, const char *value);
void pairs_count(struct pairs *p, const char *key, uint64_t value);
void pairs_stamp(struct pairs *p, const char *key, int64_t ns);

/* With as many digits as it takes to read the same number back; NaN: nothing. */
void pairs_number(struct pairs *p, const char *key, double value);

/* Writes the record.  0, -ENOMEM, as bag_writer_metadata. */
int pairs_write(const struct pairs *p, const char *name, struct bag_writer *w,
                struct error *why);
void pairs_clear(struct pairs *p);

#endif
