/* SPDX-License-Identifier: MIT */
#include "nodes/launcher/launcher.h"

#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include "hal/clock.h"
#include "msgs/bus.h"
#include "nodes/launcher/host_peers.h"
#include "nodes/launcher/process_group.h"
#include "nodes/launcher/screen.h"
#include "nodes/launcher/service.h"
#include "nodes/launcher/supervisor.h"
#include "nodes/rt/health.h"
#include "nodes/rt/log_history.h"
#include "nodes/rt/log_topic.h"
#include "nodes/rt/node.h"
#include "nodes/rt/process.h"

/* The signals that end the launcher, and those of its children, to be read where it
 * waits. */

struct signals {
    int fd; /* poll(2) finds it readable when one has come; -1: closed */
    sigset_t before;
};

/* What the launcher itself says on the bus: its health, once a second, and its lines
 * about the nodes, so that a recording has them too. */

struct voice { /* zeroed: mute */
    struct bus *bus;
    struct log_topic log;
    int64_t epoch_ns, due_ns;
    unsigned n_running, n_lost; /* as said last */
};

struct launcher {
    const struct launcher_config *cfg;
    const struct clock_source *clock;
    struct process_group process_group;
    struct signals signals;
    struct bus *bus;
    struct progress progress;
    struct host_peering host_peering; /* with the other hosts */
    struct screen screen;
    struct voice voice;
    struct log_history history;
    struct service service;
    struct supervisor supervisor;
    bool stopping, stopping_aside, killed;
    bool spared; /* the others are killed, who writes the results is not */
    bool reported;
    bool incomplete; /* the recording, or what a node was to do at its end */
    int64_t kill_ns;
    int64_t asked_ns; /* to stop, by a signal; 0: never */
    int exit_code;    /* once stopping */
};

/* As nohup leaves it: a signal that is blocked comes even if it is to be ignored. */
static bool hangup_is_ignored(void)
{
    struct sigaction now;

    return !sigaction(SIGHUP, NULL, &now) && now.sa_handler == SIG_IGN;
}

/* SIGINT, SIGTERM, SIGHUP (but under nohup) and SIGCHLD do not interrupt any more.  0 or
 * a negative errno. */
static int signals_open(struct signals *s)
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

/* The number of one that has come; 0: none has. */
static int signals_next(const struct signals *s)
{
    struct signalfd_siginfo info;

    return read(s->fd, &info, sizeof info) == (ssize_t)sizeof info ? (int)info.ssi_signo
                                                                   : 0;
}

/* What follows can be stopped as any program; signals that were for the nodes are not for
 * it. */
static void signals_close(struct signals *s)
{
    if (s->fd < 0)
        return;
    while (signals_next(s))
        ;
    close(s->fd);
    sigprocmask(SIG_SETMASK, &s->before, NULL);
}

#define PERIOD_NS 1000000000LL

/* bus: of node "launcher"; NULL: there is none. */
static void voice_open(struct voice *v, struct bus *bus, int64_t epoch_ns)
{
    *v =
        (struct voice){.bus = bus,
                       .log = {.bus = bus, .room = LOG_TOPIC_BURST, .start_ns = epoch_ns},
                       .epoch_ns = epoch_ns};
}

/* Before the bus is destroyed. */
static void voice_close(struct voice *v)
{
    if (v->bus)
        log_topic_flush(&v->log);
    v->bus = NULL;
}

static void voice_log(struct voice *v, const struct log_line *line)
{
    if (v->bus && line->level >= LOG_LEVEL_INFO)
        log_topic_send(&v->log, line);
}

/* When it is time to, and at once when more or fewer run: ready while all nodes of the
 * process group run or have ended by themselves, else degraded. */
static void voice_health(struct voice *v, int64_t now_ns,
                         const struct process_group *process_group,
                         const struct supervisor *supervisor)
{
    const unsigned n_running = process_group_count(process_group, CHILD_RUNNING),
                   n_nodes = process_group->n,
                   n_ended = process_group_count(process_group, CHILD_ENDED),
                   n_lost = process_group_lost(process_group);
    const struct log_line tick = {
        .stamp_ns = now_ns, .level = LOG_LEVEL_INFO, .node = "launcher"};
    struct health health;
    char name[] = "launcher", text[64], ended[32] = "";
    const struct health_fault lost = {NODE_FAULT_NODES_LOST, n_lost, n_nodes};
    struct health_faults faults;
    struct device_count counts[DEVICE_MAX_COUNTS];

    if (!v->bus ||
        (now_ns < v->due_ns && n_running == v->n_running && n_lost == v->n_lost))
        return;
    v->n_running = n_running;
    v->n_lost = n_lost;
    v->due_ns = now_ns + PERIOD_NS;
    voice_log(v, &tick);
    health_take(&health, v->bus, name, 0);
    health.message.state = n_running + n_ended == n_nodes
                               ? ANLOS__HEALTH__STATE__READY
                               : ANLOS__HEALTH__STATE__DEGRADED;
    if (n_ended)
        snprintf(ended, sizeof ended, ", %u ended", n_ended);
    snprintf(text, sizeof text, "%u of %u nodes run%s", n_running, n_nodes, ended);
    health.message.text = text;
    health_device(&health, counts, supervisor_counts(supervisor, counts));
    health_faults(&health.message, &faults, &lost, n_lost > 0);
    health.message.uptime_s = 1e-9 * (double)(now_ns - v->epoch_ns);
    bus_publish_message(v->bus, topic_health(), 0, now_ns, &health.message.base);
}

#define KILL_AFTER_NS 3000000000LL
/* A recorder may bring much to a slow disk, a report draws on a busy machine. */
#define KILL_ASIDE_NS 30000000000LL
#define READY_NS                                                                         \
    1000000000LL /* for a recorder to have subscribed before the rest starts */

/* Whom not to outlive, since when there have been results of this run, and the clock: in
 * the environment of the nodes.  0 or a negative errno. */
static int launcher_tell_nodes(void)
{
    char parent[24], start[24];
    int64_t now_ns = clock_now_ns(clock_system()) + clock_wall_ahead_ns();

    snprintf(parent, sizeof parent, "%ld", (long)getpid());
    snprintf(start, sizeof start, "%lld", (long long)now_ns);
    if (setenv("ANLOS_LAUNCHER_PID", parent, 1) || setenv("ANLOS_LAUNCH_NS", start, 1))
        return -errno;
    return clock_share();
}

static void launcher_print(void *ctx, const struct child *c, const char *line)
{
    struct launcher *l = ctx;

    screen_output(&l->screen, c->name, line, clock_now_ns(l->clock));
}

/* A line of the launcher itself, or about a node; and one that a node printed. */
static void launcher_say(struct launcher *l, const char *node, enum log_level level,
                         const char *text)
{
    struct log_line line = {.stamp_ns = clock_now_ns(l->clock), .level = level};

    snprintf(line.node, sizeof line.node, "%s", node);
    snprintf(line.text, sizeof line.text, "%s", text);
    log_text_clean(line.text);
    if (level >= l->cfg->arguments->log_level)
        screen_log(&l->screen, &line);
    voice_log(&l->voice, &line);
    Anlos__Log m = ANLOS__LOG__INIT;
    m.stamp_ns = line.stamp_ns;
    m.level = (Anlos__Log__Level)level;
    m.node = line.node;
    m.text = line.text;
    if (level >= LOG_LEVEL_INFO)
        log_history_add(&l->history, &m);
}

/* Asks all to end.  The first reason decides the exit code. */
static void launcher_stop(struct launcher *l, int exit_code)
{
    if (l->stopping)
        return;
    if (progress_end(&l->progress))
        screen_progress(&l->screen, l->progress.text);
    screen_end_progress(&l->screen);
    service_ends(&l->service);
    l->stopping = true;
    l->exit_code = exit_code;
    l->kill_ns = clock_now_ns(l->clock) + KILL_AFTER_NS;
    host_peering_end(&l->host_peering, exit_code,
                     l->reported ? l->cfg->launch->report.folder : NULL,
                     clock_now_ns(l->clock));
    process_group_signal(&l->process_group, false, SIGTERM);
}

/* What is aside has seen everything when the others have ended. */
static void launcher_stop_aside(struct launcher *l, int64_t now_ns)
{
    if (!l->stopping || l->stopping_aside || process_group_runs(&l->process_group, false))
        return;
    l->stopping_aside = true;
    if (l->kill_ns) {
        l->killed = false;
        l->kill_ns = now_ns + KILL_ASIDE_NS;
    }
    process_group_signal(&l->process_group, true, SIGTERM);
}

static void start_child(struct launcher *l, struct child *c)
{
    struct error why = {""};

    child_close(c, launcher_print, l);
    if (!child_start(c, clock_now_ns(l->clock), &why))
        return;
    launcher_say(l, c->name, LOG_LEVEL_ERROR, why.text);
    c->phase = CHILD_FAILED;
    if (!c->aside)
        launcher_stop(l, EXIT_BAD_INPUT);
}

static void describe_crash(struct launcher *l, const struct child *c, int status)
{
    char exit_text[64], text[160];

    child_describe_exit(status, exit_text, sizeof exit_text);
    if (c->phase == CHILD_FAILED)
        snprintf(text, sizeof text, "ended with %s %d times; it is given up", exit_text,
                 CHILD_MAX_CRASHES + 1);
    else
        snprintf(text, sizeof text, "ended with %s; starts again in %.1f s", exit_text,
                 1e-9 * (double)(c->restart_ns - clock_now_ns(l->clock)));
    launcher_say(l, c->name,
                 c->phase == CHILD_FAILED ? LOG_LEVEL_ERROR : LOG_LEVEL_WARNING, text);
}

/* What is aside comes first, so that it misses nothing of the others. */
static void launcher_start_all(struct launcher *l)
{
    for (unsigned i = 0; i < l->process_group.n && !l->stopping; i++)
        if (l->process_group.children[i].aside)
            start_child(l, &l->process_group.children[i]);
    process_group_start_rest(&l->process_group,
                             process_group_has_aside(&l->process_group, NULL)
                                 ? clock_now_ns(l->clock) + READY_NS
                                 : 0);
}

/* A recorder that refuses what it is to do, before there is anything to be lost? */
static bool refuses(const struct launcher *l, int status)
{
    return WIFEXITED(status) && WEXITSTATUS(status) == EXIT_BAD_INPUT &&
           !process_group_runs(&l->process_group, false);
}

static void goes_on_without(struct launcher *l, struct child *c, int status)
{
    char exit_text[64], text[160];

    c->phase = CHILD_FAILED;
    child_describe_exit(status, exit_text, sizeof exit_text);
    snprintf(text, sizeof text, "ended with %s; the others go on without it", exit_text);
    launcher_say(l, c->name, LOG_LEVEL_ERROR, text);
}

/* One that is aside is started again only when it crashed: what made it give up, such as
 * a full disk, is still there. */
static void exited_aside(struct launcher *l, struct child *c, int status)
{
    if (refuses(l, status)) {
        launcher_stop(l, EXIT_BAD_INPUT);
        return;
    }
    process_group_start_rest(&l->process_group, 0);
    if (c->phase == CHILD_ENDED)
        return;
    if (c->phase == CHILD_PAUSING && !WIFEXITED(status)) {
        describe_crash(l, c, status);
        if (process_group_runs(&l->process_group, false)) {
            l->incomplete = true;
            launcher_say(l, c->name, LOG_LEVEL_ERROR,
                         "the recording is not whole: what comes until then is missing, "
                         "and a bag that it wrote has no end (see anlos bag recover)");
        }
        return;
    }
    goes_on_without(l, c, status);
}

/* A page that ran and crashed: a sensor does not end with it.  What it refuses when it
 * is started is of the launch file, as of any node. */
static bool is_page_that_ran(const struct child *c)
{
    return !strcmp(c->name, "view") && c->crashes;
}

/* What it failed at itself while it was stopping; not that it was stopped.  Whoever is
 * killed with the results, and by nobody who asked twice, has not written them. */
static bool fails_at_end(const struct launcher *l, int status, bool reports)
{
    bool ours = reports ? l->killed && !l->kill_ns : l->killed || l->spared;

    if (WIFEXITED(status))
        return WEXITSTATUS(status) != EXIT_WORKED;
    if (WTERMSIG(status) == SIGINT) /* Ctrl-C came before it was in a group of its own */
        return false;
    return WTERMSIG(status) != SIGTERM && !(WTERMSIG(status) == SIGKILL && ours);
}

static bool writes_results(const struct child *c)
{
    return !strcmp(c->name, "report");
}

static void exited_stopping(struct launcher *l, const struct child *c, int status)
{
    bool reports = writes_results(c);
    char exit_text[64], text[PATH_MAX + 160];

    if (!status)
        l->reported |= reports && l->cfg->launch->scan.fixed;
    if (!fails_at_end(l, status, reports))
        return;
    l->incomplete = true;
    child_describe_exit(status, exit_text, sizeof exit_text);
    snprintf(text, sizeof text, "ended with %s while stopping%s%s", exit_text,
             reports    ? ": results are missing in "
             : c->aside ? ": the recording is not whole"
                        : "",
             reports ? l->cfg->launch->report.folder : "");
    launcher_say(l, c->name, LOG_LEVEL_ERROR, text);
}

/* Not a crash: it has seen that the results cannot be written, and what is in the way,
 * such as a full disk, is still there. */
static void results_are_lost(struct launcher *l, struct child *c, int status)
{
    char exit_text[64], text[PATH_MAX + 160];

    c->phase = CHILD_FAILED;
    child_describe_exit(status, exit_text, sizeof exit_text);
    snprintf(text, sizeof text, "ended with %s: results are missing in %s", exit_text,
             l->cfg->launch->report.folder);
    launcher_say(l, c->name, LOG_LEVEL_ERROR, text);
    launcher_stop(l, EXIT_FAILED);
}

static void exited(struct launcher *l, struct child *c, int status)
{
    enum child_phase phase = child_exited(c, status, clock_now_ns(l->clock));

    child_close(c, launcher_print, l);
    if (c->aside && status)
        l->incomplete |= l->stopping || WIFEXITED(status) || phase == CHILD_FAILED;
    if (l->stopping) {
        exited_stopping(l, c, status);
        return;
    }
    if (c->aside) {
        exited_aside(l, c, status);
        return;
    }
    if ((phase == CHILD_BAD_CONFIG || phase == CHILD_FAILED) && is_page_that_ran(c)) {
        l->incomplete = true;
        goes_on_without(l, c, status);
        return;
    }
    switch (phase) {
    case CHILD_ENDED:
        if (!writes_results(c)) {
            launcher_say(l, c->name, LOG_LEVEL_INFO,
                         "has ended; it is not started again");
            break;
        }
        l->reported = true; /* before stop: the other hosts are told */
        launcher_stop(l, l->progress.state == ANLOS__SCAN_STATUS__STATE__FAILED
                             ? EXIT_FAILED
                             : EXIT_WORKED);
        break;
    case CHILD_BAD_CONFIG:
        launcher_stop(l, EXIT_BAD_INPUT);
        break;
    case CHILD_FAILED:
        describe_crash(l, c, status);
        launcher_stop(l, EXIT_FAILED);
        break;
    default:
        if (writes_results(c) && WIFEXITED(status))
            results_are_lost(l, c, status);
        else
            describe_crash(l, c, status);
    }
}

/* Takes note of those that have ended. */
static void launcher_reap(struct launcher *l)
{
    for (unsigned i = 0; i < l->process_group.n; i++) {
        int status;
        struct child *c = &l->process_group.children[i];
        if (c->pid > 0 && waitpid(c->pid, &status, WNOHANG) == c->pid)
            exited(l, c, status);
    }
}

/* Says who starves, and kills those that hang; they are started again as others that
 * crash.  When to look again.
 *
 * SIGKILL: one that is stopped takes no other. */
static int64_t launcher_supervise(struct launcher *l, int64_t now_ns)
{
    int64_t hung_ns[PROCESS_GROUP_MAX];
    struct supervisor_starved starved;
    char text[192];

    if (l->stopping)
        return INT64_MAX;
    int64_t next = supervisor_tick(&l->supervisor, &l->process_group, now_ns, hung_ns);
    for (unsigned i = 0; i < l->process_group.n; i++) {
        if (supervisor_starves(&l->supervisor, i, &starved)) {
            snprintf(text, sizeof text,
                     "the machine is too busy for it: silent for %.1f s, %.1f of them it "
                     "waited for a processor; killed after %.0f s",
                     starved.silent_s, starved.waited_s, starved.killed_s);
            launcher_say(l, l->process_group.children[i].name, LOG_LEVEL_WARNING, text);
        }
        if (!hung_ns[i])
            continue;
        snprintf(text, sizeof text, "hangs: its loop has not turned for %.1f s; killed",
                 1e-9 * (double)hung_ns[i]);
        launcher_say(l, l->process_group.children[i].name, LOG_LEVEL_ERROR, text);
        child_signal(&l->process_group.children[i], SIGKILL);
    }
    return next;
}

/* Starts those whose pause is over, and kills those that do not end by themselves.  When
 * the next one is due; INT64_MAX: none is. */
static int64_t launcher_restart(struct launcher *l, int64_t now_ns)
{
    int64_t next = INT64_MAX;

    for (unsigned i = 0; i < l->process_group.n && !l->stopping; i++) {
        struct child *c = &l->process_group.children[i];
        if (c->phase != CHILD_PAUSING)
            continue;
        if (c->restart_ns <= now_ns)
            start_child(l, c);
        else if (c->restart_ns < next)
            next = c->restart_ns;
    }
    return next;
}

static int64_t launcher_kill(struct launcher *l, int64_t now_ns)
{
    if (!l->stopping || l->killed)
        return INT64_MAX;
    if (now_ns < l->kill_ns)
        return l->kill_ns;
    bool spare = l->kill_ns && !l->spared && !l->stopping_aside, writes = false;
    for (unsigned i = 0; i < l->process_group.n; i++) {
        struct child *c = &l->process_group.children[i];
        if (c->aside && !l->stopping_aside && l->kill_ns)
            continue;
        if (spare && c->pid > 0 && writes_results(c)) {
            writes = true;
            continue;
        }
        if (c->pid > 0)
            launcher_say(l, c->name, LOG_LEVEL_WARNING,
                         l->kill_ns ? "does not stop; killed"
                                    : "still runs, and you asked again; killed");
        child_signal(c, SIGKILL);
    }
    l->spared = writes;
    l->killed = !writes;
    if (!writes)
        return INT64_MAX;
    l->kill_ns += KILL_ASIDE_NS - KILL_AFTER_NS;
    return l->kill_ns;
}

/* timeout(1) and others send the same signal twice at once. */
#define AGAIN_NS 500000000LL

static void asked_to_stop(struct launcher *l, int signal_number)
{
    int64_t now = clock_now_ns(l->clock);

    if (!l->stopping) {
        l->asked_ns = now;
        launcher_stop(l, 128 + signal_number);
    } else if (!l->asked_ns || now - l->asked_ns >= AGAIN_NS) {
        l->kill_ns = 0; /* asked twice: no more patience */
    }
}

static void read_signals(struct launcher *l)
{
    int number;

    while ((number = signals_next(&l->signals)))
        if (number != SIGCHLD)
            asked_to_stop(l, number);
    launcher_reap(l);
    if (!process_group_goes_on(&l->process_group))
        launcher_stop(l, EXIT_WORKED);
}

static void show_progress(struct launcher *l, const ProtobufCMessage *status)
{
    if (progress_status(&l->progress, (const Anlos__ScanStatus *)status))
        screen_progress(&l->screen, l->progress.text);
}

static void hear_health(struct launcher *l, const Anlos__Health *health, int64_t epoch_ns)
{
    progress_health(&l->progress, health);
    supervisor_heard(&l->supervisor, &l->process_group, health, epoch_ns);
    service_heard(&l->service, &l->process_group, health->node, clock_now_ns(l->clock));
    if (health->state == ANLOS__HEALTH__STATE__READY &&
        process_group_has_aside(&l->process_group, health->node))
        process_group_start_rest(&l->process_group, 0);
}

static void read_bus(struct launcher *l)
{
    struct bus_message in;

    while (!bus_receive(l->bus, &in, 0)) {
        ProtobufCMessage *m = bus_message_unpack(&in);
        if (m && in.topic == topic_scan_status() && !l->stopping)
            show_progress(l, m);
        else if (m && in.topic == topic_health())
            hear_health(l, (const Anlos__Health *)m, in.envelope.epoch_ns);
        else if (m && in.topic == topic_log())
            log_history_add(&l->history, (const Anlos__Log *)m);
        else if (m && in.topic == topic_host())
            host_peering_hear(&l->host_peering, m, &in.envelope, clock_now_ns(l->clock));
        if (m)
            protobuf_c_message_free_unpacked(m, NULL);
        bus_message_free(&in);
    }
}

static void judge_host_peers(struct launcher *l, int64_t now_ns)
{
    char text[HOST_PEERS_TEXT_SIZE];
    enum host_peers_verdict verdict;

    while (!l->stopping &&
           (verdict = host_peers_judge(&l->host_peering.host_peers, now_ns, text)) !=
               HOST_PEERS_GO_ON) {
        launcher_say(l, "launcher",
                     verdict == HOST_PEERS_FAILED    ? LOG_LEVEL_ERROR
                     : verdict == HOST_PEERS_WARNING ? LOG_LEVEL_WARNING
                                                     : LOG_LEVEL_INFO,
                     text);
        if (verdict == HOST_PEERS_DONE)
            launcher_stop(l, EXIT_WORKED);
        else if (verdict == HOST_PEERS_FAILED)
            launcher_stop(l, EXIT_FAILED);
    }
}

/* May it end?  When the nodes have, and the other hosts know, or a person is impatient.
 */
static bool has_ended(const struct launcher *l)
{
    return l->stopping && !process_group_runs(&l->process_group, true) &&
           (!l->kill_ns ||
            host_peering_may_leave(&l->host_peering, clock_now_ns(l->clock)));
}

static void sooner(int64_t *next_ns, int64_t due_ns)
{
    if (due_ns < *next_ns)
        *next_ns = due_ns;
}

/* What time brings: restarts, and an end for those that do not end by themselves.
 * Returns how long nothing will, in ms. */
static int act_on_time(struct launcher *l)
{
    int64_t now = clock_now_ns(l->clock);
    int64_t next = now + 1000000000LL;

    judge_host_peers(l, now);
    sooner(&next, host_peering_tell(&l->host_peering, now));
    sooner(&next, launcher_supervise(l, now));
    voice_health(&l->voice, now, &l->process_group, &l->supervisor);
    launcher_stop_aside(l, now);
    sooner(&next, service_tick(&l->service, &l->process_group, now));
    if (l->voice.bus)
        sooner(&next, l->voice.due_ns);
    sooner(&next, log_history_tick(&l->history, now));
    sooner(&next, launcher_restart(l, now));
    sooner(&next, launcher_kill(l, now));
    return next > now ? (int)((next - now) / 1000000 + 1) : 0;
}

static void wait_and_read(struct launcher *l, int timeout_ms)
{
    struct pollfd fds[2 + 2 * PROCESS_GROUP_MAX];
    nfds_t n = 0;

    fds[n++] = (struct pollfd){.fd = l->signals.fd, .events = POLLIN};
    fds[n++] = (struct pollfd){.fd = l->bus ? bus_fd(l->bus) : -1, .events = POLLIN};
    for (unsigned i = 0; i < l->process_group.n; i++)
        for (int k = 0; k < 2; k++)
            fds[n++] = (struct pollfd){.fd = l->process_group.children[i].pipes[k].fd,
                                       .events = POLLIN};
    if (poll(fds, n, timeout_ms) < 0)
        return;
    for (unsigned i = 0; i < l->process_group.n; i++)
        for (int k = 0; k < 2; k++)
            if (fds[2 + 2 * i + (unsigned)k].revents)
                child_read(&l->process_group.children[i],
                           &l->process_group.children[i].pipes[k], launcher_print, l);
    if (l->bus && fds[1].revents)
        read_bus(l);
    if (fds[0].revents)
        read_signals(l);
}

/* Which ports a firewall has to let through. */
static void say_endpoint(struct launcher *l, const struct host *h)
{
    char text[200 + HOSTS_KEYS_SIZE];

    if (h->address[0])
        snprintf(text, sizeof text, "this is host %s: %s, ports %u to %u, %s%s", h->name,
                 h->address, h->port, h->port + hosts_n_ports() - 1,
                 h->keys[0] ? "encrypted with the keys in " : "of this machine only",
                 h->keys);
    else
        snprintf(text, sizeof text, "this is host %s: %s", h->name, h->folder);
    launcher_say(l, "launcher", LOG_LEVEL_INFO, text);
}

/* On one machine it is only to show the progress: the nodes do their work without. */
static void open_bus(struct launcher *l)
{
    const struct hosts *hosts = &l->cfg->launch->hosts;
    const struct bus_config cfg = {
        .node = "launcher",
        .run_dir = l->cfg->run_dir,
        .epoch_ns = clock_now_ns(l->clock),
        .world = l->cfg->arguments->replay || launchfile_has_node(l->cfg->launch, "play")
                     ? BUS_REPLAY
                     : BUS_LIVE};
    struct error why = {""};
    int err = bus_create(&l->bus, &cfg, &why);

    voice_open(&l->voice, l->bus, cfg.epoch_ns);
    if (!err)
        err = bus_subscribe(l->bus, topic_scan_status());
    if (!err)
        err = bus_subscribe(l->bus, topic_health());
    if (!err)
        err = bus_subscribe(l->bus, topic_log());
    if (!err)
        log_history_open(&l->history, l->cfg->run_dir);
    if (!err)
        err = host_peering_open(&l->host_peering, l->bus, hosts, cfg.epoch_ns,
                                l->cfg->launch_file);
    if (err)
        launcher_say(l, "launcher", hosts->n ? LOG_LEVEL_ERROR : LOG_LEVEL_WARNING,
                     why.text[0] ? why.text : strerror(-err));
    if (err) { /* nobody can be heard */
        l->supervisor.alive_ns = 0;
        l->service.supervised = false;
    }
    if (err && hosts->n)
        launcher_stop(l, EXIT_BAD_INPUT);
    if (!err && hosts->n)
        say_endpoint(l, &hosts->list[hosts->here]);
}

/* Once for all of them. */
static void say_priority(struct launcher *l)
{
    struct error why = {""};

    if (priority_wanted(l->cfg->launch) && priority_permitted(&why))
        launcher_say(l, "launcher", LOG_LEVEL_INFO, why.text);
}

int launcher_run(const struct launcher_config *cfg, bool *reported)
{
    struct launcher *l = calloc(1, sizeof *l);

    *reported = false;
    if (!l) {
        fprintf(stderr, "anlos launch: not enough memory for the launcher\n");
        return EXIT_FAILED;
    }
    l->cfg = cfg;
    l->clock = clock_system();
    l->signals.fd = -1;
    if (!cfg->arguments->unsupervised)
        l->supervisor.alive_ns = (int64_t)(1e9 * cfg->launch->processes.alive_s);
    service_open(&l->service);
    l->service.supervised = l->supervisor.alive_ns > 0;
    screen_init(&l->screen, cfg->arguments->log_format);
    progress_init(&l->progress, l->screen.out_terminal);
    say_priority(l);
    int err = signals_open(&l->signals);
    if (!err)
        err = launcher_tell_nodes();
    if (!err)
        err = process_group_fill(&l->process_group, cfg);
    if (err) {
        launcher_say(l, "launcher", LOG_LEVEL_ERROR, strerror(-err));
        l->exit_code = EXIT_FAILED;
    } else {
        open_bus(l);
        launcher_start_all(l);
        while (!has_ended(l))
            wait_and_read(l, act_on_time(l));
    }
    screen_end_progress(&l->screen);
    voice_close(&l->voice);
    log_history_close(&l->history);
    bus_destroy(l->bus);
    for (unsigned i = 0; i < l->process_group.n; i++)
        child_close(&l->process_group.children[i], launcher_print, l);
    screen_close(&l->screen, clock_now_ns(l->clock));
    signals_close(&l->signals);
    int exit_code = l->exit_code;
    /* Ctrl-C is how an array that stands ends: it does not hide what failed then. */
    if (l->incomplete && exit_code != EXIT_BAD_INPUT)
        exit_code = EXIT_FAILED;
    *reported = l->reported;
    free(l);
    return exit_code;
}
