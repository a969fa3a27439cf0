/* nodes/anlos/speed_error/chart.h -- the pictures of `anlos speed-error`, each as
 * SVG and PNG. */
#ifndef ANLOS_NODES_ANLOS_SPEED_ERROR_CHART_H
#define ANLOS_NODES_ANLOS_SPEED_ERROR_CHART_H

#include "nodes/anlos/speed_error/noise.h"
#include "nodes/anlos/speed_error/results.h"

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
