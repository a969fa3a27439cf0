/* SPDX-License-Identifier: MIT */
#include "recon/imaging/imager.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/imaging/method.h"

/* Pulse widths (1 / bandwidth) of traces around those of an image. */
#define MARGIN 16.0

/* Widths of a point's image that a fit is given beyond the volume: what stands there and
 * reaches into the volume is explained where it stands. */
#define OUTSIDE_WIDTHS 2.0

static const struct imager_method *const methods[] = {
    &method_fast,  &method_backprojection, &method_confocal,  &method_lct,
    &method_paper, &method_incoherent,     &method_iterative, &method_sparse};

struct imager {
    const struct imager_method *method;
    void *state;
    struct pool *pool;
    size_t n_speakers, n_pings, n_microphones, n_samples;
    struct grid grid, fitted; /* what was asked for, and what the method images */
    size_t before[3];         /* voxels of the second before the first */
    float *volume;            /* [fitted]; NULL: they are the same */
    atomic_bool *added;       /* [n_pings] */
    bool *masked;             /* [n_pings][n_microphones] */
    atomic_size_t count;
};

const char *imager_methods(void)
{
    return "fast\0backprojection\0confocal\0lct\0paper\0incoherent\0iterative\0sparse\0";
}

static const struct imager_method *find(const char *name)
{
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++)
        if (strcmp(methods[m]->name, name) == 0)
            return methods[m];
    return NULL;
}

bool imager_has_method(const char *name)
{
    return find(name) != NULL;
}

bool imager_isolates(const char *name)
{
    const struct imager_method *m = find(name);

    return m && m->isolates;
}

bool imager_clips(const char *name)
{
    const struct imager_method *m = find(name);

    return m && m->clips;
}

int method_span(double span_s[2], const struct imager_config *cfg, double half_offset_m,
                const char **why)
{
    double delays_s[2], c = cfg->geometry->sound_speed_m_s;
    double end_s = cfg->format.t0_s + (double)cfg->format.n_samples / cfg->format.rate_hz;
    double margin_s = MARGIN / (cfg->band_hz[1] - cfg->band_hz[0]);
    double apart_s = 2.0 * half_offset_m / c;
    double heard_s = sqrt(fmax((end_s - apart_s) * (end_s + apart_s), 0.0));

    grid_delays(&cfg->grid, cfg->geometry, delays_s);
    span_s[0] = fmax(2.0 * cfg->gate_m[0] / c, delays_s[0] - margin_s);
    span_s[1] = fmin(delays_s[1] + margin_s, heard_s);
    if (fmin(delays_s[1], heard_s) >= span_s[0])
        return 0;
    *why = "a gate that overlaps the volume";
    return -ENOTSUP;
}

size_t method_samples(const double span_s[2], double rate_hz, size_t at_least)
{
    double n = ceil((span_s[1] - span_s[0]) * rate_hz);
    return n > (double)at_least ? (size_t)n : at_least;
}

struct planes {
    size_t n_planes, cells;
    const float *ranges;
    float *volume;
};

static void take_plane(void *ctx, size_t z, size_t thread)
{
    const struct planes *p = ctx;
    (void)thread;
    for (size_t q = 0; q < p->cells; q++)
        p->volume[z * p->cells + q] = p->ranges[q * p->n_planes + z];
}

void method_planes(struct pool *pool, size_t n_planes, size_t cells, const float *ranges,
                   float *volume)
{
    struct planes p = {n_planes, cells, ranges, volume};
    pool_run(pool, n_planes, take_plane, &p);
}

static void clip_plane(void *ctx, size_t z, size_t thread)
{
    const struct planes *p = ctx;
    float *plane = p->volume + z * p->cells;
    (void)thread;
    for (size_t q = 0; q < p->cells; q++)
        plane[q] = plane[q] > 0.0f ? plane[q] : 0.0f;
}

void method_clip(struct pool *pool, const struct grid *g, float *intensity)
{
    struct planes p = {.cells = g->n[0] * g->n[1], .volume = intensity};
    pool_run(pool, g->n[2], clip_plane, &p);
}

bool imager_adds(const char *name)
{
    const struct imager_method *m = find(name);

    return m && m->adds;
}

static bool sensible(const struct imager_config *cfg)
{
    const struct geometry *g = cfg->geometry;
    const struct trace_format *f = &cfg->format;
    bool ok = g->n_speakers && g->n_microphones && g->n_positions && f->n_samples &&
              grid_size(&cfg->grid) && cfg->pool;
    ok = ok && g->sound_speed_m_s > 0.0 && isfinite(g->sound_speed_m_s);
    ok = ok && f->rate_hz > 0.0 && isfinite(f->rate_hz) && isfinite(f->t0_s);
    ok = ok && cfg->band_hz[0] >= 0.0 && cfg->band_hz[1] > cfg->band_hz[0];
    for (int a = 0; a < 3; a++)
        ok = ok && cfg->grid.step_m[a] > 0.0 && isfinite(cfg->grid.origin_m[a]);
    return ok;
}

/* Voxels that are added along an axis, at each end; in depth only where the traces hear,
 * and along an axis of one voxel none: its image is a section. */
static void widen(struct imager *im, const struct imager_config *cfg)
{
    const struct grid *g = &cfg->grid;
    const struct trace_format *f = &cfg->format;
    double half_c = 0.5 * cfg->geometry->sound_speed_m_s, low_m[3], high_m[3];
    double room_m[2] = {INFINITY, INFINITY}, far_m[3], width_m[3];

    geometry_aperture(cfg->geometry, low_m, high_m);
    for (int a = 0; a < 3; a++)
        far_m[a] = g->origin_m[a] + g->step_m[a] * (double)(g->n[a] - 1);
    geometry_resolution(cfg->geometry, cfg->band_hz, fabs(far_m[2] - low_m[2]), width_m);
    for (int a = 0; a < 3; a++) {
        if (a == 2) {
            double heard_m = half_c * (f->t0_s + (double)f->n_samples / f->rate_hz);
            double muted_m = fmax(cfg->gate_m[0], half_c * f->t0_s);
            room_m[0] = g->origin_m[2] - (high_m[2] + muted_m);
            room_m[1] = low_m[2] + heard_m - far_m[2];
        }
        for (int end = 0; end < 2 && g->n[a] > 1; end++) {
            double more_m = fmin(OUTSIDE_WIDTHS * width_m[a], room_m[end]);
            size_t more =
                isfinite(more_m) && more_m > 0.0 ? (size_t)(more_m / g->step_m[a]) : 0;
            im->fitted.n[a] += more;
            if (end == 0) {
                im->before[a] = more;
                im->fitted.origin_m[a] -= g->step_m[a] * (double)more;
            }
        }
    }
}

static int plan(struct imager *im, const struct imager_config *cfg, const char **why)
{
    struct imager_config fitted = *cfg;

    im->grid = im->fitted = cfg->grid;
    if (im->method->fits) {
        double span_s[2];
        int err = method_span(span_s, cfg, 0.0, why);
        if (err)
            return err;
        widen(im, cfg);
        if (grid_size(&im->fitted) > grid_size(&im->grid)) {
            im->volume = malloc(grid_size(&im->fitted) * sizeof *im->volume);
            if (!im->volume)
                return -ENOMEM;
        }
    }
    fitted.grid = im->fitted;
    return im->method->create(&im->state, &fitted, why);
}

int imager_create(struct imager **out, const struct imager_config *cfg, const char **why)
{
    const char *unused;
    if (!why)
        why = &unused;
    *why = "";
    const struct imager_method *method = find(cfg->method);
    if (!method)
        return -ENOENT;
    if (!sensible(cfg))
        return -EINVAL;
    if (cfg->geometry->pings_m && !method->any_geometry) {
        *why = "an array that a stage carries, but here each ping has places of its own "
               "(backprojection, sparse and incoherent image any geometry)";
        return -ENOTSUP;
    }
    if (cfg->geometry->slot_m != 0.0 && !method->continuous) {
        *why = "a stage that stands at each position (fast, backprojection and iterative "
               "image one that does not stop)";
        return -ENOTSUP;
    }
    struct imager *im = calloc(1, sizeof *im);
    if (!im)
        return -ENOMEM;
    im->method = method;
    im->pool = cfg->pool;
    im->n_speakers = cfg->geometry->n_speakers;
    im->n_pings = cfg->geometry->n_positions * cfg->geometry->n_speakers;
    im->n_microphones = cfg->geometry->n_microphones;
    im->n_samples = cfg->format.n_samples;
    im->added = calloc(im->n_pings, sizeof *im->added);
    im->masked = calloc(im->n_pings, im->n_microphones * sizeof *im->masked);
    int err = im->added && im->masked ? plan(im, cfg, why) : -ENOMEM;
    if (!err && pool_stopped(cfg->pool)) {
        im->method->destroy(im->state);
        err = -ECANCELED;
    }
    if (err) {
        free(im->volume);
        free(im->masked);
        free(im->added);
        free(im);
        return err;
    }
    *out = im;
    return 0;
}

#define LOUDEST_BITS 0x551184e7u /* 1e13f; what is no number has larger ones */

typedef uint32_t float_bits __attribute__((may_alias));

/* On bits: comparisons of floats would branch, or call NaN neither. */
VECTOR_CLONES
static uint32_t loudest(const float_bits *bits, size_t n)
{
    uint32_t most = 0;
    for (size_t i = 0; i < n; i++) {
        uint32_t magnitude = bits[i] & 0x7fffffffu;
        most = magnitude > most ? magnitude : most;
    }
    return most;
}

bool trace_check(const float complex *trace, size_t n)
{
    return loudest((const float_bits *)trace, 2 * n) < LOUDEST_BITS;
}

bool imager_add(struct imager *im, size_t position, size_t speaker,
                const float complex *traces, const bool *masked)
{
    size_t ping = position * im->n_speakers + speaker;
    if (atomic_exchange(&im->added[ping], true))
        return false;
    bool *unused = im->masked + ping * im->n_microphones;
    for (size_t i = 0; i < im->n_microphones; i++)
        unused[i] = (masked && masked[i]) ||
                    !trace_check(traces + i * im->n_samples, im->n_samples);
    im->method->add(im->state, position, speaker, traces, unused);
    atomic_fetch_add(&im->count, 1);
    return true;
}

size_t imager_pings(const struct imager *im)
{
    return atomic_load(&im->count);
}

int imager_image(struct imager *im, float *restrict intensity)
{
    const size_t *n = im->grid.n, *wide = im->fitted.n;
    im->method->image(im->state, im->volume ? im->volume : intensity);
    if (pool_stopped(im->pool))
        return -ECANCELED;
    for (size_t row = 0; im->volume && row < n[2] * n[1]; row++) {
        size_t z = row / n[1] + im->before[2], y = row % n[1] + im->before[1];
        const float *from = im->volume + (z * wide[1] + y) * wide[0] + im->before[0];
        memcpy(intensity + row * n[0], from, n[0] * sizeof *intensity);
    }
    return 0;
}

void imager_outcome(const struct imager *im, struct imager_outcome *out)
{
    *out = (struct imager_outcome){.choice = NULL};
    if (im->method->describe)
        im->method->describe(im->state, out);
}

void imager_reset(struct imager *im)
{
    for (size_t p = 0; p < im->n_pings; p++)
        atomic_store(&im->added[p], false);
    atomic_store(&im->count, 0);
    im->method->reset(im->state);
}

void imager_destroy(struct imager *im)
{
    if (!im)
        return;
    im->method->destroy(im->state);
    free(im->volume);
    free(im->masked);
    free(im->added);
    free(im);
}
