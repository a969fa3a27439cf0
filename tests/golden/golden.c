/* SPDX-License-Identifier: MIT */
#include "tests/golden/golden.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MAX_TABLES 8
#define MAX_NAME   64

struct table {
    char name[MAX_NAME];
    size_t rows, columns;
    double *values;
};

struct golden {
    char name[MAX_NAME];
    struct table tables[MAX_TABLES];
    size_t n_tables;
};

static void skip_comments(FILE *file)
{
    int c;
    while ((c = fgetc(file)) == '#')
        while ((c = fgetc(file)) != '\n' && c != EOF)
            ;
    ungetc(c, file);
}

/* false at the end of the file. */
static bool read_table(struct golden *g, FILE *file)
{
    struct table *t = &g->tables[g->n_tables];
    int found = fscanf(file, "%63s %zu %zu", t->name, &t->rows, &t->columns);
    if (found == EOF)
        return false;
    if (found != 3 || t->rows * t->columns == 0 || t->rows * t->columns > 1000000)
        fail_msg("%s: table %zu is damaged", g->name, g->n_tables);
    t->values = malloc(t->rows * t->columns * sizeof *t->values);
    assert_non_null(t->values);
    for (size_t i = 0; i < t->rows * t->columns; i++)
        if (fscanf(file, "%lf", &t->values[i]) != 1)
            fail_msg("%s: %s is damaged at number %zu", g->name, t->name, i);
    g->n_tables++;
    return true;
}

struct golden *golden_open(const char *name)
{
    char path[512];
    struct golden *g = calloc(1, sizeof *g);
    assert_non_null(g);
    snprintf(g->name, sizeof g->name, "%s", name);
    snprintf(path, sizeof path, "%s/tests/golden/vectors/%s.txt", SOURCE_DIR, name);
    FILE *file = fopen(path, "r");
    if (!file)
        fail_msg("%s cannot be read", path);
    skip_comments(file);
    while (g->n_tables < MAX_TABLES && read_table(g, file))
        ;
    fclose(file);
    return g;
}

const double *golden_table(const struct golden *g, const char *name, size_t *rows,
                           size_t *columns)
{
    for (size_t t = 0; t < g->n_tables; t++) {
        if (strcmp(g->tables[t].name, name) != 0)
            continue;
        if (rows)
            *rows = g->tables[t].rows;
        if (columns)
            *columns = g->tables[t].columns;
        return g->tables[t].values;
    }
    fail_msg("%s has no table %s", g->name, name);
    return NULL;
}

void golden_close(struct golden *g)
{
    for (size_t t = 0; t < g->n_tables; t++)
        free(g->tables[t].values);
    free(g);
}
