#include "hal/realtime.h"

#include <errno.h>
#include <signal.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>

/* Above everything that is not urgent, under the kernel's interrupt threads (50). */
enum { PRIORITY = 20 };

/* Later allocations fail once a limit is reached: with one, only what is there is locked.
 */
static int lock_memory(void)
{
    struct rlimit limit;
    int flags = MCL_CURRENT | MCL_ONFAULT;
    if (!getrlimit(RLIMIT_MEMLOCK, &limit) && limit.rlim_cur == RLIM_INFINITY)
        flags |= MCL_FUTURE;
    return mlockall(flags) ? -errno : 0;
}

static int start_urgent(pthread_t *out, void *(*run)(void *), void *arg)
{
    struct sched_param priority = {.sched_priority = PRIORITY};
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
                   struct complaint *missing)
{
    sigset_t all, before;
    int lock = urgent ? lock_memory() : 0;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int err = urgent ? start_urgent(out, run, arg) : -EPERM;
    bool lowly = urgent && err;
    if (err)
        err = -pthread_create(out, NULL, run, arg);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (!err && (lowly || lock))
        complain(missing, 0,
                 "%s%s%s not permitted: a busy machine may lose pings, which are taken "
                 "again; raise the limits rtprio and memlock",
                 lowly ? "real-time priority" : "", lowly && lock ? " and " : "",
                 lock ? "locked memory" : "");
    return err;
}

void realtime_join(pthread_t thread, bool urgent)
{
    pthread_join(thread, NULL);
    if (urgent)
        munlockall();
}
