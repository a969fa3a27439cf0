#include "nodes/launcher/signals.h"

#include <errno.h>
#include <stdbool.h>
#include <sys/signalfd.h>
#include <unistd.h>

/* As nohup leaves it: a signal that is blocked comes even if it is to be ignored. */
static bool hangup_is_ignored(void)
{
    struct sigaction now;

    return !sigaction(SIGHUP, NULL, &now) && now.sa_handler == SIG_IGN;
}

int signals_open(struct signals *s)
{
    sigset_t set;

    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    if (!hangup_is_ignored())
        sigaddset(&set, SIGHUP);
    sigaddset(&set, SIGCHLD);
    signal(SIGPIPE, SIG_IGN);
    if (sigprocmask(SIG_BLOCK, &set, &s->before))
        return -errno;
    s->fd = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
    return s->fd < 0 ? -errno : 0;
}

int signals_next(const struct signals *s)
{
    struct signalfd_siginfo info;

    return read(s->fd, &info, sizeof info) == (ssize_t)sizeof info ? (int)info.ssi_signo
                                                                   : 0;
}

void signals_close(struct signals *s)
{
    if (s->fd < 0)
        return;
    while (signals_next(s))
        ;
    close(s->fd);
    sigprocmask(SIG_SETMASK, &s->before, NULL);
}
