/* SPDX-License-Identifier: MIT */
/* recon/coherent/backproject_any.c -- back-projection for any geometry, tile by tile. */
#include <errno.h>
#include <stdlib.h>

#include "recon/coherent/backproject_tile.h"
#include "recon/coherent/backprojection.h"

struct any_scratch { /* one a thread */
    struct tile tile;
    struct tile_path *paths; /* [elements], or one of both ways */
};

int backproject_any_create(struct backprojection *b)
{
    struct any_scratch *own = calloc(pool_threads(b->pool), sizeof *own);
    if (!own)
        return -ENOMEM;
    b->scratch = own;
    size_t elements = b->geometry.n_speakers + b->geometry.n_microphones;
    for (size_t t = 0; t < pool_threads(b->pool); t++)
        if (!(own[t].paths = malloc(elements * sizeof *own[t].paths)))
            return -ENOMEM;
    return 0;
}

void backproject_any_destroy(struct backprojection *b)
{
    struct any_scratch *own = b->scratch;
    for (size_t t = 0; own && t < pool_threads(b->pool); t++)
        free(own[t].paths);
    free(own);
}

static struct tile_trace trace_of(const struct backprojection *b, size_t t)
{
    struct tile_trace r = {.words = b->words + t * b->fine.n_stored,
                           .last = (float)(b->fine.n_stored - 2),
                           .scale = b->unit[t] / (float)b->stored_fold[t]};
    r.power = r.scale * b->unit[t];
    return r;
}

static void add_trace(const struct backprojection *b, size_t t, struct tile *tile,
                      const struct tile_path *to, const struct tile_path *from,
                      float sum[2][TILE_VOXELS])
{
    if (!b->stored_fold[t])
        return;
    const struct tile_trace r = trace_of(b, t);
    tile_add(tile, &r, to, from, sum, b->coherence > 0.0f ? tile->squares : NULL);
}

static void add_ping(const struct backprojection *b, const struct tile_sound *sound,
                     size_t k, struct any_scratch *own)
{
    double speaker[3], microphone[3];
    geometry_speaker(&b->geometry, k, 0, speaker);
    geometry_microphone(&b->geometry, k, 0, 0, microphone);
    tile_round_trip(&own->tile, sound, speaker, microphone, own->paths);
    add_trace(b, k, &own->tile, own->paths, own->paths, own->tile.sum);
}

/* Where the microphones are when they hear a speaker. */
static void find_microphones(const struct backprojection *b,
                             const struct tile_sound *sound, size_t k, size_t speaker,
                             struct any_scratch *own)
{
    size_t n_s = b->geometry.n_speakers, n_m = b->geometry.n_microphones;
    for (size_t i = 0; i < n_m; i++) {
        double at[3];
        geometry_microphone(&b->geometry, k, speaker, i, at);
        tile_path(&own->tile, sound, at, 0.0, &own->paths[n_s + i]);
    }
}

static void add_position(const struct backprojection *b, const struct tile_sound *sound,
                         size_t k, struct any_scratch *own)
{
    size_t n_s = b->geometry.n_speakers, n_m = b->geometry.n_microphones;
    for (size_t e = 0; e < n_s; e++) {
        double at[3];
        geometry_speaker(&b->geometry, k, e, at);
        tile_path(&own->tile, sound, at, 0.0, &own->paths[e]);
    }
    for (size_t j = 0; j < n_s; j++) {
        if (j == 0 || geometry_place(&b->geometry, j))
            find_microphones(b, sound, k, j, own);
        const struct tile_path *to = &own->paths[j], *from = &own->paths[n_s];
        size_t t = (k * n_s + j) * n_m;
        for (size_t i = 0; i < n_m; i++) {
            const struct tile_trace next = {.words = b->words +
                                                     (t + i + 1) * b->fine.n_stored,
                                            .last = (float)(b->fine.n_stored - 2)};
            if (i + 1 < n_m)
                tile_fetch(&own->tile, &next, to, from + i + 1);
            add_trace(b, t + i, &own->tile, to, from + i, own->tile.part);
        }
        tile_add_part(&own->tile, to);
    }
}

static void image_tile(void *ctx, size_t item, size_t thread)
{
    struct backprojection *b = ctx;
    struct any_scratch *own = (struct any_scratch *)b->scratch + thread;
    struct tile *tile = &own->tile;
    struct tile_sound sound;
    tile_sound(&sound, &b->fine, b->geometry.sound_speed_m_s);
    tile_lay(tile, &b->grid, item);
    for (size_t k = 0; k < b->geometry.n_positions; k++) {
        if (backprojection_pairs(b) == 1)
            add_ping(b, &sound, k, own);
        else
            add_position(b, &sound, k, own);
    }
    for (size_t v = 0; v < tile->n; v++) {
        float depth_m = backprojection_depth_m(
            b, tile->position[0][v], tile->position[1][v], tile->position[2][v]);
        b->image[tile->number[v]] = backprojection_intensity(
            b, depth_m, tile->sum[0][v], tile->sum[1][v], tile->squares[v]);
    }
}

void backproject_any(struct backprojection *b)
{
    pool_run(b->pool, tile_count(&b->grid), image_tile, b);
}
