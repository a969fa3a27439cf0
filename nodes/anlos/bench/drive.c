/* nodes/anlos/bench/drive.c -- `anlos bench drive`: simulated drives, tracked, against
 * what is really there. */
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
#include "nodes/anlos/bench/bench.h"
#include "nodes/anlos/score/drive_bag.h"
#include "nodes/anlos/bench/drive_jobs.h"
#include "nodes/anlos/score/drive_report.h"
#include "nodes/anlos/speed_error/names.h"
#include "nodes/anlos/stopwatch.h"
#include "nodes/rt/export.h"

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

/* `anlos bench drive --bag`: recorded drives. */

struct bags {
    const struct bench_options *o;
    struct room *scene;
    struct truth_file *truth;
    struct drive_tally all;
    json_t *json;
    FILE *csv;
};

static int load_truth(struct bags *b, struct error *why)
{
    const struct bench_options *o = b->o;

    if (!o->truth == !o->scenes)
        return error_say(
            why, -EINVAL,
            "--bag: expected who was there: --truth FILE, or --scenes FILE of "
            "a simulated drive");
    if (o->truth)
        return truth_file_load(&b->truth, o->truth, why);
    int err = room_load(&b->scene, o->scenes, why);
    if (!err && !room_is_drive(b->scene))
        err = error_say(why, -ENOTSUP, "%s: not a drive: the key \"drive\" is missing",
                        o->scenes);
    return err;
}

static int score(struct bags *b, const char *bag, struct error *why)
{
    struct drive_outcome out;
    struct drive_tally one;
    char name[256];

    drive_bag(bag, b->scene, b->truth, &out);
    int err = out.err ? error_say(why, out.err, "%s", out.why.text) : 0;
    if (out.result.n_lists && (!err || err == -EINTR)) {
        drive_name(bag, name, sizeof name);
        drive_tally_init(&one);
        drive_tally_add(&one, &out.result);
        drive_tally_add(&b->all, &out.result);
        drive_print(name, &one);
        json_object_set_new(b->json, name, drive_json(&one));
        drive_csv_line(b->csv, name, 0, &out.result);
        int failed = drive_write(b->o->out, name, &out.moments, err ? NULL : why);
        err = err ? err : failed;
    }
    free(out.moments.at);
    return err;
}

static int run(struct bags *b, const char *names, struct error *why)
{
    int err = 0;

    drive_print_head();
    for (const char *s = names; !err && *s; s += strlen(s) + 1)
        err = score(b, s, why);
    if (b->all.n > 1) {
        drive_print("all", &b->all);
        json_object_set_new(b->json, "all", drive_json(&b->all));
    }
    int failed = drive_json_write(b->json, b->o->out, err ? NULL : why);
    return err ? err : failed;
}

/* As bench_drive. */
static int drive_bags(const struct bench_options *o, struct error *why)
{
    struct bags b = {.o = o, .json = json_object()};
    char *names = bench_names_split(o->bags);
    int err = b.json && names ? load_truth(&b, why)
                              : error_say(why, -ENOMEM, "out of memory");

    drive_tally_init(&b.all);
    if (!err)
        err = export_folder(o->out, why);
    if (!err)
        err = drive_csv_open(&b.csv, o->out, why);
    if (!err)
        err = run(&b, names, why);
    if (b.csv)
        fclose(b.csv);
    truth_file_destroy(b.truth);
    room_destroy(b.scene);
    json_decref(b.json);
    free(names);
    return err;
}

/* `anlos bench drive`: simulated drives, tracked, against what is really there. */

enum { QUICK_SEEDS = 1, SEEDS = 3, MAX_DRIVES = 1000000 };

/* Where no launch file is given. */
static const char usual[] = "nodes: [array, scan, dsp, recon, wall, track]\n"
                            "array: {uri: \"sim:the scene\"}\n"
                            "scan: {mode: fixed, background: true}\n"
                            "dsp: {background: recorded}\n"
                            "recon: {frames: {pings: 8, sum: power, every: ping}}\n"
                            "wall: {from: topic}\n";

struct drives {
    const struct bench_options *o;
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

static int load(struct launchfile **l, const struct bench_options *o, struct error *why)
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
    const struct bench_options *o = d->o;
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
static int count_drives(const struct bench_options *o, const char *scene, size_t *n,
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
    const struct bench_options *o = d->o;
    size_t n, most = 0;

    for (const char *s = d->scenes; *s; s += strlen(s) + 1) {
        int err = count_drives(o, s, &n, why);
        if (err)
            return err;
        most = n > most ? n : most;
    }
    d->n_seeds = o->hours > 0.0                  ? most
                 : o->seeds != BENCH_USUAL_SEEDS ? o->seeds
                 : o->quick                      ? QUICK_SEEDS
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
    int failed = drive_json_write(d->all, d->o->out, err ? NULL : why);
    return err ? err : failed;
}

int bench_drive(const struct bench_options *o, struct error *why)
{
    struct drives d = {.o = o, .all = json_object()};
    int err = -ENOMEM;

    if (o->bags)
        err = drive_bags(o, why);
    else if (d.all)
        err = drives_run(&d, why);
    else
        error_say(why, err, "out of memory");
    if (d.csv)
        fclose(d.csv);
    drive_jobs_clear(&d.jobs);
    json_decref(d.all);
    free(d.scenes);
    launchfile_destroy(d.launch);
    return err;
}
