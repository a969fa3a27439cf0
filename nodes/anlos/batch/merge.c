/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/batch/batch.h"

#include <dirent.h>
#include <errno.h>
#include <jansson.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/error.h"
#include "dsp/list.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_chart.h"

/* -- what is in the folders -------------------------------------------------------------
 */
struct version { /* of a program, in one folder */
    const char *folder;
    char program[24], revision[128];
    char label[256]; /* the folder, and the revision where it has several */
};

struct row {
    const char *job;
    size_t version;
    json_t *line; /* NULL: the manifest has it, no folder does */
};

struct merge {
    struct version *versions;
    size_t n_versions, versions_room;
    struct row *rows; /* in the order of jobs, then of versions */
    size_t n_rows, room;
    size_t n_missing;
    struct manifest manifest; /* empty: none was given */
    json_t *tags;             /* an object, in the order in which they came */
};

static int out_of_memory(struct error *why)
{
    return error_say(why, -ENOMEM, "out of memory");
}

static int add_row(struct merge *m, const char *job, size_t version, json_t *line,
                   struct error *why)
{
    if (list_grow(&m->rows, m->n_rows, &m->room, sizeof *m->rows))
        return out_of_memory(why);
    m->rows[m->n_rows++] = (struct row){job, version, line};
    return 0;
}

/* The number of the version that made a line; a new one is added. */
static int find_version(struct merge *m, const char *folder, const json_t *line,
                        size_t *out, struct error *why)
{
    const char *program = result_text(line, "program");

    for (*out = 0; *out < m->n_versions; ++*out)
        if (m->versions[*out].folder == folder &&
            !strcmp(m->versions[*out].program, program))
            return 0;
    if (list_grow(&m->versions, m->n_versions, &m->versions_room, sizeof *m->versions))
        return out_of_memory(why);
    struct version *v = &m->versions[m->n_versions++];
    *v = (struct version){.folder = folder};
    snprintf(v->program, sizeof v->program, "%s", program);
    snprintf(v->revision, sizeof v->revision, "%s", result_text(line, "revision"));
    return 0;
}

static int take_file(struct merge *m, const char *folder, const char *path,
                     struct error *why)
{
    json_error_t wrong;
    json_t *line = json_load_file(path, 0, &wrong);
    size_t version;

    if (!line)
        return error_say(why, -EINVAL, "%s: not a result: %s", path, wrong.text);
    if (json_integer_value(json_object_get(line, "format")) != RESULT_FORMAT ||
        !result_text(line, "job")[0]) {
        json_decref(line);
        return error_say(why, -EINVAL, "%s: not a result of this version's `anlos batch`",
                         path);
    }
    int err = find_version(m, folder, line, &version, why);
    if (!err)
        err = add_row(m, result_text(line, "job"), version, line, why);
    if (err)
        json_decref(line);
    return err;
}

/* Hidden files are not yet whole, and locks. */
static int take_folder(struct merge *m, const char *folder, struct error *why)
{
    char path[PATH_MAX];
    size_t n = m->n_rows;
    int err = 0;
    DIR *d = opendir(folder);

    if (!d)
        return error_say(why, -errno, "%s: %s", folder, strerror(errno));
    for (struct dirent *e = readdir(d); e && !err; e = readdir(d)) {
        const char *dot = strrchr(e->d_name, '.');
        if (e->d_name[0] == '.' || !dot || strcmp(dot, ".json") != 0)
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, e->d_name);
        err = take_file(m, folder, path, why);
    }
    closedir(d);
    if (!err && n == m->n_rows)
        err = error_say(why, -ENOENT, "%s: no results of `anlos batch`", folder);
    return err;
}

static int by_job(const void *a, const void *b)
{
    const struct row *x = a, *y = b;
    int order = strcmp(x->job, y->job);

    return order ? order : (x->version > y->version) - (x->version < y->version);
}

/* What the manifest asks for and a version has not, and nothing that it does not. */
static int hold_against_manifest(struct merge *m, struct error *why)
{
    size_t known = m->n_rows, kept = 0;
    int err = 0;

    qsort(m->rows, known, sizeof *m->rows, by_job);
    char *wanted = calloc(known + 1, 1);
    if (!wanted)
        return out_of_memory(why);
    for (size_t i = 0; i < m->manifest.n; i++)
        for (size_t v = 0; v < m->n_versions && !err; v++) {
            const struct row key = {.job = m->manifest.bags[i].job, .version = v};
            const struct row *at = bsearch(&key, m->rows, known, sizeof *m->rows, by_job);
            if (at)
                wanted[at - m->rows] = 1;
            else
                err = add_row(m, key.job, v, NULL, why);
            m->n_missing += !at;
        }
    for (size_t i = 0; i < m->n_rows; i++) {
        if (i >= known || wanted[i])
            m->rows[kept++] = m->rows[i];
        else
            json_decref(m->rows[i].line);
    }
    m->n_rows = kept;
    free(wanted);
    return err;
}

static void name_versions(struct merge *m)
{
    for (size_t i = 0; i < m->n_versions; i++) {
        struct version *v = &m->versions[i];
        bool alone = true, by_revision = true;
        for (size_t k = 0; k < m->n_versions; k++)
            if (k != i && m->versions[k].folder == v->folder) {
                alone = false;
                by_revision &= strcmp(m->versions[k].revision, v->revision) != 0;
            }
        if (alone)
            snprintf(v->label, sizeof v->label, "%s", v->folder);
        else if (by_revision)
            snprintf(v->label, sizeof v->label, "%.100s %.100s", v->folder, v->revision);
        else
            snprintf(v->label, sizeof v->label, "%.100s %.100s %.4s", v->folder,
                     v->revision, v->program);
    }
}

static int collect(struct merge *m, char *const folders[], size_t n, struct error *why)
{
    int err = 0;

    for (size_t i = 0; i < n && !err; i++)
        err = take_folder(m, folders[i], why);
    if (!err && m->manifest.n)
        err = hold_against_manifest(m, why);
    if (err)
        return err;
    qsort(m->rows, m->n_rows, sizeof *m->rows, by_job);
    name_versions(m);
    m->tags = json_object();
    for (size_t i = 0; i < m->n_rows; i++) {
        json_t *tag;
        size_t k;
        json_array_foreach(json_object_get(m->rows[i].line, "tags"), k, tag)
            json_object_set_new(m->tags, json_string_value(tag), json_true());
    }
    return m->tags ? 0 : out_of_memory(why);
}

static void clear(struct merge *m)
{
    for (size_t i = 0; i < m->n_rows; i++)
        json_decref(m->rows[i].line);
    free(m->rows);
    free(m->versions);
    manifest_clear(&m->manifest);
    json_decref(m->tags);
}

/* -- figures of many bags ---------------------------------------------------------------
 */
static const struct column {
    const char *key, *unit[2]; /* of the table, two lines */
    double scale;
    int width, digits;
    const char *weight;       /* of figures, or NULL: all bags count the same */
    const char *plot, *title; /* a file's name, or NULL: none is drawn */
} columns[] = {
    {"position_rms_m", {"error", "cm"}, 100.0, 6, 1, NULL, "error", "Error of place, m"},
    {"velocity_rms_m_s", {"", "m/s"}, 1.0, 5, 2, NULL, NULL, NULL},
    {"gospa_m", {"GOSPA", "m"}, 1.0, 6, 3, NULL, NULL, NULL},
    {"detection_probability", {"Pd", ""}, 1.0, 5, 3, NULL, "pd", "Detection probability"},
    {"told", {"told", ""}, 1.0, 5, 3, NULL, NULL, NULL},
    {"false_tracks_per_hour",
     {"false", "/h"},
     1.0,
     6,
     1,
     "seconds",
     "false_tracks",
     "False tracks an hour"},
    {"objects", {"objects", ""}, 1.0, 7, 2, NULL, NULL, NULL},
    {"cpu_s", {"cpu", "s"}, 1.0, 7, 2, NULL, "time", "Processor time, s"},
    {"wall_s", {"wall", "s"}, 1.0, 7, 2, NULL, NULL, NULL},
    {"bag_bytes", {"bag", "MB"}, 1e-6, 7, 1, NULL, NULL, NULL},
};
enum { N_COLUMNS = sizeof columns / sizeof *columns };

/* NaN: it has none. */
static double value_of(const json_t *line, const char *key)
{
    const json_t *x = json_object_get(json_object_get(line, "figures"), key);

    if (!x)
        x = json_object_get(json_object_get(line, "run"), key);
    if (!x)
        x = json_object_get(line, key);
    return json_is_number(x) ? json_number_value(x) : NAN;
}

struct sum {
    size_t bags, failed, missing;
    double sum[N_COLUMNS], weight[N_COLUMNS];
};

static void add_to(struct sum *s, const json_t *line)
{
    s->bags++;
    s->missing += !line;
    s->failed += line && result_is_failure(line);
    for (size_t c = 0; c < N_COLUMNS && line && !result_is_failure(line); c++) {
        double weight = columns[c].weight ? value_of(line, columns[c].weight) : 1.0;
        double x = value_of(line, columns[c].key);
        if (isfinite(x) && weight > 0.0) {
            s->sum[c] += weight * x;
            s->weight[c] += weight;
        }
    }
}

static bool has_tag(const json_t *line, const char *tag)
{
    const json_t *own;
    size_t i;

    json_array_foreach(json_object_get(line, "tags"), i,
                       own) if (!strcmp(json_string_value(own), tag)) return true;
    return false;
}

/* tag NULL: all. */
static struct sum sum_of(const struct merge *m, const char *tag, size_t version)
{
    struct sum s = {.bags = 0};

    for (size_t i = 0; i < m->n_rows; i++)
        if (m->rows[i].version == version && (!tag || has_tag(m->rows[i].line, tag)))
            add_to(&s, m->rows[i].line);
    return s;
}

static double mean(const struct sum *s, size_t column)
{
    return s->weight[column] > 0.0 ? s->sum[column] / s->weight[column] : NAN;
}

/* -- the second version over the first, bag by bag --------------------------------------
 */

/* The bag of a row and of the one before it, which are done in both. */
static bool is_pair(const struct merge *m, size_t i, const char *key, double *x,
                    double *y)
{
    if (!i || m->rows[i - 1].version != 0 || m->rows[i].version != 1 ||
        strcmp(m->rows[i - 1].job, m->rows[i].job) != 0)
        return false;
    *x = value_of(m->rows[i - 1].line, key);
    *y = value_of(m->rows[i].line, key);
    return isfinite(*x) && isfinite(*y);
}

struct comparison {
    size_t bags, lower, higher; /* than in the first version; the others are the same */
};

static struct comparison compare(const struct merge *m, const char *key)
{
    struct comparison c = {.bags = 0};
    double x, y;

    for (size_t i = 0; i < m->n_rows; i++)
        if (is_pair(m, i, key, &x, &y)) {
            c.bags++;
            c.lower += y < x;
            c.higher += y > x;
        }
    return c;
}

/* -- the table --------------------------------------------------------------------------
 */
static void print_head(void)
{
    for (int line = 0; line < 2; line++) {
        printf("%-12s %-28s %6s %6s %7s", line ? "tag" : "", line ? "version" : "",
               line ? "bags" : "", line ? "failed" : "", line ? "missing" : "");
        for (size_t c = 0; c < N_COLUMNS; c++)
            printf(" %*s", columns[c].width, columns[c].unit[line]);
        printf("\n");
    }
}

static void print_sums(const struct merge *m, const char *tag)
{
    for (size_t v = 0; v < m->n_versions; v++) {
        struct sum s = sum_of(m, tag, v);
        if (!s.bags)
            continue;
        printf("%-12s %-28s %6zu %6zu %7zu",
               v     ? ""
               : tag ? tag
                     : "all",
               m->versions[v].label, s.bags, s.failed, s.missing);
        for (size_t c = 0; c < N_COLUMNS; c++) {
            double x = columns[c].scale * mean(&s, c);
            if (isfinite(x))
                printf(" %*.*f", columns[c].width, columns[c].digits, x);
            else
                printf(" %*s", columns[c].width, "-");
        }
        printf("\n");
    }
}

static void print_comparisons(const struct merge *m)
{
    printf("\n%s over %s, bag by bag:\n", m->versions[1].label, m->versions[0].label);
    for (size_t c = 0; c < N_COLUMNS; c++) {
        const struct comparison by_bag = compare(m, columns[c].key);
        if (columns[c].plot && by_bag.bags)
            printf("%-24s lower in %zu of %zu, the same in %zu, higher in %zu\n",
                   columns[c].title, by_bag.lower, by_bag.bags,
                   by_bag.bags - by_bag.lower - by_bag.higher, by_bag.higher);
    }
}

static void print_table(const struct merge *m)
{
    const char *tag;
    json_t *any;

    print_head();
    print_sums(m, NULL);
    json_object_foreach(m->tags, tag, any) print_sums(m, tag);
    if (m->n_versions > 1)
        print_comparisons(m);
    printf("\n");
    for (size_t v = 0; v < m->n_versions; v++)
        printf("%s: revision %s, program %s\n", m->versions[v].label,
               m->versions[v].revision, m->versions[v].program);
}

/* -- files ------------------------------------------------------------------------------
 */
static const char *outcome_of(const json_t *line)
{
    return line ? result_text(line, "outcome") : "missing";
}

static json_t *sums_json(const struct merge *m, const char *tag)
{
    json_t *all = json_array();

    for (size_t v = 0; v < m->n_versions; v++) {
        struct sum s = sum_of(m, tag, v);
        json_t *o = json_pack("{ss?, ss, sI, sI, sI}", "tag", tag, "version",
                              m->versions[v].label, "bags", (json_int_t)s.bags, "failed",
                              (json_int_t)s.failed, "missing", (json_int_t)s.missing);
        for (size_t c = 0; c < N_COLUMNS; c++)
            json_object_set_new(o, columns[c].key, export_real(mean(&s, c)));
        json_array_append_new(all, o);
    }
    return all;
}

static json_t *comparisons_json(const struct merge *m)
{
    json_t *all = json_array();

    for (size_t c = 0; c < N_COLUMNS && m->n_versions > 1; c++) {
        const struct comparison by_bag = compare(m, columns[c].key);
        if (by_bag.bags)
            json_array_append_new(
                all, json_pack("{ss, sI, sI, sI}", "figure", columns[c].key, "bags",
                               (json_int_t)by_bag.bags, "lower", (json_int_t)by_bag.lower,
                               "higher", (json_int_t)by_bag.higher));
    }
    return all;
}

static json_t *json_of(const struct merge *m)
{
    json_t *versions = json_array(), *sums = sums_json(m, NULL), *bags = json_array();
    const char *tag;
    json_t *any;

    for (size_t v = 0; v < m->n_versions; v++)
        json_array_append_new(versions, json_pack("{ss, ss, ss, ss}", "version",
                                                  m->versions[v].label, "folder",
                                                  m->versions[v].folder, "revision",
                                                  m->versions[v].revision, "program",
                                                  m->versions[v].program));
    json_object_foreach(m->tags, tag, any)
    {
        json_t *more = sums_json(m, tag);
        json_array_extend(sums, more);
        json_decref(more);
    }
    for (size_t i = 0; i < m->n_rows; i++) {
        const struct row *r = &m->rows[i];
        json_t *o = json_pack("{ss, ss, ss}", "version_label",
                              m->versions[r->version].label, "job", r->job, "outcome",
                              outcome_of(r->line));
        if (r->line)
            json_object_update(o, r->line);
        json_array_append_new(bags, o);
    }
    return json_pack("{so, so, so, so}", "versions", versions, "means", sums,
                     "comparisons", comparisons_json(m), "bags", bags);
}

/* A field as RFC 4180 has it. */
static void put_field(FILE *f, const char *text)
{
    if (!text[strcspn(text, ",\"\r\n")]) {
        fputs(text, f);
        return;
    }
    putc('"', f);
    for (; *text; text++) {
        if (*text == '"')
            putc('"', f);
        putc(*text, f);
    }
    putc('"', f);
}

static void put_tags(FILE *f, const json_t *line)
{
    char all[1024] = "";
    const json_t *tag;
    size_t i;

    json_array_foreach(json_object_get(line, "tags"), i, tag)
    {
        text_add(all, sizeof all, " ", "%s", json_string_value(tag));
    }
    put_field(f, all);
}

static void put_number(FILE *f, double x)
{
    putc(',', f);
    if (isfinite(x))
        fprintf(f, "%.9g", x);
}

/* The names of all numbers that any bag has. */
static json_t *figure_names(const struct merge *m)
{
    json_t *names = json_object(), *value;
    const char *key;

    for (size_t i = 0; i < m->n_rows; i++)
        json_object_foreach(json_object_get(m->rows[i].line, "figures"), key,
                            value) if (json_is_number(value))
            json_object_set_new(names, key, json_true());
    return names;
}

static void put_row(FILE *f, const struct merge *m, const struct row *r,
                    const json_t *names)
{
    static const char *const of_run[] = {"bag_bytes", "wall_s", "cpu_s",
                                         "peak_memory_bytes"};
    const char *key;
    json_t *any;

    put_field(f, r->job);
    putc(',', f);
    put_tags(f, r->line);
    putc(',', f);
    put_field(f, m->versions[r->version].label);
    fprintf(f, ",%s,%s,%s,", m->versions[r->version].revision,
            m->versions[r->version].program, outcome_of(r->line));
    put_field(f, result_text(r->line, "error"));
    for (size_t i = 0; i < sizeof of_run / sizeof *of_run; i++)
        put_number(f, value_of(r->line, of_run[i]));
    json_object_foreach((json_t *)names, key, any) put_number(f, value_of(r->line, key));
    fputs("\n", f);
}

static void put_csv(FILE *f, const struct merge *m)
{
    json_t *names = figure_names(m), *any;
    const char *key;

    fputs("job,tags,version,revision,program,outcome,error,bag_bytes,wall_s,cpu_s,"
          "peak_memory_bytes",
          f);
    json_object_foreach(names, key, any)
    {
        putc(',', f);
        put_field(f, key);
    }
    fputs("\n", f);
    for (size_t i = 0; i < m->n_rows; i++)
        put_row(f, m, &m->rows[i], names);
    json_decref(names);
}

static bool ends(const char *path, const char *with)
{
    const char *dot = strrchr(path, '.');

    return dot && !strcmp(dot, with);
}

static int write_file(const struct merge *m, const char *path, struct error *why)
{
    const char *slash = strrchr(path, '/');
    char folder[PATH_MAX];
    struct export_file e;

    snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - path + 1) : 1,
             slash ? path : ".");
    if (ends(path, ".json")) {
        json_t *o = json_of(m);
        int err = export_json(folder, slash ? slash + 1 : path, o, why);
        json_decref(o);
        return err;
    }
    int err = export_file_open(&e, folder, slash ? slash + 1 : path, why);
    if (err)
        return err;
    put_csv(e.f, m);
    return export_file_commit(&e, why);
}

/* -- plots: one version over the other --------------------------------------------------
 */
enum { MOST_SERIES = CHART_COLOURS - 1 };

struct pairs { /* of one tag; the last are those of no other */
    const char *tag;
    double *x, *y;
    size_t n;
};

/* Bags that are done in both of the first two versions, by their first tag; how many. */
static size_t gather(const struct merge *m, const char *key, struct pairs *all, size_t n,
                     double *most)
{
    size_t n_pairs = 0;
    double x, y;

    for (size_t i = 0; i < m->n_rows; i++) {
        if (!is_pair(m, i, key, &x, &y))
            continue;
        n_pairs++;
        const char *tag = json_string_value(
            json_array_get(json_object_get(m->rows[i - 1].line, "tags"), 0));
        size_t k = 0;
        while (k + 1 < n && (!tag || strcmp(tag, all[k].tag) != 0))
            k++;
        all[k].x[all[k].n] = x;
        all[k].y[all[k].n++] = y;
        *most = fmax(*most, fmax(x, y));
    }
    return n_pairs;
}

static int plot(const struct merge *m, const struct column *c, struct pairs *all,
                size_t n, const char *folder, struct error *why)
{
    static const enum chart_style styles[] = {CHART_POINTS,    CHART_SQUARES,
                                              CHART_TRIANGLES, CHART_DIAMONDS,
                                              CHART_RINGS,     CHART_CROSSES};
    struct chart_series series[MOST_SERIES + 1];
    double most = 0.0;

    for (size_t k = 0; k < n; k++)
        all[k].n = 0;
    if (!gather(m, c->key, all, n, &most)) {
        fprintf(stderr, "%s: no bag has it in both versions, it is not drawn\n", c->plot);
        return 0;
    }
    double line[2] = {0.0, most > 0.0 ? 1.05 * most : 1.0};
    series[0] = (struct chart_series){"the same", line, line, 2, CHART_DASHED, 0};
    for (size_t k = 0; k < n; k++)
        series[k + 1] = (struct chart_series){all[k].tag, all[k].x,      all[k].y,
                                              all[k].n,   styles[k % 6], (int)k + 1};
    const double least = -0.03 * line[1]; /* what is at 0 has a whole mark */
    const struct chart chart = {.title = c->title,
                                .label = {m->versions[0].label, m->versions[1].label},
                                .min = {least, least},
                                .max = {line[1], line[1]},
                                .series = series,
                                .n_series = all[n - 1].n ? n + 1 : n,
                                .legend_beside = true};
    return export_chart(folder, c->plot, &chart, why);
}

static int write_plots(const struct merge *m, const char *folder, struct error *why)
{
    struct pairs all[MOST_SERIES];
    double *room = calloc(2 * MOST_SERIES * (m->n_rows + 1), sizeof *room);
    const char *tag;
    json_t *any;
    size_t n = 0;

    if (!room)
        return out_of_memory(why);
    json_object_foreach(m->tags, tag, any) if (n + 1 < MOST_SERIES) all[n++].tag = tag;
    all[n].tag = n ? "others" : "bags";
    n++;
    for (size_t k = 0; k < n; k++) {
        all[k].x = room + 2 * k * (m->n_rows + 1);
        all[k].y = all[k].x + m->n_rows + 1;
    }
    int err = export_folder(folder, why);
    for (size_t c = 0; c < N_COLUMNS && !err; c++)
        if (columns[c].plot)
            err = plot(m, &columns[c], all, n, folder, why);
    free(room);
    return err;
}

/* -- the command ------------------------------------------------------------------------
 */
struct asked {
    const char *manifest, *out, *plots;
};

static int merge(struct merge *m, const struct asked *a, char *const folders[], size_t n,
                 struct error *why)
{
    int err = a->manifest ? manifest_load(&m->manifest, a->manifest, why) : 0;

    if (!err)
        err = collect(m, folders, n, why);
    if (!err && a->plots && m->n_versions < 2)
        err = error_say(why, -EINVAL,
                        "--plots: only one version is there; expected the "
                        "folders of two");
    if (!err && a->out)
        err = write_file(m, a->out, why);
    if (!err && a->plots)
        err = write_plots(m, a->plots, why);
    if (!err)
        print_table(m);
    return err;
}

int batch_merge(int argc, char **argv, const char *help)
{
    static const struct usage_option options[] = {
        {"out", USAGE_TEXT(struct asked, out)},
        {"manifest", USAGE_TEXT(struct asked, manifest)},
        {"plots", USAGE_TEXT(struct asked, plots)},
        {.name = NULL},
    };
    struct asked a = {.out = NULL};
    struct usage usage = {
        .command = "batch merge", .help = help, .options = options, .into = &a};
    struct merge m = {.rows = NULL};
    struct error why = {""};
    int code = usage_next(&usage, argc, argv);

    if (code)
        return ~code;
    if (optind == argc)
        return usage_error("batch merge", "expected a DIR with results");
    if (a.out && !ends(a.out, ".csv") && !ends(a.out, ".json"))
        return usage_error("batch merge", "--out %s: expected FILE.csv or FILE.json",
                           a.out);
    int err = merge(&m, &a, argv + optind, (size_t)(argc - optind), &why);
    code = usage_outcome("batch merge", err, &why);
    if (!code && m.n_missing) {
        fprintf(stderr, "anlos batch merge: %zu results of %s are missing\n", m.n_missing,
                a.manifest);
        code = EXIT_FAILED;
    }
    clear(&m);
    return code ? code : usage_flush("batch merge");
}
