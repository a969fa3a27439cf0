/* msgs/bag/writer_state.h -- what the writer and its chunks share. */
#ifndef ANLOS_MSGS_BAG_WRITER_STATE_H
#define ANLOS_MSGS_BAG_WRITER_STATE_H

#include "msgs/bag/definitions.h"
#include "msgs/bag/sink.h"
#include "msgs/bag/summary.h"
#include "msgs/bag/writer.h"

struct writer_span { /* of log times */
    uint64_t n, start, end;
};

struct bag_writer {
    struct bag_writer_config cfg;
    struct bag_sink sink;
    struct bag_definitions definitions;
    struct bag_summary summary;
    struct bag_statistics statistics; /* counts */
    struct writer_span messages;      /* in the file */
    struct writer_span in_chunk;
    struct bytes_buffer chunk;       /* records of the chunk under way */
    struct bytes_buffer out, packed; /* scratch: what is written next, compressed */
    int error;                       /* of writing: nothing more is taken */
};

/* More messages of those times; n 0: none. */
void writer_span_add(struct writer_span *s, uint64_t start, uint64_t end, uint64_t n);

/* Ends all writing: -ENOMEM now, and the error of before. */
int writer_out_of_memory(struct bag_writer *w, struct complaint *why);
int writer_after_error(const struct bag_writer *w, struct complaint *why);

/* Writes w->out, and empties it.  Errors of writing. */
int writer_emit(struct bag_writer *w, struct complaint *why);

/* Writes the chunk under way, if there is one, with its indexes. */
int writer_end_chunk(struct bag_writer *w, struct complaint *why);

#endif
