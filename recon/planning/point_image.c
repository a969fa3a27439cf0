/* SPDX-License-Identifier: MIT */
#include "recon/planning/point_image.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/pool.h"
#include "recon/detection/peak.h"
#include "recon/imaging/fold.h"
#include "recon/processing.h"

#define LINES   48  /* of an echo's spectrum: unambiguous for so many / B */
#define REACH   8.0 /* of an echo, either way, over B: what is left is 67 dB down */
#define STEPS   3.0 /* of the image in a width */
#define ASIDE_M 0.5
#define BEHIND  (2.0 * POINT_DEPTH) /* widths */

struct work {
    const struct survey *survey;
    struct processing processing;
    struct trace_format format;
    struct imager *imager;
    const double *at_m;
    float complex **traces; /* [threads][n_microphones][n_samples] */
};

/* How much farther than recon/geometry.h has it the stage is when a frequency leaves. */
static double further_m(const struct work *w, size_t speaker, double hz)
{
    const struct survey *s = w->survey;
    double part = (hz - s->chirp_start_hz) / (s->chirp_stop_hz - s->chirp_start_hz);
    if (!s->continuous || s->n_replica)
        return 0.0;
    part = survey_is_down(s, speaker) ? 1.0 - part : part;
    double since_s = part * s->chirp_duration_s + s->latency_samples / s->sample_rate_hz;
    return survey_speed_m_s(s) * since_s - w->processing.geometry.chirp_m[speaker % 2];
}

/* The way from an element to the point, and how it changes with the stage. */
static double way_m(const struct work *w, const double from[3], double *slope)
{
    double along_m = 0.0, m = geometry_distance(from, w->at_m);
    for (int a = 0; a < 3; a++)
        along_m += (from[a] - w->at_m[a]) * w->survey->stage_axis[a];
    *slope += along_m / m;
    return m;
}

/* One pair's trace, Hann's window over the band. */
static void echo(const struct work *w, size_t position, size_t speaker, size_t microphone,
                 float complex *out)
{
    const struct geometry *g = &w->processing.geometry;
    const struct trace_format *f = &w->format;
    const double *band_hz = w->processing.band_hz;
    double from[3], to[3], slope = 0.0, width_hz = band_hz[1] - band_hz[0];
    geometry_speaker(g, position, speaker, from);
    geometry_microphone(g, position, speaker, microphone, to);
    double out_m = way_m(w, from, &slope), back_m = way_m(w, to, &slope);
    double delay_s = (out_m + back_m) / g->sound_speed_m_s;
    double first = ceil((delay_s - REACH / width_hz - f->t0_s) * f->rate_hz);
    double last = floor((delay_s + REACH / width_hz - f->t0_s) * f->rate_hz);
    size_t low = first > 0.0 ? (size_t)first : 0;
    size_t high = last < 0.0 ? 0 : (size_t)fmin(last + 1.0, (double)f->n_samples);
    memset(out, 0, f->n_samples * sizeof *out);
    for (int q = 0; q < LINES; q++) {
        double part = (q + 0.5) / LINES, hz = band_hz[0] + part * width_hz;
        double way = out_m + back_m + slope * further_m(w, speaker, hz);
        double t_s = f->t0_s + (double)low / f->rate_hz;
        double level = (0.5 - 0.5 * cos(2.0 * M_PI * part)) / (out_m * back_m * LINES);
        double complex turn = cexp(2.0 * M_PI * I * (hz - f->carrier_hz) / f->rate_hz);
        double complex at =
            level * cexp(2.0 * M_PI * I *
                         (hz * (t_s - way / g->sound_speed_m_s) - f->carrier_hz * t_s));
        for (size_t n = low; n < high; n++, at *= turn)
            out[n] += (float complex)at;
    }
}

static void add_position(void *ctx, size_t position, size_t thread)
{
    struct work *w = ctx;
    const struct survey *s = w->survey;
    for (size_t j = 0; j < s->n_speakers; j++) {
        for (size_t i = 0; i < s->n_microphones; i++)
            echo(w, position, j, i, w->traces[thread] + i * w->format.n_samples);
        imager_add(w->imager, position, j, w->traces[thread], NULL);
    }
}

/* -- the volume -------------------------------------------------------------------------
 */

static int set_volume(struct survey *s, const double at_m[3], struct error *why)
{
    struct geometry g;
    double low[3], high[3], width_m[3], narrowest_m = INFINITY, behind_m;
    const double band_hz[2] = {fmin(s->chirp_start_hz, s->chirp_stop_hz),
                               fmax(s->chirp_start_hz, s->chirp_stop_hz)};
    processing_geometry(&g, s);
    geometry_aperture(&g, low, high);
    geometry_resolution_at(&g, band_hz, at_m, width_m);
    behind_m = BEHIND * width_m[2];
    if (!(at_m[2] - behind_m > high[2]))
        return error_say(why, -EINVAL,
                         "a point at %g, %g, %g m: expected z above %.2f m, well before "
                         "the array",
                         at_m[0], at_m[1], at_m[2], high[2] + behind_m);
    for (int a = 0; a < 2; a++)
        narrowest_m = fmin(narrowest_m, width_m[a]);
    for (int a = 0; a < 3; a++) {
        double *v = s->volume_m[a];
        if (a == 2) {
            v[0] = at_m[2] - behind_m;
            v[1] = at_m[2] + behind_m;
        } else if (!s->has_volume) {
            v[0] = fmin(low[a], at_m[a]) - ASIDE_M;
            v[1] = fmax(high[a], at_m[a]) + ASIDE_M;
        } else if (v[0] == v[1] && at_m[a] == v[0]) {
            v[2] = narrowest_m / STEPS; /* a volume of one plane */
            continue;
        } else if (!(v[0] < at_m[a] && at_m[a] < v[1])) {
            return error_say(why, -EINVAL,
                             "a point at %g, %g, %g m: expected it in the volume, %g to "
                             "%g m along %c",
                             at_m[0], at_m[1], at_m[2], v[0], v[1], "xy"[a]);
        }
        v[2] = (isfinite(width_m[a]) ? width_m[a] : narrowest_m) / STEPS;
        /* Not with the point on a voxel. */
        v[0] = at_m[a] - v[2] * (floor((at_m[a] - v[0]) / v[2]) + 0.3);
    }
    s->has_volume = true;
    return 0;
}

static int plan(struct work *w, struct pool *pool, struct error *why)
{
    const struct processing *p = &w->processing;
    struct error inner;
    int err = processing_plan(&w->processing, w->survey, why);
    if (!err)
        err = processing_compressor_format(&w->format, p, w->survey, why);
    if (err)
        return err;
    err = processing_imager(&w->imager, p, "fast", &w->format, pool, &inner);
    if (err == -ENOTSUP)
        err =
            processing_imager(&w->imager, p, "backprojection", &w->format, pool, &inner);
    return err ? error_say(why, err, "%s", inner.text) : 0;
}

/* -- what the image tells ---------------------------------------------------------------
 */

/* Along an axis that is not resolved all is the point. */
static bool is_lobe(const double at_m[3], const double width_m[3],
                    const double voxel_m[3])
{
    double off[3];
    for (int a = 0; a < 3; a++)
        off[a] = (voxel_m[a] - at_m[a]) / width_m[a];
    return hypot(off[0], off[1]) >= POINT_LOBE || fabs(off[2]) >= POINT_DEPTH;
}

/* From a voxel to where the intensity is a quarter, in voxels of decibels between two. */
static double fall(const float *at, ptrdiff_t stride, size_t left)
{
    double level = 0.25 * (double)*at;
    for (size_t n = 1; n <= left; n++) {
        double here = (double)at[(ptrdiff_t)n * stride];
        double before = (double)at[(ptrdiff_t)(n - 1) * stride];
        if (here < level)
            return (double)n - log(level / here) / log(before / here);
    }
    return (double)left;
}

static void measure_widths(double width_m[3], const struct grid *g, const float *v,
                           size_t voxel)
{
    const ptrdiff_t stride[] = {1, (ptrdiff_t)g->n[0], (ptrdiff_t)(g->n[0] * g->n[1])};
    size_t at[3];
    grid_place(g, voxel, at);
    for (int a = 0; a < 3; a++)
        width_m[a] = g->step_m[a] * (fall(v + voxel, stride[a], g->n[a] - 1 - at[a]) +
                                     fall(v + voxel, -stride[a], at[a]));
}

static int measure(struct point_image *out, const struct work *w, const float *v,
                   struct error *why)
{
    const struct grid *g = &w->processing.grid;
    const double *at_m = w->at_m;
    struct peak_fit fit;
    double width_m[3];
    size_t best = grid_size(g);
    float lobe = 0.0f;
    geometry_resolution_at(&w->processing.geometry, w->processing.band_hz, at_m, width_m);
    for (size_t i = 0; i < grid_size(g); i++) {
        size_t at[3];
        double voxel_m[3];
        grid_place(g, i, at);
        for (int a = 0; a < 3; a++)
            voxel_m[a] = g->origin_m[a] + (double)at[a] * g->step_m[a];
        if (is_lobe(at_m, width_m, voxel_m))
            lobe = fmaxf(lobe, v[i]);
        else if (best == grid_size(g) || v[i] > v[best])
            best = i;
    }
    if (best == grid_size(g) || !(v[best] > 0.0f))
        return error_say(why, -EINVAL,
                         "a point at %g, %g, %g m is not heard; expected one within the "
                         "gate",
                         at_m[0], at_m[1], at_m[2]);
    peak_fit(g, v, best, 1.0, false, NULL, &fit);
    for (int a = 0; a < 3; a++)
        out->beside_m[a] = fit.position_m[a] - at_m[a];
    measure_widths(out->width_m, g, v, best);
    out->sidelobe_db = lobe > 0.0f ? 10.0 * log10((double)(v[best] / lobe)) : INFINITY;
    return 0;
}

/* Noise of equal traces, each as its midpoint has it. */
static int count_traces(struct point_image *out, const struct geometry *g)
{
    size_t n = g->n_positions * g->n_speakers * g->n_microphones;
    double sum = 0.0, square = 0.0;
    float *weight;
    if (fold_weights(g, &weight))
        return -ENOMEM;
    for (size_t q = 0; q < n; q++) {
        sum += (double)weight[q];
        square += (double)weight[q] * (double)weight[q];
    }
    out->traces = sum * sum / square;
    free(weight);
    return 0;
}

static int image(struct point_image *out, struct work *w, struct pool *pool,
                 struct error *why)
{
    size_t threads = pool_threads(pool);
    size_t size = w->survey->n_microphones * w->format.n_samples;
    float *v = malloc(grid_size(&w->processing.grid) * sizeof *v);
    w->traces = calloc(threads, sizeof *w->traces);
    int err = v && w->traces ? 0 : -ENOMEM;
    for (size_t t = 0; !err && t < threads; t++) {
        w->traces[t] = malloc(size * sizeof **w->traces);
        err = w->traces[t] ? 0 : -ENOMEM;
    }
    if (!err)
        err = count_traces(out, &w->processing.geometry);
    if (err) {
        error_say(why, err, "out of memory");
    } else {
        pool_run(pool, w->survey->n_positions, add_position, w);
        err = imager_image(w->imager, v);
        err = err ? error_say(why, err, "stopped") : measure(out, w, v, why);
    }
    for (size_t t = 0; w->traces && t < threads; t++)
        free(w->traces[t]);
    free(w->traces);
    free(v);
    return err;
}

int point_image(struct point_image *out, const struct survey *s, const double at_m[3],
                struct pool *pool, struct error *why)
{
    struct survey own;
    struct work w = {.survey = &own, .at_m = at_m};
    if (s->pings_m)
        return error_say(why, -EINVAL, "pings with places of their own are no scan");
    if (survey_copy(&own, s))
        return error_say(why, -ENOMEM, "out of memory");
    int err = set_volume(&own, at_m, why);
    if (!err)
        err = plan(&w, pool, why);
    if (!err)
        err = image(out, &w, pool, why);
    imager_destroy(w.imager);
    survey_clear(&own);
    return err;
}
