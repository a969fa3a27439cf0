/* SPDX-License-Identifier: MIT */
/* tests/bench/bench_drive.c -- simulated drives, tracked, against what is really there.
 * `anlos bench drive` runs it. */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hal/room/room.h"
#include "nodes/anlos/score/drive_report.h"
#include "nodes/anlos/speed_error/names.h"
#include "nodes/anlos/stopwatch.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"
#include "tests/bench/drive_jobs.h"

/* How far many drives are, on stderr: on a terminal one line that changes, elsewhere a
 * line now and then. */

struct drive_progress {
    size_t n, done, n_false_tracks;
    double seconds; /* simulated so far */
    double began_s, told_s;
    bool terminal;
};

#define EVERY_S 60.0 /* where it is not a terminal */

static double now_s(void)
{
    return stopwatch_now(false).wall_s;
}

static void drive_progress_begin(struct drive_progress *p, size_t n)
{
    double s = now_s();

    *p = (struct drive_progress){
        .n = n, .began_s = s, .told_s = s, .terminal = isatty(STDERR_FILENO)};
}

/* One more drive, of seconds, is done. */
static void drive_progress_add(struct drive_progress *p, double seconds,
                               size_t n_false_tracks)
{
    double s = now_s();

    p->done++;
    p->seconds += seconds;
    p->n_false_tracks += n_false_tracks;
    if (p->done == p->n || (!p->terminal && s - p->told_s < EVERY_S))
        return;
    p->told_s = s;
    double left_s = (s - p->began_s) / (double)p->done * (double)(p->n - p->done);
    fprintf(stderr, "%s%zu of %zu drives, %.2f h, %zu false tracks; %.0f s left%s",
            p->terminal ? "\r\033[K" : "", p->done, p->n, p->seconds / 3600.0,
            p->n_false_tracks, left_s, p->terminal ? "" : "\n");
}

/* Takes the line away, where something else is to be printed. */
static void drive_progress_clear(const struct drive_progress *p)
{
    if (p->terminal)
        fputs("\r\033[K", stderr);
}

enum { QUICK_SEEDS = 1, SEEDS = 3, MAX_DRIVES = 1000000, MAX_THREADS = 256 };

struct drive_options {  /* borrow from argv */
    const char *scenes; /* files with commas; NULL: that of the launch file */
    const char *launch; /* NULL: usual settings */
    const char *out;
    size_t threads;
    size_t seeds;  /* drives of each scene; 0: the usual number */
    double hours;  /* as many as take so long; 0: seeds says it */
    size_t rounds; /* of the scene in each */
    size_t jobs;   /* side by side */
    bool quick;
};

/* Where no launch file is given. */
static const char usual[] = "nodes: [array, scan, dsp, recon, wall, track]\n"
                            "array: {uri: \"sim:the scene\"}\n"
                            "scan: {mode: fixed, background: true}\n"
                            "dsp: {background: recorded}\n"
                            "recon: {frames: {pings: 8, sum: power, every: ping}}\n"
                            "wall: {from: topic}\n";

struct drives {
    const struct drive_options *o;
    struct launchfile *launch;
    char *scenes;           /* names, each ended by a zero */
    size_t n_seeds;         /* of each scene */
    struct drive_jobs jobs; /* scene after scene, draw after draw */
    struct drive_progress progress;
    FILE *csv;
    size_t n_printed; /* jobs whose scene is printed */
    json_t *all;
};

/* A scene's drives, as far as they are done. */
static void print_scene(struct drives *d, size_t first)
{
    struct drive_tally tally;
    char name[256];

    drive_tally_init(&tally);
    for (size_t i = first; i < first + d->n_seeds; i++)
        if (d->jobs.list[i].done)
            drive_tally_add(&tally, &d->jobs.list[i].outcome.result);
    if (!tally.n)
        return;
    drive_name(d->jobs.list[first].run.scene, name, sizeof name);
    drive_progress_clear(&d->progress);
    drive_print(name, &tally);
    json_object_set_new(d->all, name, drive_json(&tally));
}

/* Of all scenes: is what was stated true? */
static int tell_existence(const struct drives *d, struct error *why)
{
    struct drive_tally tally;

    drive_tally_init(&tally);
    for (size_t i = 0; i < d->jobs.n; i++)
        if (d->jobs.list[i].done)
            drive_tally_add(&tally, &d->jobs.list[i].outcome.result);
    drive_print_existence(&tally.all);
    return drive_write_existence(d->o->out, &tally.all, why);
}

static bool is_complete(const struct drives *d, size_t first)
{
    size_t n = 0;

    while (n < d->n_seeds && d->jobs.list[first + n].done)
        n++;
    return n == d->n_seeds;
}

static int take(void *context, struct drive_job *job, struct error *why)
{
    const struct drive_result *r = &job->outcome.result;
    struct drives *d = context;
    char name[256];
    int err = 0;

    drive_name(job->run.scene, name, sizeof name);
    drive_csv_line(d->csv, name, job->run.draw, r);
    if (ferror(d->csv))
        err = error_say(why, -EIO, "%s/drives.csv: %s", d->o->out, strerror(EIO));
    if (!err && job->outcome.moments.n)
        err = drive_write(d->o->out, name, &job->outcome.moments, why);
    drive_progress_add(&d->progress, r->seconds, r->n_false_tracks);
    for (; d->n_printed < d->jobs.n && is_complete(d, d->n_printed);
         d->n_printed += d->n_seeds)
        print_scene(d, d->n_printed);
    return err;
}

/* "sim:FILE?options" of a launch file: FILE. */
static int launch_scene(const struct launchfile *l, char *out, size_t size,
                        struct error *why)
{
    const char *uri = l->array.uri;

    if (strncmp(uri, "sim:", 4))
        return error_say(why, -EINVAL, "%s: array.uri: expected sim:SCENE.yaml, not %s",
                         l->path, uri);
    snprintf(out, size, "%.*s", (int)strcspn(uri + 4, "?"), uri + 4);
    return 0;
}

static int load(struct launchfile **l, const struct drive_options *o, struct error *why)
{
    int err = o->launch
                  ? launchfile_load(l, o->launch, NULL, why)
                  : launchfile_parse(l, "usual settings", usual, sizeof usual - 1, why);

    if (!err && !(*l)->scan.fixed)
        err = error_say(why, -EINVAL, "%s: scan.mode: expected fixed", (*l)->path);
    return err;
}

static int list_scenes(struct drives *d, struct error *why)
{
    const struct drive_options *o = d->o;
    char one[PATH_MAX];

    if (!o->scenes && !o->launch)
        return error_say(why, -EINVAL, "expected --scenes FILE,... or --launch FILE");
    int err = o->scenes ? 0 : launch_scene(d->launch, one, sizeof one, why);
    if (err)
        return err;
    d->scenes = bench_names_split(o->scenes ? o->scenes : one);
    return d->scenes ? 0 : error_say(why, -ENOMEM, "out of memory");
}

/* *n: drives of a scene that take o->hours together. */
static int count_drives(const struct drive_options *o, const char *scene, size_t *n,
                        struct error *why)
{
    struct room *room;
    int err = room_load(&room, scene, why);

    if (!err && !room_is_drive(room))
        err = error_say(why, -ENOTSUP, "%s: not a drive: the key \"drive\" is missing",
                        scene);
    double drive_s = err ? 1.0 : (double)o->rounds * room_period_s(room);
    double drives = ceil(o->hours * 3600.0 / drive_s - 1e-9);
    room_destroy(room);
    if (!err && drives > MAX_DRIVES)
        err = error_say(why, -EINVAL, "--hours %g: more than %d drives of %s", o->hours,
                        MAX_DRIVES, scene);
    *n = err ? 0 : (size_t)drives;
    return err;
}

/* The same for all scenes: the shortest takes o->hours. */
static int count_seeds(struct drives *d, struct error *why)
{
    const struct drive_options *o = d->o;
    size_t n, most = 0;

    for (const char *s = d->scenes; *s; s += strlen(s) + 1) {
        int err = count_drives(o, s, &n, why);
        if (err)
            return err;
        most = n > most ? n : most;
    }
    d->n_seeds = o->hours > 0.0 ? most
                 : o->seeds     ? o->seeds
                 : o->quick     ? QUICK_SEEDS
                                : SEEDS;
    return 0;
}

static int make_jobs(struct drives *d, struct error *why)
{
    size_t n_scenes = 0, i = 0;

    for (const char *s = d->scenes; *s; s += strlen(s) + 1)
        n_scenes++;
    d->jobs =
        (struct drive_jobs){.list = calloc(n_scenes * d->n_seeds, sizeof *d->jobs.list),
                            .n = n_scenes * d->n_seeds,
                            .side_by_side = d->o->jobs,
                            .done = take,
                            .context = d};
    if (!d->jobs.list)
        return error_say(why, -ENOMEM, "out of memory");
    for (const char *s = d->scenes; *s; s += strlen(s) + 1)
        for (size_t draw = 0; draw < d->n_seeds; draw++)
            d->jobs.list[i++] = (struct drive_job){
                .run = {d->launch, s, (uint32_t)draw, d->o->rounds, d->o->threads},
                .keeps_moments = draw == 0};
    return 0;
}

static int drives_run(struct drives *d, struct error *why)
{
    int err = load(&d->launch, d->o, why);

    if (!err)
        err = list_scenes(d, why);
    if (!err)
        err = count_seeds(d, why);
    if (!err)
        err = make_jobs(d, why);
    if (!err)
        err = export_folder(d->o->out, why);
    if (!err)
        err = drive_csv_open(&d->csv, d->o->out, why);
    if (err)
        return err;
    drive_print_head();
    drive_progress_begin(&d->progress, d->jobs.n);
    err = drive_jobs_run(&d->jobs, why);
    for (; d->n_printed < d->jobs.n; d->n_printed += d->n_seeds)
        print_scene(d, d->n_printed);
    drive_progress_clear(&d->progress);
    int failed = tell_existence(d, err ? NULL : why);
    err = err ? err : failed;
    failed = drive_json_write(d->all, d->o->out, err ? NULL : why);
    return err ? err : failed;
}

static int run(const struct drive_options *o, struct error *why)
{
    struct drives d = {.o = o, .all = json_object()};
    int err = d.all ? drives_run(&d, why) : error_say(why, -ENOMEM, "out of memory");

    if (d.csv)
        fclose(d.csv);
    drive_jobs_clear(&d.jobs);
    json_decref(d.all);
    free(d.scenes);
    launchfile_destroy(d.launch);
    return err;
}

static const char help[] =
    "anlos bench drive -- how exact tracks are, in simulated drives\n"
    "\n"
    "usage: anlos bench drive [--scenes FILE,...] [--launch FILE]\n"
    "                         [--seeds N | --hours H] [--rounds N] [--jobs N] [--out "
    "DIR]\n"
    "\n"
    "Tracks what hides in simulated drives, at simulated time, and tells how far the\n"
    "tracks are from the truth: of all drives of a scene, and of the worst for each\n"
    "figure; then whether what the vehicle was told on CAN is as sure as it says.\n"
    "Clutter, noise and unknown errors of each drive are its own, and what its scene\n"
    "says to be drawn: places, ways, speeds.  Recorded drives are for `anlos score`.\n"
    "\n"
    "  --scenes FILE,...    as `anlos sim` takes, with the key drive\n"
    "  --launch FILE        settings, and the scene where --scenes has none; default: a\n"
    "                       recorded background, the wall as the vehicle tells it\n"
    "  --seeds N            drives of each scene, 3 or (--quick) 1, the first as its "
    "file\n"
    "                       says\n"
    "  --hours H            as many drives of each scene as take so long\n"
    "  --rounds N           times that each goes through its scene, with the same "
    "clutter;\n"
    "                       default 1\n"
    "  --jobs N             side by side; default: one for each processor\n"
    "  --threads N          for each drive; default 1\n"
    "  --out DIR            default: out/bench\n"
    "  --quick              one drive of each scene\n"
    "  --help               this text\n"
    "\n"
    "files written\n"
    "  drives.csv           a line for each, as soon as it is done\n"
    "  drive.json           all figures of each scene\n"
    "  existence.svg, .png  of all: how often what was stated so surely was true\n"
    "  NAME.csv, .svg, .png     GOSPA and OSPA over time, of its first drive\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or input; 130 stopped by Ctrl-C, "
    "what\n"
    "was done until then is written\n";

static const struct usage_option options[] = {
    {"scenes", USAGE_TEXT(struct drive_options, scenes)},
    {"launch", USAGE_TEXT(struct drive_options, launch)},
    {"seeds", USAGE_COUNT(struct drive_options, seeds, 1, MAX_DRIVES)},
    {"hours", USAGE_NUMBER(struct drive_options, hours, USAGE_ABOVE_0, USAGE_ANY),
     .expected = "hours above 0"},
    {"rounds", USAGE_COUNT(struct drive_options, rounds, 1, MAX_DRIVES)},
    {"jobs", USAGE_COUNT(struct drive_options, jobs, 1, MAX_THREADS)},
    {"threads", USAGE_COUNT(struct drive_options, threads, 1, MAX_THREADS)},
    {"out", USAGE_TEXT(struct drive_options, out), .expected = "a folder"},
    {"quick", USAGE_FLAG(struct drive_options, quick)},
    {.name = NULL},
};

int main(int argc, char **argv)
{
    struct drive_options o = {
        .out = "out/bench", .threads = 1, .rounds = 1, .jobs = usage_default_threads()};
    struct usage usage = {
        .command = "bench drive", .help = help, .options = options, .into = &o};
    struct error why = {""};
    int code = usage_next(&usage, argc, argv);

    if (code)
        return ~code;
    if (optind < argc)
        return usage_error("bench drive", "%s: unexpected argument", argv[optind]);
    if (o.hours > 0.0 && o.seeds)
        return usage_error("bench drive", "--hours and --seeds: expected one of them");
    interrupt_catch();
    return usage_outcome("bench drive", run(&o, &why), &why);
}
