/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/confocal/scan.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <fftw3.h>

#include "dsp/fft.h"
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

/* -- its waves --------------------------------------------------------------------------
 */

#define PADDING  1.3  /* keeps a trace's end from its beginning */
#define TAPER    0.05 /* of a trace, at both ends */
#define PARTS    64   /* of the spectrum, in which the band is looked for */
#define FAINTEST 1e-6 /* of the largest power */
#define LOWEST   0.1  /* of the highest frequency: slower changes are no edges */
#define LEAST    0.1  /* of the sampled band is used in any case */

struct spectrum {
    size_t n;               /* of the transform */
    float *in, *out;        /* [n] complex */
    float *taper;           /* [samples] */
    fftwf_plan forth, back; /* back: from out to in */
    size_t low, high;       /* bins of the band */
};

static void spectrum_clear(struct spectrum *x)
{
    fftwf_destroy_plan(x->forth);
    fftwf_destroy_plan(x->back);
    fftwf_free(x->in);
    fftwf_free(x->out);
    free(x->taper);
}

static int spectrum_create(struct spectrum *x, size_t samples)
{
    memset(x, 0, sizeof *x);
    x->n = fft_size((size_t)ceil(PADDING * (double)samples) + 8, 1.1);
    x->in = fftwf_malloc(2 * x->n * sizeof *x->in);
    x->out = fftwf_malloc(2 * x->n * sizeof *x->out);
    x->taper = malloc(samples * sizeof *x->taper);
    if (!x->in || !x->out || !x->taper)
        return -ENOMEM;
    x->forth = fft_plan(x->n, x->in, x->out, FFTW_FORWARD);
    x->back = fft_plan(x->n, x->out, x->in, FFTW_BACKWARD);
    for (size_t i = 0; i < samples; i++) {
        double edge = fmin((double)i + 0.5, (double)(samples - i) - 0.5);
        double part = fmin(edge / (TAPER * (double)samples), 1.0);
        x->taper[i] = (float)(0.5 - 0.5 * cos(M_PI * part));
    }
    return x->forth && x->back ? 0 : -ENOMEM;
}

/* The spectrum of the trace at a place, x->out. */
static void transform_place(struct spectrum *x, const struct confocal_scan *s,
                            size_t place)
{
    const float *counts = s->counts + place * s->n;
    double mean = 0.0;
    memset(x->in, 0, 2 * x->n * sizeof *x->in);
    for (size_t i = 0; i < s->n; i++) {
        x->in[2 * i] = counts[i] > 0.0f ? sqrtf(counts[i]) : 0.0f;
        mean += x->in[2 * i];
    }
    mean /= (double)s->n;
    for (size_t i = 0; i < s->n; i++)
        x->in[2 * i] = x->taper[i] * (x->in[2 * i] - (float)mean);
    fftwf_execute(x->forth);
}

/* part[PARTS]: mean power of the parts of the spectrum up to half the rate.  Migration
 * sums all traces, so that what stands out of the noise by a small part of it counts. */
static int choose_band(struct spectrum *x, const double *part, size_t n_traces)
{
    double noise = 0.0, most = 0.0;
    size_t last = 0;
    for (size_t p = 0; p < PARTS; p++) {
        most = fmax(most, part[p]);
        if (p >= PARTS - PARTS / 4)
            noise += part[p] / (PARTS / 4);
    }
    double least = fmax(noise * (1.0 + 1.0 / sqrt((double)n_traces)), FAINTEST * most);
    if (!(most > 0.0))
        return -ENODATA;
    while (last < PARTS && part[last] > least)
        last++;
    double high = fmax((double)last / PARTS, LEAST) * 0.5 * (double)x->n;
    x->high = (size_t)fmin(fmax(high, 8.0), (double)(x->n / 2 - 1));
    x->low = (size_t)fmax(LOWEST * (double)x->high, 1.0);
    return x->high > x->low + 2 ? 0 : -ENODATA;
}

static int find_band(struct spectrum *x, const struct confocal_scan *s)
{
    double part[PARTS] = {0};
    size_t count[PARTS] = {0}, half = x->n / 2, n_traces = s->nx * s->ny;
    for (size_t q = 0; q < n_traces; q++) {
        transform_place(x, s, q);
        for (size_t b = 1; b < half; b++) {
            double re = x->out[2 * b], im = x->out[2 * b + 1];
            part[b * PARTS / half] += re * re + im * im;
            count[b * PARTS / half]++;
        }
    }
    for (size_t p = 0; p < PARTS; p++)
        part[p] /= (double)(count[p] ? count[p] : 1);
    return choose_band(x, part, n_traces);
}

/* The band with a Hann window, its middle at frequency 0. */
static void shift_band(struct spectrum *x)
{
    size_t middle = (x->low + x->high) / 2;
    memcpy(x->in, x->out, 2 * x->n * sizeof *x->in);
    memset(x->out, 0, 2 * x->n * sizeof *x->out);
    for (size_t b = x->low; b <= x->high; b++) {
        double at = (double)(b - x->low) / (double)(x->high - x->low);
        float w = (float)((0.5 - 0.5 * cos(2.0 * M_PI * at)) / (double)x->n);
        float *to = x->out + 2 * ((b + x->n - middle) % x->n);
        to[0] = w * x->in[2 * b];
        to[1] = w * x->in[2 * b + 1];
    }
}

/* A bin's phase counts from sample 0; the carrier's from time 0. */
static void convert(struct spectrum *x, const struct confocal_scan *s,
                    struct confocal_traces *t)
{
    double turns = t->format.carrier_hz * t->format.t0_s;
    double angle = -2.0 * M_PI * (turns - floor(turns));
    float c = (float)cos(angle), d = (float)sin(angle);
    for (size_t q = 0; q < s->nx * s->ny; q++) {
        size_t ix = q % s->nx, iy = q / s->nx;
        float *out = (float *)(t->traces + (ix * s->ny + iy) * s->n);
        transform_place(x, s, q);
        shift_band(x);
        fftwf_execute(x->back);
        for (size_t i = 0; i < s->n; i++) {
            float re = x->in[2 * i], im = x->in[2 * i + 1];
            out[2 * i] = re * c - im * d;
            out[2 * i + 1] = re * d + im * c;
        }
    }
}

int confocal_traces_create(struct confocal_traces *t, const struct confocal_scan *s,
                           struct error *why)
{
    struct spectrum x;
    memset(t, 0, sizeof *t);
    int err = spectrum_create(&x, s->n);
    if (!err)
        err = find_band(&x, s);
    if (err == -ENODATA)
        error_say(why, err, "rect_data: does not change over time in the gate");
    if (!err) {
        double rate_hz = 0.5 * CONFOCAL_LIGHT_M_S / s->range_step_m;
        double bin_hz = rate_hz / (double)x.n;
        t->format = (struct trace_format){
            .t0_s = 2.0 * s->range_m / CONFOCAL_LIGHT_M_S,
            .rate_hz = rate_hz,
            .carrier_hz = (double)((x.low + x.high) / 2) * bin_hz,
            .n_samples = s->n,
        };
        t->band_hz[0] = (double)x.low * bin_hz;
        t->band_hz[1] = (double)x.high * bin_hz;
        t->traces = malloc(s->nx * s->ny * s->n * sizeof *t->traces);
        err = t->traces ? 0 : -ENOMEM;
    }
    if (!err)
        convert(&x, s, t);
    if (err == -ENOMEM)
        error_say(why, err, "out of memory");
    spectrum_clear(&x);
    return err;
}

void confocal_traces_clear(struct confocal_traces *t)
{
    free(t->traces);
    memset(t, 0, sizeof *t);
}
