/* SPDX-License-Identifier: MIT */
#include "hal/realtime.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>

/* CAP_IPC_LOCK: whoever has it is held by no limit. */
static bool may_lock_all(void)
{
    unsigned long long effective = 0;
    struct rlimit limit;
    char line[128];
    FILE *f = fopen("/proc/self/status", "re");

    while (f && fgets(line, sizeof line, f))
        if (sscanf(line, "CapEff: %llx", &effective) == 1)
            break;
    if (f)
        fclose(f);
    return (effective >> 14 & 1) ||
           (!getrlimit(RLIMIT_MEMLOCK, &limit) && limit.rlim_cur == RLIM_INFINITY);
}

/* Later allocations fail once a limit is reached: with one, only what is there is locked.
 */
int realtime_lock(void)
{
    int flags = MCL_CURRENT | MCL_ONFAULT;

    if (may_lock_all())
        flags |= MCL_FUTURE;
    return mlockall(flags) ? -errno : 0;
}

void realtime_unlock(void)
{
    munlockall();
}

static int start_urgent(pthread_t *out, void *(*run)(void *), void *arg)
{
    struct sched_param priority = {.sched_priority = REALTIME_PRIORITY};
    pthread_attr_t attributes;
    int err = pthread_attr_init(&attributes);
    if (err)
        return -err;
    pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
    pthread_attr_setschedparam(&attributes, &priority);
    err = pthread_create(out, &attributes, run, arg);
    pthread_attr_destroy(&attributes);
    return -err;
}

int realtime_start(pthread_t *out, void *(*run)(void *), void *arg, bool urgent,
                   struct error *missing)
{
    sigset_t all, before;
    int lock = urgent ? realtime_lock() : 0;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int err = urgent ? start_urgent(out, run, arg) : -EPERM;
    bool lowly = urgent && err;
    if (err)
        err = -pthread_create(out, NULL, run, arg);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (!err && (lowly || lock))
        error_say(missing, 0,
                  "%s%s%s not permitted: a busy machine may lose pings, which are taken "
                  "again; raise the limits rtprio and memlock",
                  lowly ? "real-time priority" : "", lowly && lock ? " and " : "",
                  lock ? "locked memory" : "");
    return err;
}
