/* SPDX-License-Identifier: MIT */
#include "nodes/launcher/supervisor.h"

#include <dirent.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

_Static_assert(PROCESS_GROUP_MAX + 1 <= DEVICE_MAX_COUNTS, "no room");

/* schedstat: time run, time waited for a processor, timeslices; stat: PID (NAME) STATE.
 */
static void read_task(const char *tasks, const char *task, struct supervisor_process *out)
{
    char path[352], line[128];
    int64_t ran_ns = 0, waited_ns = 0;

    snprintf(path, sizeof path, "%s/%s/schedstat", tasks, task);
    FILE *f = fopen(path, "re");
    if (f && fscanf(f, "%" SCNd64 " %" SCNd64, &ran_ns, &waited_ns) == 2) {
        out->ran_ns += ran_ns;
        out->waited_ns += waited_ns;
    }
    if (f)
        fclose(f);
    snprintf(path, sizeof path, "%s/%s/stat", tasks, task);
    f = fopen(path, "re");
    if (f && fgets(line, sizeof line, f)) {
        const char *state = strrchr(line, ')');
        out->runnable |= state && !strncmp(state, ") R", 3);
    }
    if (f)
        fclose(f);
}

static bool read_traced(pid_t pid)
{
    char path[64], line[128];
    long tracer = 0;

    snprintf(path, sizeof path, "/proc/%ld/status", (long)pid);
    FILE *f = fopen(path, "re");
    while (f && fgets(line, sizeof line, f))
        if (sscanf(line, "TracerPid: %ld", &tracer) == 1)
            break;
    if (f)
        fclose(f);
    return tracer > 0;
}

static void look_in_proc(pid_t pid, struct supervisor_process *out)
{
    char tasks[64];
    const struct dirent *task;

    *out = (struct supervisor_process){.traced = read_traced(pid)};
    snprintf(tasks, sizeof tasks, "/proc/%ld/task", (long)pid);
    DIR *d = opendir(tasks);
    while (d && (task = readdir(d)))
        if (task->d_name[0] != '.')
            read_task(tasks, task->d_name, out);
    if (d)
        closedir(d);
}

/* What was counted of an earlier process is forgotten. */
static struct supervised *supervised(struct supervisor *s, const struct process_group *c,
                                     unsigned i)
{
    const struct child *child = &c->children[i];
    struct supervised *n = &s->list[i];
    bool reads_bag = !strcmp(child->name, "play") || !strcmp(child->name, "view");

    if (n->started_ns == child->started_ns)
        return n;
    *n = (struct supervised){.started_ns = child->started_ns,
                             .limit_ns = reads_bag ? SUPERVISOR_BAG_NS
                                                   : SUPERVISOR_START_NS,
                             .starts = n->starts + 1,
                             .hangs = n->hangs};
    snprintf(n->name, sizeof n->name, "%s hung", child->name);
    return n;
}

static void forget_silence(struct supervised *n)
{
    n->silent_ns = n->waited_ns = n->waits_ns = 0;
    n->looked = n->told = false;
}

/* One of a program that counts no turns is taken for a turn. */
static void hear(struct supervised *n, const Anlos__Health *h, int64_t alive_ns)
{
    double limit_s = fmin(fmax(h->turn_limit_s, 0.0), 1e-9 * SUPERVISOR_BAG_NS);
    int64_t limit_ns = (int64_t)(1e9 * limit_s);

    if (n->spoken && h->turns && h->turns == n->turns)
        return;
    n->spoken = true;
    n->turns = h->turns;
    n->limit_ns = limit_ns > alive_ns ? limit_ns : alive_ns;
    forget_silence(n);
}

void supervisor_heard(struct supervisor *s, const struct process_group *c,
                      const Anlos__Health *h, int64_t epoch_ns)
{
    for (unsigned i = 0; i < c->n; i++)
        if (!strcmp(c->children[i].name, h->node) &&
            epoch_ns >= c->children[i].started_ns)
            hear(supervised(s, c, i), h, s->alive_ns);
}

/* Only whoever is overdue is looked at.  The kernel tells of a wait when it is over,
 * which may be seconds later: until then, what could run and did not has waited. */
static void look_at(struct supervisor *s, struct supervised *n, pid_t pid,
                    int64_t step_ns)
{
    struct supervisor_process now;

    if (n->silent_ns < s->alive_ns / 2)
        return;
    (s->look ? s->look : look_in_proc)(pid, &now);
    if (now.traced) {
        forget_silence(n);
        return;
    }
    if (n->looked) {
        if (now.waited_ns > n->last.waited_ns) /* less: a thread has ended */
            n->waited_ns += now.waited_ns - n->last.waited_ns;
        if (n->waited_ns > n->silent_ns) /* several waited at once */
            n->waited_ns = n->silent_ns;
        bool stood = now.runnable && now.ran_ns == n->last.ran_ns;
        n->waits_ns = stood ? n->waits_ns + step_ns : 0;
    }
    n->last = now;
    n->looked = true;
}

/* Of its silence, for a processor. */
static int64_t waited_ns(const struct supervised *n)
{
    int64_t sum_ns = n->waited_ns + n->waits_ns;

    return sum_ns < n->silent_ns ? sum_ns : n->silent_ns;
}

/* Time that it waits for a processor is none in which it hangs. */
static bool is_hung(const struct supervised *n)
{
    int64_t forgiven_ns = SUPERVISOR_STARVED * n->limit_ns;

    if (waited_ns(n) < forgiven_ns)
        forgiven_ns = waited_ns(n);
    return n->silent_ns - forgiven_ns > n->limit_ns;
}

int64_t supervisor_tick(struct supervisor *s, const struct process_group *c,
                        int64_t now_ns, int64_t hung_ns[PROCESS_GROUP_MAX])
{
    int64_t step_ns = s->tick_ns ? now_ns - s->tick_ns : 0;

    memset(hung_ns, 0, PROCESS_GROUP_MAX * sizeof *hung_ns);
    /* Nobody waits that long for the launcher: it was late itself. */
    if (step_ns > 2 * SUPERVISOR_TICK_NS)
        step_ns = SUPERVISOR_TICK_NS;
    s->tick_ns = now_ns;
    for (unsigned i = 0; i < c->n; i++) {
        struct supervised *n = supervised(s, c, i);
        if (!s->alive_ns || c->children[i].phase != CHILD_RUNNING)
            continue;
        n->silent_ns += step_ns;
        look_at(s, n, c->children[i].pid, step_ns);
        if (!is_hung(n))
            continue;
        hung_ns[i] = n->silent_ns;
        n->hangs++;
        forget_silence(n);
    }
    return s->alive_ns ? now_ns + SUPERVISOR_TICK_NS : INT64_MAX;
}

bool supervisor_starves(struct supervisor *s, unsigned i, struct supervisor_starved *out)
{
    struct supervised *n = &s->list[i];

    if (!s->alive_ns || n->told || n->silent_ns <= n->limit_ns)
        return false;
    n->told = true;
    *out = (struct supervisor_starved){
        .silent_s = 1e-9 * (double)n->silent_ns,
        .waited_s = 1e-9 * (double)waited_ns(n),
        .killed_s = 1e-9 * (double)((1 + SUPERVISOR_STARVED) * n->limit_ns)};
    return true;
}

size_t supervisor_counts(const struct supervisor *s, struct device_count *out)
{
    size_t n = 1;

    out[0] = (struct device_count){"restarts", 0};
    for (unsigned i = 0; i < PROCESS_GROUP_MAX; i++) {
        const struct supervised *node = &s->list[i];
        out[0].value += node->starts > 1 ? node->starts - 1 : 0;
        if (node->hangs)
            out[n++] = (struct device_count){node->name, node->hangs};
    }
    return n;
}
