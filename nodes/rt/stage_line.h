/* SPDX-License-Identifier: MIT */
/* nodes/rt/stage_line.h -- where a stage is between its reports: it goes straight on at
 * one speed, so a line through what it said lately (least squares) is nearer to its place
 * than any report.  How far the reports lie beside the line is their jitter. */
#ifndef ANLOS_NODES_RT_STAGE_LINE_H
#define ANLOS_NODES_RT_STAGE_LINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define STAGE_LINE_REPORTS 1024

struct stage_line { /* zero: nothing was reported */
    size_t n;       /* reports so far; a ring has the newest */
    int64_t at_ns[STAGE_LINE_REPORTS];
    double place_m[STAGE_LINE_REPORTS];
};

/* A report that is not newer than the one before is ignored; one that is older by a
 * second restarts the line: a clock was set back, or the one before was wrong. */
void stage_line_add(struct stage_line *l, int64_t at_ns, double place_m);

struct stage_line_fit {
    size_t n;       /* reports */
    int64_t at_ns;  /* their mean time, */
    double place_m; /* where it was then */
    double speed_m_s;
    double jitter_m; /* rms of what the reports lie beside */
};

/* Through the reports of this span.  false: there are fewer than three, or all of one
 * time. */
bool stage_line_fit(const struct stage_line *l, int64_t from_ns, int64_t to_ns,
                    struct stage_line_fit *out);

double stage_line_place_m(const struct stage_line_fit *f, int64_t at_ns);

/* When it gets to a place. */
int64_t stage_line_time_ns(const struct stage_line_fit *f, double place_m);

#endif
