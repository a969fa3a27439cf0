/* SPDX-License-Identifier: MIT */
/* tests/bench/bench_detection.c -- how often one point in noise is found, by the peak of
 * its image over the mean, at a threshold that noise alone passes in one image of a
 * hundred.  `anlos bench detection` runs it. */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/speed_error/names.h"
#include "nodes/anlos/speed_error/noise.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"
#include "recon/frontend/compressor.h"

#define FALSE_ALARMS 0.01
#define SEEDS        400
#define QUICK_SEEDS  20
#define MAX_SEEDS    1000000
#define MAX_THREADS  256

/* What is searched: the array's footprint, and half a metre of depth around the point. */
#define DEPTH_M 0.25

static const double steps_m[3] = {0.02, 0.02, 0.005};
static const double levels_db[] = {-40, -42, -45, -48, -50, -55};

enum { LEVELS = sizeof levels_db / sizeof *levels_db };

static const char usual[] = "fast\0";

/* Hann keeps sidelobes down, at the price of 1.8 dB of signal to noise. */
static const enum window windows[] = {WINDOW_HANN, WINDOW_RECTANGULAR};

struct detection_options {
    const char *methods; /* names with commas; NULL: fast */
    const char *out;
    struct firing firing;
    size_t threads;
    size_t seeds; /* 0: the usual number */
    bool quick;
};

struct detection {
    enum window window;
    size_t n_methods, n_seeds, room;
    double *statistic; /* [n_methods][LEVELS + 1][room]; the last: of noise alone */
};

static double peak_over_mean_db(const float *v, size_t n)
{
    double sum = 0.0, peak = 0.0;
    for (size_t i = 0; i < n; i++) {
        sum += (double)v[i];
        peak = fmax(peak, (double)v[i]);
    }
    return 10.0 * log10(peak * (double)n / sum);
}

static void run_seed(struct detection *d, struct bench_trials *t)
{
    size_t n = grid_size(&bench_trials_processing(t)->grid);
    double rms = sqrt(2.0 * bench_trials_power(t)); /* of the difference, at 0 dB */
    bench_trials_noise(t, d->n_seeds);
    for (size_t m = 0; m < d->n_methods; m++)
        for (size_t k = 0; k <= LEVELS; k++) {
            double noise = k < LEVELS ? rms * pow(10.0, -levels_db[k] / 20.0) : rms;
            const float *image = bench_trials_image(t, m, k < LEVELS ? 1.0 : 0.0, noise);
            d->statistic[(m * (LEVELS + 1) + k) * d->room + d->n_seeds] =
                peak_over_mean_db(image, n);
        }
    d->n_seeds++;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* What one noise image of a hundred passes. */
static double threshold_db(double *noise, size_t n)
{
    qsort(noise, n, sizeof *noise, compare);
    size_t above = (size_t)floor(FALSE_ALARMS * (double)n);
    return noise[n - 1 - (above < n ? above : n - 1)];
}

static void print_head(FILE *csv)
{
    fputs("method,window,snr_db,seeds,threshold_db,false_alarms,detected\n", csv);
    printf("%-15s %-12s %10s", "method", "window", "threshold");
    for (size_t k = 0; k < LEVELS; k++)
        printf("  Pd %3.0f dB", levels_db[k]);
    printf("\n");
}

static void report(struct detection *d, const char *methods, FILE *csv)
{
    for (size_t m = 0; m < d->n_methods; m++, methods += strlen(methods) + 1) {
        double *all = d->statistic + m * (LEVELS + 1) * d->room;
        double least_db = threshold_db(all + LEVELS * d->room, d->n_seeds);
        printf("%-15s %-12s %7.2f dB", methods, window_name(d->window), least_db);
        for (size_t k = 0; k < LEVELS; k++) {
            size_t found = 0;
            for (size_t i = 0; i < d->n_seeds; i++)
                found += all[k * d->room + i] > least_db;
            double part = (double)found / (double)d->n_seeds;
            printf("  %9.3f", part);
            fprintf(csv, "%s,%s,%g,%zu,%.3f,%g,%.4f\n", methods, window_name(d->window),
                    levels_db[k], d->n_seeds, least_db, FALSE_ALARMS, part);
        }
        printf("\n");
    }
    fflush(stdout);
}

static int run_trials(struct detection *d, const struct bench_scene *point,
                      const char *methods, const struct detection_options *o,
                      struct error *why)
{
    struct geometry g;
    struct bench_trials *t;
    double limits[3][3], min[3], max[3];
    processing_geometry(&g, &point->survey);
    geometry_aperture(&g, min, max);
    for (int a = 0; a < 3; a++) {
        double at_m = point->truth.points_m[0][a];
        limits[a][0] = a < 2 ? min[a] : at_m - DEPTH_M;
        limits[a][1] = a < 2 ? max[a] : at_m + DEPTH_M;
        limits[a][2] = steps_m[a];
    }
    int err = bench_trials_create(&t, point, (const double(*)[3])limits, methods,
                                  d->window, o->threads, why);
    if (err)
        return err;
    for (const char *m = methods; *m; m += strlen(m) + 1)
        d->n_methods++;
    d->statistic = calloc(d->n_methods * (LEVELS + 1) * d->room, sizeof *d->statistic);
    if (!d->statistic)
        err = error_say(why, -ENOMEM, "out of memory");
    while (!err && d->n_seeds < d->room && !interrupt_requested())
        run_seed(d, t);
    bench_trials_destroy(t);
    return err;
}

static int simulate(struct bench_scene *point, const struct detection_options *o,
                    struct error *why)
{
    char folder[PATH_MAX], path[PATH_MAX];
    if (snprintf(folder, sizeof folder, "%s/scenes", o->out) >= PATH_MAX - 16)
        return error_say(why, -ENAMETOOLONG, "%s: path too long", o->out);
    snprintf(path, sizeof path, "%.*s/point.yaml", PATH_MAX - 16, folder);
    int err = export_folder(folder, why);
    if (!err)
        err = bench_scene_write_builtin("point", folder, why);
    return err ? err : bench_scene_simulate(point, path, &o->firing, o->threads, why);
}

static int run_windows(const struct bench_scene *point, const char *methods,
                       const struct detection_options *o, FILE *csv, struct error *why)
{
    size_t seeds = o->seeds ? o->seeds : o->quick ? QUICK_SEEDS : SEEDS;
    int err = 0;
    printf("one point at %.2f m, searched for between %.2f and %.2f m; threshold: one "
           "false alarm in %.0f images, of %zu seeds\n",
           point->truth.points_m[0][2], point->truth.points_m[0][2] - DEPTH_M,
           point->truth.points_m[0][2] + DEPTH_M, 1.0 / FALSE_ALARMS, seeds);
    print_head(csv);
    fflush(stdout);
    for (size_t w = 0; !err && w < sizeof windows / sizeof *windows; w++) {
        struct detection d = {.window = windows[w], .room = seeds};
        err = run_trials(&d, point, methods, o, why);
        if (!err && d.n_seeds)
            report(&d, methods, csv);
        if (!err && d.n_seeds < d.room)
            err = error_say(why, -EINTR, "interrupted after %zu seeds", d.n_seeds);
        free(d.statistic);
    }
    return err;
}

static int run(const struct detection_options *o, struct error *why)
{
    struct bench_scene point;
    struct export_file e;
    char *methods = NULL;
    int err = bench_names_methods(&methods, o->methods, usual, imager_methods(), why);
    if (!err)
        err = simulate(&point, o, why);
    if (!err) {
        err = export_file_open(&e, o->out, "detection.csv", why);
        if (!err) {
            err = run_windows(&point, methods, o, e.f, why);
            err = err && err != -EINTR          ? export_file_abandon(&e, err, why)
                  : export_file_commit(&e, why) ? -EIO
                                                : err;
        }
        bench_scene_clear(&point);
    }
    free(methods);
    return err;
}

static const char help[] =
    "anlos bench detection -- how often one point is found in how much noise\n"
    "\n"
    "usage: anlos bench detection [--methods NAME,...] [--seeds N] [--threads N]\n"
    "                             [--firing OPTIONS] [--out DIR] [--quick]\n"
    "\n"
    "  --methods NAME,...   as of `anlos recon`; default: fast\n"
    "  --seeds N            of noise; default 400\n"
    "  --threads N          at most; default: one for each processor\n"
    "  --firing OPTIONS     as an array's URI has them behind its ?, with & between:\n"
    "                       continuous=yes&slot_samples=1632\n"
    "  --out DIR            default: out/bench\n"
    "  --quick              20 seeds\n"
    "  --help               this text\n"
    "\n"
    "Writes detection.csv, and what was simulated into scenes/.\n"
    "\n"
    "exit codes: 0 done; 1 failed; 2 bad arguments or input; 130 stopped by Ctrl-C, "
    "what\n"
    "was done until then is written\n";

static const struct usage_option options[] = {
    {"methods", USAGE_TEXT(struct detection_options, methods)},
    {"seeds", USAGE_COUNT(struct detection_options, seeds, 1, MAX_SEEDS)},
    {"threads", USAGE_COUNT(struct detection_options, threads, 1, MAX_THREADS)},
    {"firing", USAGE_VALUE('f')},
    {"out", USAGE_TEXT(struct detection_options, out), .expected = "a folder"},
    {"quick", USAGE_FLAG(struct detection_options, quick)},
    {.name = NULL},
};

/* 0, or an exit code. */
static int take_firing(struct detection_options *o, const char *text)
{
    static const char *const known[] = {FIRING_KEYS, NULL};
    struct error why = {""};
    struct device d;
    char uri[1024];
    if (snprintf(uri, sizeof uri, "point?%s", text) >= (int)sizeof uri)
        return usage_error("bench detection", "--firing: too long");
    int err = device_parse(&d, uri, known, &why);
    if (!err) {
        err = firing_from_device(&o->firing, &d, &why);
        device_clear(&d);
    }
    return err ? usage_error("bench detection", "--firing: %s", why.text) : 0;
}

int main(int argc, char **argv)
{
    struct detection_options o = {.out = "out/bench", .threads = usage_default_threads()};
    struct usage usage = {
        .command = "bench detection", .help = help, .options = options, .into = &o};
    struct error why = {""};
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        if ((code = take_firing(&o, optarg)) != 0)
            return code;
    if (code)
        return ~code;
    if (optind < argc)
        return usage_error("bench detection", "%s: unexpected argument", argv[optind]);
    interrupt_catch();
    return usage_outcome("bench detection", run(&o, &why), &why);
}
