/* nodes/anlos/speed_error/speed_error.c -- `anlos bench speed-error`: every scene, every
 * method, every case; then growth and noise; then the table and the charts of what there
 * is. */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/bench/bench.h"
#include "nodes/anlos/speed_error/chart.h"
#include "nodes/anlos/speed_error/names.h"
#include "nodes/anlos/speed_error/noise.h"
#include "nodes/anlos/speed_error/results.h"
#include "nodes/anlos/speed_error/table.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/rt/export.h"

#define PATIENCE_S    0.8 /* of one case, for the fastest of some runs */
#define QUICK_LIMIT_S 2.0
#define SEEDS         32
#define QUICK_SEEDS   2

static const char usual_scenes[] = "points,corner_reflectors,letter_H,letters_LT";
static const char quick_scenes[] = "points,letter_H";
static const char quick_methods[] = "fast\0auto\0backprojection\0confocal\0lct\0paper\0";

/* The ones whose growth is measured: on a grid alone, sparse and iterative are not. */
static const char grow[] = "fast\0backprojection\0incoherent\0lct\0paper\0";

struct speed {
    const struct bench_options *options;
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
    const struct bench_options *o = s->options;
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
    const struct bench_options *o = s->options;
    char path[PATH_MAX];
    printf("%s: %s ...\n", name,
           o->recordings && !bench_names_file(name) ? "reading" : "simulating");
    fflush(stdout);
    if (bench_names_file(name))
        return bench_scene_simulate(out, name, o->threads, why);
    if (o->recordings)
        return bench_scene_read(out, o->recordings, name, o->calibration,
                                s->scenes_folder, why);
    int err = bench_scene_write_builtin(name, s->scenes_folder, why);
    if (!err && snprintf(path, sizeof path, "%s/%s.yaml", s->scenes_folder, name) >=
                    (int)sizeof path)
        err = error_say(why, -ENAMETOOLONG, "%s: path too long", s->scenes_folder);
    return err ? err : bench_scene_simulate(out, path, o->threads, why);
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
    const struct bench_options *o = s->options;
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
    const struct bench_options *o = s->options;
    size_t seeds = o->seeds != BENCH_USUAL_SEEDS ? o->seeds
                   : o->quick                    ? QUICK_SEEDS
                                                 : SEEDS;
    struct bench_options simulated = *o;
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

int bench_speed(const struct bench_options *o, struct error *why)
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
