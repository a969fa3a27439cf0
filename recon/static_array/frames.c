/* SPDX-License-Identifier: MIT */
#include "recon/static_array/frames.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/pool.h"
#include "dsp/vector.h"
#include "recon/coherent/backproject_tile.h"
#include "recon/imaging/fold.h"
#include "recon/imaging/imager.h"
#include "recon/static_array/range_doppler.h"

#define DRIFT_NS 20000000 /* over which an element's motion counts as straight */
#define FAR_M    1e-3     /* of a path, beyond the last sample: what rounding may do */

struct place {            /* of an element, seen from what is imaged */
    double delay_at_m[3]; /* at the instant that the ping's delays are those of, */
    double phase_at_m[3]; /* its phases; */
    double own_m_s[3];    /* how it goes on by itself while the sound is under way, */
    double thing_m_s[3];  /* and what is imaged, until the sound is there */
};

struct held { /* one of the newest pings */
    bool any;
    bool shows;  /* something: it is not spoiled */
    bool counts; /* in the image that is made */
    bool fresh;  /* its part has to be made */
    size_t speaker;
    int64_t stamp_ns;
    bool down;
    bool *live;                /* [n_microphones] */
    uint32_t *words;           /* [n_microphones][fine.n_stored] */
    float *unit;               /* [n_microphones] */
    float *weight;             /* [n_microphones] of the traces, 0: not live */
    struct place *places;      /* [1 + n_microphones] */
    bool made;                 /* what part is of: */
    float *made_weight;        /* [n_microphones] */
    struct place *made_places; /* [1 + n_microphones] */
    float *part; /* [tile][re, im][TILE_VOXELS], by power [tile][TILE_VOXELS] */
    float scale; /* of part in the sum */
};

struct scratch { /* one a thread */
    struct tile tile;
    struct tile_path *paths; /* [1 + n_microphones] */
    bool *hears;             /* [1 + n_microphones]: of the tile */
};

struct frames {
    struct frames_config cfg;
    struct geometry geometry;
    struct fine_trace fine;
    struct tile_sound sound;
    double centre_m[3], spread_m; /* of the elements: mean, rms distance from it */
    double far_s;                 /* delay of the last sample */
    uint32_t *cell;               /* [speaker][microphone]: number of its midpoint */
    size_t n_cells;
    uint32_t *fold;    /* [n_cells] */
    struct held *held; /* [n_pings] */
    size_t newest;
    int64_t oldest_look_ns;
    struct scratch *own; /* [threads] */
    float scale;         /* of the sum */
    float *image;
    float *alone;       /* [voxels] of the newest ping; NULL where phases add up */
    struct grid blocks; /* of its image's means... */
    size_t block[3];    /* ...over so many voxels */
    float *means;       /* [blocks]; NULL likewise */
};

static size_t planes_of(const struct frames *f)
{
    return f->cfg.sum == FRAMES_POWER ? 1 : 2;
}

/* -- create -----------------------------------------------------------------------------
 */

static bool sensible(const struct frames_config *cfg)
{
    const struct trace_format *t = &cfg->format;
    const struct chirp *c = &cfg->chirp;
    return cfg->geometry->n_speakers && cfg->geometry->n_microphones &&
           cfg->geometry->sound_speed_m_s > 0.0 && t->n_samples && t->rate_hz > 0.0 &&
           isfinite(t->t0_s) && cfg->band_hz[0] >= 0.0 &&
           cfg->band_hz[1] > cfg->band_hz[0] && grid_size(&cfg->grid) && cfg->pool &&
           cfg->n_pings >= 1 && cfg->n_pings <= FRAMES_MAX_PINGS &&
           cfg->max_age_ns >= 0 && c->duration_s >= 0.0 &&
           (c->duration_s == 0.0 || c->start_hz != c->stop_hz);
}

static int create_held(struct frames *f, struct held *h)
{
    size_t n = f->geometry.n_microphones;
    size_t part = tile_count(&f->cfg.grid) * planes_of(f) * TILE_VOXELS;
    h->live = calloc(n, sizeof *h->live);
    h->words = calloc(n * f->fine.n_stored, sizeof *h->words);
    h->unit = calloc(n, sizeof *h->unit);
    h->weight = calloc(n, sizeof *h->weight);
    h->made_weight = calloc(n, sizeof *h->made_weight);
    h->places = calloc(1 + n, sizeof *h->places);
    h->made_places = calloc(1 + n, sizeof *h->made_places);
    h->part = malloc(part * sizeof *h->part);
    return h->live && h->words && h->unit && h->weight && h->made_weight && h->places &&
                   h->made_places && h->part
               ? 0
               : -ENOMEM;
}

static void destroy_held(struct held *h)
{
    free(h->live);
    free(h->words);
    free(h->unit);
    free(h->weight);
    free(h->made_weight);
    free(h->places);
    free(h->made_places);
    free(h->part);
}

static int allocate_newest(struct frames *f)
{
    const struct grid *g = &f->cfg.grid;

    for (int a = 0; a < 3; a++) {
        double side = g->n[a] > 1 ? round(FRAMES_BLOCK_M / g->step_m[a]) : 1.0;
        f->block[a] = (size_t)fmin(fmax(side, 1.0), (double)g->n[a]);
        f->blocks.n[a] = (g->n[a] + f->block[a] - 1) / f->block[a];
        f->blocks.step_m[a] = g->step_m[a] * (double)f->block[a];
        f->blocks.origin_m[a] = g->origin_m[a] +
                                0.5 * (f->blocks.step_m[a] - g->step_m[a]);
    }
    f->alone = calloc(grid_size(g), sizeof *f->alone);
    f->means = calloc(grid_size(&f->blocks), sizeof *f->means);
    return f->alone && f->means ? 0 : -ENOMEM;
}

static int allocate(struct frames *f)
{
    size_t n_mic = f->geometry.n_microphones, threads = pool_threads(f->cfg.pool);
    f->cell = malloc(f->geometry.n_speakers * n_mic * sizeof *f->cell);
    f->held = calloc(f->cfg.n_pings, sizeof *f->held);
    f->own = calloc(threads, sizeof *f->own);
    if (!f->cell || !f->held || !f->own)
        return -ENOMEM;
    int err = fold_number(&f->geometry, f->cell, &f->n_cells);
    if (!err && !(f->fold = calloc(f->n_cells, sizeof *f->fold)))
        err = -ENOMEM;
    for (size_t k = 0; !err && k < f->cfg.n_pings; k++)
        err = create_held(f, &f->held[k]);
    if (!err && f->cfg.sum == FRAMES_POWER)
        err = allocate_newest(f);
    for (size_t t = 0; !err && t < threads; t++) {
        f->own[t].paths = malloc((1 + n_mic) * sizeof *f->own[t].paths);
        f->own[t].hears = calloc(1 + n_mic, sizeof *f->own[t].hears);
        if (!f->own[t].paths || !f->own[t].hears)
            err = -ENOMEM;
    }
    return err;
}

static void find_centre(struct frames *f)
{
    const struct geometry *g = &f->geometry;
    size_t n = g->n_speakers + g->n_microphones;
    double sum[3] = {0.0}, sum2 = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t e = 0; e < n; e++) {
            double at[3];
            if (e < g->n_speakers)
                geometry_speaker(g, 0, e, at);
            else
                geometry_microphone(g, 0, 0, e - g->n_speakers, at);
            for (int a = 0; a < 3; a++)
                sum[a] += pass ? 0.0 : at[a];
            sum2 += pass ? pow(geometry_distance(at, f->centre_m), 2.0) : 0.0;
        }
        for (int a = 0; a < 3; a++)
            f->centre_m[a] = sum[a] / (double)n;
    }
    f->spread_m = sqrt(sum2 / (double)n);
}

int frames_create(struct frames **out, const struct frames_config *cfg)
{
    if (cfg->geometry->pings_m || cfg->geometry->n_positions != 1)
        return -ENOTSUP;
    if (!sensible(cfg))
        return -EINVAL;
    struct frames *f = calloc(1, sizeof *f);
    if (!f)
        return -ENOMEM;
    f->cfg = *cfg;
    const struct trace_format *in = &cfg->format;
    double gate_s = 2.0 * cfg->gate_m[0] / cfg->geometry->sound_speed_m_s;
    int err = geometry_copy(&f->geometry, cfg->geometry);
    f->cfg.geometry = &f->geometry;
    if (!err)
        err = fine_trace_create(&f->fine, in, cfg->band_hz[1] - cfg->band_hz[0], gate_s,
                                pool_threads(cfg->pool));
    if (!err)
        err = allocate(f);
    if (err) {
        frames_destroy(f);
        return err;
    }
    tile_sound(&f->sound, &f->fine, f->geometry.sound_speed_m_s);
    f->far_s = in->t0_s + (double)in->n_samples / in->rate_hz;
    find_centre(f);
    *out = f;
    return 0;
}

void frames_destroy(struct frames *f)
{
    if (!f)
        return;
    for (size_t k = 0; f->held && k < f->cfg.n_pings; k++)
        destroy_held(&f->held[k]);
    for (size_t t = 0; f->own && t < pool_threads(f->cfg.pool); t++) {
        free(f->own[t].paths);
        free(f->own[t].hears);
    }
    free(f->held);
    free(f->own);
    free(f->cell);
    free(f->fold);
    free(f->alone);
    free(f->means);
    fine_trace_clear(&f->fine);
    geometry_clear(&f->geometry);
    free(f);
}

/* -- add --------------------------------------------------------------------------------
 */

const float *frames_newest(const struct frames *f, struct grid *blocks)
{
    *blocks = f->blocks;
    return f->means && f->held[f->newest].counts ? f->means : NULL;
}

void frames_reset(struct frames *f)
{
    for (size_t k = 0; k < f->cfg.n_pings; k++)
        f->held[k].any = false;
}

bool frames_add(struct frames *f, const struct frames_ping *ping)
{
    size_t length = f->cfg.format.n_samples;
    const struct held *last = &f->held[f->newest];
    bool in_order = !last->any || ping->stamp_ns >= last->stamp_ns;
    if (!in_order)
        frames_reset(f);
    f->newest = (f->newest + 1) % f->cfg.n_pings;
    struct held *h = &f->held[f->newest];
    h->any = true;
    h->made = false;
    h->speaker = ping->speaker;
    h->stamp_ns = ping->stamp_ns;
    h->down = ping->down;
    h->shows = true;
    for (size_t i = 0; i < f->geometry.n_microphones; i++) {
        const float complex *trace = ping->traces + i * length;
        h->live[i] = !(ping->masked && ping->masked[i]) && trace_check(trace, length);
        if (h->live[i])
            h->unit[i] =
                fine_trace_words(&f->fine, 0, trace, h->words + i * f->fine.n_stored);
    }
    return in_order;
}

void frames_spoil(struct frames *f)
{
    f->held[f->newest].shows = false;
}

/* -- where a ping's elements were -------------------------------------------------------
 */

double frames_delay_instant_s(const struct frames_config *cfg, bool down)
{
    const struct chirp *c = &cfg->chirp;
    double from = down ? c->stop_hz : c->start_hz, to = down ? c->start_hz : c->stop_hz;
    if (c->duration_s == 0.0)
        return cfg->latency_s;
    return cfg->latency_s + range_doppler_instant_s(from, to, c->duration_s);
}

static int64_t nanoseconds(double s)
{
    return (int64_t)llrint(1e9 * s);
}

struct glance { /* from the instant `at` of one ping to the reference */
    const struct frames_motion *motion;
    int64_t reference_ns;
    bool known;
};

static void step_to_reference(struct glance *g, int64_t at_ns, struct ego_step *out)
{
    *out = (struct ego_step){0.0, 0.0, 0.0};
    if (g->motion->path && ego_path_between(g->motion->path, at_ns, g->reference_ns, out))
        g->known = false;
}

/* What is imaged moves on until the reference, and is where it was then when the element
 * moves the other way instead. */
static void look(const struct glance *g, const struct ego_step *step, int64_t at_ns,
                 const double element_m[3], double out[3])
{
    double later_s = 1e-9 * (double)(g->reference_ns - at_ns);
    if (g->motion->path)
        mount_step_point(&g->motion->mount, step, element_m, out);
    else
        memcpy(out, element_m, 3 * sizeof *out);
    for (int a = 0; a < 3; a++)
        out[a] += later_s * g->motion->velocity_m_s[a];
}

static void stand(struct place *p, const double element_m[3])
{
    memcpy(p->delay_at_m, element_m, sizeof p->delay_at_m);
    memcpy(p->phase_at_m, element_m, sizeof p->phase_at_m);
    memset(p->own_m_s, 0, sizeof p->own_m_s);
    memset(p->thing_m_s, 0, sizeof p->thing_m_s);
}

static void element_of(const struct frames_config *cfg, size_t speaker, size_t e,
                       double out[3])
{
    if (e == 0)
        geometry_speaker(cfg->geometry, 0, speaker, out);
    else
        geometry_microphone(cfg->geometry, 0, speaker, e - 1, out);
}

/* places[1 + n_microphones]: of the speaker that sounded, of the microphones.  Seen from
 * the array at reference_ns.  false: the path does not reach; as if it stood. */
static bool find_places(const struct frames_config *cfg,
                        const struct frames_motion *motion, size_t speaker, bool down,
                        int64_t stamp_ns, int64_t reference_ns, struct place *places)
{
    const int64_t at_ns[3] = {
        stamp_ns + nanoseconds(frames_delay_instant_s(cfg, down)),
        stamp_ns + nanoseconds(cfg->latency_s + 0.5 * cfg->chirp.duration_s),
        stamp_ns + nanoseconds(frames_delay_instant_s(cfg, down)) + DRIFT_NS};
    struct glance g = {motion, reference_ns, true};
    struct ego_step step[3];
    for (int i = 0; motion && i < 3; i++)
        step_to_reference(&g, at_ns[i], &step[i]);
    if (!g.known)
        memset(step, 0, sizeof step);
    for (size_t e = 0; e < 1 + cfg->geometry->n_microphones; e++) {
        double element_m[3], later[3];
        element_of(cfg, speaker, e, element_m);
        stand(&places[e], element_m);
        if (!motion)
            continue;
        look(&g, &step[0], at_ns[0], element_m, places[e].delay_at_m);
        look(&g, &step[1], at_ns[1], element_m, places[e].phase_at_m);
        look(&g, &step[2], at_ns[2], element_m, later);
        for (int a = 0; a < 3; a++) {
            places[e].thing_m_s[a] = -motion->velocity_m_s[a];
            places[e].own_m_s[a] = (later[a] - places[e].delay_at_m[a]) /
                                       (1e-9 * DRIFT_NS) +
                                   motion->velocity_m_s[a];
        }
    }
    return g.known;
}

static bool near(const double a[3], const double b[3], double tolerance)
{
    for (int i = 0; i < 3; i++)
        if (!(fabs(a[i] - b[i]) <= tolerance))
            return false;
    return true;
}

/* No coordinate differs by more than tolerance_m, drift counted over sound_s. */
static bool places_agree(const struct place *a, const struct place *b, size_t n,
                         double sound_s, double tolerance_m)
{
    for (size_t e = 0; e < n; e++)
        if (!near(a[e].delay_at_m, b[e].delay_at_m, tolerance_m) ||
            !near(a[e].phase_at_m, b[e].phase_at_m, tolerance_m) ||
            !near(a[e].own_m_s, b[e].own_m_s, tolerance_m / sound_s) ||
            !near(a[e].thing_m_s, b[e].thing_m_s, tolerance_m / sound_s))
            return false;
    return true;
}

/* -- each midpoint is to count once, as in back-projection ------------------------------
 */

static const uint32_t *cells_of(const struct frames *f, const struct held *h)
{
    return f->cell + h->speaker * f->geometry.n_microphones;
}

/* Counts a ping's live pairs at their midpoints; returns how many were the first. */
static size_t count(struct frames *f, const struct held *h)
{
    size_t n_new = 0;
    for (size_t i = 0; i < f->geometry.n_microphones; i++)
        if (h->live[i])
            n_new += f->fold[cells_of(f, h)[i]]++ == 0;
    return n_new;
}

static void forget_counts(struct frames *f)
{
    memset(f->fold, 0, f->n_cells * sizeof *f->fold);
}

static void weigh_traces(const struct frames *f, struct held *h)
{
    for (size_t i = 0; i < f->geometry.n_microphones; i++)
        h->weight[i] = h->live[i] ? 1.0f / (float)f->fold[cells_of(f, h)[i]] : 0.0f;
}

static float over(size_t n)
{
    return n ? 1.0f / (float)n : 0.0f;
}

static void weigh_coherent(struct frames *f)
{
    size_t n_live = 0;
    forget_counts(f);
    for (size_t k = 0; k < f->cfg.n_pings; k++)
        if (f->held[k].counts)
            n_live += count(f, &f->held[k]);
    for (size_t k = 0; k < f->cfg.n_pings; k++) {
        f->held[k].scale = 1.0f;
        if (f->held[k].counts)
            weigh_traces(f, &f->held[k]);
    }
    f->scale = over(n_live) * over(n_live);
}

static void weigh_power(struct frames *f)
{
    size_t n_pings = 0;
    for (size_t k = 0; k < f->cfg.n_pings; k++) {
        struct held *h = &f->held[k];
        if (!h->counts)
            continue;
        forget_counts(f);
        size_t n_live = count(f, h);
        weigh_traces(f, h);
        h->scale = over(n_live) * over(n_live);
        n_pings += n_live > 0;
    }
    f->scale = over(n_pings);
}

/* Weights of the traces and scales of the pings that count. */
static void weigh_pings(struct frames *f)
{
    if (f->cfg.sum == FRAMES_POWER)
        weigh_power(f);
    else
        weigh_coherent(f);
}

/* -- tile by tile: parts of pings, and their sum ----------------------------------------
 */

/* The middle of a tile: that of its first and last voxel. */
static void find_middle(const struct tile *t, double out[3])
{
    for (int a = 0; a < 3; a++)
        out[a] = 0.5 * ((double)t->position[a][0] + (double)t->position[a][t->n - 1]);
}

/* Where an element is for a tile: a microphone when the sound arrives there, which is
 * after the way to the tile and its own way back; and what is imaged moves until the
 * sound has come to it.  The way to the tile counts as the array's for all microphones;
 * by how much it is longer from a speaker, that speaker moves instead. */
static void go_on(const struct place *p, bool is_speaker, double way_s, double to_array_s,
                  double delay_at[3], double phase_at[3])
{
    double own_s = is_speaker ? way_s - to_array_s : to_array_s + way_s;
    double thing_s = is_speaker ? 2.0 * way_s - to_array_s : to_array_s;
    for (int a = 0; a < 3; a++) {
        double by_m = own_s * p->own_m_s[a] + thing_s * p->thing_m_s[a];
        delay_at[a] = p->delay_at_m[a] + by_m;
        phase_at[a] = p->phase_at_m[a] + by_m;
    }
}

/* From a place to the nearest point of the box that a tile's voxels fill. */
static double nearest_m(const struct tile *t, const double at[3])
{
    double nearest[3];
    for (int a = 0; a < 3; a++)
        nearest[a] = fmin(fmax(at[a], (double)t->position[a][0]),
                          (double)t->position[a][t->n - 1]);
    return geometry_distance(at, nearest);
}

/* Of the elements that hear of a tile, and of the speaker; false: none does.  A third of
 * a plane lies beyond the gate.  Where a tile's voxels fill no box it is not asked. */
static bool find_paths(const struct frames *f, const struct held *h, bool is_box,
                       struct scratch *own)
{
    const struct tile *t = &own->tile;
    double middle_m[3], sound_m_s = f->geometry.sound_speed_m_s, speaker_m = 0.0;
    bool any = false;
    find_middle(t, middle_m);
    double to_array_s = geometry_distance(middle_m, f->centre_m) / sound_m_s;
    for (size_t e = 0; e < 1 + f->geometry.n_microphones; e++) {
        const struct place *p = &h->places[e];
        double way_s = geometry_distance(middle_m, p->delay_at_m) / sound_m_s;
        double delay_at[3], phase_at[3];
        go_on(p, e == 0, way_s, to_array_s, delay_at, phase_at);
        double way_m = is_box ? nearest_m(t, delay_at) : 0.0;
        if (e == 0)
            speaker_m = way_m;
        own->hears[e] = e == 0 || speaker_m + way_m < f->far_s * sound_m_s + FAR_M;
        if (!own->hears[e])
            continue;
        double more_m = geometry_distance(middle_m, phase_at) -
                        geometry_distance(middle_m, delay_at);
        tile_path(t, &f->sound, delay_at, more_m * (double)f->sound.turns_per_m,
                  &own->paths[e]);
        any = any || e > 0;
    }
    return any;
}

static void add_traces(const struct frames *f, const struct held *h, struct scratch *own)
{
    const struct tile_path *to = own->paths, *from = own->paths + 1;
    size_t n_mic = f->geometry.n_microphones;
    for (size_t i = 0; i < n_mic; i++) {
        struct tile_trace r = {.words = h->words + (i + 1) * f->fine.n_stored,
                               .last = (float)(f->fine.n_stored - 2)};
        if (i + 1 < n_mic && own->hears[i + 2])
            tile_fetch(&own->tile, &r, to, from + i + 1);
        r.words = h->words + i * f->fine.n_stored;
        r.scale = h->unit[i] * h->weight[i];
        if (h->weight[i] > 0.0f && own->hears[i + 1])
            tile_add(&own->tile, &r, to, from + i, own->tile.part, NULL);
    }
    tile_add_part(&own->tile, own->paths);
}

VECTOR_CLONES
static void take_power(size_t n, const float *restrict re, const float *restrict im,
                       float *restrict out)
{
    for (size_t v = 0; v < n; v++)
        out[v] = re[v] * re[v] + im[v] * im[v];
}

/* part: the tile's of a ping's. */
static void make_part(const struct frames *f, const struct held *h, struct scratch *own,
                      float *part)
{
    struct tile *t = &own->tile;
    float(*sum)[TILE_VOXELS] = t->sum;
    if (find_paths(f, h, true, own))
        add_traces(f, h, own);
    if (f->cfg.sum == FRAMES_POWER)
        take_power(t->whole, sum[0], sum[1], part);
    else
        memcpy(part, sum, sizeof t->sum);
    memset(sum, 0, sizeof t->sum);
}

VECTOR_CLONES
static void add_scaled(size_t n, float scale, const float *restrict x,
                       float *restrict sum)
{
    for (size_t v = 0; v < n; v++)
        sum[v] += scale * x[v];
}

VECTOR_CLONES
static void make_up_for_range(const struct frames *f, const struct tile *t, float scale,
                              float *restrict power)
{
    float x = (float)f->centre_m[0], y = (float)f->centre_m[1], z = (float)f->centre_m[2];
    float spread2 = (float)(f->spread_m * f->spread_m);
    size_t n = t->whole;
    for (size_t v = 0; v < n; v++) {
        float dx = t->position[0][v] - x, dy = t->position[1][v] - y;
        float dz = t->position[2][v] - z;
        power[v] *= scale * (dx * dx + dy * dy + dz * dz + spread2);
    }
}

static void keep_alone(const struct frames *f, struct tile *t, const float *part)
{
    const struct held *h = &f->held[f->newest];

    memset(t->squares, 0, sizeof t->squares);
    add_scaled(t->whole, h->scale, part, t->squares);
    make_up_for_range(f, t, 1.0f, t->squares);
    for (size_t v = 0; v < t->n; v++)
        f->alone[t->number[v]] = t->squares[v];
}

static void image_tile(void *ctx, size_t item, size_t thread)
{
    const struct frames *f = ctx;
    struct scratch *own = &f->own[thread];
    struct tile *t = &own->tile;
    size_t planes = planes_of(f);
    float total[2][TILE_VOXELS] = {{0.0f}};
    tile_lay(t, &f->cfg.grid, item);
    for (size_t k = 0; k < f->cfg.n_pings; k++) {
        const struct held *h = &f->held[k];
        float *part = h->part + item * planes * TILE_VOXELS;
        if (!h->counts)
            continue;
        if (h->fresh)
            make_part(f, h, own, part);
        for (size_t a = 0; a < planes; a++)
            add_scaled(t->whole, h->scale, part + a * TILE_VOXELS, total[a]);
        if (f->alone && k == f->newest)
            keep_alone(f, t, part);
    }
    float *power = planes == 2 ? t->squares : total[0];
    if (planes == 2)
        take_power(t->whole, total[0], total[1], power);
    make_up_for_range(f, t, f->scale, power);
    for (size_t v = 0; v < t->n; v++)
        f->image[t->number[v]] = power[v];
}

/* The image of the pings that count, of which the fresh ones' parts are made anew. */
static void sum_parts(struct frames *f)
{
    pool_run(f->cfg.pool, tile_count(&f->cfg.grid), image_tile, f);
}

/* -- image ------------------------------------------------------------------------------
 */

/* A part serves as long as nothing that it was made of has changed. */
static bool serves(const struct frames *f, const struct held *h)
{
    size_t n_mic = f->geometry.n_microphones;
    return h->made && memcmp(h->weight, h->made_weight, n_mic * sizeof *h->weight) == 0 &&
           places_agree(h->places, h->made_places, 1 + n_mic, f->far_s, FRAMES_STILL_M);
}

static void keep_account(const struct frames *f, struct held *h)
{
    size_t n_mic = f->geometry.n_microphones;
    memcpy(h->made_weight, h->weight, n_mic * sizeof *h->weight);
    memcpy(h->made_places, h->places, (1 + n_mic) * sizeof *h->places);
    h->made = true;
}

static void choose(struct frames *f, const struct frames_motion *motion,
                   struct frames_made *made)
{
    const struct held *newest = &f->held[f->newest];
    int64_t ages_ns = 0;
    made->stamp_ns = newest->any ? newest->stamp_ns : 0;
    for (size_t k = 0; k < f->cfg.n_pings; k++) {
        struct held *h = &f->held[k];
        h->counts = h->any && h->shows &&
                    made->stamp_ns - h->stamp_ns <= f->cfg.max_age_ns;
        if (!h->counts)
            continue;
        made->pings++;
        ages_ns += made->stamp_ns - h->stamp_ns;
        made->unknown += !find_places(&f->cfg, motion, h->speaker, h->down, h->stamp_ns,
                                      made->stamp_ns, h->places);
    }
    made->age_s = made->pings ? 1e-9 * (double)ages_ns / (double)made->pings : 0.0;
}

static size_t count_masked(const struct frames *f)
{
    size_t n = 0;
    for (size_t i = 0; i < f->geometry.n_microphones; i++) {
        bool masked = false;
        for (size_t k = 0; k < f->cfg.n_pings; k++)
            masked = masked || (f->held[k].counts && !f->held[k].live[i]);
        n += masked;
    }
    return n;
}

/* The mean over a block's voxels that were imaged; a voxel beyond the gate is 0. */
static float mean_of(const struct frames *f, const size_t block[3])
{
    const struct grid *g = &f->cfg.grid;
    size_t low[3], high[3], imaged = 0, all = 1;
    float sum = 0.0f;

    for (int a = 0; a < 3; a++) {
        low[a] = block[a] * f->block[a];
        high[a] = low[a] + f->block[a] < g->n[a] ? low[a] + f->block[a] : g->n[a];
        all *= high[a] - low[a];
    }
    for (size_t z = low[2]; z < high[2]; z++)
        for (size_t y = low[1]; y < high[1]; y++)
            for (size_t x = low[0]; x < high[0]; x++) {
                float power = f->alone[(z * g->n[1] + y) * g->n[0] + x];
                sum += power;
                imaged += power > 0.0f;
            }
    return imaged && 2 * imaged >= all ? sum / (float)imaged : 0.0f;
}

static void take_means(struct frames *f)
{
    for (size_t i = 0; i < grid_size(&f->blocks); i++) {
        size_t block[3];
        grid_place(&f->blocks, i, block);
        f->means[i] = mean_of(f, block);
    }
}

void frames_image(struct frames *f, const struct frames_motion *motion, float *intensity,
                  struct frames_made *made)
{
    *made = (struct frames_made){.pings = 0};
    f->oldest_look_ns = INT64_MAX;
    choose(f, motion, made);
    made->microphones_masked = count_masked(f);
    weigh_pings(f);
    for (size_t k = 0; k < f->cfg.n_pings; k++) {
        struct held *h = &f->held[k];
        h->fresh = h->counts && !serves(f, h);
        made->kept += h->counts && !h->fresh;
    }
    f->image = intensity;
    sum_parts(f);
    if (f->means)
        take_means(f);
    for (size_t k = 0; k < f->cfg.n_pings; k++)
        if (f->held[k].fresh)
            keep_account(f, &f->held[k]);
}

/* -- the echoes of single pings ---------------------------------------------------------
 */

static bool is_look(const struct frames *f, const struct held *h)
{
    return h->counts && h->scale > 0.0f &&
           f->held[f->newest].stamp_ns - h->stamp_ns <= f->oldest_look_ns;
}

void frames_look_back(struct frames *f, double age_s)
{
    f->oldest_look_ns = nanoseconds(age_s);
}

size_t frames_looks(const struct frames *f, struct frames_look *looks)
{
    size_t n = 0, n_mic = f->geometry.n_microphones;
    const struct chirp *c = &f->cfg.chirp;
    double sweep = c->duration_s > 0.0 ? c->duration_s / (c->stop_hz - c->start_hz) : 0.0;

    for (size_t k = 0; k < f->cfg.n_pings; k++) {
        const struct held *h = &f->held[k];
        if (!is_look(f, h))
            continue;
        struct frames_look *one = &looks[n++];
        *one = (struct frames_look){
            .age_s = 1e-9 * (double)(f->held[f->newest].stamp_ns - h->stamp_ns),
            .sweep_s_hz = h->down ? -sweep : sweep};
        for (size_t e = 0; e < 1 + n_mic; e++)
            for (int a = 0; a < 3; a++) {
                double share = e == 0 ? 0.5 : 0.5 / (double)n_mic;
                one->middle_m[a] += share * h->places[e].delay_at_m[a];
                one->velocity_m_s[a] += share * h->places[e].own_m_s[a];
            }
    }
    return n;
}

static const struct held *counted(const struct frames *f, size_t number)
{
    const struct held *h = f->held;

    while (!is_look(f, h) || number-- > 0)
        h++;
    return h;
}

struct alone { /* shared by threads */
    const struct frames *f;
    const struct held *ping;
    float *image;
};

static void image_alone(void *ctx, size_t item, size_t thread)
{
    const struct alone *a = ctx;
    struct tile *t = &a->f->own[thread].tile;

    tile_lay(t, &a->f->cfg.grid, item);
    add_scaled(t->whole, a->ping->scale, a->ping->part + item * TILE_VOXELS, t->squares);
    make_up_for_range(a->f, t, 1.0f, t->squares);
    for (size_t v = 0; v < t->n; v++)
        a->image[t->number[v]] = t->squares[v];
}

void frames_alone(struct frames *f, size_t look, float *intensity)
{
    struct alone a = {f, counted(f, look), intensity};

    pool_run(f->cfg.pool, tile_count(&f->cfg.grid), image_alone, &a);
}

struct echoes { /* shared by threads */
    const struct frames *f;
    enum frames_thing thing;
    const double (*at_m)[3];
    size_t n, parts, n_pings;
    float *out;
};

/* The last one fills the vector. */
static void lay_places(struct tile *t, const double (*at_m)[3], size_t n)
{
    t->n = n;
    t->whole = (n + VECTOR_LANES - 1) / VECTOR_LANES * VECTOR_LANES;
    for (size_t v = 0; v < t->whole; v++)
        for (int a = 0; a < 3; a++)
            t->position[a][v] = (float)at_m[v < n ? v : n - 1][a];
}

/* A point as a plane mirrors it that lies at at_m, and square to the way there. */
static void mirror(const struct frames *f, const double at_m[3], const double point_m[3],
                   double out[3])
{
    double distance_m = geometry_distance(at_m, f->centre_m), beyond_m = 0.0;

    for (int a = 0; a < 3; a++)
        beyond_m += 2.0 * (at_m[a] - point_m[a]) * (at_m[a] - f->centre_m[a]) /
                    distance_m;
    for (int a = 0; a < 3; a++)
        out[a] = point_m[a] + beyond_m * (at_m[a] - f->centre_m[a]) / distance_m;
}

/* Planes at a tile's places: what they mirror the speaker to takes their place, and only
 * the way from there counts.  Motion is as of the middle one, as in find_paths. */
static void find_mirrored_paths(const struct frames *f, const struct held *h,
                                struct scratch *own)
{
    struct tile *t = &own->tile;
    size_t middle = t->n / 2;
    const double at_m[3] = {(double)t->position[0][middle],
                            (double)t->position[1][middle],
                            (double)t->position[2][middle]};
    double way_s = geometry_distance(at_m, f->centre_m) / f->geometry.sound_speed_m_s;
    double delay_at[3], phase_at[3], delay_from[3], phase_from[3];

    go_on(&h->places[0], true, way_s, way_s, delay_at, phase_at);
    mirror(f, at_m, phase_at, phase_from);
    mirror(f, at_m, delay_at, delay_from);
    for (size_t v = 0; v < t->whole; v++) {
        const double plane_m[3] = {(double)t->position[0][v], (double)t->position[1][v],
                                   (double)t->position[2][v]};
        double from_m[3];
        mirror(f, plane_m, delay_at, from_m);
        for (int a = 0; a < 3; a++)
            t->position[a][v] = (float)from_m[a];
        own->paths[0].delay[v] = f->sound.half_start;
        own->paths[0].re[v] = 1.0f;
        own->paths[0].im[v] = 0.0f;
    }
    for (size_t e = 1; e < 1 + f->geometry.n_microphones; e++) {
        way_s = 0.5 * geometry_distance(delay_from, h->places[e].delay_at_m) /
                f->geometry.sound_speed_m_s;
        go_on(&h->places[e], false, way_s, way_s, delay_at, phase_at);
        double more_m = geometry_distance(phase_from, phase_at) -
                        geometry_distance(delay_from, delay_at);
        tile_path(t, &f->sound, delay_at, more_m * (double)f->sound.turns_per_m,
                  &own->paths[e]);
        own->hears[e] = true;
    }
}

static void take_echoes(void *ctx, size_t item, size_t thread)
{
    const struct echoes *e = ctx;
    const struct frames *f = e->f;
    const struct held *h = counted(f, item / e->parts);
    struct scratch *own = &f->own[thread];
    struct tile *t = &own->tile;
    size_t first = item % e->parts * TILE_VOXELS;
    size_t n = e->n - first < TILE_VOXELS ? e->n - first : TILE_VOXELS;
    float scale = sqrtf(h->scale) / (float)e->n_pings;

    memset(t->part, 0, sizeof t->part);
    memset(t->sum, 0, sizeof t->sum);
    lay_places(t, e->at_m + first, n);
    bool any = true;
    if (e->thing == FRAMES_PLANE)
        find_mirrored_paths(f, h, own);
    else
        any = find_paths(f, h, false, own);
    if (any)
        add_traces(f, h, own);
    for (int i = 0; i < 2; i++) {
        float *out = e->out + (2 * (item / e->parts) + (size_t)i) * e->n + first;
        for (size_t v = 0; v < n; v++)
            out[v] = scale * t->sum[i][v];
    }
    memset(t->sum, 0, sizeof t->sum);
}

void frames_echoes(struct frames *f, enum frames_thing thing, const double (*at_m)[3],
                   size_t n, float *echoes)
{
    struct echoes e = {.f = f,
                       .thing = thing,
                       .at_m = at_m,
                       .n = n,
                       .parts = (n + TILE_VOXELS - 1) / TILE_VOXELS,
                       .out = echoes};

    for (size_t k = 0; k < f->cfg.n_pings; k++)
        e.n_pings += is_look(f, &f->held[k]);
    pool_run(f->cfg.pool, e.n_pings * e.parts, take_echoes, &e);
}
