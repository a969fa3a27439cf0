#include "nodes/anlos/speed_error/noise.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/interrupt.h"
#include "nodes/rt/export_file.h"
#include "recon/peak.h"

/* The point is looked for in a box: farther off an error is no error but a miss. */
static const double box_m[3] = {0.10, 0.10, 0.04};
static const double steps_m[3] = {0.008, 0.008, 0.003};

static const double levels_db[] = {-60, -55, -50, -45, -40, -35,
                                   -30, -20, -10, 0,   10,  20};

/* The others are not about where one point is in noise, or would take hours. */
static const char able[] = "fast\0backprojection\0confocal\0lct\0paper\0incoherent\0";

static bool is_able(const char *method)
{
    for (const char *m = able; *m; m += strlen(m) + 1)
        if (!strcmp(m, method))
            return true;
    return false;
}

static void choose(struct bench_noise *out, const char *methods)
{
    size_t used = 0;
    for (const char *m = methods; *m; m += strlen(m) + 1) {
        size_t n = strlen(m) + 1;
        if (!is_able(m) || used + n >= sizeof out->methods)
            continue;
        memcpy(out->methods + used, m, n);
        used += n;
        out->n_methods++;
    }
}

static size_t brightest(const float *v, size_t n)
{
    size_t best = 0;
    for (size_t i = 1; i < n; i++)
        best = v[i] > v[best] ? i : best;
    return best;
}

/* Adds the squares of one image's errors. */
static void add_errors(struct bench_noise *b, size_t method, size_t level,
                       const struct grid *grid, const float *image, const double at_m[3])
{
    struct peak_fit fit;
    peak_fit(grid, image, brightest(image, grid_size(grid)), 1.0, false, NULL, &fit);
    double x = fit.position_m[0] - at_m[0], y = fit.position_m[1] - at_m[1];
    double z = fit.position_m[2] - at_m[2];
    b->lateral_m[method][level] += x * x + y * y;
    b->depth_m[method][level] += z * z;
}

static int find_bounds(struct bench_noise *b, const struct bench_trials *t)
{
    struct bench_bound known, unknown;
    int err = bench_trials_bound(t, true, &known);
    if (!err)
        err = bench_trials_bound(t, false, &unknown);
    for (size_t i = 0; !err && i < b->n_levels; i++) {
        double scale = pow(10.0, -b->snr_db[i] / 20.0);
        b->known[i] =
            (struct bench_bound){scale * known.lateral_m, scale * known.depth_m};
        b->unknown[i] =
            (struct bench_bound){scale * unknown.lateral_m, scale * unknown.depth_m};
    }
    return err;
}

static int run_seeds(struct bench_noise *b, struct bench_trials *t, const double at_m[3],
                     size_t n_seeds, struct error *why)
{
    const struct grid *grid = &bench_trials_processing(t)->grid;
    double rms = sqrt(2.0 * bench_trials_power(t)); /* of the difference, at 0 dB */
    while (b->n_seeds < n_seeds && !interrupt_requested()) {
        bench_trials_noise(t, b->n_seeds);
        for (size_t m = 0; m < b->n_methods; m++)
            for (size_t i = 0; i < b->n_levels; i++)
                add_errors(
                    b, m, i, grid,
                    bench_trials_image(t, m, 1.0, rms * pow(10.0, -b->snr_db[i] / 20.0)),
                    at_m);
        b->n_seeds++;
    }
    for (size_t m = 0; m < b->n_methods; m++)
        for (size_t i = 0; i < b->n_levels; i++) {
            b->lateral_m[m][i] = sqrt(b->lateral_m[m][i] / (double)b->n_seeds);
            b->depth_m[m][i] = sqrt(b->depth_m[m][i] / (double)b->n_seeds);
        }
    return b->n_seeds < n_seeds ? error_say(why, -EINTR, "interrupted") : 0;
}

int bench_noise_run(struct bench_noise *out, const struct bench_scene *point,
                    const char *methods, size_t n_seeds, size_t threads,
                    struct error *why)
{
    const double *at_m = point->truth.points_m[0];
    struct bench_trials *t;
    double limits[3][3];
    *out = (struct bench_noise){.n_levels = sizeof levels_db / sizeof *levels_db};
    memcpy(out->snr_db, levels_db, sizeof levels_db);
    choose(out, methods);
    for (int a = 0; a < 3; a++) { /* not with the point on a voxel */
        limits[a][0] = at_m[a] - box_m[a] - 0.3 * steps_m[a];
        limits[a][1] = at_m[a] + box_m[a];
        limits[a][2] = steps_m[a];
    }
    int err = bench_trials_create(&t, point, (const double(*)[3])limits, out->methods,
                                  WINDOW_HANN, threads, why);
    if (err)
        return err;
    err = find_bounds(out, t);
    if (err)
        error_say(why, err, "bound: %s", strerror(-err));
    else
        err = run_seeds(out, t, at_m, n_seeds, why);
    bench_trials_destroy(t);
    return err;
}

int bench_noise_write(const struct bench_noise *b, const char *folder, struct error *why)
{
    struct export_file e;
    int err = export_file_open(&e, folder, "noise.csv", why);
    if (err)
        return err;
    fputs("method,snr_db,seeds,lateral_cm,depth_cm,bound_lateral_cm,bound_depth_cm,"
          "bound_depth_phase_known_cm\n",
          e.f);
    const char *m = b->methods;
    for (size_t i = 0; i < b->n_methods; i++, m += strlen(m) + 1)
        for (size_t k = 0; k < b->n_levels; k++)
            fprintf(e.f, "%s,%g,%zu,%.6g,%.6g,%.6g,%.6g,%.6g\n", m, b->snr_db[k],
                    b->n_seeds, 100.0 * b->lateral_m[i][k], 100.0 * b->depth_m[i][k],
                    100.0 * b->unknown[k].lateral_m, 100.0 * b->unknown[k].depth_m,
                    100.0 * b->known[k].depth_m);
    return export_file_commit(&e, why);
}
