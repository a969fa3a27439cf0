/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "dsp/error.h"
#include "dsp/list.h"
#include "hal/recording/recording.h"
#include "hal/survey/file.h"
#include "nodes/anlos/commands.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_chart.h"
#include "recon/frontend/compressor.h"
#include "recon/planning/falloff.h"

/* Distance and power of the strongest echo in recordings, position by position, as the
 * paper measured its signal falloff: one speaker, the microphone beside it, after pulse
 * compression (Lindell 2019, section 5). */

struct falloff_points {
    size_t n, room;
    double *distance_m; /* [n] half the path */
    double *power;      /* [n] 1: an echo as loud as what the speaker emits */
};

struct measurement {
    struct survey survey;
    struct recording *scene, *background; /* background may be NULL */
    struct processing processing;
    struct compressor *compressor;
    struct trace_format format;
    size_t speaker, microphone; /* the closest pair */
    size_t frames;
    float *samples, *subtrahend; /* [n_microphones][frames] */
    float *ping;                 /* [n_microphones][ping_samples] */
    float complex *traces;       /* [n_microphones][format.n_samples] */
    uint32_t *counts;            /* [2][n_microphones] */
};

static int open_recordings(struct measurement *m, const char *folder, struct error *why)
{
    char path[PATH_MAX];
    int err;
    snprintf(path, sizeof path, "%s/survey.yaml", folder);
    err = survey_load(&m->survey, path, why);
    if (!err)
        err = processing_plan(&m->processing, &m->survey, why);
    if (err)
        return err;
    snprintf(path, sizeof path, "%s/scene", folder);
    err = recording_open(&m->scene, path, &m->survey, why);
    snprintf(path, sizeof path, "%s/background", folder);
    if (!err && !access(path, F_OK))
        err = recording_open(&m->background, path, &m->survey, why);
    return err;
}

/* Elements keep their distances while a stage carries them. */
static void find_closest_pair(struct measurement *m)
{
    const struct geometry *g = &m->processing.geometry;
    double closest = INFINITY;
    for (size_t j = 0; j < g->n_speakers; j++)
        for (size_t i = 0; i < g->n_microphones; i++) {
            double s[3], r[3];
            geometry_speaker(g, 0, j, s);
            geometry_microphone(g, 0, j, i, r);
            double d = hypot(hypot(s[0] - r[0], s[1] - r[1]), s[2] - r[2]);
            if (d >= closest)
                continue;
            closest = d;
            m->speaker = j;
            m->microphone = i;
        }
}

static int measurement_open(struct measurement *m, const char *folder, struct error *why)
{
    memset(m, 0, sizeof *m);
    int err = open_recordings(m, folder, why);
    if (!err)
        err = compressor_create(&m->compressor, &m->processing, &m->survey,
                                COMPRESSION_MATCHED_FILTER, WINDOW_HANN, why);
    if (err)
        return err;
    size_t n = m->survey.n_microphones;
    compressor_format(m->compressor, &m->format);
    find_closest_pair(m);
    m->frames = recording_frames(m->scene);
    m->samples = malloc(n * m->frames * sizeof *m->samples);
    m->subtrahend = malloc(n * m->frames * sizeof *m->subtrahend);
    m->ping = malloc(n * m->processing.ping_samples * sizeof *m->ping);
    m->traces = malloc(n * m->format.n_samples * sizeof *m->traces);
    m->counts = malloc(2 * n * sizeof *m->counts);
    if (m->samples && m->subtrahend && m->ping && m->traces && m->counts)
        return 0;
    return error_say(why, -ENOMEM, "out of memory");
}

static void measurement_close(struct measurement *m)
{
    compressor_destroy(m->compressor);
    recording_close(m->scene);
    recording_close(m->background);
    survey_clear(&m->survey);
    free(m->samples);
    free(m->subtrahend);
    free(m->ping);
    free(m->traces);
    free(m->counts);
}

/* The slot of the pair's speaker at one position, compressed. */
static int compress_position(struct measurement *m, size_t position, struct error *why)
{
    size_t n = m->survey.n_microphones, length = m->processing.ping_samples;
    size_t start = survey_slot_of(&m->survey, m->speaker) * m->survey.slot_samples;
    int err =
        recording_read(m->scene, position, m->samples, m->counts, m->counts + n, why);
    if (!err && m->background)
        err = recording_read(m->background, position, m->subtrahend, m->counts,
                             m->counts + n, why);
    if (err)
        return err;
    for (size_t i = 0; i < n; i++)
        for (size_t q = 0; q < length; q++) {
            size_t at = i * m->frames + start + q;
            bool there = start + q < m->frames;
            m->ping[i * length + q] =
                there ? m->samples[at] - (m->background ? m->subtrahend[at] : 0.0f)
                      : 0.0f;
        }
    compressor_execute(m->compressor, survey_is_down(&m->survey, m->speaker), m->ping,
                       length, m->traces);
    return 0;
}

static int append(struct falloff_points *p, double distance_m, double power)
{
    size_t room = p->room; /* of either */

    if (list_grow(&p->distance_m, p->n, &room, sizeof *p->distance_m) ||
        list_grow(&p->power, p->n, &p->room, sizeof *p->power))
        return -ENOMEM;
    p->distance_m[p->n] = distance_m;
    p->power[p->n++] = power;
    return 0;
}

static int measure_positions(struct falloff_points *p, struct measurement *m,
                             const char *folder, struct error *why)
{
    size_t before = p->n;
    for (size_t k = 0; k < m->survey.n_positions; k++) {
        double delay_s, power;
        int err = compress_position(m, k, why);
        if (err)
            return err;
        if (falloff_peak(&m->format, m->traces + m->microphone * m->format.n_samples,
                         &delay_s, &power))
            continue;
        if (append(p, 0.5 * m->survey.sound_speed_m_s * delay_s, power))
            return error_say(why, -ENOMEM, "out of memory");
    }
    return p->n > before
               ? 0
               : error_say(why, -ENODATA, "%s: no position has an echo", folder);
}

/* Appends one point for each position of a recording as `anlos sim` writes it: FOLDER
 * with survey.yaml, scene/ and, when there is one, background/, which is subtracted.  The
 * pair is the closest speaker and microphone.  0, -ENOENT, -EINVAL, -EIO, -ENODATA (no
 * position has an echo), -ENOMEM. */
static int falloff_measure(struct falloff_points *p, const char *folder,
                           struct error *why)
{
    struct measurement m;
    int err = measurement_open(&m, folder, why);
    if (!err)
        err = measure_positions(p, &m, folder, why);
    measurement_close(&m);
    return err;
}

static void falloff_points_clear(struct falloff_points *p)
{
    free(p->distance_m);
    free(p->power);
    memset(p, 0, sizeof *p);
}

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

struct set {
    const char *name;
    const char **recordings; /* [n_recordings], of falloff.recordings */
    size_t n_recordings;
    struct falloff_points points;
    struct falloff_fit fit;
};

struct falloff {
    const char *out;
    const char **recordings; /* [argc], of all sets */
    size_t n_recordings;
    struct set sets[MAX_SETS];
    size_t n_sets;
};

static void falloff_clear(struct falloff *f)
{
    for (size_t i = 0; i < f->n_sets; i++)
        falloff_points_clear(&f->sets[i].points);
    free(f->recordings);
}

static int measure_sets(struct falloff *f, struct error *why)
{
    for (size_t i = 0; i < f->n_sets; i++)
        for (size_t k = 0; k < f->sets[i].n_recordings; k++) {
            int err = falloff_measure(&f->sets[i].points, f->sets[i].recordings[k], why);
            if (err)
                return err;
        }
    return 0;
}

static int fit_sets(struct falloff *f, struct error *why)
{
    for (size_t i = 0; i < f->n_sets; i++) {
        struct set *s = &f->sets[i];
        if (falloff_fit(&s->fit, s->points.distance_m, s->points.power, s->points.n))
            return error_say(
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

static int write_csv(const struct falloff *f, const char *folder, struct error *why)
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

static int draw(const struct falloff *f, const char *folder, struct error *why)
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
        error_say(why, err, "out of memory");
    }
    for (size_t i = 0; i < f->n_sets; i++)
        free(d.relative[i]);
    return err;
}

static int write_results(const struct falloff *f, struct error *why)
{
    struct export_stage stage;
    int err = export_stage_begin(&stage, f->out, why);
    if (err)
        return err;
    err = write_csv(f, stage.path, why);
    if (!err)
        err = draw(f, stage.path, why);
    err = export_stage_end(&stage, err, why);
    if (!err)
        printf("%s: falloff.csv, falloff.svg, falloff.png\n", f->out);
    return err;
}

/* A recording, or the name of the set that follows. */
static int take_argument(struct falloff *f, int code, const char *text, struct error *why)
{
    if (code == 's' || !f->n_sets) {
        if (f->n_sets == MAX_SETS)
            return error_say(why, -EINVAL, "--set %s: more than %d sets", text, MAX_SETS);
        f->sets[f->n_sets++] = (struct set){
            .name = code == 's' ? text : "echoes",
            .recordings = f->recordings + f->n_recordings,
        };
    }
    if (code != 's') {
        f->recordings[f->n_recordings++] = text;
        f->sets[f->n_sets - 1].n_recordings++;
    }
    return 0;
}

static const struct usage_option options[] = {
    {"set", USAGE_VALUE('s')},
    {"out", USAGE_TEXT(struct falloff, out)},
    {.name = NULL},
};

int command_falloff(int argc, char **argv)
{
    struct falloff f = {0};
    struct error why = {0};
    struct usage usage = {.command = "falloff",
                          .help = help,
                          .options = options,
                          .into = &f,
                          .words = true};
    int code = 0, err = 0;

    f.recordings = calloc((size_t)argc, sizeof *f.recordings);
    if (!f.recordings)
        err = error_say(&why, -ENOMEM, "out of memory");
    while (!err && (code = usage_next(&usage, argc, argv)) > 0)
        err = take_argument(&f, code, optarg, &why);
    if (!err && !code && !f.n_sets)
        code = ~usage_error("falloff", "expected one RECORDING or more");
    if (code < 0) {
        falloff_clear(&f);
        return ~code;
    }
    if (!err)
        err = measure_sets(&f, &why);
    if (!err)
        err = fit_sets(&f, &why);
    if (!err) {
        print_sets(&f);
        if (f.out)
            err = write_results(&f, &why);
    }
    falloff_clear(&f);
    return usage_outcome("falloff", err, &why);
}
