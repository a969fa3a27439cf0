/* SPDX-License-Identifier: MIT */
/* nodes/anlos/doctor/doctor.c -- `anlos doctor`: what is configured, what is present,
 * what is wrong, what to do. */
#include "nodes/anlos/doctor/doctor.h"

#include <errno.h>
#include <jansson.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "dsp/list.h"
#include "hal/clock.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/json_whole.h"
#include "nodes/rt/log.h"
#include "nodes/rt/terminal.h"

/* -- findings ---------------------------------------------------------------------------
 */

static const char *const level_names[] = {"ok", "note", "wrong"};

static struct finding *add(struct findings *f)
{
    if (list_grow(&f->list, f->n, &f->room, sizeof *f->list)) {
        f->full = true;
        return NULL;
    }
    f->list[f->n] = (struct finding){0};
    return &f->list[f->n++];
}

void finding_add(struct findings *f, enum finding_level level, const char *area,
                 const char *format, ...)
{
    struct finding *one = add(f);
    va_list args;

    if (!one)
        return;
    one->level = level;
    snprintf(one->area, sizeof one->area, "%s", area);
    va_start(args, format);
    vsnprintf(one->what, sizeof one->what, format, args);
    va_end(args);
    log_text_clean(one->what);
}

void finding_todo(struct findings *f, const char *format, ...)
{
    va_list args;

    if (!f->n || f->full)
        return;
    struct finding *one = &f->list[f->n - 1];
    va_start(args, format);
    vsnprintf(one->todo, sizeof one->todo, format, args);
    va_end(args);
    log_text_clean(one->todo);
}

static size_t findings_count(const struct findings *f, enum finding_level level)
{
    size_t n = 0;

    for (size_t i = 0; i < f->n; i++)
        n += f->list[i].level == level;
    return n;
}

/* A line for each, what to do below it, and how many there are. */
static void findings_print(const struct findings *f, bool colour, FILE *to)
{
    static const char *const colours[] = {"\033[32m", "\033[33m", "\033[31m"};

    for (size_t i = 0; i < f->n; i++) {
        const struct finding *one = &f->list[i];
        fprintf(to, "%s%-5s%s  %-9s  %s\n", colour ? colours[one->level] : "",
                level_names[one->level], colour ? "\033[0m" : "", one->area, one->what);
        if (one->todo[0])
            fprintf(to, "%18s-> %s\n", "", one->todo);
    }
    if (f->full)
        fprintf(to, "out of memory: some are missing\n");
    fprintf(to, "%zu wrong, %zu to note, %zu ok\n", findings_count(f, FINDING_WRONG),
            findings_count(f, FINDING_NOTE), findings_count(f, FINDING_OK));
}

/* {"findings": [...], "wrong": n, "notes": n}; NULL: no memory. */
static json_t *findings_json(const struct findings *f)
{
    json_t *list = json_array();

    for (size_t i = 0; i < f->n; i++) {
        const struct finding *one = &f->list[i];
        json_array_append_new(list, json_pack("{ss, ss, ss, ss}", "level",
                                              level_names[one->level], "area", one->area,
                                              "what", one->what, "todo", one->todo));
    }
    return json_pack("{so, sI, sI}", "findings", list, "wrong",
                     (json_int_t)findings_count(f, FINDING_WRONG), "notes",
                     (json_int_t)findings_count(f, FINDING_NOTE));
}

/* Adds those of findings_json.  0, -EINVAL: it is something else. */
static int findings_add_json(struct findings *f, const json_t *o)
{
    const json_t *list = json_object_get(o, "findings"), *item;
    size_t i;

    if (!json_is_array(list))
        return -EINVAL;
    json_array_foreach(list, i, item)
    {
        const char *level, *area, *what, *todo;
        int n = FINDING_WRONG;
        if (json_unpack((json_t *)item, "{ss, ss, ss, ss}", "level", &level, "area",
                        &area, "what", &what, "todo", &todo))
            return -EINVAL;
        while (n > FINDING_OK && strcmp(level, level_names[n]))
            n--;
        finding_add(f, (enum finding_level)n, area, "%s", what);
        finding_todo(f, "%s", todo);
    }
    return 0;
}

void findings_clear(struct findings *f)
{
    free(f->list);
    *f = (struct findings){0};
}

#define NS_PER_MS 1000000LL

static void answer(const struct check *c, const void *ctx, int fd)
{
    struct findings f = {0};

    prctl(PR_SET_PDEATHSIG, SIGKILL);
    c->look(ctx, &f);
    json_t *o = findings_json(&f);
    int failed = !json_whole(o) || json_dumpfd(o, fd, JSON_COMPACT);
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
        int64_t left_ns = deadline_ns - clock_monotonic_ns();
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

/* -- the command ------------------------------------------------------------------------
 */

#define DEADLINE_NS 10000000000LL

static const char help[] =
    "anlos doctor -- what is configured, what is present, what is wrong, what to do\n"
    "\n"
    "usage: anlos doctor [--launch FILE [--host NAME]] [--json] [--run-dir DIR]\n"
    "\n"
    "Looks at the machine (cores, memory, clock, limits for real time, buffers of the\n"
    "kernel, libraries and programs), at the run folder and who runs in it, and\n"
    "\n"
    "  --launch FILE   at a launch file: whether it loads, whether each device that it\n"
    "                  names is there, permitted and good enough, room for its results,\n"
    "                  whether its nodes run, and whether this machine keeps the pace\n"
    "                  of its simulated drive.  Without it: which devices there are\n"
    "  --host NAME     which one of the launch file's hosts this machine is\n"
    "\n"
    "  --json          as JSON\n"
    "  --run-dir DIR   where the system's sockets are, default $XDG_RUNTIME_DIR/anlos, "
    "else\n"
    "                  /tmp/anlos-UID\n"
    "  --help          this text\n"
    "\n"
    "Each line is ok, note (it works, but could do better) or wrong, with what to do "
    "about\n"
    "it.  Takes 4 seconds while a system runs and 10 at most, changes nothing, and does\n"
    "not disturb what runs.\n"
    "\n"
    "examples\n"
    "  anlos doctor --launch launch/demo.yaml\n"
    "  anlos doctor --json | jq '.findings[] | select(.level == \"wrong\")'\n"
    "\n"
    "exit codes: 0 nothing is wrong; 1 something is; 2 bad arguments; 130 stopped by\n"
    "Ctrl-C\n";

static const struct usage_option options[] = {
    {"launch", USAGE_TEXT(struct doctor, launch)},
    {"host", USAGE_TEXT(struct doctor, host)},
    {"json", USAGE_SWITCH('j')},
    {"run-dir", USAGE_TEXT(struct doctor, run_dir)},
    {.name = NULL},
};

static const struct check checks[] = {
    {"machine", doctor_machine},  {"clock", doctor_clock},
    {"limits", doctor_limits},    {"libraries", doctor_libraries},
    {"launch", doctor_launch},    {"array", doctor_array},
    {"stage", doctor_stage},      {"can", doctor_can},
    {"view", doctor_view},        {"devices", doctor_present},
    {"run-dir", doctor_run_dir},  {"nodes", doctor_system},
    {"load", doctor_load_budget},
};

#define N_CHECKS (sizeof checks / sizeof *checks)

/* All at once: the slowest decides how long it takes. */
static void look(const struct doctor *d, struct findings *f)
{
    struct check_job jobs[N_CHECKS];
    int64_t deadline_ns = clock_monotonic_ns() + DEADLINE_NS;

    for (size_t i = 0; i < N_CHECKS; i++)
        check_start(&jobs[i], &checks[i], d);
    for (size_t i = 0; i < N_CHECKS; i++)
        check_finish(&jobs[i], &checks[i], deadline_ns, f);
}

static int print(const struct findings *f, bool json)
{
    if (!json) {
        findings_print(f, colour_wanted(STDOUT_FILENO), stdout);
        return usage_flush("doctor");
    }
    return usage_json("doctor", findings_json(f));
}

int command_doctor(int argc, char **argv)
{
    struct doctor d = {0};
    struct findings f = {0};
    struct usage usage = {
        .command = "doctor", .help = help, .options = options, .into = &d};
    bool json = false;
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        json = true;
    if (code)
        return ~code;
    if (d.host && !d.launch)
        return usage_error("doctor", "--host: of which launch file? --launch FILE");
    if (optind < argc)
        return usage_error("doctor",
                           "%s: expected options only; a launch file is "
                           "--launch FILE",
                           argv[optind]);
    look(&d, &f);
    bool failed = print(&f, json) != EXIT_WORKED;
    bool wrong = f.full || findings_count(&f, FINDING_WRONG) > 0;
    findings_clear(&f);
    return failed || wrong ? EXIT_FAILED : EXIT_WORKED;
}
