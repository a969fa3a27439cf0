/* SPDX-License-Identifier: MIT */
/* nodes/anlos/score/drive_report.h -- what came out of the drives: a table, drives.csv
 * with a line for each, drive.json with all figures; and of one NAME.csv with a line for
 * each list, NAME.svg and .png over time. */
#ifndef ANLOS_NODES_ANLOS_SCORE_DRIVE_REPORT_H
#define ANLOS_NODES_ANLOS_SCORE_DRIVE_REPORT_H

#include <jansson.h>
#include <stdint.h>
#include <stdio.h>

#include "dsp/error.h"
#include "nodes/anlos/score/drive_result.h"

/* "dir/drive-person.yaml": "drive-person". */
void drive_name(const char *path, char *out, size_t size);

void drive_print_head(void);
void drive_print(const char *name, const struct drive_tally *t);

/* Of all drives: a line for each bin. */
void drive_print_existence(const struct drive_result *r);

/* FOLDER/existence.svg, .png: a reliability diagram; of nothing, no file.  0 or a
 * negative errno. */
int drive_write_existence(const char *folder, const struct drive_result *r,
                          struct error *why);

/* A new object; NULL: no memory. */
json_t *drive_json(const struct drive_tally *t);

/* FOLDER/drive.json; of nothing, no file.  0 or a negative errno. */
int drive_json_write(const json_t *all, const char *folder, struct error *why);

/* FOLDER/drives.csv; fclose it.  A line is in the file when drive_csv_line returns. */
int drive_csv_open(FILE **out, const char *folder, struct error *why);
void drive_csv_line(FILE *f, const char *name, uint32_t draw,
                    const struct drive_result *r);

/* FOLDER/NAME.csv, .svg, .png.  0 or a negative errno. */
int drive_write(const char *folder, const char *name, const struct drive_moments *m,
                struct error *why);

#endif
