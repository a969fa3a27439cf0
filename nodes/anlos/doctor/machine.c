/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <inttypes.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/timex.h>
#include <unistd.h>

#include "nodes/anlos/doctor/doctor.h"
#include "nodes/anlos/feed.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/rundir.h"

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

static void look_at_health(struct findings *f, const struct census_node *n)
{
    switch (n->row->state) {
    case TABLE_FAULT:
        finding_add(f, FINDING_WRONG, "nodes", "%s has a fault: %s", n->name,
                    n->row->text);
        finding_todo(f, "'anlos node info %s' and its lines in the log say more",
                     n->name);
        break;
    case TABLE_DEGRADED:
        finding_add(f, FINDING_NOTE, "nodes", "%s: %s", n->name, n->row->text);
        break;
    case TABLE_STARTING:
        finding_add(f, FINDING_NOTE, "nodes", "%s is not ready yet: %s", n->name,
                    n->row->text);
        break;
    default:
        break;
    }
}

static void look_at_losses(struct findings *f, const struct census_node *n)
{
    const struct table_node *row = n->row;

    for (size_t i = 0; i < row->n_links; i++) {
        const struct table_link *l = &row->links[i];
        if (!l->gaps && !l->dropped)
            continue;
        finding_add(f, FINDING_NOTE, "losses",
                    "%s: of %s, %" PRIu64 " messages never arrived and %" PRIu64
                    " were pushed out of its queue, %" PRIu64 " came",
                    n->name, l->topic->name, l->gaps, l->dropped, l->messages);
        finding_todo(f, l->dropped
                            ? "it is slower than what comes: 'anlos top' shows its "
                              "share of a core; fewer previews, more cores"
                            : "the buffers above, or a process that was stopped "
                              "for long");
    }
    if (row->refused)
        finding_add(f, FINDING_NOTE, "losses",
                    "%s refused %" PRIu64 " messages: another version of anlos, or "
                    "something foreign in the run folder",
                    n->name, row->refused);
}

static void look_at_node(struct findings *f, const struct census_node *n)
{
    switch (n->life) {
    case CENSUS_DIED:
        finding_add(f, FINDING_NOTE, "nodes",
                    "%s was killed or crashed (process %ld): its sockets are left",
                    n->name, n->pid);
        finding_todo(f,
                     "they go when it starts again; its last lines in the log say why");
        break;
    case CENSUS_SILENT:
        finding_add(f, FINDING_WRONG, "nodes",
                    "%s (process %ld) lives, but its health does not come: it hangs, or "
                    "is busy for seconds",
                    n->name, n->pid);
        finding_todo(f, "'kill -9 %ld' when it stays so: the launcher starts it again",
                     n->pid);
        break;
    case CENSUS_ALIVE:
    case CENSUS_ELSEWHERE:
        look_at_health(f, n);
        look_at_losses(f, n);
        break;
    default:
        break;
    }
}

/* Nodes of the launch file that do not run while others do. */
static void look_for_missing(struct findings *f, const struct doctor *d,
                             const struct launchfile *l, const struct census *c)
{
    for (unsigned i = 0; i < l->n_nodes; i++) {
        const struct census_node *n = census_find(c, l->nodes[i]);
        if (!n || n->life >= CENSUS_ALIVE)
            continue;
        bool elsewhere = l->hosts.n && !doctor_runs(d, l, n->name);
        finding_add(f, FINDING_WRONG, "nodes",
                    elsewhere ? "%s, on another machine, is not heard, others are"
                              : "%s of the launch file does not run, others do",
                    n->name);
        finding_todo(f, elsewhere
                            ? "does it run there? cable, firewall, addresses of hosts"
                            : "the launcher's log says why");
    }
}

void doctor_system(const void *ctx, struct findings *f)
{
    const struct doctor *d = ctx;
    char run_dir[RUNDIR_SIZE];
    struct error why = {""};
    struct census *c = NULL;
    struct launchfile *l = doctor_load(d);
    const struct census_config cfg = {.run_dir = run_dir};

    if (rundir_name(run_dir, d->run_dir, &why) || rundir_check(run_dir, &why)) {
        launchfile_destroy(l);
        return; /* doctor_run_dir says so */
    }
    if (census_take(&c, &cfg, &why)) {
        finding_add(f, FINDING_WRONG, "nodes", "%s", why.text);
        launchfile_destroy(l);
        return;
    }
    size_t n = census_count_alive(c), before = f->n;
    for (size_t i = 0; i < c->n; i++)
        look_at_node(f, &c->nodes[i]);
    if (l && n)
        look_for_missing(f, d, l, c);
    if (!n)
        finding_add(f, FINDING_OK, "nodes", "nothing runs in %s", run_dir);
    else
        finding_add(f, FINDING_OK, "nodes", "%zu run in %s%s", n, run_dir,
                    f->n == before ? ", ready, nothing lost" : "");
    census_free(c);
    launchfile_destroy(l);
}

#define MEMORY_NOTE_MB  1000
#define MEMORY_WRONG_MB 200 /* what the nodes of the demo need together */

int doctor_read_word(const char *path, char *out, size_t size)
{
    FILE *f = fopen(path, "re");

    if (!f)
        return -errno;
    char *got = fgets(out, (int)size, f);
    fclose(f);
    if (!got)
        return -ENODATA;
    out[strcspn(out, " \t\n")] = '\0';
    return 0;
}

static void look_at_cores(struct findings *f)
{
    size_t n = usage_default_threads();
    double load[1] = {0.0};
    bool busy = getloadavg(load, 1) == 1 && load[0] > 1.5 * (double)n;

    finding_add(f, n < 2 || busy ? FINDING_NOTE : FINDING_OK, "cores",
                "%zu may be used, %.1f are busy", n, load[0]);
    if (busy)
        finding_todo(f, "other programs want more than there is: pings may come late; "
                        "'top' says which");
    else if (n < 2)
        finding_todo(f, "an image while the scan runs wants two");
}

static void look_at_memory(struct findings *f)
{
    char line[128];
    unsigned long kb = 0;
    FILE *m = fopen("/proc/meminfo", "re");

    while (m && fgets(line, sizeof line, m) &&
           sscanf(line, "MemAvailable: %lu kB", &kb) != 1)
        ;
    if (m)
        fclose(m);
    if (!kb)
        return;
    unsigned long mb = kb / 1024;
    finding_add(f,
                mb < MEMORY_WRONG_MB  ? FINDING_WRONG
                : mb < MEMORY_NOTE_MB ? FINDING_NOTE
                                      : FINDING_OK,
                "memory", "%lu MB are free", mb);
    if (mb < MEMORY_NOTE_MB)
        finding_todo(f, "end other programs, or choose a smaller volume in survey.yaml");
}

/* intel_pstate and amd-pstate call "powersave" what is as fast as is needed. */
static void look_at_governor(struct findings *f)
{
    static const char folder[] = "/sys/devices/system/cpu/cpu0/cpufreq/";
    char path[96], governor[32], driver[32] = "";

    snprintf(path, sizeof path, "%sscaling_governor", folder);
    if (doctor_read_word(path, governor, sizeof governor))
        return;
    snprintf(path, sizeof path, "%sscaling_driver", folder);
    if (doctor_read_word(path, driver, sizeof driver))
        driver[0] = '\0';
    bool slow = (!strcmp(governor, "powersave") && !strstr(driver, "pstate")) ||
                !strcmp(governor, "conservative");
    finding_add(f, slow ? FINDING_NOTE : FINDING_OK, "governor",
                "of the clock of core 0: %s%s%s", governor, driver[0] ? ", driver " : "",
                driver);
    if (slow)
        finding_todo(f, "for images as fast as this machine can: 'cpupower frequency-set "
                        "-g performance'");
}

void doctor_machine(const void *ctx, struct findings *f)
{
    (void)ctx;
    look_at_cores(f);
    look_at_memory(f);
    look_at_governor(f);
}

void doctor_clock(const void *ctx, struct findings *f)
{
    struct timex t = {.modes = 0};
    int state = adjtimex(&t);

    (void)ctx;
    if (state < 0) {
        finding_add(f, FINDING_NOTE, "clock", "whether it is synchronised is not known");
    } else if (state == TIME_ERROR || (t.status & STA_UNSYNC)) {
        finding_add(f, FINDING_NOTE, "clock", "is not synchronised with any other");
        finding_todo(f, "stamps of several machines can only be compared when it is: "
                        "'apt-get install chrony'");
    } else {
        finding_add(f, FINDING_OK, "clock", "synchronised, to %.1f ms",
                    1e-3 * (double)t.maxerror);
    }
}
