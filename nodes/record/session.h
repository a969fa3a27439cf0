/* SPDX-License-Identifier: MIT */
/* nodes/record/session.h -- what a recording says of itself, whatever is in it: who made
 * it when and with what, and the launch file with its inputs (msgs/bag/manifest.h). */
#ifndef ANLOS_NODES_RECORD_SESSION_H
#define ANLOS_NODES_RECORD_SESSION_H

#include <stdint.h>

#include "dsp/error.h"
#include "msgs/bag/writer.h"
#include "nodes/rt/launchfile.h"

/* A metadata record of a bag, text by text. */

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

/* Files that a recording carries as attachments, held in memory so that each part of it
 * gets them. */

#define ATTACHMENTS_MAX_FILE ((size_t)64 << 20)

struct attachments { /* starts as {0} */
    struct attachments_item {
        char *name;
        uint8_t *data; /* [size] */
        size_t size;
    } * items; /* [n] */
    size_t n, room;
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

struct session {                  /* starts as {0} */
    const char *topics, *exclude; /* patterns; exclude may be NULL */
    int64_t start_ns;
    char *launch; /* the launch file's attachment; NULL: none */
    struct attachments attachments;
};

/* Takes the launch file and what its array's URI names.  What cannot be read is left
 * out: *left_out says which (empty: nothing).  0, -ENOMEM, and errno of reading the
 * launch file itself. */
int session_add_launch(struct session *s, const struct launchfile *l,
                       struct error *left_out, struct error *why);

/* part: which file of the recording, from 1.  Errors of the writer. */
int session_write(const struct session *s, unsigned part, int64_t now_ns,
                  struct bag_writer *w, struct error *why);
void session_clear(struct session *s);

#endif
