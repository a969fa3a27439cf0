#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/falloff/job.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_chart.h"
#include "nodes/rt/export_file.h"
#include "recon/falloff.h"

#define MAX_SETS 8

static const char help[] =
    "anlos falloff -- how the power of an echo falls off with distance\n"
    "\n"
    "usage: anlos falloff [--set NAME] RECORDING... [--set NAME RECORDING...] [--out "
    "DIR]\n"
    "\n"
    "Takes from every position of the recordings the strongest echo that the closest "
    "pair\n"
    "of speaker and microphone hears, and fits a straight line to log power over log\n"
    "distance (half the path).  A mirror or a retroreflector has the slope -2, a small "
    "or\n"
    "rough thing -4 (Lindell 2019, Fig. 4 left: a wall -1.89, a corner reflector "
    "-1.92).\n"
    "\n"
    "  RECORDING    a folder as `anlos sim` writes it: survey.yaml, scene/, background/\n"
    "  --set NAME   what follows is a set with a line of its own\n"
    "  --out DIR    also writes falloff.csv, and draws falloff.svg and falloff.png\n"
    "  --help       this text\n"
    "\n"
    "example\n"
    "  anlos sim launch/scenes/falloff-wall.yaml --out /tmp/wall\n"
    "  anlos sim launch/scenes/falloff-corner.yaml --out /tmp/retro\n"
    "  anlos falloff --set wall /tmp/wall --set corner /tmp/retro --out /tmp/falloff\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or recordings\n";

static const struct option options[] = {
    {"set", required_argument, NULL, 's'},
    {"out", required_argument, NULL, 'o'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

struct set {
    const char *name;
    struct falloff_points points;
    struct falloff_fit fit;
};

struct falloff {
    const char *out;
    struct set sets[MAX_SETS];
    size_t n_sets;
};

static void falloff_clear(struct falloff *f)
{
    for (size_t i = 0; i < f->n_sets; i++)
        falloff_points_clear(&f->sets[i].points);
}

static int fit_sets(struct falloff *f, struct complaint *why)
{
    for (size_t i = 0; i < f->n_sets; i++) {
        struct set *s = &f->sets[i];
        if (falloff_fit(&s->fit, s->points.distance_m, s->points.power, s->points.n))
            return complain(
                why, -EINVAL,
                "%s: %zu echo%s; expected two or more distances to fit a line", s->name,
                s->points.n, s->points.n == 1 ? "" : "es");
    }
    return 0;
}

static void print_sets(const struct falloff *f)
{
    for (size_t i = 0; i < f->n_sets; i++) {
        const struct set *s = &f->sets[i];
        printf("%s\n%11s %9s %9s\n", s->name, "distance m", "power dB", "off dB");
        for (size_t k = 0; k < s->points.n; k++) {
            double fitted = s->fit.power_at_1 *
                            pow(s->points.distance_m[k], s->fit.slope);
            printf("%11.3f %9.2f %9.2f\n", s->points.distance_m[k],
                   10.0 * log10(s->points.power[k]),
                   10.0 * log10(s->points.power[k] / fitted));
        }
        printf("slope %.3f +- %.3f over %zu echoes\n", s->fit.slope, s->fit.sigma,
               s->fit.n);
    }
}

static int write_csv(const struct falloff *f, const char *folder, struct complaint *why)
{
    struct export_file e;
    int err = export_file_open(&e, folder, "falloff.csv", why);
    if (err)
        return err;
    fputs("set,distance_m,power_db,slope\n", e.f);
    for (size_t i = 0; i < f->n_sets; i++) {
        const struct set *s = &f->sets[i];
        for (size_t k = 0; k < s->points.n; k++)
            fprintf(e.f, "\"%s\",%.6g,%.4f,%.4f\n", s->name, s->points.distance_m[k],
                    10.0 * log10(s->points.power[k]), s->fit.slope);
    }
    return export_file_commit(&e, why);
}

/* What is drawn: each set relative to its own line's power at the nearest distance. */
struct drawing {
    double near_m, far_m, lowest;
    double line_x[2], line_y[MAX_SETS + 1][2];
    double *relative[MAX_SETS]; /* [points.n] */
    char names[MAX_SETS][96];
    struct chart_series series[2 * MAX_SETS + 1];
    size_t n_series;
};

static int scale_sets(struct drawing *d, const struct falloff *f)
{
    d->near_m = INFINITY;
    for (size_t i = 0; i < f->n_sets; i++)
        for (size_t k = 0; k < f->sets[i].points.n; k++) {
            d->near_m = fmin(d->near_m, f->sets[i].points.distance_m[k]);
            d->far_m = fmax(d->far_m, f->sets[i].points.distance_m[k]);
        }
    d->lowest = pow(d->far_m / d->near_m, -4.0);
    for (size_t i = 0; i < f->n_sets; i++) {
        const struct set *s = &f->sets[i];
        double nearest = s->fit.power_at_1 * pow(d->near_m, s->fit.slope);
        d->relative[i] = malloc(s->points.n * sizeof **d->relative);
        if (!d->relative[i])
            return -ENOMEM;
        for (size_t k = 0; k < s->points.n; k++)
            d->relative[i][k] = s->points.power[k] / nearest;
    }
    return 0;
}

static void add_lines(struct drawing *d, const struct falloff *f)
{
    d->line_x[0] = d->near_m;
    d->line_x[1] = d->far_m;
    for (size_t i = 0; i <= f->n_sets; i++) {
        bool rough = i == f->n_sets; /* the last: for comparison */
        double slope = rough ? -4.0 : f->sets[i].fit.slope;
        d->line_y[i][0] = 1.0;
        d->line_y[i][1] = pow(d->far_m / d->near_m, slope);
        if (!rough)
            snprintf(d->names[i], sizeof d->names[i], "%.60s (%.2f)", f->sets[i].name,
                     slope);
        d->series[d->n_series++] =
            (struct chart_series){.name = rough ? "small or rough (-4)" : d->names[i],
                                  .x = d->line_x,
                                  .y = d->line_y[i],
                                  .n = 2,
                                  .style = rough ? CHART_DASHED : CHART_LINE,
                                  .colour = rough ? CHART_COLOURS - 1 : (int)i};
        if (!rough)
            d->series[d->n_series++] =
                (struct chart_series){.x = f->sets[i].points.distance_m,
                                      .y = d->relative[i],
                                      .n = f->sets[i].points.n,
                                      .style = i % 2 ? CHART_POINTS : CHART_RINGS,
                                      .colour = (int)i};
    }
}

static int draw(const struct falloff *f, const char *folder, struct complaint *why)
{
    struct drawing d = {0};
    int err = scale_sets(&d, f);
    if (!err) {
        add_lines(&d, f);
        const struct chart chart = {
            .title = "Power of the echo over distance",
            .label = {"distance (m)", "power, relative"},
            .logarithmic = {true, true},
            .min = {0.95 * d.near_m, 0.7 * d.lowest},
            .max = {1.05 * d.far_m, 3.0},
            .series = d.series,
            .n_series = d.n_series,
            .legend_right = true,
        };
        err = export_chart(folder, "falloff", &chart, why);
    } else {
        complain(why, err, "out of memory");
    }
    for (size_t i = 0; i < f->n_sets; i++)
        free(d.relative[i]);
    return err;
}

static int write_results(const struct falloff *f, struct complaint *why)
{
    struct export_stage stage;
    int err = export_stage_begin(&stage, f->out, why);
    if (err)
        return err;
    err = write_csv(f, stage.path, why);
    if (!err)
        err = draw(f, stage.path, why);
    if (!err)
        err = export_stage_commit(&stage, why);
    else
        export_stage_abandon(&stage);
    if (!err)
        printf("%s: falloff.csv, falloff.svg, falloff.png\n", f->out);
    return err;
}

/* A recording, or the name of the set that follows. */
static int take_argument(struct falloff *f, int code, const char *text,
                         struct complaint *why)
{
    if (code == 's' || !f->n_sets) {
        if (f->n_sets == MAX_SETS)
            return complain(why, -EINVAL, "--set %s: more than %d sets", text, MAX_SETS);
        f->sets[f->n_sets++].name = code == 's' ? text : "echoes";
    }
    return code == 's' ? 0 : falloff_measure(&f->sets[f->n_sets - 1].points, text, why);
}

int command_falloff(int argc, char **argv)
{
    struct falloff f = {0};
    struct complaint why = {0};
    struct usage usage = {
        .command = "falloff", .help = help, .options = options, .short_options = "-:h"};
    int code = 0, err = 0;

    while (!err && (code = usage_next(&usage, argc, argv)) > 0) {
        if (code == 'o')
            f.out = optarg;
        else
            err = take_argument(&f, code, optarg, &why);
    }
    if (code < 0) {
        falloff_clear(&f);
        return ~code;
    }
    if (!err && !f.n_sets)
        return usage_error("falloff", "expected one RECORDING or more");
    if (!err)
        err = fit_sets(&f, &why);
    if (!err) {
        print_sets(&f);
        if (f.out)
            err = write_results(&f, &why);
    }
    falloff_clear(&f);
    if (!err)
        return EXIT_WORKED;
    fprintf(stderr, "anlos falloff: %s\n", why.text);
    return err == -ENOMEM ? EXIT_FAILED : EXIT_BAD_INPUT;
}
