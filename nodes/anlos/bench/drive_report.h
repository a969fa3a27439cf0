/* nodes/anlos/bench/drive_report.h -- what came out of the drives: a table, NAME.csv with
 * a line for each list, NAME.svg and .png over time, drive.json with all figures. */
#ifndef ANLOS_NODES_ANLOS_BENCH_DRIVE_REPORT_H
#define ANLOS_NODES_ANLOS_BENCH_DRIVE_REPORT_H

#include <jansson.h>

#include "nodes/anlos/bench/drive_score.h"

struct drive_moments {
    struct drive_moment *at; /* [n]; free() it */
    size_t n, room;
};

/* 0, -ENOMEM. */
int drive_moments_add(struct drive_moments *m, const struct drive_moment *moment);

void drive_print_head(void);
void drive_print(const char *name, const struct drive_score *s, size_t n_lists);

/* A new object; NULL: no memory. */
json_t *drive_json(const struct drive_score *s, size_t n_lists);

/* FOLDER/NAME.csv, .svg, .png.  0 or a negative errno. */
int drive_write(const char *folder, const char *name, const struct drive_moments *m,
                struct complaint *why);

#endif
