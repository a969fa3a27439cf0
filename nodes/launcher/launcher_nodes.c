#include "nodes/launcher/launcher_state.h"

#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "nodes/rt/node.h"

#define KILL_AFTER_NS 3000000000LL
#define KILL_ASIDE_NS 30000000000LL /* a recorder may bring much to a slow disk */
#define READY_NS      1000000000LL /* for a recorder to be all ears before the rest starts */

int launcher_tell_nodes(void)
{
    char parent[24], start[24];
    int64_t now_ns = clock_now_ns(clock_system()) + clock_wall_ahead_ns();

    snprintf(parent, sizeof parent, "%ld", (long)getpid());
    snprintf(start, sizeof start, "%lld", (long long)now_ns);
    if (setenv("ANLOS_LAUNCHER_PID", parent, 1) || setenv("ANLOS_LAUNCH_NS", start, 1))
        return -errno;
    return clock_share();
}

void launcher_print(void *ctx, const struct child *c, const char *line)
{
    struct launcher *l = ctx;

    screen_output(&l->screen, c->name, line, clock_now_ns(l->clock));
}

void launcher_say(struct launcher *l, const char *node, enum log_level level,
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

void launcher_stop(struct launcher *l, int exit_code)
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
    fellowship_end(&l->fellowship, exit_code,
                   l->reported ? l->cfg->launch->report.folder : NULL,
                   clock_now_ns(l->clock));
    crew_signal(&l->crew, false, SIGTERM);
}

void launcher_stop_aside(struct launcher *l, int64_t now_ns)
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

void launcher_start_all(struct launcher *l)
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
        launcher_stop(l, EXIT_BAD_INPUT);
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
    launcher_say(l, c->name, LOG_LEVEL_ERROR, text);
}

/* What it failed at itself while it was stopping; not that it was stopped. */
static bool fails_at_end(const struct launcher *l, int status)
{
    if (WIFEXITED(status))
        return WEXITSTATUS(status) != EXIT_WORKED;
    return WTERMSIG(status) != SIGTERM && !(WTERMSIG(status) == SIGKILL && l->killed);
}

static void exited_stopping(struct launcher *l, const struct child *c, int status)
{
    bool reports = !strcmp(c->name, "report");
    char exit_text[64], text[PATH_MAX + 160];

    if (!status)
        l->reported |= reports && l->cfg->launch->scan.fixed;
    if (!fails_at_end(l, status))
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
    switch (phase) {
    case CHILD_ENDED:
        if (strcmp(c->name, "report")) {
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
        describe_crash(l, c, status);
    }
}

void launcher_reap(struct launcher *l)
{
    for (unsigned i = 0; i < l->crew.n; i++) {
        int status;
        struct child *c = &l->crew.children[i];
        if (c->pid > 0 && waitpid(c->pid, &status, WNOHANG) == c->pid)
            exited(l, c, status);
    }
}

/* SIGKILL: one that is stopped takes no other. */
int64_t launcher_supervise(struct launcher *l, int64_t now_ns)
{
    int64_t hung_ns[CREW_MAX];
    char text[160];

    if (l->stopping)
        return INT64_MAX;
    int64_t next = supervisor_tick(&l->supervisor, &l->crew, now_ns, hung_ns);
    for (unsigned i = 0; i < l->crew.n; i++) {
        if (!hung_ns[i])
            continue;
        snprintf(text, sizeof text, "hangs: its loop has not turned for %.1f s; killed",
                 1e-9 * (double)hung_ns[i]);
        launcher_say(l, l->crew.children[i].name, LOG_LEVEL_ERROR, text);
        child_signal(&l->crew.children[i], SIGKILL);
    }
    return next;
}

int64_t launcher_restart(struct launcher *l, int64_t now_ns)
{
    int64_t next = INT64_MAX;

    for (unsigned i = 0; i < l->crew.n && !l->stopping; i++) {
        struct child *c = &l->crew.children[i];
        if (c->phase != CHILD_PAUSING)
            continue;
        if (c->restart_ns <= now_ns)
            start_child(l, c);
        else if (c->restart_ns < next)
            next = c->restart_ns;
    }
    return next;
}

int64_t launcher_kill(struct launcher *l, int64_t now_ns)
{
    if (!l->stopping || l->killed)
        return INT64_MAX;
    if (now_ns < l->kill_ns)
        return l->kill_ns;
    l->killed = true;
    for (unsigned i = 0; i < l->crew.n; i++) {
        struct child *c = &l->crew.children[i];
        if (c->aside && !l->stopping_aside && l->kill_ns)
            continue;
        if (c->pid > 0)
            launcher_say(l, c->name, LOG_LEVEL_WARNING,
                         l->kill_ns ? "does not stop; killed"
                                    : "still runs, and you asked again; killed");
        child_signal(c, SIGKILL);
    }
    return INT64_MAX;
}
