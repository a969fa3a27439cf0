/* SPDX-License-Identifier: MIT */
#include "recon/tracking/assignment.h"

#include <math.h>
#include <stdbool.h>

#define NOBODY ASSIGNMENT_ROWS

struct search { /* column 0 is where a path begins; the real ones count from 1 */
    size_t n_rows, n_columns;
    const double *cost;
    double row_dual[ASSIGNMENT_ROWS], column_dual[ASSIGNMENT_COLUMNS + 1];
    size_t owner[ASSIGNMENT_COLUMNS + 1]; /* the row that has a column */
    size_t from[ASSIGNMENT_COLUMNS + 1];  /* the column before, on the shortest path */
    double least[ASSIGNMENT_COLUMNS + 1]; /* length of that path */
    bool done[ASSIGNMENT_COLUMNS + 1];
};

/* From the row of a column on to all columns that are not reached yet; returns the
 * nearest of these. */
static size_t extend(struct search *s, size_t at)
{
    size_t row = s->owner[at], nearest = 0;
    double shortest = INFINITY;

    s->done[at] = true;
    for (size_t c = 1; c <= s->n_columns; c++) {
        if (s->done[c])
            continue;
        double length = s->cost[row * s->n_columns + c - 1] - s->row_dual[row] -
                        s->column_dual[c];
        if (length < s->least[c]) {
            s->least[c] = length;
            s->from[c] = at;
        }
        if (s->least[c] < shortest) {
            shortest = s->least[c];
            nearest = c;
        }
    }
    for (size_t c = 0; c <= s->n_columns; c++) {
        if (s->done[c]) {
            s->row_dual[s->owner[c]] += shortest;
            s->column_dual[c] -= shortest;
        } else {
            s->least[c] -= shortest;
        }
    }
    return nearest;
}

static void place(struct search *s, size_t row)
{
    size_t at = 0;

    for (size_t c = 0; c <= s->n_columns; c++) {
        s->least[c] = INFINITY;
        s->done[c] = false;
    }
    s->owner[0] = row;
    do
        at = extend(s, at);
    while (s->owner[at] != NOBODY);
    for (; at; at = s->from[at])
        s->owner[at] = s->owner[s->from[at]];
}

double assignment_solve(size_t n_rows, size_t n_columns, const double *cost,
                        size_t *column)
{
    struct search s = {.n_rows = n_rows, .n_columns = n_columns, .cost = cost};
    double total = 0.0;

    for (size_t c = 0; c <= n_columns; c++)
        s.owner[c] = NOBODY;
    for (size_t r = 0; r < n_rows; r++)
        place(&s, r);
    for (size_t c = 1; c <= n_columns; c++) {
        if (s.owner[c] == NOBODY)
            continue;
        column[s.owner[c]] = c - 1;
        total += cost[s.owner[c] * n_columns + c - 1];
    }
    return total;
}
