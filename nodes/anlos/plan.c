/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/pool.h"
#include "hal/room/scene.h"
#include "hal/survey/file.h"
#include "hal/survey/rig_file.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_chart.h"
#include "recon/planning/scan_plan.h"
#include "recon/processing.h"

#define MAX_THREADS 256

static const char help[] =
    "anlos plan -- what a scan of so many seconds will resolve, and how it goes best\n"
    "\n"
    "usage: anlos plan --survey FILE | --scene FILE | --rig FILE [options]\n"
    "\n"
    "Looks at every way to scan: with a stage that stops at each position or goes on\n"
    "without, with slots as they are or as short as the gate allows, with one speaker\n"
    "or two at a time, with all positions or fewer; computes how long each takes and\n"
    "the image that it will give of one point; says which suits, and what to write\n"
    "into a launch file for it.  Nothing is recorded.\n"
    "\n"
    "  --survey FILE   the array, its stage, chirp and slots, and how far it is to see\n"
    "                  (gate_m)\n"
    "  --scene FILE    the same of a scene of the simulator\n"
    "  --rig FILE      the same of a rig on a sound card\n"
    "  --time-s T      at most so long for one pass: the most exact way is taken\n"
    "  --error-cm X    a point's place, across, is to be as exact as this: the\n"
    "                  quickest way is taken\n"
    "  --snr-db X      raw signal to noise of a recording as it is now: power of the\n"
    "                  echoes over that of the noise; by default there is no noise\n"
    "  --at X,Y,Z      where the point is, m, array frame, as imaged; by default half\n"
    "                  way from the middle of the volume to its edge\n"
    "  --far-m X       how far it is to see, in place of the gate's end: nearer, and\n"
    "                  slots may be shorter; what is farther off is heard as if nearer\n"
    "  --stage V,A,S   what the stage can do: m/s, m/s2, and s that it takes to settle;\n"
    "                  0.2,0.5,0.15 by default\n"
    "  --reach A,B     from where to where the stage can be, m: one that goes on gets "
    "up\n"
    "                  to speed before its positions and brakes behind them; -0.05,2 by\n"
    "                  default; both --stage and this, as the simulated one\n"
    "  --out DIR       also writes plan.json, and draws error and sidelobes over time:\n"
    "                  plan-error and plan-sidelobes, .svg and .png\n"
    "  --threads N     1..256, default: one for each processor\n"
    "  --help          this text\n"
    "\n"
    "columns\n"
    "  takes s         one pass, with the way to its beginning; a background recorded\n"
    "                  by the same scan is another, and the way back\n"
    "  cm/s            of a stage that goes on, while it records\n"
    "  width           of the point's image, at -6 dB: what is closer is one\n"
    "  sidelobes       the strongest beside the point, dB over it: fainter objects may\n"
    "                  be one.  Over 2 dB more than now is too much.\n"
    "  noise           dB more than with all positions\n"
    "  error cm        of the point's place, across: what noise and motion make of it\n"
    "\n"
    "example\n"
    "  anlos plan --scene launch/scenes/corner.yaml --time-s 20\n"
    "\n"
    "exit codes: 0 done; 1 there is no such way, or failed; 2 bad arguments or file\n";

struct request {
    const char *path, *out; /* out: NULL: nowhere */
    int kind;               /* 's' a survey, 'S' a scene, 'r' a rig */
    struct scan_plan_config plan;
    double far_m; /* 0: the gate's */
    bool has_at;
    size_t threads;
};

#define ABOVE_0(field)                                                                   \
    USAGE_NUMBER(struct request, field, USAGE_ABOVE_0, USAGE_ANY),                       \
        .expected = "a number above 0"

static const struct usage_option options[] = {
    {"survey", USAGE_VALUE('s')},
    {"scene", USAGE_VALUE('S')},
    {"rig", USAGE_VALUE('r')},
    {"time-s", ABOVE_0(plan.time_s)},
    {"error-cm", ABOVE_0(plan.error_m), .unit = 0.01},
    {"snr-db", USAGE_NUMBER(struct request, plan.snr_db, -USAGE_ANY, USAGE_ANY),
     .expected = "a number"},
    {"at", USAGE_VALUE('a')},
    {"far-m", ABOVE_0(far_m)},
    {"stage", USAGE_VALUE('g')},
    {"reach", USAGE_VALUE('R')},
    {"out", USAGE_TEXT(struct request, out)},
    {"threads", USAGE_COUNT(struct request, threads, 1, MAX_THREADS)},
    {.name = NULL},
};

/* 0, or an exit code. */
static int take_stage(struct scan_stage *stage, const char *text)
{
    double v[3];
    if (usage_numbers(text, 3, v) || !(v[0] > 0 && v[1] > 0 && v[2] >= 0))
        return usage_error("plan",
                           "--stage %s: expected speed, acceleration and the time to "
                           "settle in m/s, m/s2 and s: 0.2,0.5,0.15",
                           text);
    stage->speed_m_s = v[0];
    stage->acceleration_m_s2 = v[1];
    stage->settle_s = v[2];
    return 0;
}

/* 0, or an exit code. */
static int take_reach(struct scan_stage *stage, const char *text)
{
    double *v = stage->reach_m;
    if (usage_numbers(text, 2, v) || !(v[0] < v[1]))
        return usage_error("plan", "--reach %s: expected two places in m: -0.05,2", text);
    return 0;
}

/* 0, or an exit code. */
static int take_option(struct request *q, int code)
{
    switch (code) {
    case 'a':
        q->has_at = true;
        return usage_numbers(optarg, 3, q->plan.at_m)
                   ? usage_error("plan", "--at %s: expected X,Y,Z in m", optarg)
                   : 0;
    case 'g':
        return take_stage(&q->plan.stage, optarg);
    case 'R':
        return take_reach(&q->plan.stage, optarg);
    default:
        if (q->path)
            return usage_error("plan", "expected one of --survey, --scene and --rig");
        q->kind = code;
        q->path = optarg;
        return 0;
    }
}

static int load(struct survey *out, const struct request *q, struct error *why)
{
    struct scene *scene = NULL;
    struct rig rig;
    int err;
    if (q->kind == 's')
        return survey_load(out, q->path, why);
    if (q->kind == 'S') {
        err = scene_load(&scene, out, q->path, why);
        scene_free(scene);
        return err;
    }
    err = rig_load(&rig, q->path, why);
    if (err)
        return err;
    err = survey_copy(out, &rig.survey);
    rig_clear(&rig);
    return err ? error_say(why, err, "out of memory") : 0;
}

static int set_far(struct survey *s, double far_m, struct error *why)
{
    if (!s->has_gate && !(far_m > 0.0))
        return 0;
    if (!s->has_gate) {
        struct processing p;
        int err = processing_plan(&p, s, why);
        if (err)
            return err;
        s->gate_m[0] = p.gate_m[0];
        s->has_gate = true;
    }
    if (far_m > 0.0)
        s->gate_m[1] = far_m;
    return survey_check(s, why);
}

/* Half way from the middle to the edge, in the middle of the depth. */
static int choose_point(double at_m[3], const struct survey *s, struct error *why)
{
    struct processing p;
    int err = processing_plan(&p, s, why);
    for (int a = 0; !err && a < 3; a++)
        at_m[a] = p.grid.origin_m[a] +
                  (a < 2 ? 0.75 : 0.5) * p.grid.step_m[a] * (double)(p.grid.n[a] - 1);
    return err;
}

/* -- what comes of it -------------------------------------------------------------------
 */

/* How wide it is along an axis of which there is an image; else NAN. */
static double width_cm(const struct scan_way *w, const struct survey *s, int axis)
{
    bool flat = s->has_volume && s->volume_m[axis][0] == s->volume_m[axis][1];
    return flat ? NAN : 100.0 * w->image.width_m[axis];
}

static double more_noise_db(const struct scan_way *w, const struct scan_plan *p)
{
    return 10.0 * log10(p->whole.traces / w->image.traces);
}

static void print_way(const struct scan_way *w, const struct scan_plan *p,
                      const struct survey *s)
{
    const char *remark = w == p->best ? "<- this" : w->why_not;
    printf("%-8s %7.1f %8zu %9zu %7.1f", w->continuous ? "goes on" : "stops",
           1e3 * (double)w->slot_samples / s->sample_rate_hz, w->together, w->n_positions,
           w->time_s);
    if (w->continuous)
        printf(" %6.2f ", 100.0 * fabs(w->speed_m_s));
    else
        printf(" %6s ", "");
    for (int a = 0; a < 3; a++)
        if (isfinite(width_cm(w, s, a)))
            printf(" %4.1f", width_cm(w, s, a));
        else
            printf(" %4s", "-");
    printf("  %9.1f %8.1f %8.2f%s%s\n", -w->image.sidelobe_db, more_noise_db(w, p),
           100.0 * w->error_m, remark[0] ? "  " : "", remark);
}

/* Could the stage go this way, were there more time? */
static bool takes_long(const struct scan_way *w)
{
    return !strcmp(w->why_not, SCAN_TOO_SLOW);
}

/* What was not computed: the stage or the chirp does not allow it, or the time. */
static void print_others(const struct scan_plan *p)
{
    const struct scan_way *first = NULL;
    size_t slow = 0, cannot = 0;
    for (size_t i = 0; i < p->n_ways; i++) {
        const struct scan_way *w = &p->ways[i];
        if (w->image.traces > 0.0)
            continue;
        if (takes_long(w)) {
            slow++;
        } else {
            first = first ? first : w;
            cannot++;
        }
    }
    if (slow)
        printf("%zu more take%s longer\n", slow, slow > 1 ? "" : "s");
    if (cannot)
        printf("%zu more cannot be had%s: %s\n", cannot,
               cannot > 1 ? ", the first of them" : "", first->why_not);
}

static void print_table(const struct scan_plan *p, const struct scan_plan_config *cfg)
{
    bool begun = false;
    for (size_t i = 0; i < p->n_ways; i++) {
        const struct scan_way *w = &p->ways[i];
        if (!(w->image.traces > 0.0))
            continue;
        if (!begun)
            printf("a point at %.2f, %.2f, %.2f m, its echo %s noise; sidelobes and "
                   "noise in dB\n%-8s %7s %8s %9s %7s %6s  %14s  %9s %8s %8s\n",
                   cfg->at_m[0], cfg->at_m[1], cfg->at_m[2],
                   isfinite(cfg->snr_db) ? "in" : "without", "stage", "slot ms",
                   "together", "positions", "takes s", "cm/s", "width x y z cm",
                   "sidelobes", "noise", "error cm");
        begun = true;
        print_way(w, p, cfg->survey);
    }
    print_others(p);
}

/* Why none will do, and what would help. */
static void print_none(const struct scan_plan *p, const struct scan_plan_config *cfg)
{
    double quickest_s = INFINITY, least_m = INFINITY;
    bool any = false;
    for (size_t i = 0; i < p->n_ways; i++) {
        const struct scan_way *w = &p->ways[i];
        bool computed = w->image.traces > 0.0;
        bool quiet = w->image.sidelobe_db >= p->whole.sidelobe_db - SCAN_SIDELOBES_DB;
        any = any || computed;
        if (computed && quiet)
            least_m = fmin(least_m, w->error_m);
        if (takes_long(w))
            quickest_s = fmin(quickest_s, w->time_s);
    }
    printf("none will do: ");
    if (isfinite(least_m))
        printf("the most exact of these is %.2f cm off; allow more with --error-cm%s\n",
               100.0 * least_m, isfinite(cfg->time_s) ? ", or more time" : "");
    else if (any)
        printf("the sidelobes of these are over %.0f dB above those of the scan as it "
               "is; allow more time, or see less far (--far-m), with shorter slots\n",
               SCAN_SIDELOBES_DB);
    else if (isfinite(quickest_s))
        printf("the quickest takes %.1f s; allow more with --time-s, or see less far "
               "(--far-m), with shorter slots\n",
               quickest_s);
    else
        printf("the stage or the chirp allows none; --stage says what it can do\n");
}

/* Only what is not as the file has it. */
static void print_options(const struct scan_way *w, const struct survey *s, char between)
{
    if (w->slot_samples != s->slot_samples) {
        printf("%cslot_samples=%zu", between, w->slot_samples);
        between = '&';
    }
    if (w->together != (s->together > 1 ? s->together : 1)) {
        printf("%ctogether=%zu", between, w->together);
        between = '&';
    }
    if (w->alternates != s->chirp_alternates) {
        printf("%calternates=%s", between, w->alternates ? "yes" : "no");
        between = '&';
    }
    if (w->n_positions != s->n_positions) {
        printf("%cpositions=%zu", between, w->n_positions);
        between = '&';
    }
    if (w->continuous != s->continuous)
        printf("%ccontinuous=%s", between, w->continuous ? "yes" : "no");
}

static void print_launch(const struct scan_way *w, const struct request *q,
                         const struct survey *s)
{
    printf("in a launch file, %s:\n  array: {uri: \"",
           q->kind == 'r' ? "with your card as DEVICE and the rig's path from there"
                          : "with the scene's path from there; or for anlos sim, from "
                            "behind sim: on");
    if (q->kind == 'r')
        printf("alsa:DEVICE?rig=%s", q->path);
    else
        printf("sim:%s", q->kind == 'S' ? q->path : "SCENE");
    print_options(w, s, q->kind == 'r' ? '&' : '?');
    printf("\"}\n");
}

static int print(const struct scan_plan *p, const struct request *q,
                 const struct survey *s)
{
    const struct scan_way *w = p->best;
    print_table(p, &q->plan);
    if (!w) {
        print_none(p, &q->plan);
        usage_flush("plan");
        return EXIT_FAILED;
    }
    printf("%.1f s a pass", w->time_s);
    if (w->continuous)
        printf(", the stage goes from %.3f to %.3f m, through at %.1f cm/s", w->room_m[0],
               w->room_m[1], 100.0 * fabs(w->speed_m_s));
    printf("; two points are told apart that are");
    const char *before = " ", *after = " apart";
    for (int a = 0; a < 3; a++) {
        static const char *const along[] = {"along x", "along y", "in depth"};
        if (!isfinite(width_cm(w, s, a)))
            continue;
        printf("%s%.1f cm%s %s", before, width_cm(w, s, a), after, along[a]);
        before = ", ";
        after = "";
    }
    printf("\n");
    print_launch(w, q, s);
    return usage_flush("plan");
}

/* -- files ------------------------------------------------------------------------------
 */

static json_t *way_json(const struct scan_way *w, const struct scan_plan *p,
                        const struct survey *s)
{
    bool computed = w->image.traces > 0.0;
    double width_m[3];
    for (int a = 0; a < 3; a++)
        width_m[a] = computed ? 0.01 * width_cm(w, s, a) : NAN;
    return json_pack("{sb, sf, sI, sI, sI, so, so, so, so, so, so, ss, sb}", "continuous",
                     w->continuous, "slot_s", (double)w->slot_samples / s->sample_rate_hz,
                     "slot_samples", (json_int_t)w->slot_samples, "together",
                     (json_int_t)w->together, "positions", (json_int_t)w->n_positions,
                     "time_s", export_real(w->time_s > 0.0 ? w->time_s : NAN),
                     "speed_m_s", export_real(w->continuous ? fabs(w->speed_m_s) : NAN),
                     "width_m", export_reals(width_m, 3), "sidelobe_db",
                     export_real(computed ? -w->image.sidelobe_db : NAN), "noise_db",
                     export_real(computed ? more_noise_db(w, p) : NAN), "error_m",
                     export_real(computed ? w->error_m : NAN), "why_not", w->why_not,
                     "best", w == p->best);
}

static int write_json(const char *folder, const struct scan_plan *p,
                      const struct scan_plan_config *cfg, struct error *why)
{
    json_t *ways = json_array();
    for (size_t i = 0; i < p->n_ways; i++)
        json_array_append_new(ways, way_json(&p->ways[i], p, cfg->survey));
    json_t *all = json_pack("{so, so, so, so, so}", "at_m", export_reals(cfg->at_m, 3),
                            "time_s", export_real(cfg->time_s), "error_m",
                            export_real(cfg->error_m > 0.0 ? cfg->error_m : NAN),
                            "snr_db", export_real(cfg->snr_db), "ways", ways);
    int err = export_json(folder, "plan.json", all, why);
    json_decref(all);
    return err;
}

enum { KINDS = 4 }; /* that stop or go on, with one speaker at a time or two */

static size_t kind_of(const struct scan_way *w)
{
    return 2 * (size_t)w->continuous + (w->together > 1);
}

static int draw(const char *folder, bool sidelobes, const struct scan_plan *p,
                struct error *why)
{
    static const char *const names[KINDS] = {"stops", "stops, two speakers at a time",
                                             "goes on",
                                             "goes on, two speakers at a time"};
    static const enum chart_style styles[KINDS] = {CHART_RINGS, CHART_SQUARES,
                                                   CHART_POINTS, CHART_DIAMONDS};
    double x[KINDS][SCAN_WAYS], y[KINDS][SCAN_WAYS];
    double most_s = 0.0, low = INFINITY, high = -INFINITY;
    struct chart_series series[KINDS];
    for (size_t k = 0; k < KINDS; k++)
        series[k] =
            (struct chart_series){names[k], x[k], y[k], 0, styles[k], k < 2 ? 0 : 3};
    for (size_t i = 0; i < p->n_ways; i++) {
        const struct scan_way *w = &p->ways[i];
        struct chart_series *of = &series[kind_of(w)];
        if (!(w->image.traces > 0.0))
            continue;
        double value = sidelobes ? -w->image.sidelobe_db : 100.0 * w->error_m;
        x[kind_of(w)][of->n] = w->time_s;
        y[kind_of(w)][of->n++] = value;
        most_s = fmax(most_s, w->time_s);
        low = fmin(low, value);
        high = fmax(high, value);
    }
    if (!(most_s > 0.0))
        return 0;
    const struct chart chart = {
        .title = sidelobes ? "Strongest sidelobe of a point, over the time of a pass"
                           : "Error of a point's place, over the time of a pass",
        .label = {"time of a pass (s)",
                  sidelobes ? "sidelobe (dB)" : "error across (cm)"},
        .min = {0.0, sidelobes ? 5.0 * floor(low / 5.0) : 0.0},
        .max = {10.0 * ceil(most_s / 10.0),
                sidelobes ? fmin(0.0, 5.0 * ceil(high / 5.0 + 0.5)) : 1.5 * high},
        .series = series,
        .n_series = KINDS,
        .legend_right = true,
    };
    return export_chart(folder, sidelobes ? "plan-sidelobes" : "plan-error", &chart, why);
}

static int write_into(const char *out, const struct scan_plan *p,
                      const struct scan_plan_config *cfg, struct error *why)
{
    struct export_stage stage;
    int err = export_stage_begin(&stage, out, why);
    if (err)
        return err;
    err = write_json(stage.path, p, cfg, why);
    if (!err)
        err = draw(stage.path, false, p, why);
    if (!err)
        err = draw(stage.path, true, p, why);
    return export_stage_end(&stage, err, why);
}

static int run(struct request *q)
{
    struct error why = {0};
    struct survey survey;
    struct pool *pool = NULL;
    struct scan_plan plan;
    int code = EXIT_FAILED, err = load(&survey, q, &why);
    if (!err) {
        err = set_far(&survey, q->far_m, &why);
        if (!err && !q->has_at)
            err = choose_point(q->plan.at_m, &survey, &why);
        if (!err && pool_create(&pool, q->threads))
            err = error_say(&why, -ENOMEM, "out of memory");
        q->plan.survey = &survey;
        q->plan.pool = pool;
        if (!err)
            err = scan_plan(&plan, &q->plan, &why);
        if (!err && q->out)
            err = write_into(q->out, &plan, &q->plan, &why);
        if (!err)
            code = print(&plan, q, &survey);
        pool_destroy(pool);
        survey_clear(&survey);
    }
    return err ? usage_outcome("plan", err, &why) : code;
}

int command_plan(int argc, char **argv)
{
    struct request q = {.plan = {.stage = {0.2, 0.5, 0.15, {-0.05, 2.0}},
                                 .time_s = INFINITY,
                                 .snr_db = INFINITY},
                        .threads = usage_default_threads()};
    struct usage usage = {
        .command = "plan", .help = help, .options = options, .into = &q};
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        if ((code = take_option(&q, code)) != 0)
            return code;
    if (code)
        return ~code;
    if (optind < argc)
        return usage_error("plan",
                           "%s: unexpected argument; a file is named by --survey, "
                           "--scene or --rig",
                           argv[optind]);
    if (!q.path)
        return usage_error("plan", "--survey, --scene or --rig is missing");
    return run(&q);
}
