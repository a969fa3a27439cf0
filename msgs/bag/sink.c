#include "msgs/bag/sink.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "msgs/bag/record.h"

int bag_sink_create(struct bag_sink *s, const char *path, struct complaint *why)
{
    *s = (struct bag_sink){.path = strdup(path), .fd = -1};
    if (!s->path)
        return complain(why, -ENOMEM, "out of memory");
    s->fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (s->fd >= 0)
        return 0;
    int err = complain(why, -errno, "%s: %s", path, strerror(errno));
    free(s->path);
    s->path = NULL;
    return err;
}

/* A file may not grow beyond the process's limit, nor can space be held there. */
static bool exceeds_limit(uint64_t end)
{
    struct rlimit limit;

    return !getrlimit(RLIMIT_FSIZE, &limit) && limit.rlim_cur != RLIM_INFINITY &&
           end > limit.rlim_cur;
}

/* 0, or a disk that is full; a file system that cannot hold space ready is let be. */
static int hold(const struct bag_sink *s, uint64_t n)
{
    int err;

    if (exceeds_limit(s->size + n))
        return -EFBIG;
    do
        err = fallocate(s->fd, FALLOC_FL_KEEP_SIZE, (off_t)s->size, (off_t)n) ? errno : 0;
    while (err == EINTR);
    return err == ENOSPC || err == EDQUOT ? -err : 0;
}

static int write_all(const struct bag_sink *s, struct bytes what)
{
    uint64_t at = s->size;

    while (what.size) {
        ssize_t n = pwrite(s->fd, what.data, what.size, (off_t)at);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n ? -errno : -EIO;
        what.data += n;
        what.size -= (size_t)n;
        at += (uint64_t)n;
    }
    return 0;
}

int bag_sink_write(struct bag_sink *s, struct bytes what, uint64_t reserve,
                   struct complaint *why)
{
    if (!what.size)
        return 0;
    int err = hold(s, what.size + reserve);
    if (err)
        return complain(why, err, "%s: %s", s->path, strerror(-err));
    err = write_all(s, what);
    /* Should taking it back fail too, the size still tells where the next record goes. */
    if (err)
        return complain(why, err, "%s: %s%s", s->path, strerror(-err),
                        ftruncate(s->fd, (off_t)s->size) ? "; its end is damaged" : "");
    s->size += what.size;
    s->crc = bag_crc(s->crc, what);
    return 0;
}

int bag_sink_sync(struct bag_sink *s, struct complaint *why)
{
    return fdatasync(s->fd) ? complain(why, -errno, "%s: %s", s->path, strerror(errno))
                            : 0;
}

int bag_sink_close(struct bag_sink *s, struct complaint *why)
{
    int err = 0;

    if (s->fd < 0)
        return 0;
    if (ftruncate(s->fd, (off_t)s->size) || fsync(s->fd))
        err = -errno;
    if (close(s->fd) && !err)
        err = -errno;
    if (err)
        complain(why, err, "%s: %s", s->path, strerror(-err));
    free(s->path);
    *s = (struct bag_sink){.fd = -1};
    return err;
}
