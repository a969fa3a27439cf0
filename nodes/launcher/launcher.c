#include "nodes/launcher/launcher.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include "hal/clock.h"
#include "msgs/bus.h"
#include "nodes/launcher/crew.h"
#include "nodes/launcher/fellowship.h"
#include "nodes/launcher/progress.h"
#include "nodes/launcher/screen.h"
#include "nodes/launcher/service.h"
#include "nodes/launcher/voice.h"
#include "nodes/rt/node.h"

#define KILL_AFTER_NS 3000000000LL
#define KILL_ASIDE_NS 30000000000LL /* a recorder may bring much to a slow disk */
#define READY_NS      1000000000LL /* for a recorder to be all ears before the rest starts */
#define AGAIN_NS                                                                         \
    500000000LL /* timeout(1) and others send the same signal twice at once */

struct launcher {
    const struct launcher_config *cfg;
    const struct clock_source *clock;
    struct crew crew;
    int signal_fd;
    sigset_t signals_before;
    struct bus *bus;
    struct progress progress;
    struct fellowship fellowship; /* with the other hosts */
    struct screen screen;
    struct voice voice;
    struct service service;
    bool stopping, stopping_aside, killed;
    bool reported;
    bool recording_failed; /* the rest went on */
    int64_t kill_ns;
    int64_t asked_ns; /* to stop, by a signal; 0: never */
    int exit_code;    /* once stopping */
};

static void print_line(void *ctx, const struct child *c, const char *line)
{
    struct launcher *l = ctx;

    screen_output(&l->screen, c->name, line, clock_now_ns(l->clock));
}

static void say(struct launcher *l, const char *node, enum log_level level,
                const char *text)
{
    struct log_line line = {.stamp_ns = clock_now_ns(l->clock), .level = level};

    snprintf(line.node, sizeof line.node, "%s", node);
    snprintf(line.text, sizeof line.text, "%s", text);
    log_text_clean(line.text);
    if (level >= l->cfg->arguments->log_level)
        screen_log(&l->screen, &line);
    voice_log(&l->voice, &line);
}

/* Asks all to end.  The first reason decides the exit code. */
static void stop(struct launcher *l, int exit_code)
{
    if (l->stopping)
        return;
    screen_end_progress(&l->screen);
    service_ends(&l->service);
    l->stopping = true;
    l->exit_code = exit_code;
    l->kill_ns = clock_now_ns(l->clock) + KILL_AFTER_NS;
    fellowship_end(&l->fellowship, exit_code,
                   l->reported ? l->cfg->launch->report.folder : NULL,
                   clock_now_ns(l->clock));
    crew_signal(&l->crew, false, SIGTERM);
}

/* What is aside has seen everything when the others have ended. */
static void stop_aside(struct launcher *l, int64_t now_ns)
{
    if (!l->stopping || l->stopping_aside || crew_runs(&l->crew, false))
        return;
    l->stopping_aside = true;
    if (l->kill_ns) {
        l->killed = false;
        l->kill_ns = now_ns + KILL_ASIDE_NS;
    }
    crew_signal(&l->crew, true, SIGTERM);
}

static void start_child(struct launcher *l, struct child *c)
{
    struct complaint why = {""};

    child_close(c, print_line, l);
    if (!child_start(c, clock_now_ns(l->clock), &why))
        return;
    say(l, c->name, LOG_LEVEL_ERROR, why.text);
    c->phase = CHILD_FAILED;
    if (!c->aside)
        stop(l, EXIT_BAD_INPUT);
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
    say(l, c->name, c->phase == CHILD_FAILED ? LOG_LEVEL_ERROR : LOG_LEVEL_WARNING, text);
}

/* What is aside comes first, so that it misses nothing of the others. */
static void start_all(struct launcher *l)
{
    for (unsigned i = 0; i < l->crew.n && !l->stopping; i++)
        if (l->crew.children[i].aside)
            start_child(l, &l->crew.children[i]);
    crew_start_rest(
        &l->crew, crew_has_aside(&l->crew, NULL) ? clock_now_ns(l->clock) + READY_NS : 0);
}

/* A recorder that refuses what it is to do, before there is anything to be lost? */
static bool refuses(const struct launcher *l, int status)
{
    return WIFEXITED(status) && WEXITSTATUS(status) == EXIT_BAD_INPUT &&
           !crew_runs(&l->crew, false);
}

/* One that is aside is started again only when it crashed: what made it give up, such as
 * a full disk, is still there. */
static void exited_aside(struct launcher *l, struct child *c, int status)
{
    char exit_text[64], text[160];

    if (refuses(l, status)) {
        stop(l, EXIT_BAD_INPUT);
        return;
    }
    crew_start_rest(&l->crew, 0);
    if (c->phase == CHILD_ENDED)
        return;
    if (c->phase == CHILD_PAUSING && !WIFEXITED(status)) {
        describe_crash(l, c, status);
        return;
    }
    c->phase = CHILD_FAILED;
    child_describe_exit(status, exit_text, sizeof exit_text);
    snprintf(text, sizeof text, "ended with %s; the others go on without it", exit_text);
    say(l, c->name, LOG_LEVEL_ERROR, text);
}

static void exited(struct launcher *l, struct child *c, int status)
{
    enum child_phase phase = child_exited(c, status, clock_now_ns(l->clock));

    child_close(c, print_line, l);
    if (c->aside && status)
        l->recording_failed |= l->stopping || WIFEXITED(status) || phase == CHILD_FAILED;
    if (l->stopping) {
        l->reported |= !strcmp(c->name, "report") && !status &&
                       l->cfg->launch->scan.fixed;
        return;
    }
    if (c->aside) {
        exited_aside(l, c, status);
        return;
    }
    switch (phase) {
    case CHILD_ENDED:
        if (strcmp(c->name, "report")) {
            say(l, c->name, LOG_LEVEL_INFO, "has ended; it is not started again");
            break;
        }
        l->reported = true; /* before stop: the other hosts are told */
        stop(l, l->progress.state == ANLOS__SCAN_STATUS__STATE__FAILED ? EXIT_FAILED
                                                                       : EXIT_WORKED);
        break;
    case CHILD_BAD_CONFIG:
        stop(l, EXIT_BAD_INPUT);
        break;
    case CHILD_FAILED:
        describe_crash(l, c, status);
        stop(l, EXIT_FAILED);
        break;
    default:
        describe_crash(l, c, status);
    }
}

static void reap(struct launcher *l)
{
    for (unsigned i = 0; i < l->crew.n; i++) {
        int status;
        struct child *c = &l->crew.children[i];
        if (c->pid > 0 && waitpid(c->pid, &status, WNOHANG) == c->pid)
            exited(l, c, status);
    }
}

static void asked_to_stop(struct launcher *l, int signal_number)
{
    int64_t now = clock_now_ns(l->clock);

    if (!l->stopping) {
        l->asked_ns = now;
        stop(l, 128 + signal_number);
    } else if (!l->asked_ns || now - l->asked_ns >= AGAIN_NS) {
        l->kill_ns = 0; /* asked twice: no more patience */
    }
}

static void read_signals(struct launcher *l)
{
    struct signalfd_siginfo info;

    while (read(l->signal_fd, &info, sizeof info) == (ssize_t)sizeof info)
        if (info.ssi_signo != SIGCHLD)
            asked_to_stop(l, (int)info.ssi_signo);
    reap(l);
    if (!crew_goes_on(&l->crew))
        stop(l, EXIT_WORKED);
}

static void show_progress(struct launcher *l, const ProtobufCMessage *status)
{
    if (progress_status(&l->progress, (const Anlos__ScanStatus *)status))
        screen_progress(&l->screen, l->progress.text);
}

static void hear_health(struct launcher *l, const Anlos__Health *health)
{
    progress_health(&l->progress, health);
    service_heard(&l->service, &l->crew, health->node, clock_now_ns(l->clock));
    if (health->state == ANLOS__HEALTH__STATE__READY &&
        crew_has_aside(&l->crew, health->node))
        crew_start_rest(&l->crew, 0);
}

static void read_bus(struct launcher *l)
{
    struct bus_message in;

    while (!bus_receive(l->bus, &in, 0)) {
        ProtobufCMessage *m = bus_message_unpack(&in);
        if (m && in.topic == topic_scan_status() && !l->stopping)
            show_progress(l, m);
        else if (m && in.topic == topic_health())
            hear_health(l, (const Anlos__Health *)m);
        else if (m && in.topic == topic_host())
            fellowship_hear(&l->fellowship, m, &in.envelope, clock_now_ns(l->clock));
        if (m)
            protobuf_c_message_free_unpacked(m, NULL);
        bus_message_free(&in);
    }
}

static void judge_fellows(struct launcher *l, int64_t now_ns)
{
    char text[FELLOWS_TEXT_SIZE];
    enum fellows_verdict verdict;

    while (!l->stopping && (verdict = fellows_judge(&l->fellowship.fellows, now_ns,
                                                    text)) != FELLOWS_GO_ON) {
        say(l, "launcher",
            verdict == FELLOWS_FAILED    ? LOG_LEVEL_ERROR
            : verdict == FELLOWS_WARNING ? LOG_LEVEL_WARNING
                                         : LOG_LEVEL_INFO,
            text);
        if (verdict == FELLOWS_DONE)
            stop(l, EXIT_WORKED);
        else if (verdict == FELLOWS_FAILED)
            stop(l, EXIT_FAILED);
    }
}

/* May it end?  When the nodes have, and the other hosts know, or a person is impatient.
 */
static bool has_ended(const struct launcher *l)
{
    return l->stopping && !crew_runs(&l->crew, true) &&
           (!l->kill_ns || fellowship_may_leave(&l->fellowship, clock_now_ns(l->clock)));
}

/* What time brings: restarts, and an end for those that do not end by themselves.
 * Returns how long nothing will, in ms. */
static int act_on_time(struct launcher *l)
{
    int64_t now = clock_now_ns(l->clock);
    int64_t next = now + 1000000000LL;

    judge_fellows(l, now);
    int64_t tell_ns = fellowship_tell(&l->fellowship, now);
    voice_health(&l->voice, now, crew_count(&l->crew, CHILD_RUNNING),
                 crew_count(&l->crew, CHILD_ENDED), l->crew.n);
    stop_aside(l, now);
    int64_t service_ns = service_tick(&l->service, &l->crew, now);
    if (service_ns < next)
        next = service_ns;
    if (tell_ns < next)
        next = tell_ns;
    if (l->voice.bus && l->voice.due_ns < next)
        next = l->voice.due_ns;
    for (unsigned i = 0; i < l->crew.n && !l->stopping; i++) {
        struct child *c = &l->crew.children[i];
        if (c->phase != CHILD_PAUSING)
            continue;
        if (c->restart_ns <= now)
            start_child(l, c);
        else if (c->restart_ns < next)
            next = c->restart_ns;
    }
    if (l->stopping && !l->killed && now >= l->kill_ns) {
        l->killed = true;
        for (unsigned i = 0; i < l->crew.n; i++) {
            if (l->crew.children[i].aside && !l->stopping_aside && l->kill_ns)
                continue;
            if (l->crew.children[i].pid > 0)
                say(l, l->crew.children[i].name, LOG_LEVEL_WARNING,
                    l->kill_ns ? "does not stop; killed"
                               : "still runs, and you asked again; killed");
            child_signal(&l->crew.children[i], SIGKILL);
        }
    } else if (l->stopping && !l->killed && l->kill_ns < next) {
        next = l->kill_ns;
    }
    return next > now ? (int)((next - now) / 1000000 + 1) : 0;
}

static void wait_and_read(struct launcher *l, int timeout_ms)
{
    struct pollfd fds[2 + 2 * CREW_MAX];
    nfds_t n = 0;

    fds[n++] = (struct pollfd){.fd = l->signal_fd, .events = POLLIN};
    fds[n++] = (struct pollfd){.fd = l->bus ? bus_fd(l->bus) : -1, .events = POLLIN};
    for (unsigned i = 0; i < l->crew.n; i++)
        for (int k = 0; k < 2; k++)
            fds[n++] =
                (struct pollfd){.fd = l->crew.children[i].pipes[k].fd, .events = POLLIN};
    if (poll(fds, n, timeout_ms) < 0)
        return;
    for (unsigned i = 0; i < l->crew.n; i++)
        for (int k = 0; k < 2; k++)
            if (fds[2 + 2 * i + (unsigned)k].revents)
                child_read(&l->crew.children[i], &l->crew.children[i].pipes[k],
                           print_line, l);
    if (l->bus && fds[1].revents)
        read_bus(l);
    if (fds[0].revents)
        read_signals(l);
}

/* As nohup leaves it: a signal that is blocked comes even if it is to be ignored. */
static bool hangup_is_ignored(void)
{
    struct sigaction now;

    return !sigaction(SIGHUP, NULL, &now) && now.sa_handler == SIG_IGN;
}

static int open_signals(struct launcher *l)
{
    char parent[24];
    sigset_t set;

    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    if (!hangup_is_ignored())
        sigaddset(&set, SIGHUP);
    sigaddset(&set, SIGCHLD);
    signal(SIGPIPE, SIG_IGN);
    snprintf(parent, sizeof parent, "%ld", (long)getpid());
    if (sigprocmask(SIG_BLOCK, &set, &l->signals_before) ||
        setenv("ANLOS_LAUNCHER_PID", parent, 1))
        return -errno;
    l->signal_fd = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
    return l->signal_fd < 0 ? -errno : 0;
}

/* What follows can be stopped as any program; signals that were for the nodes are not for
 * it. */
static void close_signals(struct launcher *l)
{
    struct signalfd_siginfo info;

    if (l->signal_fd < 0)
        return;
    while (read(l->signal_fd, &info, sizeof info) == (ssize_t)sizeof info)
        ;
    close(l->signal_fd);
    sigprocmask(SIG_SETMASK, &l->signals_before, NULL);
}

/* Which ports a firewall has to let through. */
static void say_endpoint(struct launcher *l, const struct host *h)
{
    char text[200];

    if (h->address[0])
        snprintf(text, sizeof text, "this is host %s: %s, ports %u to %u", h->name,
                 h->address, h->port, h->port + hosts_n_ports() - 1);
    else
        snprintf(text, sizeof text, "this is host %s: %s", h->name, h->folder);
    say(l, "launcher", LOG_LEVEL_INFO, text);
}

/* On one machine it is only to show the progress: the nodes do their work without. */
static void open_bus(struct launcher *l)
{
    const struct hosts *hosts = &l->cfg->launch->hosts;
    const struct bus_config cfg = {.node = "launcher",
                                   .run_dir = l->cfg->run_dir,
                                   .epoch_ns = clock_now_ns(l->clock)};
    struct complaint why = {""};
    int err = bus_create(&l->bus, &cfg, &why);

    voice_open(&l->voice, l->bus, cfg.epoch_ns);
    if (!err)
        err = bus_subscribe(l->bus, topic_scan_status());
    if (!err)
        err = bus_subscribe(l->bus, topic_health());
    if (!err)
        err = fellowship_open(&l->fellowship, l->bus, hosts, cfg.epoch_ns,
                              l->cfg->launch_file);
    if (err)
        say(l, "launcher", hosts->n ? LOG_LEVEL_ERROR : LOG_LEVEL_WARNING,
            why.text[0] ? why.text : strerror(-err));
    if (err && hosts->n)
        stop(l, EXIT_BAD_INPUT);
    if (!err && hosts->n)
        say_endpoint(l, &hosts->list[hosts->here]);
}

int launcher_run(const struct launcher_config *cfg, bool *reported)
{
    struct launcher *l = calloc(1, sizeof *l);

    *reported = false;
    if (!l)
        return EXIT_FAILED;
    l->cfg = cfg;
    l->clock = clock_system();
    l->signal_fd = -1;
    service_open(&l->service);
    screen_init(&l->screen, cfg->arguments->log_format);
    progress_init(&l->progress, l->screen.out_terminal);
    int err = open_signals(l);
    if (!err)
        err = crew_fill(&l->crew, cfg);
    if (err) {
        say(l, "launcher", LOG_LEVEL_ERROR, strerror(-err));
        l->exit_code = EXIT_FAILED;
    } else {
        open_bus(l);
        start_all(l);
        while (!has_ended(l))
            wait_and_read(l, act_on_time(l));
    }
    screen_end_progress(&l->screen);
    voice_close(&l->voice);
    bus_destroy(l->bus);
    for (unsigned i = 0; i < l->crew.n; i++)
        child_close(&l->crew.children[i], print_line, l);
    screen_close(&l->screen, clock_now_ns(l->clock));
    close_signals(l);
    int exit_code = l->exit_code;
    if (exit_code == EXIT_WORKED && l->recording_failed)
        exit_code = EXIT_FAILED; /* the results are there, the bag is cut short */
    *reported = l->reported;
    free(l);
    return exit_code;
}
