/* SPDX-License-Identifier: MIT */
/* recon/static_array/frames_sum.c -- tile by tile: parts of pings, and their sum. */
#include <math.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/static_array/frames_state.h"

#define FAR_M 1e-3 /* of a path, beyond the last sample: what rounding may do */

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
static void go_on(const struct frames_place *p, bool is_speaker, double way_s,
                  double to_array_s, double delay_at[3], double phase_at[3])
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
 * a plane lies beyond the gate. */
static bool find_paths(const struct frames *f, const struct held *h,
                       struct frames_scratch *own)
{
    const struct tile *t = &own->tile;
    double middle_m[3], sound_m_s = f->geometry.sound_speed_m_s, speaker_m = 0.0;
    bool any = false;
    find_middle(t, middle_m);
    double to_array_s = geometry_distance(middle_m, f->centre_m) / sound_m_s;
    for (size_t e = 0; e < 1 + f->geometry.n_microphones; e++) {
        const struct frames_place *p = &h->places[e];
        double way_s = geometry_distance(middle_m, p->delay_at_m) / sound_m_s;
        double delay_at[3], phase_at[3];
        go_on(p, e == 0, way_s, to_array_s, delay_at, phase_at);
        double way_m = nearest_m(t, delay_at);
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

/* false: nothing of a ping comes from this tile. */
static bool add_ping(const struct frames *f, const struct held *h,
                     struct frames_scratch *own)
{
    const struct tile_path *to = own->paths, *from = own->paths + 1;
    size_t n_mic = f->geometry.n_microphones;
    if (!find_paths(f, h, own))
        return false;
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
    return true;
}

VECTOR_CLONES
static void take_power(size_t n, const float *restrict re, const float *restrict im,
                       float *restrict out)
{
    for (size_t v = 0; v < n; v++)
        out[v] = re[v] * re[v] + im[v] * im[v];
}

/* part: the tile's of a ping's. */
static void make_part(const struct frames *f, const struct held *h,
                      struct frames_scratch *own, float *part)
{
    struct tile *t = &own->tile;
    float(*sum)[TILE_VOXELS] = t->sum;
    if (add_ping(f, h, own))
        tile_add_part(t, own->paths);
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
    struct frames_scratch *own = &f->own[thread];
    struct tile *t = &own->tile;
    size_t planes = frames_planes(f);
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

void frames_sum_parts(struct frames *f)
{
    pool_run(f->cfg.pool, tile_count(&f->cfg.grid), image_tile, f);
}
