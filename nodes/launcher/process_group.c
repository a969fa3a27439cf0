/* SPDX-License-Identifier: MIT */
#include "nodes/launcher/process_group.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "nodes/rt/launchfile_hosts.h"
#include "nodes/rt/node.h"
#include "nodes/rt/stop.h"

#define FIRST_PAUSE_NS 100000000LL

extern char **environ;

void child_init(struct child *c, const char *name, char *const *argv)
{
    *c = (struct child){.name = name, .argv = argv, .phase = CHILD_PAUSING};
    c->pipes[0].fd = c->pipes[1].fd = -1;
}

static void close_pipe(int fds[2])
{
    for (int i = 0; i < 2; i++)
        if (fds[i] >= 0)
            close(fds[i]);
}

/* Signals as a fresh process has them, whatever the launcher blocks or ignores. */
static int set_attributes(posix_spawnattr_t *attr)
{
    sigset_t none, defaults;

    sigemptyset(&none);
    sigemptyset(&defaults);
    sigaddset(&defaults, SIGINT);
    sigaddset(&defaults, SIGTERM);
    sigaddset(&defaults, SIGPIPE);
    int err = posix_spawnattr_setflags(
        attr, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    if (!err)
        err = posix_spawnattr_setpgroup(attr, 0);
    if (!err)
        err = posix_spawnattr_setsigmask(attr, &none);
    if (!err)
        err = posix_spawnattr_setsigdefault(attr, &defaults);
    return err;
}

/* Not fork: the launcher may have a bus by now, whose threads and sockets must not be
 * copied, not even for a moment. */
static int spawn(struct child *c, int out, int err_out)
{
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attr;
    int err = posix_spawn_file_actions_init(&files);

    if (err)
        return -err;
    err = posix_spawnattr_init(&attr);
    if (err) {
        posix_spawn_file_actions_destroy(&files);
        return -err;
    }
    err = set_attributes(&attr);
    if (!err)
        err = posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null",
                                               O_RDONLY, 0);
    if (!err)
        err = posix_spawn_file_actions_adddup2(&files, out, STDOUT_FILENO);
    if (!err)
        err = posix_spawn_file_actions_adddup2(&files, err_out, STDERR_FILENO);
    if (!err)
        err = posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
    if (!err)
        err = posix_spawn(&c->pid, c->argv[0], &files, &attr, c->argv, environ);
    posix_spawnattr_destroy(&attr);
    posix_spawn_file_actions_destroy(&files);
    return -err;
}

int child_start(struct child *c, int64_t now_ns, struct error *why)
{
    int out[2] = {-1, -1}, err_out[2] = {-1, -1};
    int err = pipe2(out, O_CLOEXEC) || pipe2(err_out, O_CLOEXEC) ? -errno : 0;

    if (!err &&
        (fcntl(out[0], F_SETFL, O_NONBLOCK) || fcntl(err_out[0], F_SETFL, O_NONBLOCK)))
        err = -errno;
    if (!err)
        err = spawn(c, out[1], err_out[1]);
    if (err) {
        c->pid = 0;
        close_pipe(out);
        close_pipe(err_out);
        return error_say(why, err, "%s: cannot be started: %s", c->argv[0],
                         strerror(-err));
    }
    close(out[1]);
    close(err_out[1]);
    c->pipes[0] = (struct child_pipe){.fd = out[0]};
    c->pipes[1] = (struct child_pipe){.fd = err_out[0]};
    c->phase = CHILD_RUNNING;
    c->started_ns = now_ns;
    return 0;
}

enum child_phase child_exited(struct child *c, int status, int64_t now_ns)
{
    bool by_itself = WIFEXITED(status);

    c->pid = 0;
    if (by_itself && WEXITSTATUS(status) == EXIT_WORKED)
        return c->phase = CHILD_ENDED;
    if (by_itself && WEXITSTATUS(status) == EXIT_BAD_INPUT)
        return c->phase = CHILD_BAD_CONFIG;
    if (now_ns - c->started_ns >= CHILD_GOOD_RUN_NS)
        c->crashes = 0;
    if (++c->crashes > CHILD_MAX_CRASHES)
        return c->phase = CHILD_FAILED;
    c->restart_ns = now_ns + (FIRST_PAUSE_NS << (c->crashes - 1));
    return c->phase = CHILD_PAUSING;
}

void child_describe_exit(int status, char *text, size_t size)
{
    if (WIFSIGNALED(status))
        snprintf(text, size, "signal %d (%s)", WTERMSIG(status),
                 strsignal(WTERMSIG(status)));
    else
        snprintf(text, size, "exit code %d", WEXITSTATUS(status));
}

/* Prints the whole lines of the text and keeps what begins the next one. */
static void print_lines(struct child *c, struct child_pipe *p, child_print *print,
                        void *ctx)
{
    char *start = p->text, *end;

    p->text[p->used] = '\0';
    while ((end = memchr(start, '\n', p->used - (size_t)(start - p->text)))) {
        *end = '\0';
        print(ctx, c, start);
        start = end + 1;
    }
    p->used -= (size_t)(start - p->text);
    memmove(p->text, start, p->used);
    if (p->used == sizeof p->text - 1) { /* longer than a line may be: in pieces */
        p->text[p->used] = '\0';
        print(ctx, c, p->text);
        p->used = 0;
    }
}

void child_read(struct child *c, struct child_pipe *p, child_print *print, void *ctx)
{
    while (p->fd >= 0) {
        ssize_t n = read(p->fd, p->text + p->used, sizeof p->text - 1 - p->used);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0 && errno == EAGAIN)
            return;
        if (n > 0) {
            p->used += (size_t)n;
            print_lines(c, p, print, ctx);
            continue;
        }
        close(p->fd);
        p->fd = -1;
        if (p->used) {
            p->text[p->used] = '\0';
            print(ctx, c, p->text);
            p->used = 0;
        }
    }
}

void child_signal(const struct child *c, int number)
{
    if (c->pid > 0)
        kill(c->pid, number);
}

void child_close(struct child *c, child_print *print, void *ctx)
{
    for (int i = 0; i < 2; i++) {
        child_read(c, &c->pipes[i], print, ctx);
        if (c->pipes[i].fd >= 0)
            close(c->pipes[i].fd);
        c->pipes[i].fd = -1;
    }
}

int process_group_fill(struct process_group *c, const struct launcher_config *cfg)
{
    for (unsigned i = 0; i < cfg->launch->n_nodes && c->n < PROCESS_GROUP_MAX; i++) {
        const char *name = cfg->launch->nodes[i];
        if (!launchfile_runs_here(cfg->launch, name))
            continue;
        int err = program_fill(&c->programs[c->n], cfg, name);
        if (err)
            return err;
        child_init(&c->children[c->n], name, c->programs[c->n].argv);
        c->children[c->n].aside = !strcmp(name, "record");
        c->n++;
    }
    return 0;
}

bool process_group_runs(const struct process_group *c, bool aside)
{
    for (unsigned i = 0; i < c->n; i++)
        if (c->children[i].pid > 0 && (aside || !c->children[i].aside))
            return true;
    return false;
}

bool process_group_goes_on(const struct process_group *c)
{
    for (unsigned i = 0; i < c->n; i++)
        if (!c->children[i].aside && (c->children[i].phase == CHILD_RUNNING ||
                                      c->children[i].phase == CHILD_PAUSING))
            return true;
    return false;
}

bool process_group_has_aside(const struct process_group *c, const char *name)
{
    for (unsigned i = 0; i < c->n; i++)
        if (c->children[i].aside && (!name || !strcmp(c->children[i].name, name)))
            return true;
    return false;
}

unsigned process_group_count(const struct process_group *c, enum child_phase phase)
{
    unsigned n = 0;

    for (unsigned i = 0; i < c->n; i++)
        n += c->children[i].phase == phase;
    return n;
}

unsigned process_group_lost(const struct process_group *c)
{
    unsigned n = 0;

    for (unsigned i = 0; i < c->n; i++)
        n += c->children[i].phase != CHILD_RUNNING &&
             c->children[i].phase != CHILD_ENDED &&
             !node_is_optional(c->children[i].name);
    return n;
}

void process_group_signal(const struct process_group *c, bool aside, int number)
{
    for (unsigned i = 0; i < c->n; i++)
        if (c->children[i].aside == aside)
            child_signal(&c->children[i], number);
}

void process_group_start_rest(struct process_group *c, int64_t start_ns)
{
    for (unsigned i = 0; i < c->n; i++)
        if (!c->children[i].started_ns && !c->children[i].aside)
            c->children[i].restart_ns = start_ns;
}
