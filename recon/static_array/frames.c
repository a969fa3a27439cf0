/* SPDX-License-Identifier: MIT */
#include "recon/static_array/frames.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/fold.h"
#include "recon/imaging/trace_check.h"
#include "recon/static_array/frames_state.h"

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
    size_t part = tile_count(&f->cfg.grid) * frames_planes(f) * TILE_VOXELS;
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

/* -- image ------------------------------------------------------------------------------
 */

/* A part serves as long as nothing that it was made of has changed. */
static bool serves(const struct frames *f, const struct held *h)
{
    size_t n_mic = f->geometry.n_microphones;
    return h->made && memcmp(h->weight, h->made_weight, n_mic * sizeof *h->weight) == 0 &&
           frames_places_agree(h->places, h->made_places, 1 + n_mic, f->far_s,
                               FRAMES_STILL_M);
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
        made->unknown += !frames_places(&f->cfg, motion, h->speaker, h->down, h->stamp_ns,
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
    choose(f, motion, made);
    made->microphones_masked = count_masked(f);
    frames_weigh(f);
    for (size_t k = 0; k < f->cfg.n_pings; k++) {
        struct held *h = &f->held[k];
        h->fresh = h->counts && !serves(f, h);
        made->kept += h->counts && !h->fresh;
    }
    f->image = intensity;
    frames_sum_parts(f);
    if (f->means)
        take_means(f);
    for (size_t k = 0; k < f->cfg.n_pings; k++)
        if (f->held[k].fresh)
            keep_account(f, &f->held[k]);
}
