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
#include "recon/planning/scan_plan.h"
#include "recon/processing.h"

#define MAX_THREADS 256

static const char help[] =
    "anlos plan -- what a scan of so many seconds will resolve, and how it goes best\n"
    "\n"
    "usage: anlos plan --survey FILE | --scene FILE | --rig FILE [options]\n"
    "\n"
    "Looks at every way to scan: with a stage that stops at each position or goes on\n"
    "without, with slots as they are or as short as the gate allows, with one speaker "
    "or\n"
    "two at a time, with all positions or fewer; computes how long each takes and the\n"
    "image that it will give of one point; says which suits, and what to write into a\n"
    "launch file for it.  Nothing is recorded.\n"
    "\n"
    "  --survey FILE   the array, its stage, chirp and slots, and how far it is to see\n"
    "                  (gate_m); or the same of a scene (--scene), of a rig (--rig)\n"
    "  --time-s T      at most so long for one pass: the most exact way is taken\n"
    "  --error-cm X    a point's place, across, is to be as exact as this: the quickest\n"
    "                  way is taken\n"
    "  --snr-db X      raw signal to noise of a recording as it is now: power of the\n"
    "                  echoes over that of the noise; by default there is no noise\n"
    "  --at X,Y,Z      where the point is, m, array frame, as imaged; by default half "
    "way\n"
    "                  from the middle of the volume to its edge\n"
    "  --far-m X       how far it is to see, in place of the gate's end: nearer, and "
    "slots\n"
    "                  may be shorter; what stands farther off is heard as if nearer\n"
    "  --stage V,A,S   what the stage can do: m/s, m/s2, and s that it takes to settle;\n"
    "                  0.2,0.5,0.15 by default\n"
    "  --threads N     1..256, default: one for each processor\n"
    "  --help          this text\n"
    "\n"
    "example\n"
    "  anlos plan --scene launch/scenes/corner.yaml --time-s 20\n"
    "\n"
    "exit codes: 0 done; 1 there is no such way, or failed; 2 bad arguments or file\n";

static const struct option options[] = {
    {"survey", required_argument, NULL, 's'},   {"scene", required_argument, NULL, 'S'},
    {"rig", required_argument, NULL, 'r'},      {"time-s", required_argument, NULL, 't'},
    {"error-cm", required_argument, NULL, 'e'}, {"snr-db", required_argument, NULL, 'n'},
    {"at", required_argument, NULL, 'a'},       {"far-m", required_argument, NULL, 'f'},
    {"stage", required_argument, NULL, 'g'},    {"threads", required_argument, NULL, 'T'},
    {"help", no_argument, NULL, 'h'},           {NULL, 0, NULL, 0},
};

struct request {
    const char *path;
    int kind; /* 's' a survey, 'S' a scene, 'r' a rig */
    struct scan_plan_config plan;
    double far_m; /* 0: the gate's */
    bool has_at;
    size_t threads;
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
    *stage = (struct scan_stage){v[0], v[1], v[2]};
    return 0;
}

/* 0, or an exit code. */
static int take_option(struct request *q, int code)
{
    double *number = code == 't'   ? &q->plan.time_s
                     : code == 'e' ? &q->plan.error_m
                     : code == 'f' ? &q->far_m
                                   : NULL;
    const char *name = code == 't' ? "time-s" : code == 'e' ? "error-cm" : "far-m";
    if (number) {
        if (usage_positive(optarg, number))
            return usage_error("plan", "--%s %s: expected a number above 0", name,
                               optarg);
        *number *= code == 'e' ? 0.01 : 1.0;
        return 0;
    }
    switch (code) {
    case 'n':
        return usage_numbers(optarg, 1, &q->plan.snr_db)
                   ? usage_error("plan", "--snr-db %s: expected a number", optarg)
                   : 0;
    case 'a':
        q->has_at = true;
        return usage_numbers(optarg, 3, q->plan.at_m)
                   ? usage_error("plan", "--at %s: expected X,Y,Z in m", optarg)
                   : 0;
    case 'g':
        return take_stage(&q->plan.stage, optarg);
    case 'T':
        return usage_take_count("plan", "threads", optarg, 1, MAX_THREADS, &q->threads);
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

static void print_way(const struct scan_way *w, const struct scan_plan *p,
                      const struct survey *s)
{
    const struct point_image *i = &w->image;
    printf("%-8s %7.1f %8zu %9zu %7.1f", w->continuous ? "goes on" : "stops",
           1e3 * (double)w->slot_samples / s->sample_rate_hz, w->together, w->n_positions,
           w->time_s);
    if (w->continuous)
        printf(" %6.2f", 100.0 * fabs(w->speed_m_s));
    else
        printf(" %6s", "");
    printf("  %4.1f %4.1f %4.1f  %9.1f %8.1f %8.2f", 100.0 * i->width_m[0],
           100.0 * i->width_m[1], 100.0 * i->width_m[2], -i->sidelobe_db,
           10.0 * log10(p->whole.traces / i->traces), 100.0 * w->error_m);
    printf("  %s\n", w == p->best ? "<- this" : w->why_not);
}

static void print_table(const struct scan_plan *p, const struct scan_plan_config *cfg)
{
    size_t slow = 0, cannot = 0;
    printf("a point at %.2f, %.2f, %.2f m, its echo %s noise; sidelobes and noise in "
           "dB,\nnoise more than with all positions\n",
           cfg->at_m[0], cfg->at_m[1], cfg->at_m[2],
           isfinite(cfg->snr_db) ? "in" : "without");
    printf("%-8s %7s %8s %9s %7s %6s  %14s  %9s %8s %8s\n", "stage", "slot ms",
           "together", "positions", "takes s", "cm/s", "width x y z cm", "sidelobes",
           "noise", "error cm");
    for (size_t i = 0; i < p->n_ways; i++) {
        const struct scan_way *w = &p->ways[i];
        if (w->image.traces > 0.0)
            print_way(w, p, cfg->survey);
        else if (w->time_s > cfg->time_s)
            slow++;
        else
            cannot++;
    }
    if (slow)
        printf("%zu more ways take longer\n", slow);
    if (cannot)
        printf("%zu more ask for more than the stage or the chirp allows\n", cannot);
}

/* Only what is not as the file has it. */
static void print_options(const struct scan_way *w, const struct survey *s)
{
    char between = '?';
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
    printf(
        "in the launch file, or what follows the ? behind anlos sim's scene:\n  array: "
        "{uri: \"");
    if (q->kind == 'r')
        printf("alsa:DEVICE?rig=%s", q->path);
    else
        printf("sim:%s", q->kind == 'S' ? q->path : "SCENE");
    print_options(w, s);
    printf("\"}\n");
}

static int print(const struct scan_plan *p, const struct request *q,
                 const struct survey *s)
{
    print_table(p, &q->plan);
    if (!p->best) {
        printf("none will do: allow more time or a larger error, or --far-m nearer\n");
        return EXIT_FAILED;
    }
    const struct scan_way *w = p->best;
    printf("%.1f s a pass", w->time_s);
    if (w->continuous)
        printf(", the stage goes through at %.1f cm/s", 100.0 * fabs(w->speed_m_s));
    printf("; two points are told apart that are %.1f cm apart along x, %.1f along y, "
           "%.1f in depth\n",
           100.0 * w->image.width_m[0], 100.0 * w->image.width_m[1],
           100.0 * w->image.width_m[2]);
    print_launch(w, q, s);
    return EXIT_WORKED;
}

static int run(struct request *q)
{
    struct error why = {0};
    struct survey survey;
    struct pool *pool = NULL;
    struct scan_plan plan;
    int code = EXIT_BAD_INPUT, err = load(&survey, q, &why);
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
        if (!err)
            code = print(&plan, q, &survey);
        pool_destroy(pool);
        survey_clear(&survey);
    }
    if (!err)
        return code;
    fprintf(stderr, "anlos plan: %s\n", why.text);
    return err == -ENOMEM ? EXIT_FAILED : EXIT_BAD_INPUT;
}

int command_plan(int argc, char **argv)
{
    struct usage usage = {.command = "plan", .help = help, .options = options};
    struct request q = {
        .plan = {.stage = {0.2, 0.5, 0.15}, .time_s = INFINITY, .snr_db = INFINITY},
        .threads = usage_default_threads()};
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        if ((code = take_option(&q, code)) != 0)
            return code;
    if (code)
        return ~code;
    if (optind < argc)
        return usage_error("plan", "%s: unexpected argument", argv[optind]);
    if (!q.path)
        return usage_error("plan", "--survey, --scene or --rig is missing");
    return run(&q);
}
