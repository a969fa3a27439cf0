/* SPDX-License-Identifier: MIT */
#include "msgs/bag/file.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "msgs/bag/compression.h"

#define ALLOWED_PER_BYTE 4096
#define ALLOWED_BYTES    ((uint64_t)1 << 30)

static int open_fd(struct bag_file *f, const char *path, struct error *why)
{
    struct stat st;

    f->fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (f->fd < 0 || fstat(f->fd, &st))
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    if (!S_ISREG(st.st_mode))
        return error_say(why, -EINVAL, "%s is no file", path);
    f->size = (uint64_t)st.st_size;
    return 0;
}

int bag_file_open_any(struct bag_file *f, const char *path, struct error *why)
{
    *f = (struct bag_file){.path = strdup(path), .fd = -1};
    int err = f->path ? open_fd(f, path, why) : error_say(why, -ENOMEM, "out of memory");
    if (err)
        bag_file_close(f);
    return err;
}

int bag_file_open(struct bag_file *f, const char *path, struct error *why)
{
    char magic[BAG_MAGIC_SIZE];
    int err = bag_file_open_any(f, path, why);

    if (err)
        return err;
    ssize_t n = pread(f->fd, magic, sizeof magic, 0);
    if (n < 0)
        err = error_say(why, -errno, "%s: %s", path, strerror(errno));
    else if (n != (ssize_t)sizeof magic || memcmp(magic, BAG_MAGIC, sizeof magic))
        err = error_say(why, -EBADMSG, f->size ? "%s is no MCAP file" : "%s is empty",
                        path);
    if (err)
        bag_file_close(f);
    return err;
}

void bag_file_close(struct bag_file *f)
{
    if (f->fd >= 0)
        close(f->fd);
    free(f->path);
    *f = (struct bag_file){.fd = -1};
}

int bag_file_read(const struct bag_file *f, uint64_t offset, uint64_t n,
                  struct bytes_buffer *into, struct error *why)
{
    into->size = 0;
    if (offset > f->size || n > f->size - offset)
        return error_say(why, -EBADMSG,
                         "%s: byte %" PRIu64 ": the file ends in the middle of a record; "
                         "`anlos bag recover` saves what is whole",
                         f->path, offset);
    if (n > BAG_MAX_SIZE)
        return error_say(why, -EFBIG,
                         "%s: byte %" PRIu64 ": a record of %" PRIu64
                         " bytes; the largest that is read has %" PRIu64,
                         f->path, offset, n, BAG_MAX_SIZE);
    if (bytes_reserve(into, (size_t)n))
        return error_say(why, -ENOMEM, "%s: out of memory", f->path);
    while (into->size < n) {
        ssize_t got = pread(f->fd, into->data + into->size, (size_t)n - into->size,
                            (off_t)(offset + into->size));
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return error_say(why, -EIO, "%s: byte %" PRIu64 ": %s", f->path, offset,
                             got ? strerror(errno)
                                 : "the file was cut while it was read");
        into->size += (size_t)got;
    }
    return 0;
}

int bag_file_record(const struct bag_file *f, uint64_t offset, struct bytes_buffer *into,
                    struct error *why)
{
    int err = bag_file_read(f, offset, BAG_RECORD_HEAD_SIZE, into, why);

    if (err)
        return err;
    struct bytes_cursor c = {.left = {into->data + 1, 8}};
    uint64_t length = bytes_number(&c, 8);
    if (length > f->size) /* the sum below cannot overflow then */
        length = f->size;
    return bag_file_read(f, offset, BAG_RECORD_HEAD_SIZE + length, into, why);
}

uint64_t bag_file_allowance(const struct bag_file *f)
{
    return f->size * ALLOWED_PER_BYTE + ALLOWED_BYTES;
}

int bag_file_chunk(const struct bag_file *f, uint64_t offset, const struct bag_chunk *k,
                   uint64_t *allowance, struct bytes_buffer *into, struct error *why)
{
    enum bag_compression compression;

    if (bag_compression_find(&compression, k->compression))
        return error_say(why, -ENOTSUP,
                         "%s: byte %" PRIu64 ": a chunk with the compression \"%.*s\"; "
                         "none, zstd and lz4 can be read",
                         f->path, offset,
                         (int)(k->compression.size < 32 ? k->compression.size : 32),
                         (const char *)k->compression.data);
    if (k->uncompressed_size > BAG_MAX_SIZE)
        return error_say(why, -EFBIG,
                         "%s: byte %" PRIu64 ": a chunk of %" PRIu64
                         " bytes; the largest that is read has %" PRIu64,
                         f->path, offset, k->uncompressed_size, BAG_MAX_SIZE);
    if (k->uncompressed_size > *allowance)
        return error_say(why, -EFBIG,
                         "%s: byte %" PRIu64 ": more would come out of the chunks than "
                         "a recording of %" PRIu64 " bytes holds",
                         f->path, offset, f->size);
    *allowance -= k->uncompressed_size;
    int err = bag_decompress(into, compression, k->records, k->uncompressed_size);
    if (err)
        return error_say(why, err, "%s: byte %" PRIu64 ": a chunk %s", f->path, offset,
                         err == -ENOMEM ? "for which memory ran out"
                                        : "is damaged; `anlos bag recover` saves what is "
                                          "whole");
    if (k->uncompressed_crc && bag_crc(0, bytes_in(into)) != k->uncompressed_crc)
        return error_say(why, -EBADMSG,
                         "%s: byte %" PRIu64 ": a chunk does not have its checksum; "
                         "`anlos bag recover` saves what is whole",
                         f->path, offset);
    return 0;
}

int bag_file_attachment(const struct bag_file *f, uint64_t offset,
                        const struct bag_attachment *a, struct error *why)
{
    /* Its content begins with two times and a length in front of the name. */
    const uint8_t *start = a->name.data - 20;
    struct bytes covered = {start, (size_t)(a->data.data + a->data.size - start)};

    return !a->crc || bag_crc(0, covered) == a->crc
               ? 0
               : error_say(why, -EBADMSG,
                           "%s: byte %" PRIu64 ": an attachment without its checksum",
                           f->path, offset);
}
