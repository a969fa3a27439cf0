/* SPDX-License-Identifier: MIT */
/* nodes/record/attachments.h -- files that a recording carries as attachments, held in
 * memory so that each part of it gets them. */
#ifndef ANLOS_NODES_RECORD_ATTACHMENTS_H
#define ANLOS_NODES_RECORD_ATTACHMENTS_H

#include <stdint.h>

#include "dsp/error.h"
#include "msgs/bag/writer.h"

#define ATTACHMENTS_MAX_FILE ((size_t)64 << 20)

struct attachments { /* starts as {0} */
    struct attachments_item {
        char *name;
        uint8_t *data; /* [size] */
        size_t size;
    } * items; /* [n] */
    size_t n;
};

/* Reads a file, which the attachment `name` will be.  0, -ENOENT and other errno,
 * -EFBIG, -EISDIR, -ENOMEM. */
int attachments_add_file(struct attachments *c, const char *name, const char *path,
                         struct error *why);

/* The folder's files whose names do not start with a dot, as PREFIX + name. */
int attachments_add_folder(struct attachments *c, const char *prefix, const char *folder,
                           struct error *why);

/* Errors of bag_writer_attachment. */
int attachments_write(const struct attachments *c, struct bag_writer *w, int64_t now_ns,
                      struct error *why);
void attachments_clear(struct attachments *c);

#endif
