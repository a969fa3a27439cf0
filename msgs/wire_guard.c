/* SPDX-License-Identifier: MIT */
#include "msgs/wire_guard.h"

#include <dlfcn.h>
#include <errno.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <unistd.h>

#define MAX_FD         4096
#define HANDSHAKE_SIZE 8 /* of an SP connection: 0 S P 0 and the protocol */
#define HEADER_SIZE    9 /* of a frame: 1, and the length, u64 big-endian */

enum role { ROLE_NONE, ROLE_PUBLISHER, ROLE_SUBSCRIBER };

/* A connection, by its descriptor, until that is closed.  nanomsg reads one by one thread
 * at a time, so that each needs no lock, but for what epoll_wait looks at; that they are
 * global is in the nature of the calls.  */
struct link {
    _Atomic(void *) handle; /* nanomsg's, in the events of it; NULL: awaits none */
    _Atomic bool pauses;    /* has the handshake, and does not read on yet */
    enum role role;
    size_t handshake; /* bytes of it that have come */
    size_t header;    /* bytes of a frame's header that have come */
    uint64_t left;    /* of the frame's body */
};

static struct link links[MAX_FD];
static _Atomic uint64_t refused;

uint64_t wire_guard_refused(void)
{
    return refused;
}

/* The C library's, or a sanitizer's. */
static void *next(const char *name, _Atomic(void *) *kept)
{
    void *call = *kept;
    if (!call)
        *kept = call = dlsym(RTLD_NEXT, name);
    return call;
}

static bool is_ours(const struct sockaddr *address, socklen_t size)
{
    static const char suffix[] = ".ipc";
    const struct sockaddr_un *at = (const void *)address;
    if (!address || size <= offsetof(struct sockaddr_un, sun_path) ||
        address->sa_family != AF_UNIX)
        return false;
    size_t n = strnlen(at->sun_path, size - offsetof(struct sockaddr_un, sun_path));
    return n > sizeof suffix &&
           !memcmp(at->sun_path + n - (sizeof suffix - 1), suffix, sizeof suffix - 1);
}

static bool begin(int fd, enum role role)
{
    if (fd < 0 || fd >= MAX_FD)
        return false;
    struct link *l = &links[fd];
    l->handle = NULL;
    l->pauses = false;
    l->role = role;
    l->handshake = l->header = 0;
    l->left = 0;
    return true;
}

static struct link *find(int fd)
{
    return fd >= 0 && fd < MAX_FD && links[fd].role ? &links[fd] : NULL;
}

/* Of what nanomsg reads next, handshake, header or body: what is left. */
static uint64_t wanted(const struct link *l)
{
    if (l->handshake < HANDSHAKE_SIZE)
        return HANDSHAKE_SIZE - l->handshake;
    if (l->header < HEADER_SIZE)
        return HEADER_SIZE - l->header;
    return l->left ? l->left : HEADER_SIZE;
}

/* Takes what has come, which is never more than what is wanted.  false: no more of this.
 * nanomsg itself looks at the handshake, and at lengths. */
static bool accept_bytes(struct link *l, const uint8_t *data, size_t n)
{
    if (l->handshake < HANDSHAKE_SIZE) {
        l->handshake += n;
        return true;
    }
    if (l->role == ROLE_PUBLISHER)
        return false; /* a subscriber has nothing to say */
    if (l->header == HEADER_SIZE && l->left) {
        l->left -= n;
        return true;
    }
    if (l->header == HEADER_SIZE)
        l->header = 0;
    if (!l->header && *data != 1)
        return false;
    for (; n; n--, l->header++)
        l->left = l->left << 8 | *data++;
    return true;
}

int accept4(int fd, struct sockaddr *restrict address, socklen_t *restrict size,
            int flags)
{
    typedef int call(int, struct sockaddr *, socklen_t *, int);
    static _Atomic(void *) kept;
    struct sockaddr_un at;
    socklen_t at_size = sizeof at;
    void *found = next("accept4", &kept);
    call *real;
    memcpy(&real, &found, sizeof real);
    int peer = real(fd, address, size, flags);
    if (peer < 0 || getsockname(fd, (struct sockaddr *)&at, &at_size) ||
        !is_ours((struct sockaddr *)&at, at_size) || begin(peer, ROLE_PUBLISHER))
        return peer;
    close(peer);
    errno = EMFILE;
    return -1;
}

int connect(int fd, const struct sockaddr *address, socklen_t size)
{
    typedef int call(int, const struct sockaddr *, socklen_t);
    static _Atomic(void *) kept;
    void *found = next("connect", &kept);
    call *real;
    memcpy(&real, &found, sizeof real);
    if (is_ours(address, size) && !begin(fd, ROLE_SUBSCRIBER)) {
        errno = EMFILE;
        return -1;
    }
    return real(fd, address, size);
}

int close(int fd)
{
    typedef int call(int);
    static _Atomic(void *) kept;
    void *found = next("close", &kept);
    call *real;
    memcpy(&real, &found, sizeof real);
    struct link *l = find(fd);
    if (l) { /* before another file gets its number */
        l->role = ROLE_NONE;
        l->handle = NULL;
    }
    return real(fd);
}

int epoll_ctl(int epoll, int how, int fd, struct epoll_event *event)
{
    typedef int call(int, int, int, struct epoll_event *);
    static _Atomic(void *) kept;
    void *found = next("epoll_ctl", &kept);
    call *real;
    memcpy(&real, &found, sizeof real);
    struct link *l = find(fd);
    if (l)
        l->handle = how == EPOLL_CTL_DEL ? NULL : event->data.ptr;
    return real(epoll, how, fd, event);
}

static struct link *find_handle(const void *handle)
{
    for (size_t fd = 0; handle && fd < MAX_FD; fd++)
        if (links[fd].handle == handle)
            return &links[fd];
    return NULL;
}

/* Leaves of an event what nanomsg may be told now: of a connection's end neither before
 * what was sent over it, nor while it pauses.  false: nothing. */
static bool hold_end(struct epoll_event *event)
{
    const uint32_t end = EPOLLHUP | EPOLLERR;
    if (!(event->events & end))
        return true;
    const struct link *l = find_handle(event->data.ptr);
    if (l && (l->pauses || event->events & ~end))
        event->events &= ~end;
    return event->events;
}

/* What is kept back comes again, until it is acted upon. */
int epoll_wait(int epoll, struct epoll_event *events, int max, int timeout)
{
    typedef int call(int, struct epoll_event *, int, int);
    static _Atomic(void *) kept;
    void *found = next("epoll_wait", &kept);
    call *real;
    memcpy(&real, &found, sizeof real);
    int n = real(epoll, events, max, timeout), told = 0;
    for (int i = 0; i < n; i++)
        if (hold_end(&events[i]))
            events[told++] = events[i];
    return n < 0 ? n : told;
}

ssize_t recvmsg(int fd, struct msghdr *message, int flags)
{
    typedef ssize_t call(int, struct msghdr *, int);
    static _Atomic(void *) kept;
    void *found = next("recvmsg", &kept);
    call *real;
    memcpy(&real, &found, sizeof real);
    struct link *l = find(fd);
    if (!l || !message->msg_iovlen)
        return real(fd, message, flags);
    l->pauses = false;
    struct msghdr part = *message;
    struct iovec into = *message->msg_iov;
    if (into.iov_len > wanted(l))
        into.iov_len = (size_t)wanted(l);
    part.msg_iov = &into;
    part.msg_iovlen = 1;
    ssize_t n = real(fd, &part, flags);
    message->msg_controllen = part.msg_controllen;
    message->msg_flags = part.msg_flags;
    if (n <= 0 || accept_bytes(l, into.iov_base, (size_t)n)) {
        l->pauses = n > 0 && l->handshake == HANDSHAKE_SIZE && !l->header;
        return n;
    }
    refused++;
    return 0;
}
