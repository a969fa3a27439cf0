#include "nodes/anlos/doctor/check.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define NS_PER_MS 1000000LL

int64_t check_now_ns(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void answer(const struct check *c, const void *ctx, int fd)
{
    struct findings f = {0};

    prctl(PR_SET_PDEATHSIG, SIGKILL);
    c->look(ctx, &f);
    json_t *o = findings_json(&f);
    int failed = !o || json_dumpfd(o, fd, JSON_COMPACT);
    json_decref(o);
    findings_clear(&f);
    close(fd);
    _exit(failed);
}

void check_start(struct check_job *job, const struct check *c, const void *ctx)
{
    int fds[2];

    *job = (struct check_job){.pid = -1, .fd = -1};
    fflush(NULL);
    if (pipe(fds))
        return;
    job->pid = fork();
    if (!job->pid) {
        close(fds[0]);
        answer(c, ctx, fds[1]);
    }
    close(fds[1]);
    if (job->pid < 0)
        close(fds[0]);
    else
        job->fd = fds[0];
}

/* All that it writes until it ends.  0, -ETIMEDOUT, -ENOMEM; *text is to be freed. */
static int read_answer(const struct check_job *job, int64_t deadline_ns, char **text,
                       size_t *used)
{
    size_t room = 0;

    for (*used = 0;;) {
        struct pollfd p = {.fd = job->fd, .events = POLLIN};
        int64_t left_ns = deadline_ns - check_now_ns();
        int n = poll(&p, 1, left_ns > 0 ? (int)(left_ns / NS_PER_MS) + 1 : 0);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return -ETIMEDOUT;
        if (*used == room) {
            room = room ? 2 * room : 4096;
            char *more = realloc(*text, room);
            if (!more)
                return -ENOMEM;
            *text = more;
        }
        ssize_t got = read(job->fd, *text + *used, room - *used);
        if (got <= 0)
            return 0;
        *used += (size_t)got;
    }
}

/* One that sleeps in the kernel cannot be killed either: it is not waited for. */
static int end_child(const struct check_job *job, bool late)
{
    int status = 0;

    if (late)
        kill(job->pid, SIGKILL);
    while (waitpid(job->pid, &status, late ? WNOHANG : 0) < 0 && errno == EINTR)
        ;
    return status;
}

void check_finish(struct check_job *job, const struct check *c, int64_t deadline_ns,
                  struct findings *out)
{
    char *text = NULL;
    size_t used = 0;

    if (job->pid < 0) {
        finding_add(out, FINDING_WRONG, c->area,
                    "was not looked at: no process could be started");
        finding_todo(out, "free memory, or raise the limit of processes (ulimit -u)");
        return;
    }
    int err = read_answer(job, deadline_ns, &text, &used);
    int status = end_child(job, err != 0);
    json_t *o = err ? NULL : json_loadb(text, used, 0, NULL);
    if (err == -ETIMEDOUT) {
        finding_add(out, FINDING_WRONG, c->area, "gave no answer in time: it hangs");
        finding_todo(out, "look at the end of 'dmesg'; unplug and plug in the device, or "
                          "look whether a network disk is away");
    } else if (err || findings_add_json(out, o)) {
        finding_add(out, FINDING_WRONG, c->area, "looking at it failed (%s)",
                    WIFSIGNALED(status) ? strsignal(WTERMSIG(status)) : "no answer");
    }
    json_decref(o);
    free(text);
    close(job->fd);
}
