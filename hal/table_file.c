/* SPDX-License-Identifier: MIT */
#include "hal/table_file.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "hal/text_file.h"

#define MOST_S 4e9 /* until 2096 */

enum { NO_COLUMN = TABLE_MAX_FIELDS };

struct table {
    const char *path;
    size_t line; /* from 1 */
    const struct table_column *columns;
    size_t n_columns;
    size_t at[TABLE_MAX_FIELDS]; /* which field a column is, or NO_COLUMN */
    size_t n_fields;             /* of each line; 0: there were no names yet */
    table_row *row;
    void *ctx;
    struct error *why;
};

static bool has_decimal_commas(const char *line, size_t least)
{
    size_t n = 1;
    for (; *line; line++)
        n += *line == ';' || *line == '\t';
    return n >= least;
}

size_t table_split(char *line, size_t least, char *fields[TABLE_MAX_FIELDS])
{
    size_t n = 0;
    line[strcspn(line, "\r\n")] = 0;
    if (has_decimal_commas(line, least))
        for (char *c = line; *c; c++)
            *c = *c == ',' ? '.' : *c;
    for (char *at = line; at && n < TABLE_MAX_FIELDS; n++) {
        char *end = strpbrk(at, ",;\t");
        if (end)
            *end++ = 0;
        at += strspn(at, " \"");
        size_t length = strlen(at);
        while (length && strchr(" \"", at[length - 1]))
            at[--length] = 0;
        fields[n] = at;
        at = end;
    }
    return n;
}

bool table_number(const char *text, double *out)
{
    char *end;
    *out = strtod(text, &end);
    return end != text && !*end && isfinite(*out);
}

bool table_count(const char *text, uint64_t most, uint64_t *out)
{
    char *end;
    errno = 0;
    *out = strtoull(text, &end, 10);
    return *text >= '0' && *text <= '9' && !*end && !errno && *out <= most;
}

bool table_time(const char *text, int64_t *out_ns)
{
    double s;
    if (!table_number(text, &s) || !(s >= 0.0 && s < MOST_S))
        return false;
    const char *point = strchr(text, '.');
    *out_ns = !point || strpbrk(text, "eExX")
                  ? llround(s * 1e9)
                  : (int64_t)strtoll(text, NULL, 10) * INT64_C(1000000000) +
                        llround(strtod(point, NULL) * 1e9);
    return true;
}

static int take_names(struct table *t, char *const *fields, size_t n)
{
    for (size_t c = 0; c < t->n_columns; c++) {
        size_t found = 0;
        t->at[c] = NO_COLUMN;
        for (size_t i = 0; i < n; i++)
            if (!strcasecmp(fields[i], t->columns[c].name)) {
                t->at[c] = i;
                found++;
            }
        if (found > 1 || (!found && t->columns[c].needed))
            return error_say(t->why, -EINVAL,
                             "%s:%zu: the column %s is %s; the first line names the "
                             "columns",
                             t->path, t->line, t->columns[c].name,
                             found ? "named twice" : "missing");
    }
    t->n_fields = n;
    return 0;
}

static int take_line(void *ctx, char *line, size_t number)
{
    struct table *t = ctx;
    char *fields[TABLE_MAX_FIELDS], *row[TABLE_MAX_FIELDS];
    t->line = number;
    if (t->line == 1 && !strncmp(line, "\xef\xbb\xbf", 3))
        line += 3; /* byte order mark */
    line += strspn(line, " ");
    if (*line == '#' || !line[strspn(line, " \t\r\n")])
        return 0;
    size_t n =
        table_split(line, t->n_fields > 1 ? t->n_fields : TABLE_MAX_FIELDS, fields);
    if (!t->n_fields)
        return take_names(t, fields, n);
    if (n != t->n_fields)
        return error_say(t->why, -EINVAL, "%s:%zu: %zu columns, expected %zu", t->path,
                         t->line, n, t->n_fields);
    for (size_t c = 0; c < t->n_columns; c++)
        row[c] = t->at[c] == NO_COLUMN ? NULL : fields[t->at[c]];
    const char *wrong = t->row(t->ctx, row);
    return wrong ? error_say(t->why, -EINVAL, "%s:%zu: %s", t->path, t->line, wrong) : 0;
}

int table_load(const char *path, const struct table_column *columns, size_t n_columns,
               table_row *row, void *ctx, struct error *why)
{
    struct table t = {.path = path,
                      .columns = columns,
                      .n_columns = n_columns,
                      .row = row,
                      .ctx = ctx,
                      .why = why};
    int err = text_file_lines(path, take_line, &t, why);

    if (!err && !t.n_fields)
        err =
            error_say(why, -EINVAL, "%s: empty; its first line names the columns", path);
    return err;
}
