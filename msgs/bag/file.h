/* SPDX-License-Identifier: MIT */
/* msgs/bag/file.h -- records of a file by their offset, with every length checked against
 * what is there before memory is taken for it. */
#ifndef ANLOS_MSGS_BAG_FILE_H
#define ANLOS_MSGS_BAG_FILE_H

#include "dsp/error.h"
#include "msgs/bag/record.h"

/* The largest record, and the largest chunk after decompression: a volume and what goes
 * with it.  What claims to be larger is refused, and not written. */
#define BAG_MAX_SIZE ((uint64_t)320 << 20)

struct bag_file {
    char *path; /* for errors */
    int fd;
    uint64_t size;
};

/* A regular file with the format's magic at its start.  0, -ENOENT and other errno of
 * opening, -EBADMSG (another kind of file, or empty), -ENOMEM. */
int bag_file_open(struct bag_file *f, const char *path, struct error *why);

/* The same without a look at what the file begins with. */
int bag_file_open_any(struct bag_file *f, const char *path, struct error *why);
void bag_file_close(struct bag_file *f);

/* Fills `into` with n bytes at the offset.  0, -EBADMSG (the file ends before), -EIO,
 * -EFBIG, -ENOMEM. */
int bag_file_read(const struct bag_file *f, uint64_t offset, uint64_t n,
                  struct bytes_buffer *into, struct error *why);

/* Head and content of the record at the offset.  Errors as bag_file_read. */
int bag_file_record(const struct bag_file *f, uint64_t offset, struct bytes_buffer *into,
                    struct error *why);

/* How many bytes may come out of the chunks of a file in one pass over it: more than
 * silence in real bags comes to (1800 times its size in chunks of 4 MB), but no small
 * file stands for an endless one. */
uint64_t bag_file_allowance(const struct bag_file *f);

/* A chunk's records, decompressed and checked; what comes out is taken off *allowance.
 * 0, -EBADMSG, -ENOTSUP (compression), -EFBIG (BAG_MAX_SIZE, or the allowance is used
 * up), -ENOMEM. */
int bag_file_chunk(const struct bag_file *f, uint64_t offset, const struct bag_chunk *k,
                   uint64_t *allowance, struct bytes_buffer *into, struct error *why);

/* The attachment read from there: does it have its checksum?  0, -EBADMSG. */
int bag_file_attachment(const struct bag_file *f, uint64_t offset,
                        const struct bag_attachment *a, struct error *why);

#endif
