/* SPDX-License-Identifier: MIT */
#include "tests/bench/drive_jobs.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/convert.h"
#include "nodes/anlos/doctor/drive_pipe.h"
#include "nodes/anlos/score/drive_score.h"
#include "nodes/rt/stop.h"

#define STAMP_NS 1000000000 /* of time 0: a stamp of 0 is none */

static int score_next(struct drive_pipe *p, struct drive_score *score,
                      struct drive_told *told, struct drive_moments *moments, double *t_s,
                      struct error *why)
{
    struct drive_moment moment;
    struct drive_image image;
    int err = drive_pipe_next(p, &image, why);

    if (err)
        return err;
    drive_score_list(score, image.t_s, image.out_s, image.tracks, image.detections,
                     &moment);
    /* It goes to the vehicle when its image is made, which takes no time here. */
    drive_score_told(score, told, image.t_s, image.tracks,
                     STAMP_NS + llround(1e9 * image.t_s),
                     STAMP_NS + llround(1e9 * image.out_s));
    detections_free(image.tracks);
    detections_free(image.detections);
    *t_s = image.t_s;
    return drive_moments_add(moments, &moment) ? error_say(why, -ENOMEM, "out of memory")
                                               : 0;
}

static int run(const struct drive_run *r, struct drive_pipe *p, struct drive_score *score,
               struct drive_outcome *out)
{
    int err = drive_pipe_create(p, r->launch, r->scene, r->draw, r->threads, &out->why);

    if (err)
        return err;
    const struct room *room = p->world.room;
    const struct drive_truth truth = drive_truth_room(room);
    double t_s = drive_world_s(p->world.begin_ns);
    double end_s = t_s + (double)r->rounds * room_period_s(room);
    struct drive_told told;
    drive_score_init(score, &truth, room_survey(room), t_s);
    drive_told_init(&told, r->launch);
    drive_told_survey(&told, p->world.survey);
    while (!err && t_s < end_s && !interrupt_requested())
        err = score_next(p, score, &told, &out->moments, &t_s, &out->why);
    drive_score_end(score);
    out->result = score->result;
    if (!err && interrupt_requested())
        err = error_say(&out->why, -EINTR, "interrupted");
    return err;
}

void drive_run(const struct drive_run *r, struct drive_outcome *out)
{
    struct drive_score *score = calloc(1, sizeof *score);
    struct drive_pipe *p = calloc(1, sizeof *p);

    *out = (struct drive_outcome){.err = -ENOMEM};
    if (score && p) {
        out->err = run(r, p, score, out);
        drive_pipe_clear(p);
    } else {
        error_say(&out->why, -ENOMEM, "out of memory");
    }
    free(p);
    free(score);
}

enum { MOST_SIDE_BY_SIDE = 256, LOOK_MS = 200 };

struct worker {
    pid_t pid;
    int fd;
    struct drive_job *job; /* NULL: it has none */
    char *bytes;           /* [n] of what it wrote: struct drive_outcome and moments */
    size_t n, room;
};

struct process_group {
    const struct drive_jobs *jobs;
    struct worker workers[MOST_SIDE_BY_SIDE];
    size_t n, next; /* workers; job to begin next */
    bool stops;     /* no more are begun */
    int err;
};

/* -- in the worker's process ------------------------------------------------------------
 */
static void write_all(int fd, const void *data, size_t size)
{
    const char *at = data;

    while (size) {
        ssize_t n = write(fd, at, size);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            _exit(1);
        at += n;
        size -= (size_t)n;
    }
}

static _Noreturn void work(const struct drive_job *job, int fd, pid_t parent)
{
    struct drive_outcome out;

    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent)
        _exit(1);
    drive_run(&job->run, &out);
    if (!job->keeps_moments)
        out.moments.n = 0;
    write_all(fd, &out, sizeof out);
    write_all(fd, out.moments.at, out.moments.n * sizeof *out.moments.at);
    _exit(0);
}

/* -- in the first one -------------------------------------------------------------------
 */
static int begin(struct worker *w, struct drive_job *job, struct error *why)
{
    pid_t self = getpid();
    int ends[2];

    if (pipe2(ends, O_CLOEXEC))
        return error_say(why, -errno, "pipe: %s", strerror(errno));
    fflush(NULL);
    *w = (struct worker){.pid = fork(), .fd = ends[0], .job = job};
    if (!w->pid)
        work(job, ends[1], self);
    int err = w->pid < 0 ? -errno : 0;
    close(ends[1]);
    if (!err)
        return 0;
    close(ends[0]);
    w->job = NULL;
    return error_say(why, err, "fork: %s", strerror(-err));
}

/* More of what a worker writes: 0, -ENODATA (that was all), -ENOMEM. */
static int receive(struct worker *w)
{
    if (w->n == w->room) {
        size_t room = w->room ? 2 * w->room : 65536;
        char *bytes = realloc(w->bytes, room);
        if (!bytes)
            return -ENOMEM;
        w->bytes = bytes;
        w->room = room;
    }
    ssize_t n = read(w->fd, w->bytes + w->n, w->room - w->n);
    if (n < 0)
        return errno == EINTR ? 0 : -errno;
    w->n += (size_t)n;
    return n ? 0 : -ENODATA;
}

static void take_outcome(const struct worker *w, int status)
{
    struct drive_outcome *out = &w->job->outcome;
    size_t head = sizeof *out;

    if (w->n >= head)
        memcpy(out, w->bytes, head);
    size_t tail = w->n >= head ? out->moments.n * sizeof *out->moments.at : 0;
    out->moments.at = NULL;
    if (w->n < head || w->n != head + tail) {
        out->moments.n = 0;
        out->err =
            error_say(&out->why, -EIO, "%s: its process ended by %s %d",
                      w->job->run.scene, WIFSIGNALED(status) ? "signal" : "exit code",
                      WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
        return;
    }
    out->moments.at = tail ? malloc(tail) : NULL;
    if (out->moments.at)
        memcpy(out->moments.at, w->bytes + head, tail);
    else
        out->moments.n = 0;
    out->moments.room = out->moments.n;
}

static void stop(struct process_group *c)
{
    for (size_t i = 0; i < c->n && !c->stops; i++)
        if (c->workers[i].job)
            kill(c->workers[i].pid, SIGTERM);
    c->stops = true;
}

static void tell(struct process_group *c, struct drive_job *job, struct error *why)
{
    int err = job->outcome.err;

    job->done = !err || (err == -EINTR && job->outcome.result.n_lists);
    if (err && err != -EINTR && !c->err)
        c->err = error_say(why, err, "%s", job->outcome.why.text);
    if (job->done) {
        int failed = c->jobs->done(c->jobs->context, job, c->err ? NULL : why);
        c->err = c->err ? c->err : failed;
    }
    if (c->err)
        stop(c);
}

static void finish(struct process_group *c, struct worker *w, struct error *why)
{
    struct drive_job *job = w->job;
    int status = 0;

    while (waitpid(w->pid, &status, 0) < 0 && errno == EINTR)
        ;
    close(w->fd);
    take_outcome(w, status);
    free(w->bytes);
    *w = (struct worker){.job = NULL};
    tell(c, job, why);
}

/* Until something came, or it is time to look for Ctrl-C; false: nobody works. */
static bool hear(struct process_group *c, struct error *why)
{
    struct pollfd fds[MOST_SIDE_BY_SIDE];
    size_t busy = 0;

    for (size_t i = 0; i < c->n; i++) {
        fds[i] = (struct pollfd){.fd = c->workers[i].job ? c->workers[i].fd : -1,
                                 .events = POLLIN};
        busy += c->workers[i].job != NULL;
    }
    if (!busy)
        return false;
    if (poll(fds, c->n, LOOK_MS) <= 0)
        return true;
    for (size_t i = 0; i < c->n; i++)
        if (fds[i].revents && receive(&c->workers[i]))
            finish(c, &c->workers[i], why);
    return true;
}

static int run_process_group(struct process_group *c, struct error *why)
{
    do {
        if (interrupt_requested())
            stop(c);
        for (size_t i = 0; i < c->n && c->next < c->jobs->n && !c->stops; i++) {
            if (c->workers[i].job)
                continue;
            c->err = begin(&c->workers[i], &c->jobs->list[c->next++], why);
            if (c->err)
                stop(c);
        }
    } while (hear(c, why));
    return c->err;
}

static int run_here(struct process_group *c, struct error *why)
{
    for (; c->next < c->jobs->n && !c->stops && !interrupt_requested(); c->next++) {
        struct drive_job *job = &c->jobs->list[c->next];
        drive_run(&job->run, &job->outcome);
        if (!job->keeps_moments) {
            free(job->outcome.moments.at);
            job->outcome.moments = (struct drive_moments){.n = 0};
        }
        tell(c, job, why);
    }
    return c->err;
}

int drive_jobs_run(const struct drive_jobs *jobs, struct error *why)
{
    size_t most = jobs->side_by_side < jobs->n ? jobs->side_by_side : jobs->n;
    struct process_group *c = calloc(1, sizeof *c);

    if (!c)
        return error_say(why, -ENOMEM, "out of memory");
    c->jobs = jobs;
    c->n = most < MOST_SIDE_BY_SIDE ? most : MOST_SIDE_BY_SIDE;
    int err = c->n > 1 ? run_process_group(c, why) : run_here(c, why);
    free(c);
    if (!err && interrupt_requested())
        err = error_say(why, -EINTR, "interrupted");
    return err;
}

void drive_jobs_clear(struct drive_jobs *jobs)
{
    for (size_t i = 0; jobs->list && i < jobs->n; i++)
        free(jobs->list[i].outcome.moments.at);
    free(jobs->list);
    *jobs = (struct drive_jobs){.list = NULL};
}
