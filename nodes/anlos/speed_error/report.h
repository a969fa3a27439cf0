/* SPDX-License-Identifier: MIT */
/* nodes/anlos/speed_error/report.h -- the results of `anlos speed-error` as Markdown
 * and pictures. */
#ifndef ANLOS_NODES_ANLOS_SPEED_ERROR_REPORT_H
#define ANLOS_NODES_ANLOS_SPEED_ERROR_REPORT_H

#include "nodes/anlos/speed_error/noise.h"
#include "nodes/anlos/speed_error/results.h"

/* Writes FOLDER/speed-error.md.  noise: NULL for none.  remark: said at the top, or NULL.
 * 0 or a negative errno. */
int bench_table_write(const struct bench_results *b, const struct bench_noise *noise,
                      const char *remark, const char *folder, struct error *why);

/* What was varied of a case, as words: "2-14 kHz". */
void bench_table_setting(const struct bench_case *c, char *text, size_t size);

/* The pictures, each as SVG and PNG. */

/* speed-error-SCENE: error over time, a mark for each run, the Pareto front as a line.
 * Nothing where no run counts.  All: 0 or a negative errno. */
int bench_chart_scene(const struct bench_results *b, const char *scene,
                      const char *folder, struct error *why);

/* noise-lateral and noise-depth: error over signal to noise, and the bound. */
int bench_chart_noise(const struct bench_noise *b, const char *folder, struct error *why);

/* growth-time and growth-memory, over 1, 4 and 16 times the work. */
int bench_chart_growth(const struct bench_results *b, const char *folder,
                       struct error *why);

#endif
