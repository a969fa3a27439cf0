/* SPDX-License-Identifier: MIT */
#include "msgs/endpoint.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdalign.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/inotify.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

_Static_assert(ENDPOINT_PATH_SIZE == sizeof(((struct sockaddr_un *)0)->sun_path),
               "the length of a socket path");

int endpoint_url(char url[ENDPOINT_URL_SIZE], const char *run_dir, const char *node,
                 const char *topic, struct error *why)
{
    int length = snprintf(url, ENDPOINT_URL_SIZE, ENDPOINT_SCHEME "%s/%s.%s.ipc", run_dir,
                          node, topic);
    if (length < 0 || (size_t)length >= ENDPOINT_URL_SIZE) {
        size_t name = strlen(node) + strlen(topic) + sizeof "/..ipc";
        return error_say(why, -ENAMETOOLONG,
                         "run folder %s: socket %s.%s.ipc in it would have a path of %zu "
                         "characters, the system allows %d: choose a run folder of at "
                         "most %zu",
                         run_dir, node, topic, strlen(run_dir) + name - 1,
                         ENDPOINT_PATH_SIZE - 1, ENDPOINT_PATH_SIZE - name);
    }
    char *name = url + sizeof ENDPOINT_SCHEME - 1 + strlen(run_dir) + 1;
    for (char *slash = name; (slash = strchr(slash, '/'));)
        *slash = '-';
    return 0;
}

void endpoint_url_of_all(char url[ENDPOINT_URL_SIZE], const char *of)
{
    size_t n = strlen(of) - strlen("ipc");
    memcpy(url, of, n);
    memcpy(url + n, "all", sizeof "all");
}

const char *endpoint_path(const char *url)
{
    return url + sizeof ENDPOINT_SCHEME - 1;
}

static int make_one(const char *path)
{
    struct stat st;
    if (mkdir(path, 0700) == 0)
        return 0;
    if (errno != EEXIST)
        return -errno;
    if (stat(path, &st) != 0)
        return -errno;
    return S_ISDIR(st.st_mode) ? 0 : -ENOTDIR;
}

int endpoint_make_folder(const char *run_dir, struct error *why)
{
    char path[PATH_MAX];
    size_t length = strlen(run_dir);
    int err = length == 0 ? -ENOENT : length >= sizeof path ? -ENAMETOOLONG : 0;
    if (!err)
        memcpy(path, run_dir, length + 1);
    for (size_t i = 1; !err && i <= length; i++) {
        if (i < length && path[i] != '/')
            continue;
        path[i] = 0;
        err = make_one(path);
        path[i] = i < length ? '/' : 0;
    }
    if (err)
        error_say(why, err, "run folder \"%s\": cannot be made: %s", run_dir,
                  strerror(-err));
    return err;
}

int endpoint_lock(const char *run_dir, const char *node, bool replay, struct error *why)
{
    char path[PATH_MAX], owner[32] = "";
    if ((size_t)snprintf(path, sizeof path, "%s/%s.lock", run_dir, node) >= sizeof path)
        return error_say(why, -ENAMETOOLONG, "run folder %s: path too long", run_dir);
    int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (fd < 0)
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
        int err = errno == EWOULDBLOCK ? -EADDRINUSE : -errno;
        ssize_t n = pread(fd, owner, sizeof owner - 1, 0);
        owner[n > 0 ? n : 0] = 0;
        owner[strcspn(owner, "\n")] = 0;
        close(fd);
        if (err == -EADDRINUSE)
            return error_say(
                why, err,
                "%s: a node \"%s\" already runs here (process %s): stop it, or "
                "choose another run folder",
                path, node, owner);
        return error_say(why, err, "%s: %s", path, strerror(-err));
    }
    int length = snprintf(owner, sizeof owner, "%ld\n%s", (long)getpid(),
                          replay ? "replay\n" : "");
    if (ftruncate(fd, 0) != 0 || pwrite(fd, owner, (size_t)length, 0) != length) {
        int err = errno ? -errno : -EIO;
        close(fd);
        return error_say(why, err, "%s: %s", path, strerror(-err));
    }
    return fd;
}

/* -- how one hears of them --------------------------------------------------------------
 */

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
