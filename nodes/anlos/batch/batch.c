/* SPDX-License-Identifier: MIT */
/* nodes/anlos/batch/batch.c -- `anlos batch`: many bags, each in a process of its own,
 * because one that ends it costs that bag alone.  The processes are forked and start no
 * program: a version that is installed meanwhile has no part in it. */
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "nodes/anlos/batch/batch.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/stopwatch.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/process.h"
#include "nodes/rt/stop.h"

static const char help[] =
    "anlos batch -- process many recordings, one result each\n"
    "\n"
    "usage: anlos batch MANIFEST --out DIR [--shard I/N] [-j N] [options]\n"
    "       anlos batch merge DIR... [--manifest FILE] [--out FILE] [--plots DIR]\n"
    "\n"
    "Runs `anlos recon --bag` on each bag of the manifest, and `anlos score` where it "
    "says\n"
    "who was there, each bag in a process of its own.  What came of it is a file of one\n"
    "line of JSON in DIR, there whole or not at all, and the same line on standard "
    "output.\n"
    "A bag whose result is there already is left alone, unless the bag, its settings or\n"
    "this program are others by now, or it failed: after an end of any kind the same\n"
    "command goes on where it was.  Tasks of one batch share DIR, each with its shard.\n"
    "\n"
    "  merge            prints what the results in folders come to, two versions beside\n"
    "                   each other, all and by tag: means of the bags, and how many\n"
    "                   of them are lower and higher in the second one\n"
    "\n"
    "  MANIFEST         lines of PATH<tab>key=value<tab>...; '#' begins a comment, "
    "paths\n"
    "                   are seen from the manifest's folder; keys:\n"
    "                     truth=FILE   who was there (anlos score --truth)\n"
    "                     scene=FILE   the same of a recorded simulation (--scenes)\n"
    "                     tag=NAME     to sum up by; again for another one\n"
    "                     launch=FILE  its settings in place of those in the bag\n"
    "                     bytes=N      its size, so that no shard asks the file system\n"
    "  --out DIR        where the results go; made when missing\n"
    "  --shard I/N      only the I-th of N parts of about the same size, I from 1\n"
    "  -j, --jobs N     so many bags side by side; default: one for each processor\n"
    "  --launch FILE    settings of the bags whose line names none\n"
    "  --timeout S      a bag that takes longer is ended and counts as failed; default "
    "3600,\n"
    "                   0: none is\n"
    "  --scratch DIR    what is not done yet goes there, default --out: a disk of this\n"
    "                   machine spares the file system of many some 60 operations a bag\n"
    "  --help           this text\n"
    "\n"
    "of merge\n"
    "  --manifest FILE  its bags and no others; says which have no result\n"
    "  --out FILE       .csv: a line for each bag and version; .json: those and the "
    "means\n"
    "  --plots DIR      error, pd, false_tracks, time (.svg, .png): each bag, the "
    "second\n"
    "                   version over the first\n"
    "\n"
    "examples\n"
    "  find bags -name '*.mcap' -printf '%p\\tbytes=%s\\n' >bags.txt\n"
    "  anlos batch bags.txt --out out/batch\n"
    "  parallel anlos batch bags.txt --out out/batch -j 1 --shard {}/8 ::: $(seq 8)\n"
    "  anlos batch merge out/before out/batch --out table.csv --plots out/plots\n"
    "\n"
    "exit codes: 0 all are done; 1 a bag failed (the others were done), DIR is full,\n"
    "another batch is at work in it, or merge found none for a bag; 2 bad arguments,\n"
    "manifest or results, or a DIR that may not be written; 130 stopped by Ctrl-C, what\n"
    "was done is kept\n";

enum { MOST_JOBS = 256, MOST_SHARDS = 100000, MOST_THREADS = 256, LOOK_MS = 200 };
enum { LOCK_TRIES = 200 }; /* in two seconds */
enum { TIMEOUT_S = 3600, MOST_TIMEOUT_S = 30 * 24 * 3600 };

struct worker {
    pid_t pid;
    int fd;                         /* what it says on stderr */
    const struct manifest_bag *bag; /* NULL: it has none */
    uint64_t inputs;
    char name[RESULT_NAME_SIZE], folder[PATH_MAX];
    char said[4096]; /* the last of it */
    size_t n_said;
    struct timespec started;
    struct stopwatch begun;
    bool overdue; /* it was ended for that */
};

struct batch {
    const char *manifest_path, *scratch_path; /* scratch_path: NULL: none was given */
    struct result_place place;
    size_t shard, n_shards, jobs;
    size_t timeout_s; /* 0: none */
    char shard_name[32];
    char work[PATH_MAX - 512];    /* in the folder of results, where a line gets whole */
    char scratch[PATH_MAX - 512]; /* for what the children leave; may be the same */
    int locks[2];                 /* -1: none */
    struct manifest manifest;
    size_t next; /* bag to look at next */
    size_t n_done, n_before, n_failed;
    struct worker workers[MOST_JOBS];
    bool stops; /* no more are begun */
};

/* -- two batches in one folder ----------------------------------------------------------
 */
/* Who was killed has children that hold his lock, and end with him, but not at once. */
static int lock_soon(int fd, int operation)
{
    const struct timespec pause = {.tv_nsec = 10000000};
    int err = flock(fd, operation | LOCK_NB);

    for (int tries = 0; err && errno == EWOULDBLOCK && tries < LOCK_TRIES; tries++) {
        nanosleep(&pause, NULL);
        err = flock(fd, operation | LOCK_NB);
    }
    return err;
}

static int lock(int *fd, const char *folder, const char *name, int operation,
                struct error *why)
{
    char path[PATH_MAX];

    snprintf(path, sizeof path, "%s/.%s.lock", folder, name);
    *fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (*fd < 0)
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    if (!lock_soon(*fd, operation))
        return 0;
    if (errno == EWOULDBLOCK)
        return error_say(why, -EBUSY,
                         "%s: another batch is at work there%s; wait for it, or name "
                         "another --out",
                         folder, operation == LOCK_SH ? " without --shard" : "");
    fprintf(stderr,
            "anlos batch: %s: no locks on this file system: nothing keeps a "
            "second batch from doing the same work\n",
            folder);
    return 0;
}

/* All of a manifest alone; shards beside each other, but each once. */
static int lock_folder(struct batch *b, struct error *why)
{
    const char *folder = b->place.folder;
    char name[64];

    if (b->n_shards == 1)
        return lock(&b->locks[0], folder, "batch", LOCK_EX, why);
    int err = lock(&b->locks[0], folder, "batch", LOCK_SH, why);
    if (err)
        return err;
    snprintf(name, sizeof name, "shard-%s", b->shard_name);
    err = lock(&b->locks[1], folder, name, LOCK_EX, why);
    return err == -EBUSY
               ? error_say(why, err,
                           "%s: another batch is at work on shard %zu/%zu there", folder,
                           b->shard, b->n_shards)
               : err;
}

static void unlock(struct batch *b)
{
    for (int i = 0; i < 2; i++)
        if (b->locks[i] >= 0)
            close(b->locks[i]);
}

static int remove_one(const char *path, const struct stat *st, int kind, struct FTW *at)
{
    (void)st;
    (void)kind;
    (void)at;
    remove(path);
    return 0;
}

static void remove_all(const char *folder)
{
    nftw(folder, remove_one, 16, FTW_DEPTH | FTW_PHYS);
}

/* -- in the worker's process ------------------------------------------------------------
 */
static int run_recon(const struct batch *b, const struct worker *w)
{
    const struct manifest_bag *bag = w->bag;
    const char *launch = bag->launch ? bag->launch : b->place.launch, *argv[16];
    size_t threads = processors_usable() / b->jobs;
    char number[24];
    int n = 0;

    threads = threads < 1 ? 1 : threads > MOST_THREADS ? MOST_THREADS : threads;
    snprintf(number, sizeof number, "%zu", threads);
    argv[n++] = "recon";
    argv[n++] = "--bag";
    argv[n++] = bag->path;
    argv[n++] = "--out";
    argv[n++] = w->folder;
    argv[n++] = "--threads";
    argv[n++] = number;
    argv[n++] = "--no-image";
    if (bag->truth || bag->scene)
        argv[n++] = "--record";
    if (launch) {
        argv[n++] = "--launch";
        argv[n++] = launch;
    }
    argv[n] = NULL;
    return command_recon(n, (char **)argv);
}

static int run_score(const struct worker *w)
{
    const struct manifest_bag *bag = w->bag;
    char lists[PATH_MAX + 16], out[PATH_MAX + 16];
    const char *argv[] = {"score",
                          "--bag",
                          lists,
                          bag->truth ? "--truth" : "--scenes",
                          bag->truth ? bag->truth : bag->scene,
                          "--out",
                          out,
                          NULL};

    snprintf(lists, sizeof lists, "%s/lists.mcap", w->folder);
    snprintf(out, sizeof out, "%s/score", w->folder);
    return command_score(7, (char **)argv);
}

static _Noreturn void work(const struct batch *b, const struct worker *w, int said,
                           pid_t parent)
{
    int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);

    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent || nowhere < 0 || dup2(nowhere, STDOUT_FILENO) < 0 ||
        dup2(said, STDERR_FILENO) < 0)
        _exit(EXIT_FAILED);
    int code = run_recon(b, w);
    if (!code && (w->bag->truth || w->bag->scene))
        code = run_score(w);
    fflush(NULL);
    _exit(code);
}

/* -- in the first one -------------------------------------------------------------------
 */
static int begin(struct batch *b, struct worker *w, struct error *why)
{
    pid_t self = getpid();
    int ends[2];

    w->n_said = 0;
    w->overdue = false;
    clock_gettime(CLOCK_REALTIME, &w->started);
    w->begun = stopwatch_now(false);
    if (pipe2(ends, O_CLOEXEC))
        return error_say(why, -errno, "pipe: %s", strerror(errno));
    fflush(NULL);
    w->pid = fork();
    if (!w->pid)
        work(b, w, ends[1], self);
    int err = w->pid < 0 ? -errno : 0;
    close(ends[1]);
    w->fd = ends[0];
    if (!err)
        return 0;
    close(ends[0]);
    w->bag = NULL;
    return error_say(why, err, "fork: %s", strerror(-err));
}

/* The line alone on standard output; failures for people too. */
static void tell(struct batch *b, const json_t *line)
{
    char *text = json_dumps(line, JSON_COMPACT | JSON_REAL_PRECISION(9));

    if (text)
        puts(text);
    else
        fprintf(stderr, "anlos batch: a result is not printed: out of memory\n");
    fflush(stdout);
    free(text);
    if (!result_is_failure(line)) {
        b->n_done++;
        return;
    }
    b->n_failed++;
    fprintf(stderr, "anlos batch: %s failed: %s\n",
            json_string_value(json_object_get(line, "job")),
            json_string_value(json_object_get(line, "error")));
}

static int keep(struct batch *b, const struct worker *w, const json_t *line,
                struct error *why)
{
    char temporary[PATH_MAX + 16];

    snprintf(temporary, sizeof temporary, "%s/%s.json", b->work, w->name);
    return result_write(&b->place, w->name, line, temporary, why);
}

/* The next bag that has to be processed; NULL: there is none. */
static int choose(struct batch *b, struct worker *w, struct error *why)
{
    int err = 0;

    w->bag = NULL;
    while (!err && !w->bag && b->next < b->manifest.n) {
        const struct manifest_bag *bag = &b->manifest.bags[b->next++];
        result_name(&b->place, bag, w->name);
        snprintf(w->folder, sizeof w->folder, "%s/%s", b->scratch, w->name);
        w->inputs = result_inputs(&b->place, bag);
        json_t *line = result_load(&b->place, w->name, w->inputs);
        b->n_before += line != NULL;
        if (!line)
            w->bag = bag;
        else if (result_retag(line, bag))
            err = keep(b, w, line, why);
        json_decref(line);
    }
    return err;
}

/* The newest of what it says; false: that was all. */
static bool listen_to(struct worker *w)
{
    size_t room = sizeof w->said - 1;

    if (w->n_said == room) {
        memmove(w->said, w->said + room / 2, room - room / 2);
        w->n_said = room - room / 2;
    }
    ssize_t n = read(w->fd, w->said + w->n_said, room - w->n_said);
    if (n > 0)
        w->n_said += (size_t)n;
    return n > 0 || (n < 0 && errno == EINTR);
}

/* The last line in which a command says something, else the last one. */
static const char *last_sentence(struct worker *w)
{
    const char *last = "", *sentence = NULL;
    char *rest = w->said, *line;

    w->said[w->n_said] = '\0';
    while ((line = strsep(&rest, "\n"))) {
        if (*line)
            last = line;
        if (!strncmp(line, "anlos ", 6))
            sentence = line;
    }
    return sentence ? sentence : last;
}

static int finish(struct batch *b, struct worker *w, struct error *why)
{
    struct result_run run = {.shard = b->shard_name,
                             .started = w->started,
                             .timeout_s = w->overdue ? b->timeout_s : 0};
    struct stopwatch took = {0.0, 0.0};
    int err = 0;

    while (wait4(w->pid, &run.status, 0, &run.used) < 0 && errno == EINTR)
        ;
    close(w->fd);
    stopwatch_lap(&took, &w->begun, false);
    run.wall_s = took.wall_s;
    run.said = last_sentence(w);
    if (!b->stops && !interrupt_requested()) { /* else nobody knows why it ended */
        json_t *line = result_make(&b->place, w->bag, w->inputs, w->folder, &run);
        err = keep(b, w, line, why);
        if (!err)
            tell(b, line);
        json_decref(line);
    }
    remove_all(w->folder);
    w->bag = NULL;
    return err;
}

/* What they have is not kept, and one that hangs would not hear a gentler signal. */
static void stop(struct batch *b)
{
    for (size_t i = 0; i < b->jobs && !b->stops; i++)
        if (b->workers[i].bag)
            kill(b->workers[i].pid, SIGKILL);
    b->stops = true;
}

static void end_overdue(struct batch *b)
{
    for (size_t i = 0; i < b->jobs && b->timeout_s; i++) {
        struct worker *w = &b->workers[i];
        struct stopwatch took = {0.0, 0.0}, begun = w->begun;
        if (!w->bag || w->overdue)
            continue;
        stopwatch_lap(&took, &begun, false);
        w->overdue = took.wall_s > (double)b->timeout_s;
        if (w->overdue)
            kill(w->pid, SIGKILL);
    }
}

/* Until something came, or it is time to look for Ctrl-C; false: nobody works. */
static bool hear(struct batch *b, int *err, struct error *why)
{
    struct pollfd fds[MOST_JOBS];
    size_t busy = 0;

    for (size_t i = 0; i < b->jobs; i++) {
        const struct worker *w = &b->workers[i];
        fds[i] = (struct pollfd){.fd = w->bag ? w->fd : -1, .events = POLLIN};
        busy += w->bag != NULL;
    }
    if (!busy)
        return false;
    if (poll(fds, b->jobs, LOOK_MS) <= 0)
        return true;
    for (size_t i = 0; i < b->jobs; i++) {
        if (!fds[i].revents || listen_to(&b->workers[i]))
            continue;
        int failed = finish(b, &b->workers[i], *err ? NULL : why);
        *err = *err ? *err : failed;
    }
    return true;
}

static int run_bags(struct batch *b, struct error *why)
{
    int err = 0;

    do {
        if (err || interrupt_requested())
            stop(b);
        end_overdue(b);
        for (size_t i = 0; i < b->jobs && !b->stops && !err; i++) {
            struct worker *w = &b->workers[i];
            if (w->bag)
                continue;
            err = choose(b, w, why);
            if (!err && w->bag)
                err = begin(b, w, why);
        }
    } while (hear(b, &err, why) || (err && !b->stops));
    return err;
}

/* -- the command ------------------------------------------------------------------------
 */
static void summary(const struct batch *b, bool whole)
{
    size_t n = b->manifest.n, left = n - b->n_done - b->n_before - b->n_failed;

    fprintf(stderr, "anlos batch: ");
    if (b->n_shards > 1)
        fprintf(stderr, "shard %zu/%zu: ", b->shard, b->n_shards);
    fprintf(stderr, "%zu bag%s: %zu done now, %zu before, %zu failed", n,
            n == 1 ? "" : "s", b->n_done, b->n_before, b->n_failed);
    if (!whole)
        fprintf(stderr, ", %zu left; the same command goes on with them", left);
    fprintf(stderr, "\n");
}

static int make_folders(struct batch *b, struct error *why)
{
    const char *folder = b->place.folder;
    int n = snprintf(b->work, sizeof b->work, "%s/.work-%s", folder, b->shard_name);

    if (n >= (int)sizeof b->work)
        return error_say(why, -ENAMETOOLONG, "%s: path too long", folder);
    remove_all(b->work); /* of one that was killed */
    if (mkdir(b->work, 0777))
        return error_say(why, -errno, "%s: cannot be written: %s", b->work,
                         strerror(errno));
    if (!b->scratch_path) {
        memcpy(b->scratch, b->work, sizeof b->scratch);
        return 0;
    }
    n = snprintf(b->scratch, sizeof b->scratch, "%s/anlos-batch-XXXXXX", b->scratch_path);
    if (n >= (int)sizeof b->scratch)
        return error_say(why, -ENAMETOOLONG, "%s: path too long", b->scratch_path);
    return mkdtemp(b->scratch) ? 0
                               : error_say(why, -errno, "%s: cannot be written: %s",
                                           b->scratch_path, strerror(errno));
}

static int run_locked(struct batch *b, struct error *why)
{
    int err = make_folders(b, why);

    if (!err) {
        err = run_bags(b, why);
        remove_all(b->scratch);
        if (!err && interrupt_requested())
            err = error_say(why, -EINTR, "interrupted");
        summary(b, !err);
    }
    remove_all(b->work);
    return err;
}

static int run(struct batch *b, struct error *why)
{
    int err = manifest_load(&b->manifest, b->manifest_path, why);

    if (!err)
        err = result_program(&b->place.program, why);
    if (!err && manifest_shard(&b->manifest, b->shard, b->n_shards))
        err = error_say(why, -ENOMEM, "out of memory");
    if (!err)
        err = export_folder(b->place.folder, why);
    if (!err)
        err = lock_folder(b, why);
    if (!err)
        err = run_locked(b, why);
    unlock(b);
    manifest_clear(&b->manifest);
    return err;
}

static const struct usage_option options[] = {
    {"out", USAGE_TEXT(struct batch, place.folder)},
    {"shard", USAGE_VALUE('s')},
    {"jobs", USAGE_COUNT(struct batch, jobs, 1, MOST_JOBS), .letter = 'j'},
    {"launch", USAGE_TEXT(struct batch, place.launch)},
    {"timeout", USAGE_COUNT(struct batch, timeout_s, 0, MOST_TIMEOUT_S)},
    {"scratch", USAGE_TEXT(struct batch, scratch_path)},
    {.name = NULL},
};

static int take_shard(struct batch *b, const char *text)
{
    char first[24];
    const char *slash = strchr(text, '/');
    int n = slash ? (int)(slash - text) : 0;

    snprintf(first, sizeof first, "%.*s", n, text);
    if (n >= (int)sizeof first || !slash ||
        usage_count(slash + 1, 1, MOST_SHARDS, &b->n_shards) ||
        usage_count(first, 1, b->n_shards, &b->shard))
        return usage_error("batch", "--shard %s: expected I/N, 1 <= I <= N <= %d", text,
                           MOST_SHARDS);
    return 0;
}

static int take_options(struct batch *b, int argc, char **argv)
{
    struct usage usage = {
        .command = "batch", .help = help, .options = options, .into = b};
    int code, wrong = 0;

    while (!wrong && (code = usage_next(&usage, argc, argv)) > 0)
        wrong = take_shard(b, optarg);
    if (wrong || code)
        return wrong ? ~wrong : code;
    if (optind == argc)
        return ~usage_error("batch", "expected a MANIFEST");
    if (optind + 1 < argc)
        return ~usage_error("batch", "%s: unexpected argument", argv[optind + 1]);
    if (!b->place.folder || !*b->place.folder)
        return ~usage_error("batch", "--out DIR is missing");
    b->manifest_path = argv[optind];
    return 0;
}

int command_batch(int argc, char **argv)
{
    if (argc > 1 && !strcmp(argv[1], "merge"))
        return batch_merge(argc - 1, argv + 1, help);
    struct batch *b = calloc(1, sizeof *b);
    struct error why = {""};

    if (!b)
        return usage_outcome("batch", -ENOMEM, &(struct error){"out of memory"});
    b->locks[0] = b->locks[1] = -1;
    b->shard = b->n_shards = 1;
    b->timeout_s = TIMEOUT_S;
    b->jobs = processors_usable();
    if (b->jobs > MOST_JOBS)
        b->jobs = MOST_JOBS;
    int code = take_options(b, argc, argv);
    if (code) {
        free(b);
        return ~code;
    }
    snprintf(b->shard_name, sizeof b->shard_name, "%zu-of-%zu", b->shard, b->n_shards);
    interrupt_catch();
    code = usage_outcome("batch", run(b, &why), &why);
    if (!code && b->n_failed)
        code = EXIT_FAILED;
    if (!code)
        code = usage_flush("batch");
    free(b);
    return code;
}
