/* SPDX-License-Identifier: MIT */
#include "msgs/discovery.h"

#include <errno.h>
#include <fcntl.h>
#include <stdalign.h>
#include <stdio.h>
#include <string.h>
#include <sys/inotify.h>
#include <unistd.h>

#include "msgs/endpoint.h"

#define LOCK_NAME "discovery.lock"

#define MOST_WAITING 16 /* of those who wait for one topic: more are not waited for */

static int open_lock(const char *run_dir, int flags)
{
    char path[ENDPOINT_PATH_SIZE];

    if (snprintf(path, sizeof path, "%s/" LOCK_NAME, run_dir) >= (int)sizeof path)
        return -ENAMETOOLONG;
    int fd = open(path, O_RDWR | O_CLOEXEC | O_NOFOLLOW | flags, 0600);
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

/* The byte that somebody who waits for the topic has locked. */
static struct flock place(const struct topic *t, int i)
{
    return (struct flock){.l_type = F_WRLCK,
                          .l_whence = SEEK_SET,
                          .l_start = (t - topics_all()) * MOST_WAITING + i,
                          .l_len = 1};
}

void discovery_await(const struct discovery *n, const struct topic *t)
{
    for (int i = 0; i < MOST_WAITING; i++) {
        struct flock free = place(t, i);
        if (!fcntl(n->lock, F_OFD_SETLK, &free))
            return;
    }
}

size_t discovery_awaited(const char *run_dir, const struct topic *t)
{
    int fd = open_lock(run_dir, 0);
    size_t n = 0;

    for (int i = 0; fd >= 0 && i < MOST_WAITING; i++) {
        struct flock held = place(t, i);
        n += !fcntl(fd, F_OFD_GETLK, &held) && held.l_type != F_UNLCK;
    }
    if (fd >= 0)
        close(fd);
    return n;
}
