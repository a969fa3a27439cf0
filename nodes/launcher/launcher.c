#include "nodes/launcher/launcher.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/launcher/launcher_state.h"
#include "nodes/rt/node.h"
#include "nodes/rt/priority.h"

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
    if (!crew_goes_on(&l->crew))
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
    supervisor_heard(&l->supervisor, &l->crew, health, epoch_ns);
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
            hear_health(l, (const Anlos__Health *)m, in.envelope.epoch_ns);
        else if (m && in.topic == topic_log())
            log_history_add(&l->history, (const Anlos__Log *)m);
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
        launcher_say(l, "launcher",
                     verdict == FELLOWS_FAILED    ? LOG_LEVEL_ERROR
                     : verdict == FELLOWS_WARNING ? LOG_LEVEL_WARNING
                                                  : LOG_LEVEL_INFO,
                     text);
        if (verdict == FELLOWS_DONE)
            launcher_stop(l, EXIT_WORKED);
        else if (verdict == FELLOWS_FAILED)
            launcher_stop(l, EXIT_FAILED);
    }
}

/* May it end?  When the nodes have, and the other hosts know, or a person is impatient.
 */
static bool has_ended(const struct launcher *l)
{
    return l->stopping && !crew_runs(&l->crew, true) &&
           (!l->kill_ns || fellowship_may_leave(&l->fellowship, clock_now_ns(l->clock)));
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

    judge_fellows(l, now);
    sooner(&next, fellowship_tell(&l->fellowship, now));
    sooner(&next, launcher_supervise(l, now));
    voice_health(&l->voice, now, &l->crew, &l->supervisor);
    launcher_stop_aside(l, now);
    sooner(&next, service_tick(&l->service, &l->crew, now));
    if (l->voice.bus)
        sooner(&next, l->voice.due_ns);
    sooner(&next, log_history_tick(&l->history, now));
    sooner(&next, launcher_restart(l, now));
    sooner(&next, launcher_kill(l, now));
    return next > now ? (int)((next - now) / 1000000 + 1) : 0;
}

static void wait_and_read(struct launcher *l, int timeout_ms)
{
    struct pollfd fds[2 + 2 * CREW_MAX];
    nfds_t n = 0;

    fds[n++] = (struct pollfd){.fd = l->signals.fd, .events = POLLIN};
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
                           launcher_print, l);
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
    struct complaint why = {""};
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
        err = fellowship_open(&l->fellowship, l->bus, hosts, cfg.epoch_ns,
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
    struct complaint why = {""};

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
        err = crew_fill(&l->crew, cfg);
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
    for (unsigned i = 0; i < l->crew.n; i++)
        child_close(&l->crew.children[i], launcher_print, l);
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
