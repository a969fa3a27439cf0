/* SPDX-License-Identifier: MIT */
/* recon/static_array/frames_state.h -- inside recon/static_array/frames. */
#ifndef ANLOS_RECON_STATIC_ARRAY_FRAMES_STATE_H
#define ANLOS_RECON_STATIC_ARRAY_FRAMES_STATE_H

#include "dsp/pool.h"
#include "recon/coherent/backproject_tile.h"
#include "recon/static_array/frames_places.h"

struct held { /* one of the newest pings */
    bool any;
    bool shows;  /* something: it is not spoiled */
    bool counts; /* in the image that is made */
    bool fresh;  /* its part has to be made */
    size_t speaker;
    int64_t stamp_ns;
    bool down;
    bool *live;                       /* [n_microphones] */
    uint32_t *words;                  /* [n_microphones][fine.n_stored] */
    float *unit;                      /* [n_microphones] */
    float *weight;                    /* [n_microphones] of the traces, 0: not live */
    struct frames_place *places;      /* [1 + n_microphones] */
    bool made;                        /* what part is of: */
    float *made_weight;               /* [n_microphones] */
    struct frames_place *made_places; /* [1 + n_microphones] */
    float *part; /* [tile][re, im][TILE_VOXELS], by power [tile][TILE_VOXELS] */
    float scale; /* of part in the sum */
};

struct frames_scratch { /* one a thread */
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
    struct frames_scratch *own; /* [threads] */
    float scale;                /* of the sum */
    float *image;
    float *alone;       /* [voxels] of the newest ping; NULL where phases add up */
    struct grid blocks; /* of its image's means... */
    size_t block[3];    /* ...over so many voxels */
    float *means;       /* [blocks]; NULL likewise */
};

static inline size_t frames_planes(const struct frames *f)
{
    return f->cfg.sum == FRAMES_POWER ? 1 : 2;
}

/* Weights of the traces and scales of the pings that count:
 * recon/static_array/frames_weigh.c. */
void frames_weigh(struct frames *f);

/* The image of the pings that count, of which the fresh ones' parts are made anew:
 * recon/static_array/frames_sum.c. */
void frames_sum_parts(struct frames *f);

#endif
