#include "nodes/anlos/doctor/doctor.h"

#include <errno.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

enum { PRIORITY = 20 };        /* of hal/realtime.c */
#define BUFFER_BYTES (8 << 20) /* under it, messages of 3 MB back to back get lost */
#define MIN_FILES    512
#define LOCK_BYTES   ((size_t)256 << 20) /* more than any node has */

static const char limits_todo[] =
    "put '@audio - rtprio 20' and '@audio - memlock unlimited' into "
    "/etc/security/limits.d/anlos.conf, join the group audio, log in anew";

/* Tried, not asked for: limits are not all that may be in the way. */
static void look_at_priority(struct findings *f)
{
    struct sched_param urgent = {.sched_priority = PRIORITY}, usual = {0};

    if (sched_setscheduler(0, SCHED_FIFO, &urgent)) {
        finding_add(f, FINDING_NOTE, "realtime",
                    "priority %d is not permitted (%s): pings and steps of a stage may "
                    "come late on a busy machine",
                    PRIORITY, strerror(errno));
        finding_todo(f, "%s", limits_todo);
        return;
    }
    sched_setscheduler(0, SCHED_OTHER, &usual);
    finding_add(f, FINDING_OK, "realtime", "priority %d is permitted", PRIORITY);
}

/* Of what is locked from now on, nothing is touched; whoever may lock all (CAP_IPC_LOCK)
 * is held by no limit, whatever it says. */
static bool can_lock_more(void)
{
    if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT))
        return false;
    void *p = mmap(NULL, LOCK_BYTES, PROT_READ | PROT_WRITE,
                   MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (p != MAP_FAILED)
        munmap(p, LOCK_BYTES);
    return p != MAP_FAILED;
}

static void look_at_locking(struct findings *f)
{
    bool all = can_lock_more();

    munlockall();
    if (mlockall(MCL_CURRENT | MCL_ONFAULT)) {
        finding_add(f, FINDING_NOTE, "memlock", "memory cannot be locked (%s)",
                    strerror(errno));
        finding_todo(f, "%s", limits_todo);
        return;
    }
    munlockall();
    finding_add(f, all ? FINDING_OK : FINDING_NOTE, "memlock", "memory can be locked%s",
                all ? "" : ", but not all that a node asks for later");
    if (!all)
        finding_todo(f, "%s", limits_todo);
}

static void look_at_buffers(struct findings *f)
{
    static const char *const names[] = {"wmem_max", "rmem_max"};
    char path[64], word[24];

    for (size_t i = 0; i < 2; i++) {
        snprintf(path, sizeof path, "/proc/sys/net/core/%s", names[i]);
        if (doctor_read_word(path, word, sizeof word))
            continue;
        long bytes = atol(word);
        finding_add(f, bytes < BUFFER_BYTES ? FINDING_NOTE : FINDING_OK, "buffers",
                    "net.core.%s allows %.1f MB for a connection%s", names[i],
                    1e-6 * (double)bytes,
                    bytes < BUFFER_BYTES ? ": messages may get lost on a busy machine"
                                         : "");
        if (bytes < BUFFER_BYTES)
            finding_todo(f,
                         "'sysctl -w net.core.%s=33554432', and the same in "
                         "/etc/sysctl.d/anlos.conf",
                         names[i]);
    }
}

static void look_at_files(struct findings *f)
{
    struct rlimit limit;

    if (getrlimit(RLIMIT_NOFILE, &limit) || limit.rlim_cur >= MIN_FILES)
        return;
    finding_add(f, FINDING_NOTE, "files", "a process may open only %lu",
                (unsigned long)limit.rlim_cur);
    finding_todo(f, "'ulimit -n 1024' before the launch");
}

void doctor_limits(const void *ctx, struct findings *f)
{
    (void)ctx;
    look_at_priority(f);
    look_at_locking(f);
    look_at_buffers(f);
    look_at_files(f);
}
