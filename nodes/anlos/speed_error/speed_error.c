/* SPDX-License-Identifier: MIT */
/* nodes/anlos/speed_error/speed_error.c -- `anlos speed-error`: every scene, every
 * method, every case; then growth and noise; then the table and the charts of what there
 * is. */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/recon/options.h"
#include "nodes/anlos/speed_error/names.h"
#include "nodes/anlos/speed_error/noise.h"
#include "nodes/anlos/speed_error/report.h"
#include "nodes/anlos/speed_error/results.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"

#define PATIENCE_S    0.8 /* of one case, for the fastest of some runs */
#define QUICK_LIMIT_S 2.0
#define LIMIT_S       20.0
#define SEEDS         32
#define QUICK_SEEDS   2

static const char usual_scenes[] = "points,corner_reflectors,letter_H,letters_LT";
static const char quick_scenes[] = "points,letter_H";
static const char quick_methods[] = "fast\0auto\0backprojection\0confocal\0lct\0paper\0";

/* The ones whose growth is measured: on a grid alone, sparse and iterative are not. */
static const char grow[] = "fast\0backprojection\0incoherent\0lct\0paper\0";

#define USUAL_SEEDS ((size_t)-1)

struct speed_options {   /* borrow from argv */
    const char *scenes;  /* names or scene files with commas; NULL: the usual ones */
    const char *methods; /* names with commas; NULL: all */
    const char *recordings, *calibration; /* folders, or NULL */
    const char *out;
    double limit_s;
    size_t threads;
    size_t seeds; /* of noise; 0: none */
    bool quick;
};

struct speed {
    const struct speed_options *options;
    char scenes_folder[PATH_MAX];
    char *methods; /* as imager_methods() */
    char *names;   /* of the scenes, in the same way */
    struct bench_results results;
    struct bench_noise noise;
};

/* -- what is to be done -----------------------------------------------------------------
 */

static int choose_scenes(struct speed *s, struct error *why)
{
    const struct speed_options *o = s->options;
    char *known = NULL;
    int err = o->recordings ? bench_scene_list(&known, o->recordings, why) : 0;
    if (err)
        return err;
    if (o->scenes || !known) {
        s->names = bench_names_split(o->scenes  ? o->scenes
                                     : o->quick ? quick_scenes
                                                : usual_scenes);
        err = s->names
                  ? bench_names_check("scene", s->names,
                                      known ? known : bench_scene_builtin_names(), why)
                  : error_say(why, -ENOMEM, "out of memory");
        free(known);
    } else {
        s->names = known;
    }
    return err;
}

static int load_scene(struct bench_scene *out, const struct speed *s, const char *name,
                      struct error *why)
{
    const struct speed_options *o = s->options;
    char path[PATH_MAX];
    printf("%s: %s ...\n", name,
           o->recordings && !bench_names_file(name) ? "reading" : "simulating");
    fflush(stdout);
    if (bench_names_file(name))
        return bench_scene_simulate(out, name, NULL, o->threads, why);
    if (o->recordings)
        return bench_scene_read(out, o->recordings, name, o->calibration,
                                s->scenes_folder, why);
    int err = bench_scene_write_builtin(name, s->scenes_folder, why);
    if (!err && snprintf(path, sizeof path, "%s/%s.yaml", s->scenes_folder, name) >=
                    (int)sizeof path)
        err = error_say(why, -ENAMETOOLONG, "%s: path too long", s->scenes_folder);
    return err ? err : bench_scene_simulate(out, path, NULL, o->threads, why);
}

/* -- the runs ---------------------------------------------------------------------------
 */

static void print_result(const struct bench_result *r)
{
    char setting[160];
    bench_table_setting(&r->c, setting, sizeof setting);
    printf("  %-14s %-44s ", r->c.method, setting);
    if (r->state != BENCH_DONE)
        printf("%s\n", r->note);
    else if (!isnan(r->score.iou))
        printf("%8.3f s  IoU %.3f\n", r->cost.total_s, r->score.iou);
    else
        printf("%8.3f s  lateral %.3f cm\n", r->cost.total_s, 100.0 * r->score.lateral_m);
    fflush(stdout);
}

/* The run that is most like it: the dearest that was made. */
static const struct bench_result *
find_known(const struct speed *s, const struct bench_scene *scene, const char *method)
{
    const struct bench_result *known = NULL;
    for (size_t i = 0; i < s->results.n; i++) {
        const struct bench_result *r = &s->results.r[i];
        if (r->state == BENCH_DONE && !strcmp(r->scene, scene->name) &&
            !strcmp(r->c.method, method) &&
            (!known || r->cost.total_s > known->cost.total_s))
            known = r;
    }
    return known;
}

/* false: it takes too long, and *out says so. */
static bool is_affordable(struct bench_result *out, const struct speed *s,
                          const struct bench_scene *scene, const struct bench_case *c)
{
    const struct bench_result *known = find_known(s, scene, c->method);
    struct grid grid;
    if (!known || bench_case_grid(&grid, scene, c->step))
        return true;
    size_t speakers = (scene->survey.n_speakers - 1) / c->speaker_stride + 1;
    size_t positions = (scene->survey.n_positions - 1) / c->position_stride + 1;
    size_t pairs = speakers * positions * scene->survey.n_microphones;
    double predicted_s = bench_case_predict(c, grid_size(&grid), pairs, known);
    double limit_s = s->options->limit_s;
    if (s->options->quick)
        limit_s = fmin(limit_s, QUICK_LIMIT_S);
    if (predicted_s <= limit_s)
        return true;
    *out = (struct bench_result){
        .c = *c, .state = BENCH_SKIPPED, .voxels = grid_size(&grid), .pairs = pairs};
    memcpy(out->scene, scene->name, sizeof out->scene);
    snprintf(out->note, sizeof out->note,
             "skipped: %.1f s predicted, more than the limit of %g s", predicted_s,
             limit_s);
    return false;
}

/* false: it is to take as long as `fast`, which was not run, and *out says so. */
static bool has_budget(struct bench_result *out, const struct bench_scene *scene,
                       const struct bench_case *c)
{
    if (!c->in_time_of_fast || c->budget_s > 0.0)
        return true;
    *out = (struct bench_result){.c = *c, .state = BENCH_SKIPPED};
    memcpy(out->scene, scene->name, sizeof out->scene);
    snprintf(out->note, sizeof out->note,
             "skipped: no time of fast; name it before auto in --methods");
    return false;
}

static int run_cases(struct speed *s, const struct bench_scene *scene,
                     const struct bench_case *cases, size_t n, struct error *why)
{
    double patience_s = s->options->quick ? 0.0 : PATIENCE_S;
    int err = 0;
    for (size_t i = 0; !err && i < n; i++) {
        struct bench_result r;
        if (has_budget(&r, scene, &cases[i]) && is_affordable(&r, s, scene, &cases[i]))
            err = bench_case_run(&r, scene, &cases[i], patience_s, why);
        if (!err)
            err = bench_results_add(&s->results, &r, why);
        if (!err)
            print_result(&r);
        if (!err && interrupt_requested())
            err = error_say(why, -EINTR, "interrupted");
    }
    return err;
}

/* What is to take as long as `fast` does, which comes before it in the list of methods.
 */
static void settle_budgets(const struct speed *s, const char *scene,
                           struct bench_case *cases, size_t n)
{
    const struct bench_result *fast = bench_results_fast(&s->results, scene);
    for (size_t i = 0; fast && i < n; i++)
        if (cases[i].in_time_of_fast)
            cases[i].budget_s = fast->cost.plan_s + fast->cost.total_s;
}

static int run_scene(struct speed *s, const char *name, bool growth, struct error *why)
{
    const struct speed_options *o = s->options;
    struct bench_case cases[BENCH_MAX_CASES];
    struct bench_scene scene;
    int err = load_scene(&scene, s, name, why);
    if (err)
        return err;
    for (const char *m = s->methods; !err && *m; m += strlen(m) + 1) {
        size_t n = bench_plan(cases, m, o->threads, o->quick);
        settle_budgets(s, scene.name, cases, n);
        err = run_cases(s, &scene, cases, n, why);
    }
    if (!err && growth)
        printf("%s, growth ...\n", name);
    for (const char *m = s->methods; !err && growth && *m; m += strlen(m) + 1) {
        if (!bench_names_have(grow, m))
            continue;
        bench_plan_growth(cases, m, o->threads);
        err = run_cases(s, &scene, cases, BENCH_GROWTH_CASES, why);
    }
    bench_scene_clear(&scene);
    return err;
}

static int run_noise(struct speed *s, struct error *why)
{
    const struct speed_options *o = s->options;
    size_t seeds = o->seeds != USUAL_SEEDS ? o->seeds : o->quick ? QUICK_SEEDS : SEEDS;
    struct speed_options simulated = *o;
    struct speed own = *s;
    struct bench_scene point;
    simulated.recordings = NULL;
    own.options = &simulated;
    int err = load_scene(&point, &own, "point", why);
    if (err)
        return err;
    printf("noise, %zu seeds ...\n", seeds);
    fflush(stdout);
    err = bench_noise_run(&s->noise, &point, s->methods, seeds, o->threads, why);
    bench_scene_clear(&point);
    return err;
}

/* -- what comes of it -------------------------------------------------------------------
 */

static int write_all(const struct speed *s, const char *remark, struct error *why)
{
    const char *out = s->options->out;
    char name[64];
    int err = bench_table_write(&s->results, &s->noise, remark, out, why);
    for (size_t i = 0; !err && i < s->results.n; i++) {
        memcpy(name, s->results.r[i].scene, sizeof name);
        if (!i || strcmp(name, s->results.r[i - 1].scene))
            err = bench_chart_scene(&s->results, name, out, why);
    }
    if (!err)
        err = bench_chart_growth(&s->results, out, why);
    if (!err && s->noise.n_seeds && s->noise.n_methods)
        err = bench_noise_write(&s->noise, out, why);
    if (!err && s->noise.n_seeds && s->noise.n_methods)
        err = bench_chart_noise(&s->noise, out, why);
    return err;
}

static int run_all(struct speed *s, struct error *why)
{
    int err = 0;
    bool first = true;
    for (const char *m = s->names; !err && *m; m += strlen(m) + 1) {
        err = run_scene(s, m, first, why);
        first = false;
    }
    if (!err && s->options->seeds)
        err = run_noise(s, why);
    const char *remark = err == -EINTR ? "Interrupted: this is what was done until then."
                         : s->options->quick
                             ? "A quick run: few methods, few parameters, little "
                               "averaging."
                             : NULL;
    if (err && err != -EINTR)
        return err;
    int written = write_all(s, remark, why);
    if (!written)
        printf("%s: speed-error.csv, speed-error.md and charts%s\n", s->options->out,
               err ? " of what was done until now" : "");
    return written ? written : err;
}

static int run_speed(const struct speed_options *o, struct error *why)
{
    struct speed s = {.options = o};
    char *known = bench_names_all_methods();
    int err = known ? bench_names_methods(&s.methods, o->methods,
                                          o->quick ? quick_methods : NULL, known, why)
                    : error_say(why, -ENOMEM, "out of memory");
    free(known);
    if (!err)
        err = choose_scenes(&s, why);
    if (!err)
        err = snprintf(s.scenes_folder, sizeof s.scenes_folder, "%s/scenes", o->out) <
                      (int)sizeof s.scenes_folder
                  ? export_folder(s.scenes_folder, why)
                  : error_say(why, -ENAMETOOLONG, "%s: path too long", o->out);
    if (!err)
        err = bench_results_open(&s.results, o->out, why);
    if (!err)
        err = run_all(&s, why);
    bench_results_close(&s.results);
    free(s.methods);
    free(s.names);
    return err;
}

/* -- the command line -------------------------------------------------------------------
 */

enum { MAX_THREADS = 256, MAX_SEEDS = 1000000 };

static const char help[] =
    "anlos speed-error -- what error costs in time, measured\n"
    "\n"
    "usage: anlos speed-error [--scenes NAME,...] [--methods NAME,...]\n"
    "                         [--recordings DIR] [--out DIR] [--quick] ...\n"
    "\n"
    "Images scenes whose truth is known by every method, with all and with fewer\n"
    "speakers and positions, on finer and coarser grids, in other bands, with other\n"
    "numbers of iterations and threads: one parameter at a time, of fast also some\n"
    "together; of auto, goals in time and error, each held against the best of fast\n"
    "in that time.  Then it measures how time and memory grow with the work, and how\n"
    "exactly one point is placed in noise beside what is possible at all (Cramer-Rao).\n"
    "\n"
    "  --scenes NAME,...    points, corner_reflectors, letter_H, letters_LT (these four "
    "by\n"
    "                       default), or files as `anlos sim` takes; with --recordings,\n"
    "                       what is in there (by default all)\n"
    "  --methods NAME,...   as of `anlos recon`; default: all and auto\n"
    "  --recordings DIR     takes scenes from a folder, in place of the simulator: NAME "
    "as\n"
    "                       `anlos sim` wrote it (points and corners), or NAME.json,\n"
    "                       NAME_wav/ and NAME_bg_wav/ of the reference simulator\n"
    "  --calibration DIR    the curves of the latter's microphones, with\n"
    "                       channel_mapping.txt\n"
    "  --out DIR            default: out/bench\n"
    "  --limit-s SECONDS    skips a run that is predicted to take longer; default 20\n"
    "  --threads N          at most; default: one for each processor\n"
    "  --seeds N            of noise; default 32, 0: no noise\n"
    "  --quick              few methods and parameters: under a minute\n"
    "  --help               this text\n"
    "\n"
    "files written\n"
    "  speed-error.csv      a line for each run, as soon as it is done\n"
    "  speed-error.md       the same in tables, with machine, compiler and FFTW\n"
    "  speed-error-SCENE    charts, .svg and .png: error over time, Pareto front marked\n"
    "  noise-lateral, noise-depth, noise.csv\n"
    "  growth-time, growth-memory\n"
    "  scenes/              what was simulated, or the surveys of what was read\n"
    "\n"
    "example\n"
    "  anlos speed-error --quick --out /tmp/bench\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or input; 130 stopped by Ctrl-C, "
    "what\n"
    "was done until then is written\n";

static const struct usage_option options[] = {
    {"scenes", USAGE_TEXT(struct speed_options, scenes)},
    {"methods", USAGE_TEXT(struct speed_options, methods),
     .names = recon_sound_method_name, .list = true},
    {"recordings", USAGE_TEXT(struct speed_options, recordings)},
    {"calibration", USAGE_TEXT(struct speed_options, calibration)},
    {"out", USAGE_TEXT(struct speed_options, out), .expected = "a folder"},
    {"limit-s", USAGE_NUMBER(struct speed_options, limit_s, USAGE_ABOVE_0, USAGE_ANY),
     .expected = "seconds above 0"},
    {"threads", USAGE_COUNT(struct speed_options, threads, 1, MAX_THREADS)},
    {"seeds", USAGE_COUNT(struct speed_options, seeds, 0, MAX_SEEDS)},
    {"quick", USAGE_FLAG(struct speed_options, quick)},
    {.name = NULL},
};

int command_speed_error(int argc, char **argv)
{
    struct speed_options o = {.out = "out/bench",
                              .limit_s = LIMIT_S,
                              .seeds = USUAL_SEEDS,
                              .threads = usage_default_threads()};
    struct usage usage = {
        .command = "speed-error", .help = help, .options = options, .into = &o};
    struct error why = {""};
    int code = usage_next(&usage, argc, argv);

    if (code)
        return ~code;
    if (optind < argc)
        return usage_error("speed-error", "%s: unexpected argument", argv[optind]);
    interrupt_catch();
    return usage_outcome("speed-error", run_speed(&o, &why), &why);
}
