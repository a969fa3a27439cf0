/* SPDX-License-Identifier: MIT */
#include "recon/planning/probe.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "dsp/window.h"
#include "recon/coherent/colocated.h"
#include "recon/imaging/coarse.h"
#include "recon/imaging/fold.h"
#include "recon/imaging/imager.h"
#include "recon/planning/moveout_error.h"

#define SCALLOP_DB 6.0  /* that a peak may lose between coarse voxels */
#define MARGIN_M   0.06 /* of depth kept around what holds something */
#define UNRESOLVED 1e-9 /* of the variance in depth */

/* -- a place: what the geometry alone says of how a point there will be imaged ----------
 */

struct directions { /* sums over pairs, which `weight` divides */
    double mean[3], product[3][3], weight;
};

static void add_pair(struct directions *d, const double s[3], const double m[3],
                     const double at_m[3], double weight)
{
    double u[3];
    geometry_direction(at_m, s, m, u);
    for (int a = 0; a < 3; a++)
        d->mean[a] += weight * u[a];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            d->product[a][b] += weight * u[a] * u[b];
    d->weight += weight;
}

static void add_pairs(struct directions *d, const struct geometry *g, const float *weight,
                      const double at_m[3])
{
    size_t n = g->n_positions * g->n_speakers * g->n_microphones;
    for (size_t t = 0; t < n; t++) {
        double s[3], m[3];
        geometry_pair(g, t, s, m);
        add_pair(d, s, m, at_m, (double)weight[t]);
    }
}

void psf_tilt(const struct geometry *g, const float *weight, const double band_hz[2],
              const double at_m[3], double tilt[2])
{
    struct directions d = {0};
    double c[3][3], middle_hz = 0.5 * (band_hz[0] + band_hz[1]);
    double width_hz = band_hz[1] - band_hz[0];
    double f2 = middle_hz * middle_hz, spread2 = HANN_VARIANCE * width_hz * width_hz;
    add_pairs(&d, g, weight, at_m);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            c[a][b] = (f2 + spread2) * d.product[a][b] / d.weight -
                      f2 * d.mean[a] * d.mean[b] / (d.weight * d.weight);
    double across[4] = {c[0][0], c[0][1], c[1][0], c[1][1]};
    tilt[0] = -c[0][2];
    tilt[1] = -c[1][2];
    for (int a = 0; a < 2; a++)
        if (!(across[3 * a] > UNRESOLVED * c[2][2]))
            across[3 * a] = 0.0;
    normal_equations_solve(2, across, tilt, UNRESOLVED);
}

struct places {
    double band_hz[2];
    struct array { /* with all of the speakers, and with fewer */
        struct geometry geometry;
        float *weight;
    } all, fewer[PROBE_FEWER];
    double (*speakers_m)[3]; /* of all that are fewer, one after the other */
};

/* Every n-th speaker, whose places go to at. */
static int thin_out(struct array *out, const struct geometry *g, size_t stride,
                    double (*at)[3])
{
    out->geometry = *g;
    out->geometry.speakers_m = (const double(*)[3])at;
    out->geometry.n_speakers = 0;
    for (size_t j = 0; j < g->n_speakers; j += stride)
        memcpy(at[out->geometry.n_speakers++], g->speakers_m[j], sizeof *at);
    return fold_weights(&out->geometry, &out->weight);
}

static void places_destroy(struct places *p)
{
    if (!p)
        return;
    free(p->all.weight);
    for (size_t i = 0; i < PROBE_FEWER; i++)
        free(p->fewer[i].weight);
    free(p->speakers_m);
    free(p);
}

/* set->geometry outlives them.  0, -ENOMEM. */
static int places_create(struct places **out, const struct trace_set *set)
{
    const struct geometry *g = set->geometry;
    struct places *p = calloc(1, sizeof *p);
    if (!p)
        return -ENOMEM;
    memcpy(p->band_hz, set->band_hz, sizeof p->band_hz);
    p->all.geometry = *g;
    p->speakers_m = malloc((PROBE_FEWER * g->n_speakers + 1) * sizeof *p->speakers_m);
    int err = p->speakers_m ? fold_weights(g, &p->all.weight) : -ENOMEM;
    for (size_t i = 0; !err && !g->pings_m && i < PROBE_FEWER; i++)
        err =
            thin_out(&p->fewer[i], g, (size_t)2 << i, p->speakers_m + i * g->n_speakers);
    if (err) {
        places_destroy(p);
        return err;
    }
    *out = p;
    return 0;
}

/* Of an object's position_m: moveout_m, moveout_rad, fewer_m, width_m, tilt. */
static void places_describe(const struct places *p, struct probe_object *o)
{
    const struct array *all = &p->all;
    double centre_hz = 0.5 * (p->band_hz[0] + p->band_hz[1]);
    geometry_resolution_at(&all->geometry, p->band_hz, o->position_m, o->width_m);
    psf_tilt(&all->geometry, all->weight, p->band_hz, o->position_m, o->tilt);
    moveout_error(&all->geometry, all->weight, o->position_m, centre_hz, o->moveout_m,
                  &o->moveout_rad);
    for (size_t i = 0; i < PROBE_FEWER; i++) {
        const struct array *fewer = &p->fewer[i];
        double shift_m[3], rad;
        if (!fewer->weight)
            continue;
        moveout_error(&fewer->geometry, fewer->weight, o->position_m, centre_hz, shift_m,
                      &rad);
        for (int a = 0; a < 2; a++)
            o->fewer_m[i][a] = shift_m[a] - o->moveout_m[a];
    }
}

/* -- the image that is looked at --------------------------------------------------------
 */

struct probing {
    struct probe *out;
    const struct trace_set *set;
    struct pool *pool;
    struct places *places;
    struct imager_config cfg; /* of the coarse image */
    float *intensity;
    struct detection found[PROBE_OBJECTS];
};

/* Depths outside hold nothing that detection would report next to the strongest. */
static void measure_depth(const struct probing *p, double range_db)
{
    const struct grid *g = &p->cfg.grid;
    size_t plane = g->n[0] * g->n[1], first = g->n[2], last = 0;
    float *most = p->intensity + plane * g->n[2]; /* [nz] */
    float strongest = 0.0f;
    for (size_t z = 0; z < g->n[2]; z++) {
        most[z] = 0.0f;
        for (size_t q = 0; q < plane; q++)
            most[z] = fmaxf(most[z], p->intensity[z * plane + q]);
        strongest = fmaxf(strongest, most[z]);
    }
    float least = strongest * (float)pow(10.0, -0.1 * (range_db + SCALLOP_DB));
    for (size_t z = 0; z < g->n[2]; z++) {
        if (!(most[z] > least))
            continue;
        first = z < first ? z : first;
        last = z;
    }
    double end_m = g->origin_m[2] + g->step_m[2] * (double)(g->n[2] - 1);
    p->out->depth_m[0] = g->origin_m[2];
    p->out->depth_m[1] = end_m;
    if (first > last)
        return;
    p->out->depth_m[0] =
        fmax(g->origin_m[2] + g->step_m[2] * (double)first - MARGIN_M, g->origin_m[2]);
    p->out->depth_m[1] =
        fmin(g->origin_m[2] + g->step_m[2] * (double)last + MARGIN_M, end_m);
}

static void assume(struct probe *out, const struct trace_set *set,
                   const struct grid *grid, const struct places *places)
{
    static const double part[3] = {0.75, 0.75, 0.5};
    struct probe_object *o = &out->typical;
    memset(out, 0, sizeof *out);
    out->imaged = !set->geometry->pings_m;
    out->coherence.element_m = NAN;
    out->depth_m[0] = grid->origin_m[2];
    out->depth_m[1] = grid->origin_m[2] + grid->step_m[2] * (double)(grid->n[2] - 1);
    for (int a = 0; a < 3; a++)
        o->position_m[a] = grid->origin_m[a] +
                           part[a] * grid->step_m[a] * (double)(grid->n[a] - 1);
    places_describe(places, o);
}

int probe_assume(struct probe *out, const struct trace_set *set, const struct grid *grid)
{
    struct places *places;
    int err = places_create(&places, set);
    if (err)
        return err;
    assume(out, set, grid, places);
    places_destroy(places);
    return 0;
}

/* Of what is extended, the edge that is farther aside suffers most. */
static void move_to_edge(const struct geometry *g, const double extent_m[2],
                         struct probe_object *o)
{
    double low[3], high[3];
    geometry_aperture(g, low, high);
    for (int a = 0; a < 2; a++)
        o->position_m[a] +=
            copysign(0.5 * extent_m[a], o->position_m[a] - 0.5 * (low[a] + high[a]));
}

static double width_hz(const double band_hz[2])
{
    return band_hz[1] - band_hz[0];
}

/* The larger of width and height, as it would be in all of the band. */
static double sharp_extent_m(const struct probing *p, const struct detection *d,
                             const struct probe_object *o)
{
    double blurred_m[3], most_m = 0.0;
    geometry_resolution_at(p->set->geometry, p->cfg.band_hz, o->position_m, blurred_m);
    for (int a = 0; a < 2; a++) {
        double extent_m = d->extent_m[a];
        if (isfinite(blurred_m[a])) {
            double blur = blurred_m[a] * blurred_m[a] - o->width_m[a] * o->width_m[a];
            extent_m = sqrt(fmax(extent_m * extent_m - blur, 0.0));
        }
        most_m = fmax(most_m, extent_m);
    }
    return most_m;
}

static void describe_object(void *ctx, size_t i, size_t thread)
{
    const struct probing *p = ctx;
    const struct detection *d = &p->found[i];
    struct probe_object *o = &p->out->objects[i];
    (void)thread;
    double gain = width_hz(p->set->band_hz) / width_hz(p->cfg.band_hz);
    *o = (struct probe_object){.level_db = d->level_db + 10.0 * log10(gain)};
    double noise = pow(10.0, -0.05 * o->level_db); /* over amplitude */
    memcpy(o->position_m, d->position_m, sizeof o->position_m);
    move_to_edge(p->set->geometry, d->extent_m, o);
    places_describe(p->places, o);
    memcpy(o->position_m, d->position_m, sizeof o->position_m);
    o->extent_m = sharp_extent_m(p, d, o);
    for (int a = 0; a < 3; a++) /* 1 / sqrt(curvature of the intensity x SNR) */
        o->noise_m[a] =
            isfinite(o->width_m[a]) ? o->width_m[a] / sqrt(8.0 * log(4.0)) * noise : 0.0;
}

static int find_objects(struct probing *p)
{
    struct detect_config detect;
    detect_config_default(&detect);
    geometry_resolution(p->set->geometry, p->cfg.band_hz,
                        0.5 * (p->set->gate_m[0] + p->set->gate_m[1]),
                        detect.resolution_m);
    int err = detect_objects(&detect, &p->cfg.grid, p->intensity, p->found, PROBE_OBJECTS,
                             &p->out->n_objects);
    if (err)
        return err;
    pool_run(p->pool, p->out->n_objects, describe_object, p);
    if (p->out->n_objects)
        p->out->snr_db = p->out->objects[0].level_db;
    measure_depth(p, detect.dynamic_range_db);
    return 0;
}

static int look(struct probing *p)
{
    struct imager *im = NULL;
    int err = coarse_create(&im, &p->cfg);
    if (err == -ENOTSUP)
        return 0;
    if (!err) {
        p->intensity =
            malloc((grid_size(&p->cfg.grid) + p->cfg.grid.n[2]) * sizeof *p->intensity);
        err = p->intensity ? trace_set_feed(p->set, im, p->pool) : -ENOMEM;
    }
    if (!err)
        err = imager_image(im, p->intensity);
    if (!err) {
        p->out->imaged = true;
        err = find_objects(p);
    }
    imager_destroy(im);
    return err;
}

/* -- mirror or scatterer ----------------------------------------------------------------
 */

static int measure_power(const struct probing *p, struct colocated *c)
{
    struct colocated_lattice l;
    colocated_lattice(c, &l);
    size_t cells = l.nx * l.ny, pairs = trace_set_pairs(p->set);
    size_t n_mic = p->set->geometry->n_microphones;
    float *power = malloc(cells * (l.n_ranges + 2) * sizeof *power);
    bool *masked = malloc(n_mic * sizeof *masked);
    int err = power && masked ? 0 : -ENOMEM;
    for (size_t q = 0; !err && q < p->set->geometry->n_positions * pairs; q += n_mic) {
        for (size_t i = 0; i < n_mic; i++)
            masked[i] = !p->set->heard[q + i];
        colocated_add(c, q / pairs, q % pairs / n_mic,
                      p->set->traces + q * p->set->format.n_samples, masked);
    }
    if (!err) {
        const struct scattering_config scattering = {
            l.nx, l.ny, l.pitch_x_m, l.pitch_y_m, l.n_ranges, l.range_m, l.range_step_m};
        colocated_power(c, power);
        scattering_measure(&scattering, power, power + cells * l.n_ranges,
                           &p->out->scattering);
        p->out->specular = scattering_is_specular(&p->out->scattering);
    }
    free(power);
    free(masked);
    return err;
}

static int measure_scattering(const struct probing *p)
{
    struct colocated *c = NULL;
    const char *why;
    int err = colocated_create(&c, &p->cfg, &why);
    if (err == -ENOTSUP)
        return 0;
    if (!err)
        err = measure_power(p, c);
    colocated_destroy(c);
    return err;
}

/* By how much the ways of the pairs of a position to an object and back differ, mean
 * square, because the stage goes on from one speaker to the next. */
static double motion_m2(const struct geometry *g, const double at_m[3])
{
    double low[3], high[3], mean_m = 0.0, spread_m2 = 0.0, sine2 = 0.0;
    geometry_aperture(g, low, high);
    for (size_t j = 0; j < g->n_speakers; j++)
        mean_m += geometry_gone_on_m(g, j) / (double)g->n_speakers;
    for (size_t j = 0; j < g->n_speakers; j++)
        spread_m2 += pow(geometry_gone_on_m(g, j) - mean_m, 2.0) / (double)g->n_speakers;
    double last_m = g->stage_positions_m[g->n_positions - 1];
    double middle_m = 0.5 * (g->stage_positions_m[0] + last_m);
    for (size_t k = 0; k < g->n_positions; k++) {
        double d[3], along_m = 0.0, range_m = 0.0;
        for (int a = 0; a < 3; a++) {
            d[a] = at_m[a] - 0.5 * (low[a] + high[a]) -
                   (g->stage_positions_m[k] - middle_m) * g->stage_axis[a];
            along_m += d[a] * g->stage_axis[a];
            range_m = hypot(range_m, d[a]);
        }
        sine2 += pow(along_m / range_m, 2.0) / (double)g->n_positions;
    }
    return 4.0 * spread_m2 * sine2;
}

/* Echoes that moveout leaves out of step, or the motion of the stage, look like elements
 * that are out of place: two of them a pair. */
static void leave_out_known(struct probe *out, const struct trace_set *set)
{
    const struct geometry *g = set->geometry;
    double centre_hz = 0.5 * (set->band_hz[0] + set->band_hz[1]);
    double sigma_m = out->coherence.element_m;
    if (!out->n_objects || !(sigma_m > 0.0))
        return;
    double path_m = out->objects[0].moveout_rad * g->sound_speed_m_s /
                    (2.0 * M_PI * centre_hz);
    double known_m2 = path_m * path_m;
    if (!g->pings_m && fabs(g->slot_m) > 0.0)
        known_m2 += motion_m2(g, out->objects[0].position_m);
    out->coherence.element_m = sqrt(fmax(sigma_m * sigma_m - 0.5 * known_m2, 0.0));
}

int probe_scattering(struct probe *out, const struct trace_set *set,
                     const struct grid *grid, struct pool *pool)
{
    struct probing p = {.out = out, .set = set, .pool = pool};
    p.cfg = trace_set_imager(set, grid, pool);
    p.cfg.method = "fast";
    return measure_scattering(&p);
}

int probe_run(struct probe *out, const struct trace_set *set, const struct grid *grid,
              const struct coherence *known, struct pool *pool)
{
    struct probing p = {.out = out, .set = set, .pool = pool};
    struct imager_config wanted = trace_set_imager(set, grid, pool);
    struct coherence before;
    if (known)
        before = *known; /* it may be that of *out */
    int err = places_create(&p.places, set);
    if (err)
        return err;
    assume(out, set, grid, p.places);
    out->imaged = false;
    coarse_view(&wanted, &p.cfg);
    err = look(&p);
    memcpy(p.cfg.band_hz, set->band_hz, sizeof p.cfg.band_hz);
    if (!err && out->imaged)
        err = measure_scattering(&p);
    if (!err && known)
        out->coherence = before;
    else if (!err)
        err = coherence_measure(&out->coherence, set, pool);
    err = err == -ENOTSUP ? 0 : err;
    if (!err)
        leave_out_known(out, set);
    free(p.intensity);
    places_destroy(p.places);
    return err;
}
