/* nodes/anlos/bench/drive.c -- `anlos bench drive`: simulated drives, tracked, against
 * what is really there. */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/bench/bench.h"
#include "nodes/anlos/bench/drive_pipe.h"
#include "nodes/anlos/bench/drive_report.h"
#include "nodes/anlos/bench/names.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_file.h"
#include "nodes/rt/objects.h"

#define QUICK_PERIODS 1
#define PERIODS       3

/* Where no launch file is given. */
static const char usual[] = "nodes: [array, scan, dsp, recon, wall, track]\n"
                            "array: {uri: \"sim:the scene\"}\n"
                            "scan: {mode: fixed, background: true}\n"
                            "dsp: {background: recorded}\n"
                            "recon: {frames: {pings: 8, sum: power, every: ping}}\n"
                            "wall: {from: topic}\n";

static int score_drive(struct drive_pipe *p, double seconds, struct drive_score *score,
                       struct drive_moments *moments, struct complaint *why)
{
    double end_s = drive_world_s(p->world.begin_ns) + seconds;
    struct drive_image image = {.t_s = 0.0};
    struct drive_moment moment;
    int err = 0;

    while (!err && image.t_s < end_s && !interrupt_requested()) {
        err = drive_pipe_next(p, &image, why);
        if (err)
            break;
        drive_score_list(score, image.t_s, image.out_s, image.tracks, image.detections,
                         &moment);
        objects_free(image.tracks);
        objects_free(image.detections);
        if (drive_moments_add(moments, &moment))
            err = complain(why, -ENOMEM, "out of memory");
    }
    drive_score_end(score);
    if (!err && interrupt_requested())
        err = complain(why, -EINTR, "interrupted");
    return err;
}

/* "dir/drive-person.yaml": "drive-person". */
static void scene_name(const char *path, char *out, size_t size)
{
    const char *slash = strrchr(path, '/'), *base = slash ? slash + 1 : path;
    const char *dot = strrchr(base, '.');

    snprintf(out, size, "%.*s", dot ? (int)(dot - base) : (int)strlen(base), base);
}

static int run_scene(const struct launchfile *l, const char *scene,
                     const struct bench_options *o, json_t *all, struct complaint *why)
{
    struct drive_score *score = calloc(1, sizeof *score);
    struct drive_moments moments = {NULL, 0, 0};
    struct drive_pipe *p = calloc(1, sizeof *p);
    char name[256];
    size_t periods = o->seeds != BENCH_USUAL_SEEDS ? o->seeds
                     : o->quick                    ? QUICK_PERIODS
                                                   : PERIODS;
    int err = score && p ? drive_pipe_create(p, l, scene, o->threads, why)
                         : complain(why, -ENOMEM, "out of memory");

    scene_name(scene, name, sizeof name);
    if (!err) {
        drive_score_init(score, p->world.room, drive_world_s(p->world.begin_ns));
        err = score_drive(p, (double)periods * room_period_s(p->world.room), score,
                          &moments, why);
    }
    if ((!err || err == -EINTR) && moments.n) {
        drive_print(name, score, moments.n);
        json_object_set_new(all, name, drive_json(score, moments.n));
        int failed = drive_write(o->out, name, &moments, err ? NULL : why);
        err = err ? err : failed;
    }
    if (p)
        drive_pipe_clear(p);
    free(moments.at);
    free(p);
    free(score);
    return err;
}

static int write_json(const json_t *all, const char *folder, struct complaint *why)
{
    struct export_file e;
    int err = export_file_open(&e, folder, "drive.json", why);

    if (err)
        return err;
    if (json_dumpf(all, e.f, JSON_INDENT(2)) || fputc('\n', e.f) == EOF)
        return export_file_abandon(&e, -EIO, why);
    return export_file_commit(&e, why);
}

/* "sim:FILE?options" of a launch file: FILE. */
static int launch_scene(const struct launchfile *l, char *out, size_t size,
                        struct complaint *why)
{
    const char *uri = l->array.uri;

    if (strncmp(uri, "sim:", 4))
        return complain(why, -EINVAL, "%s: array.uri: expected sim:SCENE.yaml, not %s",
                        l->path, uri);
    snprintf(out, size, "%.*s", (int)strcspn(uri + 4, "?"), uri + 4);
    return 0;
}

static int load(struct launchfile **l, const struct bench_options *o,
                struct complaint *why)
{
    int err = o->launch
                  ? launchfile_load(l, o->launch, NULL, why)
                  : launchfile_parse(l, "usual settings", usual, sizeof usual - 1, why);

    if (!err && !(*l)->scan.fixed)
        err = complain(why, -EINVAL, "%s: scan.mode: expected fixed", (*l)->path);
    return err;
}

static int list_scenes(const struct launchfile *l, const struct bench_options *o,
                       char **scenes, struct complaint *why)
{
    char one[PATH_MAX];

    if (!o->scenes && !o->launch)
        return complain(why, -EINVAL, "expected --scenes FILE,... or --launch FILE");
    int err = o->scenes ? 0 : launch_scene(l, one, sizeof one, why);
    if (err)
        return err;
    *scenes = bench_names_split(o->scenes ? o->scenes : one);
    return *scenes ? 0 : complain(why, -ENOMEM, "out of memory");
}

int bench_drive(const struct bench_options *o, struct complaint *why)
{
    struct launchfile *l = NULL;
    json_t *all = json_object();
    char *scenes = NULL;
    int err = all ? load(&l, o, why) : complain(why, -ENOMEM, "out of memory");

    if (!err)
        err = list_scenes(l, o, &scenes, why);
    if (!err)
        err = export_folder(o->out, why);
    if (!err)
        drive_print_head();
    for (const char *s = scenes; !err && *s; s += strlen(s) + 1)
        err = run_scene(l, s, o, all, why);
    if ((!err || err == -EINTR) && json_object_size(all)) {
        int failed = write_json(all, o->out, err ? NULL : why);
        err = err ? err : failed;
    }
    json_decref(all);
    free(scenes);
    launchfile_destroy(l);
    return err;
}
