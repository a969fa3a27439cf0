/* SPDX-License-Identifier: MIT */
#include "nodes/rt/stop.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <unistd.h>

#include "msgs/bus.h"

/* -- a node -----------------------------------------------------------------------------
 */

/* The stop flag: the bus that a signal wakes. */
static _Atomic(struct bus *) stop_bus;
static volatile sig_atomic_t stop_asked;

static void stop_on_signal(int number)
{
    struct bus *bus = atomic_load(&stop_bus);

    (void)number;
    stop_asked = 1;
    if (bus)
        bus_interrupt(bus);
}

static int catch_signals(void)
{
    /* No SA_RESTART: a sleep of the hardware must end when the process is to stop. */
    struct sigaction stop = {.sa_handler = stop_on_signal};
    struct sigaction ignore = {.sa_handler = SIG_IGN};

    sigemptyset(&stop.sa_mask);
    sigemptyset(&ignore.sa_mask);
    if (sigaction(SIGINT, &stop, NULL) || sigaction(SIGTERM, &stop, NULL) ||
        sigaction(SIGPIPE, &ignore, NULL))
        return -errno;
    return 0;
}

/* A node that was started by a launcher does not outlive it. */
static void follow_parent(void)
{
    const char *parent = getenv("ANLOS_LAUNCHER_PID");

    if (!parent)
        return;
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != (pid_t)atol(parent))
        raise(SIGTERM);
}

int stop_install(void)
{
    int err = catch_signals();

    if (!err)
        follow_parent();
    return err;
}

void stop_block(sigset_t *before)
{
    sigset_t stops;

    sigemptyset(&stops);
    sigaddset(&stops, SIGINT);
    sigaddset(&stops, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &stops, before);
}

void stop_unblock(const sigset_t *before)
{
    pthread_sigmask(SIG_SETMASK, before, NULL);
}

void stop_wakes(struct bus *bus)
{
    atomic_store(&stop_bus, bus);
    if (bus && stop_asked)
        bus_interrupt(bus);
}

bool stop_requested(void)
{
    return stop_asked != 0;
}

/* -- a command --------------------------------------------------------------------------
 */

static volatile sig_atomic_t requested;

static void on_signal(int number)
{
    (void)number;
    requested = 1;
}

void interrupt_catch(void)
{
    struct sigaction stop = {.sa_handler = on_signal, .sa_flags = (int)SA_RESETHAND};
    struct sigaction ignore = {.sa_handler = SIG_IGN}, before;
    requested = 0;
    sigemptyset(&stop.sa_mask);
    sigemptyset(&ignore.sa_mask);
    sigaction(SIGINT, &stop, NULL);
    sigaction(SIGTERM, &stop, NULL);
    if (!sigaction(SIGHUP, NULL, &before) && before.sa_handler != SIG_IGN) /* nohup */
        sigaction(SIGHUP, &stop, NULL);
    sigaction(SIGPIPE, &ignore, NULL);
    sigaction(SIGXFSZ, &ignore, NULL);
}

bool interrupt_requested(void)
{
    return requested != 0;
}

bool interrupt_stops(void *unused)
{
    (void)unused;
    return interrupt_requested();
}
