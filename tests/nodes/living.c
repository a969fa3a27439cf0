/* SPDX-License-Identifier: MIT */
#include "tests/nodes/living.h"

#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "hal/clock.h"
#include "msgs/bus.h"

static volatile sig_atomic_t stop;

static void on_signal(int number)
{
    (void)number;
    stop = 1;
}

static void live(const char *run_dir, const char *node, enum living_kind kind,
                 const Anlos__Health *health, int ready)
{
    const struct bus_config cfg = {
        .node = node, .run_dir = run_dir, .epoch_ns = clock_now_ns(clock_system())};
    Anlos__Health h = *health;
    struct bus *bus = NULL;

    prctl(PR_SET_PDEATHSIG, SIGKILL);
    signal(SIGTERM, on_signal);
    if (bus_create(&bus, &cfg, NULL))
        _exit(1);
    h.node = (char *)node;
    h.pid = (uint32_t)getpid();
    if (write(ready, "x", 1) != 1)
        _exit(1);
    while (!stop) {
        int64_t now_ns = clock_now_ns(clock_system());
        h.uptime_s = 1e-9 * (double)(now_ns - cfg.epoch_ns);
        if (kind == LIVING &&
            bus_publish_message(bus, topic_health(), 0, now_ns, &h.base))
            _exit(1);
        poll(NULL, 0, 50); /* the pace of its health */
    }
    bus_destroy(bus);
    _exit(0);
}

pid_t living_start(const char *run_dir, const char *node, enum living_kind kind,
                   const Anlos__Health *health)
{
    int fds[2];
    char x;

    if (pipe(fds))
        abort();
    pid_t pid = fork();
    if (pid < 0)
        abort();
    if (!pid)
        live(run_dir, node, kind, health, fds[1]);
    close(fds[1]);
    if (read(fds[0], &x, 1) != 1)
        abort();
    close(fds[0]);
    return pid;
}

void living_end(pid_t pid, int signal)
{
    kill(pid, signal);
    if (waitpid(pid, NULL, 0) != pid)
        abort();
}
