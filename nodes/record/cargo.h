/* nodes/record/cargo.h -- files that a recording carries as attachments, held in memory
 * so that each part of it gets them. */
#ifndef ANLOS_NODES_RECORD_CARGO_H
#define ANLOS_NODES_RECORD_CARGO_H

#include <stdint.h>

#include "msgs/bag/writer.h"
#include "dsp/complaint.h"

#define CARGO_MAX_FILE ((size_t)64 << 20)

struct cargo { /* starts as {0} */
    struct cargo_item {
        char *name;
        uint8_t *data; /* [size] */
        size_t size;
    } * items; /* [n] */
    size_t n;
};

/* Reads a file, which the attachment `name` will be.  0, -ENOENT and other errno,
 * -EFBIG, -EISDIR, -ENOMEM. */
int cargo_add_file(struct cargo *c, const char *name, const char *path,
                   struct complaint *why);

/* The folder's files whose names do not start with a dot, as PREFIX + name. */
int cargo_add_folder(struct cargo *c, const char *prefix, const char *folder,
                     struct complaint *why);

/* Errors of bag_writer_attachment. */
int cargo_write(const struct cargo *c, struct bag_writer *w, int64_t now_ns,
                struct complaint *why);
void cargo_clear(struct cargo *c);

#endif
