/* SPDX-License-Identifier: MIT */
/* A wall clock that a long run sets while processes run (tests/bench/soak), to be loaded
 * before their libraries: what the file ANLOS_WALL_CLOCK begins with, an int64_t in ns,
 * is added to the system's.  Sleeps and the monotonic clock are left as they are. */
#include <dlfcn.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#define NS_PER_S INT64_C(1000000000)

static int (*system_gettime)(clockid_t, struct timespec *);
static const _Atomic int64_t *ahead_ns;

__attribute__((constructor)) static void find(void)
{
    const char *path = getenv("ANLOS_WALL_CLOCK");
    int fd = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;

    *(void **)&system_gettime = dlsym(RTLD_NEXT, "clock_gettime");
    if (fd < 0)
        return;
    void *page = mmap(NULL, sizeof *ahead_ns, PROT_READ, MAP_SHARED, fd, 0);
    close(fd);
    if (page != MAP_FAILED)
        ahead_ns = page;
}

int clock_gettime(clockid_t id, struct timespec *t)
{
    if (!system_gettime)
        find();
    int err = system_gettime(id, t);
    if (err || id != CLOCK_REALTIME || !ahead_ns)
        return err;
    int64_t ns = (int64_t)t->tv_sec * NS_PER_S + t->tv_nsec + *ahead_ns;
    t->tv_sec = (time_t)(ns / NS_PER_S);
    t->tv_nsec = (long)(ns % NS_PER_S);
    return 0;
}
