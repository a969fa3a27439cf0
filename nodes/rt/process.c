/* SPDX-License-Identifier: MIT */
#include "nodes/rt/process.h"

#include <dirent.h>
#include <errno.h>
#include <malloc.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "hal/realtime.h"

size_t processors_usable(void)
{
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set))
        return 1;
    int n = CPU_COUNT(&set);
    return n > 0 ? (size_t)n : 1;
}

#define KEPT_BYTES ((size_t)1 << 20) /* free at the heap's end, at least */

/* Left to itself glibc gives each thread a heap of its own, of which each keeps what its
 * own peak took: messages that waited while the process did not run.  A thread's cannot
 * even be made smaller where memory is locked (hal/realtime.h): glibc leaves it to
 * madvise(2), which refuses then.  That of the process can.
 *
 * But not for each message anew, whose pages cost ten times what it takes to fill them.
 * What may stay at the end is twice the largest block by itself that was freed, and no
 * setting that would not keep it from growing with larger messages. */
void heap_share(void)
{
    mallopt(M_ARENA_MAX, 1);
    void *volatile block = malloc(KEPT_BYTES / 2);
    free(block);
}

void heap_trim(void)
{
    malloc_trim(0);
}

/* -- priority ---------------------------------------------------------------------------
 */

#define RUN_US 1000000 /* without a pause */

static const struct {
    const char *node;
    int fifo; /* under the threads of hal/realtime.h; 0: never */
    int nice;
} table[] = {
    {"array", 15, -15}, {"stage", 14, -14}, {"can", 12, -12}, {"dsp", 10, -10},
    {"wall", 8, -8},    {"track", 8, -8},   {"scan", 8, -8},  {"recon", 0, -5},
    {"record", 0, 0},   {"view", 0, 5},     {"report", 0, 5},
};

/* As signal handlers need; set once. */
static volatile sig_atomic_t lost;

/* Whoever was started nicer than that stays so.  0, or a negative errno. */
static int be_nice(int nice, int *now)
{
    int before = getpriority(PRIO_PROCESS, 0);

    *now = nice > 0 && before > nice ? before : nice;
    return setpriority(PRIO_PROCESS, 0, *now) ? -errno : 0;
}

bool priority_wanted(const struct launchfile *l)
{
    return l->processes.realtime != REALTIME_OFF && launchfile_keeps_pace(l);
}

static int set_policy(int policy, int priority)
{
    struct sched_param param = {.sched_priority = priority};

    return sched_setscheduler(0, policy, &param) ? -errno : 0;
}

int priority_permitted(struct error *why)
{
    struct sched_param before = {0};
    int policy = sched_getscheduler(0);

    sched_getparam(0, &before);
    int fifo = set_policy(SCHED_FIFO, REALTIME_PRIORITY), lock = realtime_lock();
    if (!fifo)
        sched_setscheduler(0, policy, &before);
    if (!lock)
        realtime_unlock();
    if (!fifo && !lock)
        return 0;
    return error_say(
        why, -EPERM,
        "%s%s%s not permitted: lists may be late on a busy machine; raise the "
        "limits rtprio to %d and memlock to unlimited (launch/hardware.md)",
        fifo ? "real-time priority" : "", fifo && lock ? " and " : "",
        lock ? "locked memory" : "", REALTIME_PRIORITY);
}

/* The kernel sends it to the process, and who blocks it is ignored: the other threads
 * follow in priority_drop. */
static void give_up(int number)
{
    const struct sched_param usual = {.sched_priority = 0};

    (void)number;
    sched_setscheduler(0, SCHED_OTHER, &usual);
    lost = 1;
}

static void limit_run(void)
{
    const struct rlimit limit = {RUN_US, RLIM_INFINITY};
    struct sigaction action = {.sa_handler = give_up, .sa_flags = SA_RESTART};

    sigemptyset(&action.sa_mask);
    sigaction(SIGXCPU, &action, NULL);
    setrlimit(RLIMIT_RTTIME, &limit);
}

int priority_take(const struct launchfile *l, const char *node,
                  char text[PRIORITY_TEXT_SIZE], struct error *why)
{
    size_t i = 0;
    bool locked = false;
    int nice = 0;

    snprintf(text, PRIORITY_TEXT_SIZE, "usual");
    while (i < sizeof table / sizeof *table && strcmp(table[i].node, node))
        i++;
    if (!priority_wanted(l) || i == sizeof table / sizeof *table)
        return 0;
    if (l->processes.realtime == REALTIME_REQUIRED) {
        int err = priority_permitted(why);
        if (err)
            return err;
    }
    if (table[i].nice < 0)
        locked = !realtime_lock();
    limit_run();
    if (table[i].fifo && !set_policy(SCHED_FIFO, table[i].fifo))
        snprintf(text, PRIORITY_TEXT_SIZE, "fifo %d", table[i].fifo);
    else if (table[i].nice && !be_nice(table[i].nice, &nice))
        snprintf(text, PRIORITY_TEXT_SIZE, "nice %d", nice);
    if (locked)
        strcat(text, ", locked");
    return 0;
}

bool priority_is_lost(void)
{
    return lost;
}

void priority_drop(void)
{
    const struct sched_param usual = {.sched_priority = 0};
    DIR *tasks = opendir("/proc/self/task");
    struct dirent *task;

    while (tasks && (task = readdir(tasks)))
        if (task->d_name[0] != '.')
            sched_setscheduler((pid_t)atoi(task->d_name), SCHED_OTHER, &usual);
    if (tasks)
        closedir(tasks);
}
