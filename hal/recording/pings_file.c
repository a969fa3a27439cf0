/* SPDX-License-Identifier: MIT */
#include "hal/recording/pings_file.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "dsp/list.h"
#include "hal/table_file.h"
#include "hal/text_file.h"
#include "recon/survey.h"

enum { COLUMNS = 6 };

static const char *const names[2][COLUMNS] = {
    {"tx_x_m", "tx_y_m", "tx_z_m", "rx_x_m", "rx_y_m", "rx_z_m"},
    {"speaker_x_m", "speaker_y_m", "speaker_z_m", "microphone_x_m", "microphone_y_m",
     "microphone_z_m"}};

struct pings_file {
    const char *path;
    size_t line;            /* from 1 */
    bool named;             /* there was a line of names */
    size_t column[COLUMNS]; /* of the fields, which the six numbers are */
    size_t n_fields;        /* in a line of names */
    double (*pings)[2][3];
    size_t n, room;
    struct error *why;
};

static bool is_header(char *const *fields, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        char *end = fields[i];
        strtod(fields[i], &end);
        if (*end)
            return true;
    }
    return false;
}

static int take_names(struct pings_file *f, char *const *fields, size_t n)
{
    for (size_t c = 0; c < COLUMNS; c++) {
        size_t found = 0;
        for (size_t i = 0; i < n; i++) {
            if (strcasecmp(fields[i], names[0][c]) && strcasecmp(fields[i], names[1][c]))
                continue;
            f->column[c] = i;
            found++;
        }
        if (found != 1)
            return error_say(
                f->why, -EINVAL,
                "%s:%zu: the column %s %s; expected %s, %s, ... %s once each", f->path,
                f->line, names[0][c], found ? "is named twice" : "is missing",
                names[0][0], names[0][1], names[0][5]);
    }
    f->named = true;
    f->n_fields = n;
    return 0;
}

static int append(struct pings_file *f, const double at[COLUMNS])
{
    if (f->n == SURVEY_MAX_PINGS)
        return error_say(f->why, -EINVAL, "%s:%zu: more than %d pings", f->path, f->line,
                         SURVEY_MAX_PINGS);
    if (list_grow(&f->pings, f->n, &f->room, sizeof *f->pings))
        return error_say(f->why, -ENOMEM, "%s: out of memory", f->path);
    memcpy(f->pings[f->n++], at, sizeof *f->pings);
    return 0;
}

static int take_ping(struct pings_file *f, char *const *fields, size_t n)
{
    double at[COLUMNS];
    if (n != f->n_fields)
        return error_say(f->why, -EINVAL, "%s:%zu: %zu columns, expected %zu%s", f->path,
                         f->line, n, f->n_fields,
                         n == 2 * f->n_fields
                             ? "; where decimals have commas, put semicolons between the "
                               "columns"
                         : f->named
                             ? ""
                             : ": speaker x, y, z and microphone x, y, z in m, or a "
                               "first line with names");
    for (size_t c = 0; c < COLUMNS; c++) {
        const char *text = fields[f->column[c]];
        if (!table_number(text, &at[c]))
            return error_say(f->why, -EINVAL, "%s:%zu: %s is \"%.40s\", expected metres",
                             f->path, f->line, names[0][c], text);
    }
    return append(f, at);
}

static int take_line(void *ctx, char *line, size_t number)
{
    struct pings_file *f = ctx;
    char *fields[TABLE_MAX_FIELDS];
    f->line = number;
    if (f->line == 1 && !strncmp(line, "\xef\xbb\xbf", 3))
        line += 3; /* byte order mark */
    line += strspn(line, " ");
    if (*line == '#' || !line[strspn(line, " \t\r\n")])
        return 0;
    size_t n = table_split(line, COLUMNS, fields);
    if (!f->named && !f->n && is_header(fields, n))
        return take_names(f, fields, n);
    return take_ping(f, fields, n);
}

int pings_load(double (**out)[2][3], size_t *n, const char *path, struct error *why)
{
    struct pings_file f = {
        .path = path, .column = {0, 1, 2, 3, 4, 5}, .n_fields = COLUMNS, .why = why};
    int err = text_file_lines(path, take_line, &f, why);
    if (!err && !f.n)
        err = error_say(why, -EINVAL, "%s: expected a line for each ping, found none",
                        path);
    if (err) {
        free(f.pings);
        return err;
    }
    *out = f.pings;
    *n = f.n;
    return 0;
}

struct listing {
    const double (*pings)[2][3];
    size_t n;
};

static void print_pings(FILE *f, const void *what)
{
    const struct listing *l = what;
    char text[DECIMAL_SIZE];
    fputs("tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m\n", f);
    for (size_t k = 0; k < l->n; k++)
        for (int c = 0; c < 6; c++)
            fprintf(f, "%s%s", decimal_print(l->pings[k][c / 3][c % 3], text),
                    c < 5 ? "," : "\n");
}

int pings_save(const double (*pings)[2][3], size_t n, const char *path)
{
    const struct listing l = {pings, n};
    char *name;
    if (asprintf(&name, "%s-pings.csv", path) < 0)
        return -ENOMEM;
    int err = text_file_write(name, false, print_pings, &l);
    free(name);
    return err;
}
