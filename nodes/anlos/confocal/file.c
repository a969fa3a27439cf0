/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/confocal/file.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/mat_file.h"

#define DEFAULT_BIN_S 4e-12
#define MAX_PLACES    4096 /* along an axis */
#define SMOOTH        16   /* the gate is looked for in sums of 2 SMOOTH + 1 bins */

static int check_shape(const struct confocal_file *f, const char *path, struct error *why)
{
    if (f->nx < 2 || f->ny < 2 || f->n_bins < 2 || f->nx > MAX_PLACES ||
        f->ny > MAX_PLACES)
        return error_say(
            why, -EINVAL,
            "%s: rect_data: %zu x %zu x %zu, expected places x places x time "
            "bins, at least 2 of each and at most %d places",
            path, f->nx, f->ny, f->n_bins, MAX_PLACES);
    return 0;
}

static int read_scales(struct confocal_file *f, struct mat_file *mat, const char *path,
                       struct error *why)
{
    double width_m = 0.0, bin_s = DEFAULT_BIN_S;
    int err = mat_file_read_number(mat, "width", &width_m, why);
    if (!err && mat_file_has(mat, "bin_s"))
        err = mat_file_read_number(mat, "bin_s", &bin_s, why);
    if (err)
        return err;
    if (!(width_m > 1e-3 && width_m < 100.0))
        return error_say(
            why, -EINVAL,
            "%s: width: %g, expected half the side of the scan, 0.001 to 100 "
            "m",
            path, width_m);
    if (!(bin_s > 1e-15 && bin_s < 1e-6))
        return error_say(why, -EINVAL, "%s: bin_s: %g, expected 1e-15 to 1e-6 s", path,
                         bin_s);
    f->pitch_x_m = 2.0 * width_m / (double)(f->nx - 1);
    f->pitch_y_m = 2.0 * width_m / (double)(f->ny - 1);
    f->bin_m = 0.5 * CONFOCAL_LIGHT_M_S * bin_s;
    return 0;
}

/* What is no number is no light. */
static int check_counts(struct confocal_file *f, const char *path, struct error *why)
{
    size_t n = f->nx * f->ny * f->n_bins;
    float largest = 0.0f;
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(f->counts[i])) {
            f->counts[i] = 0.0f;
            f->n_not_finite++;
        }
        largest = fmaxf(largest, fabsf(f->counts[i]));
    }
    return largest > 0.0f ? 0
                          : error_say(why, -ENODATA,
                                      "%s: rect_data: nothing but zeros, expected photon "
                                      "counts",
                                      path);
}

int confocal_file_load(struct confocal_file *f, const char *path, struct error *why)
{
    struct mat_file *mat = NULL;
    size_t extents[3];
    memset(f, 0, sizeof *f);
    int err = mat_file_open(&mat, path, why);
    if (!err)
        err = mat_file_extents(mat, "rect_data", 3, extents, why);
    if (!err) {
        f->nx = extents[0];
        f->ny = extents[1];
        f->n_bins = extents[2];
        err = check_shape(f, path, why);
    }
    if (!err)
        err = read_scales(f, mat, path, why);
    if (!err)
        err = mat_file_read_float(mat, "rect_data", 3, extents, &f->counts, why);
    mat_file_close(mat);
    return err ? err : check_counts(f, path, why);
}

void confocal_file_clear(struct confocal_file *f)
{
    free(f->counts);
    memset(f, 0, sizeof *f);
}

/* Light of the whole scan around a bin. */
static double light(const double *total, size_t n_bins, size_t bin)
{
    size_t first = bin > SMOOTH ? bin - SMOOTH : 0;
    size_t end = bin + SMOOTH + 1 < n_bins ? bin + SMOOTH + 1 : n_bins;
    double sum = 0.0;
    for (size_t b = first; b < end; b++)
        sum += total[b];
    return sum / (double)(end - first);
}

void confocal_file_gate(const struct confocal_file *f, double gate_m[2])
{
    size_t places = f->nx * f->ny, darkest = 0, near = 0;
    double *total = calloc(f->n_bins, sizeof *total), least = INFINITY, contrast = 0.0;
    gate_m[0] = 0.0;
    gate_m[1] = (double)f->n_bins * f->bin_m;
    if (!total)
        return; /* the whole recording is a gate too */
    for (size_t b = 0; b < f->n_bins; b++)
        for (size_t q = 0; q < places; q++)
            total[b] += fmaxf(f->counts[b * places + q], 0.0f);
    for (size_t b = 0; b < f->n_bins; b++) {
        double now = light(total, f->n_bins, b);
        if (now < least) {
            least = now;
            darkest = b;
        }
        if (now > contrast * (least + 1e-9 * now)) {
            contrast = now / (least + 1e-9 * now);
            near = darkest;
        }
    }
    gate_m[0] = (double)near * f->bin_m;
    free(total);
}

/* plane[ny][nx] of a group of bins, to its place in the scan, x and y turned round. */
static void store_plane(const struct confocal_scan *s, const float *plane, size_t bin)
{
    for (size_t y = 0; y < s->ny; y++) {
        for (size_t x = 0; x < s->nx; x++) {
            size_t from = (s->ny - 1 - y) * s->nx + s->nx - 1 - x;
            s->counts[(y * s->nx + x) * s->n + bin] = plane[from];
        }
    }
}

int confocal_scan_create(struct confocal_scan *s, const struct confocal_file *f,
                         const double gate_m[2], size_t max_bins, double least_step_m,
                         struct error *why)
{
    size_t places = f->nx * f->ny;
    double low = ceil(fmax(gate_m[0] / f->bin_m, 0.0));
    double high = floor(fmin(gate_m[1] / f->bin_m + 1.0, (double)f->n_bins));
    memset(s, 0, sizeof *s);
    if (!(high - low >= 2.0))
        return error_say(why, -EINVAL,
                         "--gate-m %g,%g: expected NEAR,FAR around at least two bins of "
                         "the recording, which ends at %.3f m",
                         gate_m[0], gate_m[1], (double)f->n_bins * f->bin_m);
    size_t first = (size_t)low, n = (size_t)(high - low);
    size_t group = (n + max_bins - 1) / max_bins;
    double fine = fmin(floor(least_step_m / f->bin_m + 1e-6), (double)(n / 2));
    group = fine > (double)group ? (size_t)fine : group;
    *s = (struct confocal_scan){
        .nx = f->nx,
        .ny = f->ny,
        .n = n / group,
        .pitch_x_m = f->pitch_x_m,
        .pitch_y_m = f->pitch_y_m,
        .range_m = (low + 0.5 * (double)(group - 1)) * f->bin_m,
        .range_step_m = (double)group * f->bin_m,
    };
    float *plane = malloc(places * sizeof *plane);
    s->counts = malloc(places * s->n * sizeof *s->counts);
    if (plane && s->counts) {
        for (size_t b = 0; b < s->n; b++) {
            memset(plane, 0, places * sizeof *plane);
            for (size_t g = 0; g < group; g++)
                for (size_t q = 0; q < places; q++)
                    plane[q] += f->counts[(first + b * group + g) * places + q];
            store_plane(s, plane, b);
        }
    }
    free(plane);
    if (plane && s->counts)
        return 0;
    confocal_scan_clear(s);
    return error_say(why, -ENOMEM, "out of memory");
}

void confocal_scan_clear(struct confocal_scan *s)
{
    free(s->counts);
    memset(s, 0, sizeof *s);
}
