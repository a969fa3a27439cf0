/* nodes/anlos/speed_error/noise.h -- position error of one point over raw signal to
 * noise, rms over many seeds, beside the Cramer-Rao bound. */
#ifndef ANLOS_NODES_ANLOS_SPEED_ERROR_NOISE_H
#define ANLOS_NODES_ANLOS_SPEED_ERROR_NOISE_H

#include "nodes/anlos/speed_error/trials.h"

#define BENCH_NOISE_LEVELS 16

struct bench_noise {
    char methods[256]; /* that were run, as imager_methods() has them */
    size_t n_methods, n_levels, n_seeds;
    double snr_db[BENCH_NOISE_LEVELS]; /* raw: echoes over noise in the recording */
    double lateral_m[BENCH_TRIAL_METHODS][BENCH_NOISE_LEVELS];
    double depth_m[BENCH_TRIAL_METHODS][BENCH_NOISE_LEVELS];
    struct bench_bound known[BENCH_NOISE_LEVELS], unknown[BENCH_NOISE_LEVELS];
};

/* Of those of `methods` that are about where one point is in noise and take no hours.
 * What is done when a person interrupts stays (n_seeds).  0, -EINTR, other negative
 * errno. */
int bench_noise_run(struct bench_noise *out, const struct bench_scene *point,
                    const char *methods, size_t n_seeds, size_t threads,
                    struct error *why);

/* FOLDER/noise.csv.  0, negative errno. */
int bench_noise_write(const struct bench_noise *b, const char *folder, struct error *why);

#endif
