/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/score/drive_truth_file.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "hal/table_file.h"
#include "hal/text_file.h"

#define HEAD   "time_s,id,kind,x_m,y_m"
#define GAP_NS INT64_C(1000000000)

struct row {
    int64_t ns;
    double at_m[2];
};

struct object {
    char name[32], kind[16];
    struct row *rows; /* [n] */
    size_t n, room;
};

struct truth_file {
    struct object *objects; /* [n] */
    size_t n, room;
};

static struct object *find(struct truth_file *f, const char *name, const char *kind)
{
    for (size_t i = 0; i < f->n; i++)
        if (!strcmp(f->objects[i].name, name))
            return &f->objects[i];
    if (list_grow(&f->objects, f->n, &f->room, sizeof *f->objects))
        return NULL;
    struct object *o = &f->objects[f->n++];
    *o = (struct object){.n = 0};
    snprintf(o->name, sizeof o->name, "%s", name);
    snprintf(o->kind, sizeof o->kind, "%s", kind);
    return o;
}

static int add_row(struct object *o, const struct row *row)
{
    int err = list_grow(&o->rows, o->n, &o->room, sizeof *o->rows);

    if (!err)
        o->rows[o->n++] = *row;
    return err;
}

/* Splits a line at its commas; false: not five parts, or one is too long. */
static bool split(char *line, char *parts[5])
{
    line[strcspn(line, "\r\n")] = '\0';
    for (int i = 0; i < 5; i++) {
        parts[i] = line;
        char *comma = strchr(line, ',');
        if (!comma != (i == 4))
            return false;
        if (comma) {
            *comma = '\0';
            line = comma + 1;
        }
    }
    return *parts[1] && strlen(parts[1]) < 32 && strlen(parts[2]) < 16;
}

/* NULL, or what is wrong. */
static const char *take_line(struct truth_file *f, char *line, int *err)
{
    struct row row;
    char *parts[5];

    *err = -EINVAL;
    if (!split(line, parts))
        return "expected " HEAD;
    if (!table_time(parts[0], &row.ns))
        return "expected Unix time in seconds in column time_s";
    if (!table_number(parts[3], &row.at_m[0]) || !table_number(parts[4], &row.at_m[1]))
        return "expected metres in columns x_m and y_m";
    struct object *o = find(f, parts[1], parts[2]);
    if (o && strcmp(o->kind, parts[2]))
        return "this id was of another kind before";
    if (o && o->n && row.ns <= o->rows[o->n - 1].ns)
        return "this id has an earlier line with a later time, or the same";
    *err = o ? add_row(o, &row) : -ENOMEM;
    return *err ? "out of memory" : NULL;
}

static int read_lines(struct truth_file *out, FILE *f, const char *path,
                      struct error *why)
{
    char line[256];
    int err = 0;

    for (size_t number = 1; !err && fgets(line, sizeof line, f); number++) {
        const char *wrong = NULL;
        if (number == 1) {
            line[strcspn(line, "\r\n")] = '\0';
            wrong = strcmp(line, HEAD) ? "expected " HEAD : NULL;
            err = wrong ? -EINVAL : 0;
        } else if (line[strspn(line, " \r\n")]) {
            wrong = take_line(out, line, &err);
        }
        if (wrong)
            err = error_say(why, err, "%s:%zu: %s", path, number, wrong);
    }
    if (!err && ferror(f))
        err = error_say(why, -EIO, "%s: %s", path, strerror(EIO));
    if (!err && !out->n)
        err = error_say(why, -EINVAL, "%s: no rows", path);
    return err;
}

int truth_file_load(struct truth_file **out, const char *path, struct error *why)
{
    struct truth_file *t = calloc(1, sizeof *t);
    FILE *f = NULL;
    int err = t ? text_file_open(&f, path, why)
                : error_say(why, -ENOMEM, "out of memory");

    if (!err)
        err = read_lines(t, f, path, why);
    if (f)
        fclose(f);
    if (err)
        truth_file_destroy(t);
    else
        *out = t;
    return err;
}

/* Where it is between two rows; false: it is not there. */
static bool place(const struct object *o, int64_t ns, struct truth_place *out)
{
    size_t low = 0, high = o->n - 1;

    if (ns < o->rows[0].ns || ns > o->rows[high].ns || !high)
        return false;
    while (high - low > 1) {
        size_t middle = (low + high) / 2;
        if (o->rows[middle].ns <= ns)
            low = middle;
        else
            high = middle;
    }
    const struct row *a = &o->rows[low], *b = a + 1;
    if (b->ns - a->ns > GAP_NS)
        return false;
    double span_s = 1e-9 * (double)(b->ns - a->ns), s = 1e-9 * (double)(ns - a->ns);
    out->name = o->name;
    out->kind = o->kind;
    for (int k = 0; k < 2; k++) {
        out->velocity_m_s[k] = (b->at_m[k] - a->at_m[k]) / span_s;
        out->position_m[k] = a->at_m[k] + s * out->velocity_m_s[k];
    }
    return true;
}

size_t truth_file_at(const struct truth_file *f, int64_t unix_ns, struct truth_place *out,
                     size_t max)
{
    struct truth_place here;
    size_t n = 0;

    for (size_t i = 0; i < f->n; i++) {
        if (!place(&f->objects[i], unix_ns, &here))
            continue;
        if (n < max)
            out[n] = here;
        n++;
    }
    return n;
}

void truth_file_destroy(struct truth_file *f)
{
    if (!f)
        return;
    for (size_t i = 0; i < f->n; i++)
        free(f->objects[i].rows);
    free(f->objects);
    free(f);
}
