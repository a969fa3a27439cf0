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
#include "nodes/launcher/child.h"
#include "nodes/launcher/program.h"
#include "nodes/launcher/progress.h"
#include "nodes/launcher/screen.h"
#include "nodes/rt/node.h"

#define KILL_AFTER_NS 3000000000LL
#define MAX_NODES     16

struct launcher {
    const struct launcher_config *cfg;
    const struct clock_source *clock;
    struct child children[MAX_NODES];
    struct program programs[MAX_NODES];
    unsigned n;
    int signal_fd;
    struct bus *bus;
    struct progress progress;
    struct screen screen;
    bool stopping, killed;
    bool reported;
    int64_t kill_ns;
    int exit_code; /* once stopping */
};

static void print_line(void *ctx, const struct child *c, const char *line)
{
    screen_log(ctx, c->name, line);
}

static void say(struct launcher *l, const char *node, enum log_level level,
                const char *text)
{
    char line[1200];

    snprintf(line, sizeof line, "%s %s", log_level_name(level), text);
    screen_log(&l->screen, node, line);
}

/* Asks all to end.  The first reason decides the exit code. */
static void stop(struct launcher *l, int exit_code)
{
    if (l->stopping)
        return;
    screen_end_progress(&l->screen);
    l->stopping = true;
    l->exit_code = exit_code;
    l->kill_ns = clock_now_ns(l->clock) + KILL_AFTER_NS;
    for (unsigned i = 0; i < l->n; i++)
        child_signal(&l->children[i], SIGTERM);
}

static bool any_running(const struct launcher *l)
{
    for (unsigned i = 0; i < l->n; i++)
        if (l->children[i].pid > 0)
            return true;
    return false;
}

/* Running, or about to be again? */
static bool any_alive(const struct launcher *l)
{
    for (unsigned i = 0; i < l->n; i++)
        if (l->children[i].phase == CHILD_RUNNING ||
            l->children[i].phase == CHILD_PAUSING)
            return true;
    return false;
}

static void start_child(struct launcher *l, struct child *c)
{
    struct complaint why = {""};

    child_close(c, print_line, &l->screen);
    if (!child_start(c, clock_now_ns(l->clock), &why))
        return;
    say(l, c->name, LOG_LEVEL_ERROR, why.text);
    c->phase = CHILD_FAILED;
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

static void exited(struct launcher *l, struct child *c, int status)
{
    enum child_phase phase = child_exited(c, status, clock_now_ns(l->clock));

    child_close(c, print_line, &l->screen);
    if (l->stopping)
        return;
    switch (phase) {
    case CHILD_ENDED:
        if (strcmp(c->name, "report"))
            break;
        l->reported = true;
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
    for (unsigned i = 0; i < l->n; i++) {
        int status;
        struct child *c = &l->children[i];
        if (c->pid > 0 && waitpid(c->pid, &status, WNOHANG) == c->pid)
            exited(l, c, status);
    }
}

static void read_signals(struct launcher *l)
{
    struct signalfd_siginfo info;

    while (read(l->signal_fd, &info, sizeof info) == (ssize_t)sizeof info)
        if (info.ssi_signo != SIGCHLD && l->stopping)
            l->kill_ns = 0; /* asked twice: no more patience */
        else if (info.ssi_signo != SIGCHLD)
            stop(l, 128 + (int)info.ssi_signo);
    reap(l);
    if (!any_alive(l))
        stop(l, EXIT_WORKED);
}

static void show_progress(struct launcher *l, const ProtobufCMessage *status)
{
    if (progress_status(&l->progress, (const Anlos__ScanStatus *)status))
        screen_progress(&l->screen, l->progress.text);
}

static void read_bus(struct launcher *l)
{
    struct bus_message in;

    while (!bus_receive(l->bus, &in, 0)) {
        ProtobufCMessage *m = bus_message_unpack(&in);
        if (m && in.topic == topic_scan_status() && !l->stopping)
            show_progress(l, m);
        else if (m && in.topic == topic_health())
            progress_health(&l->progress, (const Anlos__Health *)m);
        if (m)
            protobuf_c_message_free_unpacked(m, NULL);
        bus_message_free(&in);
    }
}

/* What time brings: restarts, and an end for those that do not end by themselves.
 * Returns how long nothing will, in ms. */
static int act_on_time(struct launcher *l)
{
    int64_t now = clock_now_ns(l->clock);
    int64_t next = now + 1000000000LL;

    for (unsigned i = 0; i < l->n && !l->stopping; i++) {
        struct child *c = &l->children[i];
        if (c->phase != CHILD_PAUSING)
            continue;
        if (c->restart_ns <= now)
            start_child(l, c);
        else if (c->restart_ns < next)
            next = c->restart_ns;
    }
    if (l->stopping && !l->killed && now >= l->kill_ns) {
        l->killed = true;
        for (unsigned i = 0; i < l->n; i++) {
            if (l->children[i].pid > 0)
                say(l, l->children[i].name, LOG_LEVEL_WARNING, "does not stop; killed");
            child_signal(&l->children[i], SIGKILL);
        }
    } else if (l->stopping && !l->killed && l->kill_ns < next) {
        next = l->kill_ns;
    }
    return next > now ? (int)((next - now) / 1000000 + 1) : 0;
}

static void wait_and_read(struct launcher *l, int timeout_ms)
{
    struct pollfd fds[2 + 2 * MAX_NODES];
    nfds_t n = 0;

    fds[n++] = (struct pollfd){.fd = l->signal_fd, .events = POLLIN};
    fds[n++] = (struct pollfd){.fd = l->bus ? bus_fd(l->bus) : -1, .events = POLLIN};
    for (unsigned i = 0; i < l->n; i++)
        for (int k = 0; k < 2; k++)
            fds[n++] =
                (struct pollfd){.fd = l->children[i].pipes[k].fd, .events = POLLIN};
    if (poll(fds, n, timeout_ms) < 0)
        return;
    for (unsigned i = 0; i < l->n; i++)
        for (int k = 0; k < 2; k++)
            if (fds[2 + 2 * i + (unsigned)k].revents)
                child_read(&l->children[i], &l->children[i].pipes[k], print_line,
                           &l->screen);
    if (l->bus && fds[1].revents)
        read_bus(l);
    if (fds[0].revents)
        read_signals(l);
}

static int open_signals(struct launcher *l)
{
    char parent[24];
    sigset_t set;

    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGHUP);
    sigaddset(&set, SIGCHLD);
    signal(SIGPIPE, SIG_IGN);
    snprintf(parent, sizeof parent, "%ld", (long)getpid());
    if (sigprocmask(SIG_BLOCK, &set, NULL) || setenv("ANLOS_LAUNCHER_PID", parent, 1))
        return -errno;
    l->signal_fd = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
    return l->signal_fd < 0 ? -errno : 0;
}

/* Without the bus there is no progress to be seen, but the nodes do their work. */
static void open_bus(struct launcher *l)
{
    const struct bus_config cfg = {.node = "launcher",
                                   .run_dir = l->cfg->run_dir,
                                   .epoch_ns = clock_now_ns(l->clock),
                                   .listen_only = true};
    struct complaint why = {""};
    int err = bus_create(&l->bus, &cfg, &why);

    if (!err)
        err = bus_subscribe(l->bus, topic_scan_status());
    if (!err)
        err = bus_subscribe(l->bus, topic_health());
    if (err)
        say(l, "launch", LOG_LEVEL_WARNING, why.text[0] ? why.text : strerror(-err));
}

static int set_up(struct launcher *l)
{
    int err = open_signals(l);

    for (unsigned i = 0; !err && i < l->cfg->launch->n_nodes && i < MAX_NODES; i++) {
        const char *name = l->cfg->launch->nodes[i];
        err = program_fill(&l->programs[i], l->cfg, name);
        if (err)
            break;
        child_init(&l->children[i], name, l->programs[i].argv);
        l->n = i + 1;
    }
    return err;
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
    screen_init(&l->screen);
    progress_init(&l->progress, l->screen.out_terminal);
    int err = set_up(l);
    if (err) {
        say(l, "launch", LOG_LEVEL_ERROR, strerror(-err));
        l->exit_code = EXIT_FAILED;
    } else {
        for (unsigned i = 0; i < l->n && !l->stopping; i++)
            start_child(l, &l->children[i]);
        open_bus(l);
        while (!l->stopping || any_running(l))
            wait_and_read(l, act_on_time(l));
    }
    screen_end_progress(&l->screen);
    bus_destroy(l->bus);
    for (unsigned i = 0; i < l->n; i++)
        child_close(&l->children[i], print_line, &l->screen);
    if (l->signal_fd >= 0)
        close(l->signal_fd);
    int exit_code = l->exit_code;
    *reported = l->reported;
    free(l);
    return exit_code;
}
