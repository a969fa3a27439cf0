/* SPDX-License-Identifier: MIT */
#include "msgs/discovery.h"

#include <errno.h>
#include <fcntl.h>
#include <stdalign.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/inotify.h>
#include <unistd.h>

#include "msgs/endpoint.h"

#define LOCK_NAME "newcomers.lock"

static int open_lock(const char *run_dir, int flags)
{
    char path[ENDPOINT_PATH_SIZE];

    if (snprintf(path, sizeof path, "%s/" LOCK_NAME, run_dir) >= (int)sizeof path)
        return -ENAMETOOLONG;
    int fd = open(path, O_RDONLY | O_CLOEXEC | flags, 0600);
    return fd < 0 ? -errno : fd;
}

int discovery_open(struct discovery *n, const char *run_dir)
{
    int err = 0;

    n->lock = -1;
    n->fd = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
    if (n->fd < 0 || inotify_add_watch(n->fd, run_dir, IN_CREATE | IN_DELETE) < 0)
        err = -errno;
    if (!err && (n->lock = open_lock(run_dir, O_CREAT)) < 0)
        err = n->lock;
    if (!err && flock(n->lock, LOCK_SH | LOCK_NB))
        err = -errno;
    if (err)
        discovery_close(n);
    return err;
}

/* The kernel does not tell that a folder is removed while somebody holds a file of it. */
static void let_go(struct discovery *n, const char *deleted)
{
    if (n->lock < 0 || strcmp(deleted, LOCK_NAME) != 0)
        return;
    close(n->lock);
    n->lock = -1;
}

bool discovery_read(struct discovery *n, void (*call)(void *context, const char *name),
                    void *context)
{
    alignas(struct inotify_event) char events[4096];
    bool there = true;
    ssize_t size;

    while ((size = read(n->fd, events, sizeof events)) > 0) {
        for (const char *at = events; at < events + size;) {
            const struct inotify_event *e = (const void *)at;
            if (e->mask & IN_DELETE)
                let_go(n, e->name);
            else if (e->len)
                call(context, e->name);
            there = there && !(e->mask & IN_IGNORED);
            at += sizeof *e + e->len;
        }
    }
    return there;
}

void discovery_close(struct discovery *n)
{
    if (n->fd >= 0)
        close(n->fd);
    if (n->lock >= 0)
        close(n->lock);
    n->fd = n->lock = -1;
}

bool discovery_are_awaited(const char *run_dir)
{
    int fd = open_lock(run_dir, 0);

    if (fd < 0)
        return false;
    bool awaited = flock(fd, LOCK_EX | LOCK_NB) && errno == EWOULDBLOCK;
    close(fd);
    return awaited;
}
