/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/score/drive_report.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "nodes/anlos/score/drive_score.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_chart.h"
#include "nodes/rt/json_whole.h"

void drive_name(const char *path, char *out, size_t size)
{
    const char *slash = strrchr(path, '/'), *base = slash ? slash + 1 : path;
    const char *dot = strrchr(base, '.');

    snprintf(out, size, "%.*s", dot ? (int)(dot - base) : (int)strlen(base), base);
}

/* -- the table --------------------------------------------------------------------------
 */

static const struct column {
    enum drive_figure figure;
    int width, digits;
    double scale;
} columns[] = {
    {DRIVE_GOSPA, 6, 3, 1.0},        {DRIVE_OSPA, 6, 3, 1.0},
    {DRIVE_LOCALISATION, 8, 3, 1.0}, {DRIVE_MISSED, 6, 3, 1.0},
    {DRIVE_FALSE, 6, 3, 1.0},        {DRIVE_TOLD, 4, 2, 1.0},
    {DRIVE_TOLD_FAR, 4, 2, 1.0},     {DRIVE_FALSE_TRACKS, 6, 0, 1.0},
    {DRIVE_DELAY, 6, 2, 1.0},        {DRIVE_DELAY_WORST, 6, 2, 1.0},
    {DRIVE_LEAD, 6, 2, 1.0},         {DRIVE_POSITION, 6, 1, 100.0},
    {DRIVE_VELOCITY, 5, 2, 1.0},
};

void drive_print_head(void)
{
    printf("%-22s %6s %6s %22s %9s %6s %13s %6s %12s\n", "", "GOSPA", "OSPA",
           "local. missed  false", "told far", "false", "echo to track", "lead",
           "error of");
    printf("%-22s %6s %6s %22s %9s %6s %13s %6s %12s\n", "drive", "m", "m",
           "m      m      m", "", "tracks", "mean s  worst", "s", "cm  m/s");
}

static void print_line(const char *name, const double figures[DRIVE_FIGURES])
{
    printf("%-22s", name);
    for (size_t i = 0; i < sizeof columns / sizeof *columns; i++) {
        const struct column *c = &columns[i];
        double x = c->scale * figures[c->figure];
        if (isfinite(x))
            printf(" %*.*f", c->width, c->digits, x);
        else /* of none */
            printf(" %*s", c->width, "-");
    }
    printf("\n");
}

static void figures_of(const struct drive_result *r, double out[DRIVE_FIGURES])
{
    for (int i = 0; i < DRIVE_FIGURES; i++)
        out[i] = drive_figure(r, (enum drive_figure)i);
}

static void print_nees(const struct drive_result *r)
{
    bool any = false;

    for (size_t c = 0; c < DRIVE_CLASSES; c++) {
        const struct drive_nees *k = &r->nees[c];
        if (!k->sum.n)
            continue;
        if (any)
            printf(", ");
        else
            printf("%-22s NEES (2 is right) ", "");
        printf("%s %.2f, %.0f %% within 95 %%", drive_class_name(c), drive_mean(&k->sum),
               100.0 * (double)k->n_within / (double)k->sum.n);
        any = true;
    }
    if (any)
        printf("\n");
}

void drive_print(const char *name, const struct drive_tally *t)
{
    const struct drive_result *r = &t->all;
    double all[DRIVE_FIGURES];
    char worst[32];

    figures_of(r, all);
    print_line(name, all);
    snprintf(worst, sizeof worst, "  worst of %zu", t->n);
    if (t->n > 1)
        print_line(worst, t->worst);
    printf("%-22s %zu lists in %.0f s, %.1f Hz; %zu objects came in, %zu left without a "
           "track\n",
           "", r->n_lists, r->seconds, (double)r->n_lists / r->seconds, r->n_entries,
           r->n_late);
    printf("%-22s %.2f false tracks an hour; with %.0f %% confidence under %.2f\n", "",
           drive_false_per_hour(r), 100.0 * DRIVE_CONFIDENCE,
           drive_false_per_hour_bound(r));
    print_nees(r);
    fflush(stdout);
}

void drive_print_existence(const struct drive_result *r)
{
    printf("\nexistence on CAN: stated, true, how often\n");
    for (size_t b = 0; b < DRIVE_BINS; b++) {
        const struct drive_bin *bin = &r->existence[b];
        printf("  %2.0f to %3.0f %%  ", 100.0 * drive_bin_from(b),
               100.0 * drive_bin_from(b + 1));
        if (bin->n)
            printf("%5.1f %%  %5.1f %%  %zu\n", 100.0 * bin->stated / (double)bin->n,
                   100.0 * (double)bin->n_true / (double)bin->n, bin->n);
        else
            printf("    -        -  0\n");
    }
    fflush(stdout);
}

/* -- files ------------------------------------------------------------------------------
 */

static void put(json_t *o, const char *key, double x)
{
    json_object_set_new(o, key, export_real(x));
}

static void put_figures(json_t *o, const double figures[DRIVE_FIGURES])
{
    for (int i = 0; i < DRIVE_FIGURES; i++)
        put(o, drive_figure_name((enum drive_figure)i), figures[i]);
}

static void put_nees(json_t *o, const struct drive_result *r)
{
    json_t *all = json_object();

    for (size_t c = 0; c < DRIVE_CLASSES; c++) {
        const struct drive_nees *k = &r->nees[c];
        if (k->sum.n)
            json_object_set_new(all, drive_class_name(c),
                                json_pack("{s:f, s:f, s:I}", "mean", drive_mean(&k->sum),
                                          "within_95",
                                          (double)k->n_within / (double)k->sum.n, "n",
                                          (json_int_t)k->sum.n));
    }
    json_object_set_new(o, "nees", all);
}

static void put_existence(json_t *o, const struct drive_result *r)
{
    json_t *all = json_array();

    for (size_t b = 0; b < DRIVE_BINS; b++) {
        const struct drive_bin *bin = &r->existence[b];
        if (bin->n)
            json_array_append_new(all, json_pack("{s:f, s:f, s:f, s:f, s:I}", "from",
                                                 drive_bin_from(b), "to",
                                                 drive_bin_from(b + 1), "stated",
                                                 bin->stated / (double)bin->n, "true",
                                                 (double)bin->n_true / (double)bin->n,
                                                 "n", (json_int_t)bin->n));
    }
    json_object_set_new(o, "existence", all);
}

json_t *drive_json(const struct drive_tally *t)
{
    const struct drive_result *r = &t->all;
    json_t *o = json_object(), *worst = json_object();
    double all[DRIVE_FIGURES];

    if (!o || !worst) {
        json_decref(o);
        json_decref(worst);
        return NULL;
    }
    put(o, "drives", (double)t->n);
    put(o, "seconds", r->seconds);
    put(o, "lists", (double)r->n_lists);
    put(o, "cutoff_m", DRIVE_CUTOFF_M);
    put(o, "order", DRIVE_ORDER);
    figures_of(r, all);
    put_figures(o, all);
    put(o, "false_tracks_per_hour", drive_false_per_hour(r));
    put(o, "false_tracks_per_hour_bound", drive_false_per_hour_bound(r));
    put(o, "confidence", DRIVE_CONFIDENCE);
    put(o, "objects_entered", (double)r->n_entries);
    put(o, "objects_without_track", (double)r->n_late);
    put_nees(o, r);
    put_existence(o, r);
    put_figures(worst, t->worst);
    json_object_set_new(o, "worst", worst);
    return o;
}

int drive_json_write(const json_t *all, const char *folder, struct error *why)
{
    struct export_file e;

    if (!json_object_size(all)) /* nothing came out */
        return 0;
    if (!json_whole(all))
        return error_say(why, -ENOMEM, "%s/drive.json: out of memory", folder);
    int err = export_file_open(&e, folder, "drive.json", why);

    if (err)
        return err;
    if (json_dumpf(all, e.f, JSON_INDENT(2)) || fputc('\n', e.f) == EOF)
        return export_file_abandon(&e, -EIO, why);
    return export_file_commit(&e, why);
}

int drive_csv_open(FILE **out, const char *folder, struct error *why)
{
    char path[PATH_MAX];

    snprintf(path, sizeof path, "%s/drives.csv", folder);
    unlink(path); /* and not through a link that somebody has put there */
    FILE *f = *out = fopen(path, "wxe");
    if (!f)
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    fprintf(f, "drive,draw,seconds,lists,objects_entered,objects_without_track");
    for (int i = 0; i < DRIVE_FIGURES; i++)
        fprintf(f, ",%s", drive_figure_name((enum drive_figure)i));
    fputc('\n', f);
    return 0;
}

void drive_csv_line(FILE *f, const char *name, uint32_t draw,
                    const struct drive_result *r)
{
    fprintf(f, "%s,%u,%.3f,%zu,%zu,%zu", name, draw, r->seconds, r->n_lists, r->n_entries,
            r->n_late);
    for (int i = 0; i < DRIVE_FIGURES; i++) {
        double x = drive_figure(r, (enum drive_figure)i);
        if (isfinite(x))
            fprintf(f, ",%.6g", x);
        else
            fputc(',', f);
    }
    fputc('\n', f);
    fflush(f);
}

static int write_csv(const char *folder, const char *file, const struct drive_moments *m,
                     struct error *why)
{
    struct export_file e;
    int err = export_file_open(&e, folder, file, why);

    if (err)
        return err;
    fprintf(e.f, "t_s,gospa_m,ospa_m,localisation_m,missed_m,false_m,objects,tracks,"
                 "detections\n");
    for (size_t i = 0; i < m->n; i++) {
        const struct drive_moment *k = &m->at[i];
        fprintf(e.f, "%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%zu,%zu,%zu\n", k->t_s, k->gospa_m,
                k->ospa_m, k->localisation_m, k->missed_m, k->false_m, k->n_objects,
                k->n_tracks, k->n_detections);
    }
    return export_file_commit(&e, why);
}

static int draw(const char *folder, const char *name, const struct drive_moments *m,
                struct error *why)
{
    double *x = malloc(5 * (m->n + 1) * sizeof *x);
    if (!x)
        return error_say(why, -ENOMEM, "out of memory");
    double *y[4], most_m = 0.1;
    for (int k = 0; k < 4; k++)
        y[k] = x + (size_t)(k + 1) * (m->n + 1);
    for (size_t i = 0; i < m->n; i++) {
        x[i] = m->at[i].t_s;
        y[0][i] = m->at[i].gospa_m;
        y[1][i] = m->at[i].ospa_m;
        y[2][i] = (double)m->at[i].n_objects;
        y[3][i] = (double)m->at[i].n_tracks;
        for (int k = 0; k < 4; k++)
            most_m = fmax(most_m, y[k][i]);
    }
    const struct chart_series series[] = {
        {"objects", x, y[2], m->n, CHART_DASHED, 0},
        {"tracks", x, y[3], m->n, CHART_POINTS, 1},
        {"OSPA", x, y[1], m->n, CHART_LINE, 2},
        {"GOSPA", x, y[0], m->n, CHART_LINE, 3},
    };
    const struct chart chart = {
        .title = name,
        .label = {"time, s", "GOSPA and OSPA in m; number of objects and tracks"},
        .min = {m->n ? x[0] : 0.0, 0.0},
        .max = {m->n > 1 ? x[m->n - 1] : 1.0, 1.1 * most_m},
        .series = series,
        .n_series = sizeof series / sizeof *series,
        .legend_beside = true};
    int err = export_chart(folder, name, &chart, why);
    free(x);
    return err;
}

int drive_write(const char *folder, const char *name, const struct drive_moments *m,
                struct error *why)
{
    char file[300];

    snprintf(file, sizeof file, "%s.csv", name);
    int err = write_csv(folder, file, m, why);
    return err ? err : draw(folder, name, m, why);
}

int drive_write_existence(const char *folder, const struct drive_result *r,
                          struct error *why)
{
    double stated[DRIVE_BINS], found[DRIVE_BINS], right[2] = {0.0, 100.0};
    size_t n = 0;

    for (size_t b = 0; b < DRIVE_BINS; b++) {
        const struct drive_bin *bin = &r->existence[b];
        if (!bin->n)
            continue;
        stated[n] = 100.0 * bin->stated / (double)bin->n;
        found[n++] = 100.0 * (double)bin->n_true / (double)bin->n;
    }
    const struct chart_series series[] = {
        {"as stated", right, right, 2, CHART_DASHED, 0},
        {NULL, stated, found, n, CHART_LINE, 1},
        {"on CAN", stated, found, n, CHART_POINTS, 1},
    };
    const struct chart chart = {.title = "existence: stated and true",
                                .label = {"stated, %", "of these somebody was there, %"},
                                .min = {0.0, 0.0},
                                .max = {100.0, 100.0},
                                .series = series,
                                .n_series = sizeof series / sizeof *series};
    return n ? export_chart(folder, "existence", &chart, why) : 0;
}
